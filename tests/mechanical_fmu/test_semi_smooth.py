"""C4 and B16 by the semi-smooth Newton: the answer of Uzawa's rounds for about one solve, quadratic at the end."""

from __future__ import annotations

import re
import sys
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, STEEL, blocks, done, elastic, hold, inputs_of

from contact.half.model import Discard
from contact.half.state import from_bytes, to_bytes
from contact.problem.pairs import Settling
from contact.rpc.link import open_link
from mechanical_fmu.enforcement import ENFORCEMENTS, Change, _text
from mechanical_fmu.problem import parse_elastic

TOLERANCE = EXPECTED["C4"]["tolerance"]
MODULUS, LENGTH, DELTA = STEEL["E"] / (1 - STEEL["nu"] ** 2), 2.0, 5e-7  # two blocks are one bar in plane strain
P = MODULUS * DELTA / LENGTH
ROUND_OFF = 1e-14


def bar(eps_L_over_E, share, stroke=(0.0, -DELTA), gap=0.0, method="semi_smooth", **more):
    """Two blocks squeezed by DELTA in the first second."""
    driven = hold("upper.top", 1, {"t": list(range(len(stroke))), "value": list(stroke)})
    holds = [hold("lower.bottom", 1), hold("lower.left", 0), hold("upper.left", 0), driven]
    return elastic(blocks(4, 4, gap=gap, eps_N=eps_L_over_E * MODULUS / LENGTH), holds,
                   pairs={"interface": {"augmented": {"tolerance": share, "method": method}}},
                   **({"tolerance": 1e-11} | more))


def squeezed(how, share, mu=0.0, two_pass=False, geometry="plane", by_node=False, **more):
    """Two blocks that do not match, squeezed by a tenth and pushed aside: bulging faces, wandering cuts, slip."""
    interface = blocks(4, 5, geometry=geometry)
    interface = replace(interface, pairs=tuple(replace(p, mu=mu, two_pass=two_pass, by_node=by_node)
                                               for p in interface.pairs))
    boundary = [hold("lower.bottom", 0), hold("lower.bottom", 1),
                hold("upper.top", 0, {"t": [0, 1, 2], "value": [0, 0, 0.01 * (geometry == "plane")]}),
                hold("upper.top", 1, {"t": [0, 1, 2], "value": [0, -0.1, -0.2]})]
    half = elastic(interface, boundary, material={"alpha": 0.0}, tolerance=1e-10,
                   pairs={"interface": {"augmented": {"tolerance": share, "method": how}}}, **more)
    half.settings = replace(half.settings, adopt=-1.0)
    return half


def went(half, n):
    """State and outputs after each of n steps of a second."""
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        found = []
        for t in range(n):
            state, outputs = done(half.step(state, inputs_of(half), float(t), 1.0, link))
            found.append((state, outputs))
    return found


@pytest.mark.parametrize("adopt", [0.002, -1.0], ids=["anchored", "fresh"])
@pytest.mark.parametrize("eps_L_over_E", [0.01, 1.0, 20.0])
def test_the_pressure_is_exact_after_one_solve(eps_L_over_E, adopt):
    """Two iterations are what a penalty alone takes; Uzawa takes 25 at eps L/E = 1 and does not settle at .01."""
    half = bar(eps_L_over_E, 1e-8)
    half.settings = replace(half.settings, adopt=adopt)
    outputs = went(half, 1)[0][1]
    assert -outputs["contact.t_N"] / P == pytest.approx(1.0, rel=TOLERANCE)
    assert np.abs(outputs["contact.gap"]).max() <= TOLERANCE * DELTA
    assert outputs["iterations"] <= 3


def test_forces_in_balance_are_not_enough():
    """From the equilibrium of a penalty alone: nothing is out of balance, yet the pressures are not those of no gap."""
    plain = elastic(blocks(4, 4, eps_N=4.0 * MODULUS / LENGTH), tolerance=1e-11, boundary=[
        hold("lower.bottom", 1), hold("lower.left", 0), hold("upper.left", 0),
        hold("upper.top", 1, {"t": [0, 1, 2], "value": [0, -DELTA, -DELTA]})])
    state, outputs = went(plain, 1)[0]
    assert -outputs["contact.t_N"] / P == pytest.approx(0.8, rel=TOLERANCE)
    half = bar(4.0, 1e-8, (0.0, -DELTA, -DELTA))
    with closing(open_link("direct")) as link:
        _, outputs = done(half.step(state, inputs_of(half), 1.0, 1.0, link))
    assert -outputs["contact.t_N"] / P == pytest.approx(1.0, rel=TOLERANCE)


def test_let_go_it_opens_without_pull_and_touches_again():
    _, apart, again = went(bar(4.0, 1e-8, stroke=(0.0, -DELTA, DELTA, -DELTA)), 3)
    assert not apart[1]["contact.t_N"].any()
    assert not apart[0].contact.multipliers.any()
    assert apart[1]["contact.gap"] == pytest.approx(DELTA, rel=1e-6)
    assert -again[1]["contact.t_N"] / P == pytest.approx(1.0, rel=TOLERANCE)


def test_what_just_touches_settles():
    found = went(bar(4.0, 1e-3, stroke=(0.0, 1e-6, 0.0, -1e-9, -DELTA), tolerance=1e-8, cuts=0), 4)
    assert max(outputs["iterations"] for _, outputs in found) <= 6
    assert np.abs(found[1][1]["contact.t_N"]).max() < 1.0
    assert -found[2][1]["contact.t_N"] / P * DELTA / 1e-9 == pytest.approx(1.0, rel=0.01)
    assert -found[3][1]["contact.t_N"] / P == pytest.approx(1.0, rel=1e-3)


def test_pressures_of_round_off_need_not_settle():
    """Brought to 1e-16 m of overlap, pressures of 1e-2 Pa are the round-off of coordinates, and no force feels them."""
    found = went(bar(1e3, 1e-6, stroke=(0.0, 1e-6, -1e-16, -1e-16), tolerance=1e-8, cuts=0), 3)
    assert max(outputs["iterations"] for _, outputs in found) <= 3
    assert np.abs(found[-1][1]["contact.t_N"]).max() < 1.0


def under_a_rigid_block(method, *motion):
    """An elastic block under a rigid one that goes by the given conditions along y and in its angle."""
    boundary = [hold("lower.bottom", 0), hold("lower.bottom", 1), hold("upper", 0), *motion]
    return elastic(blocks(4, 5), boundary, material={"alpha": 0.0}, tolerance=1e-10,
                   bodies={"lower": {"material": "m"}, "upper": {"material": "m", "rigid": True}},
                   pairs={"interface": {"augmented": {"tolerance": 1e-6, "method": method}}})


CASES = {"plain": lambda m: squeezed(m, 1e-6), "two passes": lambda m: squeezed(m, 1e-6, two_pass=True),
         "friction": lambda m: squeezed(m, 1e-6, mu=0.2),
         "rigid, lifted on one side": lambda m: under_a_rigid_block(
             m, hold("upper", 1, {"t": [0, 1, 2], "value": [0, -0.05, -0.02]}),
             hold("upper", 2, {"t": [0, 1, 2], "value": [0, 0.0, 0.08]})),
         "rigid, pressed by a force": lambda m: under_a_rigid_block(
             m, hold("upper", 2), {"on": "upper", "f_y": {"t": [0, 1, 2], "value": [-1e9, -5e9, -1e10]}}),
         "axisymmetric": lambda m: squeezed(m, 1e-6, geometry="axisymmetric"),
         "with inertia": lambda m: squeezed(m, 1e-6, dynamics={"rho_inf": 0.8},
                                            materials={"m": {**STEEL, "rho": 7800}})}


@pytest.mark.few("plain", "two passes", "friction", "rigid, pressed by a force", "axisymmetric")
@pytest.mark.parametrize("make", CASES.values(), ids=list(CASES))
def test_it_is_the_answer_of_the_rounds_for_less(make):
    for (_, one), (_, other) in zip(went(make("uzawa"), 2), went(make("semi_smooth"), 2), strict=True):
        scale = np.abs(one["contact.t_N"]).max()
        assert scale > 0.0
        assert np.abs(other["contact.t_N"] - one["contact.t_N"]).max() <= 1e-5 * scale
        assert other["iterations"] <= 0.7 * one["iterations"]


@pytest.mark.parametrize("method", ["modified_newton", "bfgs"])
def test_methods_on_old_tangents_take_the_rounds(method):
    """They have no tangent to put the multipliers into; the answer is the same."""
    one, other = (went(squeezed("semi_smooth", 1e-6, method=m), 1)[0][1] for m in ("newton", method))
    scale = np.abs(one["contact.t_N"]).max()
    assert np.abs(other["contact.t_N"] - one["contact.t_N"]).max() <= 1e-5 * scale
    assert other["iterations"] > one["iterations"]


@pytest.mark.parametrize(("mu", "two_pass"), [(0.0, False), (0.0, True), (0.2, False)])
def test_the_last_residuals_fall_quadratically(mu, two_pass, monkeypatch):
    """Of forces and multipliers alike: the history holds the larger of both."""
    histories = []

    def noted(*given):
        found = solve(*given)
        histories.append(found.history)
        return found

    solve = ENFORCEMENTS["semi_smooth"]
    monkeypatch.setitem(ENFORCEMENTS, "semi_smooth", noted)
    went(squeezed("semi_smooth", 1e-9, mu, two_pass), 2)
    last = [r for r in histories[-1] if r > ROUND_OFF][-3:]
    exponent = np.log(last[2] / last[1]) / np.log(last[1] / last[0])
    assert exponent >= EXPECTED["B16"]["exponent"], histories[-1]


def test_pressures_that_do_not_settle_are_named():
    half = squeezed("semi_smooth", 1e-6, cuts=0)
    half.settings = replace(half.settings, max_iterations=2)
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        answer = half.step(state, inputs_of(half), 0.0, 1.0, link)
    assert isinstance(answer, Discard)
    found = re.search(r"no equilibrium after 2 iterations: the forces on body \w+ are out of balance by (\S+) .*the "
                      r"contact pressures still change by (\S+) Pa \(of at most (\S+)\), most on pair interface, node "
                      r"(\d+) of upper\.bottom \(at the start at (\S+), (\S+) m\); method: uzawa", answer.message)
    assert found, answer.message
    assert 0.0 < float(found[2]) < float(found[3])
    told = [float(found[5]), float(found[6])]  # with six digits; of two nodes as bad round-off takes one
    np.testing.assert_allclose(told, half.system.interface.nodes[int(found[4]) - 1], rtol=1e-5)
    assert float(found[6]) == 1.0, "a node of the upper block's bottom"


def test_pressures_that_stay_are_not_said_to_change():
    """Bodies that press nothing fail by their forces alone: no word of 0 Pa, nor of another method for contact."""
    half = squeezed("semi_smooth", 1e-6)
    n = half.system.contact.pair_nodes.size
    said = _text(half.system, half.settings, np.array([0.5, 0.1]), (Change(np.zeros(n), 1e-300, False),), "in vain")
    assert "out of balance by 0.5" in said
    assert "pressure" not in said
    assert "pressures still change by 3 Pa" in _text(half.system, half.settings, np.array([0.5, 0.1]),
                                                     (Change(np.full(n, 3.0), 4.0, False),), "in vain")


def test_the_state_carries_the_pressures_and_survives_its_bytes():
    stroke = (0.0, -DELTA, -3 * DELTA)
    half = bar(4.0, 1e-6, stroke)
    (first, _), (whole, expected) = went(half, 2)
    with closing(open_link("direct")) as link:
        restored = from_bytes(to_bytes(first), ("contact", "mechanical_fmu"))
        cold = bar(4.0, 1e-6, stroke)
        again, outputs = done(cold.step(restored, inputs_of(cold), 1.0, 1.0, link))
    assert again.u.tobytes() == whole.u.tobytes()
    assert again.contact.multipliers.tobytes() == whole.contact.multipliers.tobytes()
    assert outputs["contact.t_N"].tobytes() == expected["contact.t_N"].tobytes()


def test_what_model_json_may_say():
    def parsed(pairs):
        return parse_elastic(blocks(2, 2), {"half": "elastic", "format": 2, "materials": {"m": STEEL}, "pairs": pairs,
                                            "bodies": {b: {"material": "m"} for b in ("lower", "upper")}})

    assert parsed({}).enforcement == "penalty"
    assert parsed({"interface": {}}).enforcement == "penalty"
    assert parsed({"interface": {"augmented": {"tolerance": 1e-3, "method": "uzawa"}}}).enforcement == "uzawa"
    both = parsed({"interface": {"augmented": {"tolerance": 1e-3, "method": "semi_smooth"}}})
    assert both.enforcement == "semi_smooth"
    assert tuple(ENFORCEMENTS) == ("penalty", *(method.value for method in Settling))
    assert both.augmented == {"interface": 1e-3}
    for wrong, words in (({"tolerance": 1e-3, "method": "smooth"}, "Did you mean 'semi_smooth'"),
                         ({"tolerance": 0.0}, "tolerance"), ({"tolerance": 1e-3, "form": 1}, "form")):
        with pytest.raises(ValueError, match=words):
            parsed({"interface": {"augmented": wrong}})


def test_two_pairs_need_one_method():
    interface = blocks(2, 2)
    interface = replace(interface, pairs=tuple(replace(interface.pairs[0], name=name) for name in ("one", "two")))
    with pytest.raises(ValueError, match=r"two\.augmented\.method: uzawa here, semi_smooth in contact\.one"):
        elastic(interface, pairs={"one": {"augmented": {"tolerance": 1e-3, "method": "semi_smooth"}},
                                  "two": {"augmented": {"tolerance": 1e-3, "method": "uzawa"}}})
