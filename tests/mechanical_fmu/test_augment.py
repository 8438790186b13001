"""C4, the augmented Lagrangian: how fast the penetration goes, what pressure is left, what the state keeps of it."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.half.model import Discard
from contact.half.state import from_bytes, frozen_copy, to_bytes
from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, STEEL, blocks, done, elastic, hold, inputs_of

from mechanical_fmu.enforcement import MAX_ROUNDS

TOLERANCE = EXPECTED["C4"]["tolerance"]
MODULUS, LENGTH, DELTA = STEEL["E"] / (1 - STEEL["nu"] ** 2), 2.0, 5e-7  # two blocks are one bar in plane strain
P = MODULUS * DELTA / LENGTH
HOLDS = [hold("lower.bottom", 1), hold("lower.left", 0), hold("upper.left", 0)]


@pytest.fixture
def link():
    link = open_link("direct")
    yield link
    link.close()


def bar(eps_L_over_E, augmented=None, stroke=(0.0, -DELTA), **more):
    """Two blocks squeezed by DELTA in the first second; a tolerance where they are augmented."""
    pairs = {} if augmented is None else {"pairs": {"interface": {"augmented": {"tolerance": augmented,
                                                                                "method": "uzawa"}}}}
    driven = hold("upper.top", 1, {"t": list(range(len(stroke))), "value": list(stroke)})
    interface = blocks(4, 4, eps_N=eps_L_over_E * MODULUS / LENGTH)
    return elastic(interface, [*HOLDS, driven], **({"tolerance": 1e-11} | pairs | more))


def steps(half, link, n, state=None, first=0):
    """State and outputs after each of n steps of a second."""
    if state is None:
        state, _ = half.start(inputs_of(half), 0.0, link)
    went = []
    for t in range(first, first + n):
        state, outputs = done(half.step(state, inputs_of(half), float(t), 1.0, link))
        went.append((state, outputs))
    return went


@pytest.mark.parametrize("eps_L_over_E", [0.5, 2.0, 20.0])
def test_penetration_falls_by_the_same_number_every_round(link, eps_L_over_E):
    """Each tolerance asks for one round more; in a step that changes nothing there is none."""
    c = 1.0 / (1.0 + eps_L_over_E)
    for k in range(1, 5):
        # After k rounds beyond the first the pressures would still change by this share of the largest.
        change = c**k * (1.0 - c) / (1.0 - c**(k + 1))
        first, held = (outputs["contact.gap"] for _, outputs in steps(bar(eps_L_over_E, 1.01 * change), link, 2))
        np.testing.assert_allclose(-first / DELTA, c**(k + 1), rtol=TOLERANCE, atol=1e-8)
        assert held.tobytes() == first.tobytes()


@pytest.mark.parametrize("eps_L_over_E", [1.0, 20.0, 200.0])
def test_the_pressure_is_exact_whatever_the_penalty(link, eps_L_over_E):
    plain = steps(bar(eps_L_over_E), link, 1)[0][1]
    assert -plain["contact.t_N"] / P == pytest.approx(1.0 - 1.0 / (1.0 + eps_L_over_E), rel=TOLERANCE)
    outputs = steps(bar(eps_L_over_E, 1e-8), link, 1)[0][1]
    assert -outputs["contact.t_N"] / P == pytest.approx(1.0, rel=TOLERANCE)
    assert np.abs(outputs["contact.gap"]).max() <= TOLERANCE * DELTA
    assert outputs["contact.touching"] == plain["contact.touching"]


def test_let_go_it_opens_without_pull_and_touches_again_as_before(link):
    """Multipliers of a pressed step must not hold what is drawn apart, nor be remembered there."""
    went = steps(bar(4.0, 1e-8, stroke=(0.0, -DELTA, DELTA, -DELTA)), link, 3)
    apart, again = went[1], went[2]
    assert not apart[1]["contact.t_N"].any()
    assert apart[1]["contact.touching"] == 0
    assert not apart[0].contact.multipliers.any()
    assert apart[1]["contact.gap"] == pytest.approx(DELTA, rel=1e-6)
    assert -again[1]["contact.t_N"] / P == pytest.approx(1.0, rel=TOLERANCE)


def test_what_just_touches_settles(link):
    """A thousandth of 110 Pa is less than the half's tolerance resolves (.2 Pa here): no more is asked than that."""
    stroke = (0.0, 1e-6, 0.0, -1e-9, -DELTA)
    went = steps(bar(4.0, 1e-3, stroke=stroke, tolerance=1e-8, cuts=0), link, 4)
    assert max(outputs["iterations"] for _, outputs in went[:3]) <= 6
    assert np.abs(went[1][1]["contact.t_N"]).max() < 1.0
    assert -went[2][1]["contact.t_N"] / P * DELTA / 1e-9 == pytest.approx(1.0, rel=0.01)
    assert -went[3][1]["contact.t_N"] / P == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("squeezed", [DELTA, 1e-11])
def test_no_more_is_asked_of_pressures_than_forces_feel(link, squeezed):
    """A share of 1e-8 of them is less than what forces are solved to."""
    went = steps(bar(4.0, 1e-8, stroke=(0.0, -squeezed), tolerance=1e-8, cuts=0), link, 1)
    assert -went[0][1]["contact.t_N"] / P * DELTA / squeezed == pytest.approx(1.0, rel=1e-3)


def test_multipliers_are_of_the_state_and_survive_its_bytes(link):
    half, stroke = bar(4.0, 1e-6, stroke=(0.0, -DELTA, -3 * DELTA)), (0.0, -DELTA, -3 * DELTA)
    state = steps(half, link, 1)[0][0]
    assert -state.contact.multipliers.min() / P == pytest.approx(1.0, rel=1e-4)
    whole, expected = steps(half, link, 1, frozen_copy(state), first=1)[0]
    cold = bar(4.0, 1e-6, stroke=stroke)
    restored = from_bytes(to_bytes(state), ("contact", "mechanical_fmu"))
    again, outputs = steps(cold, open_link("direct"), 1, restored, first=1)[0]
    assert again.contact.multipliers.tobytes() == whole.contact.multipliers.tobytes()
    assert again.u.tobytes() == whole.u.tobytes()
    for name, value in expected.items():
        assert np.asarray(outputs[name]).tobytes() == np.asarray(value).tobytes(), name
    # And they matter: without them the same step is another one.
    forgotten = replace(state, contact=replace(state.contact, multipliers=np.zeros_like(state.contact.multipliers)))
    assert steps(cold, link, 1, forgotten, first=1)[0][0].u.tobytes() != whole.u.tobytes()


def test_pressures_that_do_not_settle_are_a_discard_that_names_them(link):
    """A penalty of a hundredth of E/L moves by 1 % a round: too slow, and said with its numbers."""
    half = bar(0.01, 1e-8, cuts=0)
    state, _ = half.start(inputs_of(half), 0.0, link)
    answer = half.step(state, inputs_of(half), 0.0, 1.0, link)
    assert isinstance(answer, Discard)
    found = re.search(r"do not settle: after (\d+) rounds they still change by (\S+) Pa \(of at most (\S+)\); "
                      "a larger penalty", answer.message)
    assert found, answer.message
    contraction = 1.0 / 1.01
    assert int(found[1]) == MAX_ROUNDS
    assert float(found[2]) == pytest.approx(P * contraction ** (MAX_ROUNDS - 1) * (1 - contraction), rel=5e-3)
    assert float(found[3]) == pytest.approx(P * (1 - contraction ** MAX_ROUNDS), rel=5e-3)


def test_pairs_without_it_keep_their_penalty(link):
    """Only the named pair is corrected: its slave side alone has multipliers."""
    half = bar(4.0, 1e-6)
    state = steps(half, link, 1)[0][0]
    slave = half.system.contact.on_slaves(["interface"])
    assert slave.sum() == 5
    assert (state.contact.multipliers[slave] < 0.0).all()
    assert not state.contact.multipliers[~slave].any()
    assert not steps(bar(4.0), link, 1)[0][0].contact.multipliers.any()
