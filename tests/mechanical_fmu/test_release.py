"""Conditions that end, at a time or when a pair closes: what held goes within one step, and is never back."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import STEEL, NoLink, block, blocks, done, elastic, hold, inputs_of

from contact.half.state import from_bytes, to_bytes
from contact.rpc.link import open_link
from mechanical_fmu.advance import Task, loading_of

LINK = NoLink()
GRID = np.linspace(0.0, 1.0, 5)
PULL = 1e-5
FOOT = [hold("lower.bottom", 0), hold("lower.bottom", 1)]
FORCE = 1e6


def ramp(value, end=1.0):
    return {"t": [0.0, end], "value": [0.0, value]}


def pulled(**more):
    """A block that is sheared by its top until 1 s."""
    return elastic(block(GRID, GRID), [hold("block.bottom", 0), hold("block.bottom", 1),
                                       {"on": "block.top", "u_x": ramp(PULL), "u_y": 0.0, "until": 1.0}],
                   tolerance=1e-11, **more)


def walked(half, times, link=LINK, state=None):
    """States and outputs at times [s]."""
    if state is None:
        state, out = half.start(inputs_of(half), times[0], link)
        found = [(state, out)]
    else:
        found = []
    for t0, t1 in pairwise(times):
        state, out = done(half.step(state, inputs_of(half), t0, t1 - t0, link))
        found.append((state, out))
    return found


def test_it_holds_to_its_time_and_no_longer():
    half = pulled()
    found = walked(half, [0.0, 0.5, 1.0, 1.5, 2.0])
    top = np.unique(half.system.interface.surfaces["block.top"])
    u = [out["x"] - half.system.interface.nodes for _, out in found]
    np.testing.assert_allclose([one[top, 0] for one in u[:3]], np.outer([0.0, 0.5, 1.0], np.full(top.size, PULL)),
                               atol=1e-18)
    assert found[2][1]["sigma_v"].max() > 0.1 * STEEL["E"] * PULL
    for one, (_, out) in zip(u[3:], found[3:], strict=True):
        assert np.abs(one).max() <= 1e-8 * PULL
        assert np.abs(out["reaction.block"]).max() <= 1e-8 * STEEL["E"] * PULL


def test_what_held_it_goes_evenly_within_the_step():
    half = pulled()
    state, _ = walked(half, [0.0, 1.0])[-1]
    after = half._of(state)
    task = Task(state.drive, state.drive, 1.0, None, None, np.array(state.handed))
    assert np.abs(state.handed).max() > 0.0
    for share, left in ((0.0, 1.0), (0.25, 0.75), (1.0, 0.0)):
        loading = loading_of(after.system, task, share, 1.0, np.array(state.history))
        balance = after.system.balance(np.array(state.u), loading)
        out = np.linalg.norm(balance.r * after.system.constraints.free.reshape(-1, 2))
        all_of_it = np.linalg.norm(state.handed)
        assert out == pytest.approx((1.0 - left) * all_of_it, abs=1e-9 * all_of_it)


def test_the_same_bits_from_a_state_that_went_through_bytes():
    half, again = pulled(), pulled()
    state, _ = walked(half, [0.0, 0.5, 1.0])[-1]
    assert state.released
    copy = from_bytes(to_bytes(state), {"mechanical_fmu", "contact"})
    one, other = walked(half, [1.0, 1.5, 2.0], state=state), walked(again, [1.0, 1.5, 2.0], state=copy)
    for (_, a), (_, b) in zip(one, other, strict=True):
        assert all(np.array_equal(a[name], b[name]) for name in a)
    # Put back to before it was released, it holds again.
    first, _ = walked(half, [0.0, 0.5])[-1]
    assert not first.released
    held = walked(half, [0.5, 0.75], state=first)[-1][1]
    assert held["sigma_v"].max() > 0.05 * STEEL["E"] * PULL


def lowered(until, gap=1e-3, mu=0.0):
    """A block that is lowered onto another while a force presses it, held by its top until something."""
    interface = blocks(4, 3, gap=gap)
    interface = replace(interface, pairs=tuple(replace(p, mu=mu) for p in interface.pairs))
    return elastic(interface, [*FOOT, hold("upper.middle", 0), {"on": "upper.top", "t_y": ramp(-FORCE)},
                               {"on": "upper.top", "u_y": ramp(-2 * gap, 2.0), "until": until}],
                   tolerance=1e-10, material={"alpha": 0.0})


def test_a_pair_that_closes_releases():
    """Then the force presses as it does where nothing ever held the block."""
    times = list(np.linspace(0.0, 2.0, 9))
    with closing(open_link("direct")) as link:
        half = lowered({"interface": "closes"})
        found = walked(half, times, link)
        free = walked(elastic(blocks(4, 3, gap=1e-3), [*FOOT, hold("upper.middle", 0),
                                                       {"on": "upper.top", "t_y": ramp(-FORCE)}],
                              tolerance=1e-10, material={"alpha": 0.0}), times, link)
    closed = [bool(out["contact.touching"]) for _, out in found]
    first = closed.index(True)
    assert 0 < first < len(times) - 2
    assert [bool(state.released) for state, _ in found] == [False] * first + [True] * (len(times) - first)
    for (_, a), (_, b) in zip(found[first + 1:], free[first + 1:], strict=True):
        assert np.abs(a["contact.t_N"] - b["contact.t_N"]).max() <= 1e-6 * FORCE
        assert np.abs(a["x"] - b["x"]).max() <= 1e-6 * 1e-3


def test_a_turn_is_released():
    turn = {"about": [0.5, 1.0], "angle": ramp(1e-4)}
    half = elastic(block(GRID, GRID), [hold("block.bottom", 0), hold("block.bottom", 1),
                                       {"on": "block.top", "rotation": turn, "until": 1.0}], tolerance=1e-11)
    found = walked(half, [0.0, 1.0, 2.0])
    assert found[1][1]["sigma_v"].max() > 1e-6 * STEEL["E"]
    assert found[2][1]["sigma_v"].max() <= 1e-12 * STEEL["E"]


def test_a_rigid_tool_is_let_go_when_it_rests():
    half = elastic(blocks(4, 3, gap=1e-3), [
        *FOOT, {"body": "upper", "u_x": 0.0}, {"body": "upper", "f_y": -FORCE},
        {"body": "upper", "u_y": ramp(-1.001e-3), "angle": 0.0, "until": {"interface": "closes"}}], tolerance=1e-10,
        material={"alpha": 0.0}, bodies={"lower": {"material": "m"}, "upper": {"material": "m", "rigid": True}})
    with closing(open_link("direct")) as link:
        found = walked(half, [0.0, 0.5, 1.0, 1.5], link)
    assert [len(state.released) for state, _ in found] == [0, 0, 2, 2]
    assert found[-1][1]["reaction.lower"][1] == pytest.approx(FORCE, rel=1e-8)


@pytest.mark.parametrize("more", [{"dynamics": {"rho_inf": 0.5}}, {"method": "explicit"}])
def test_with_inertia_it_swings_on(more):
    half = elastic(block(GRID, GRID), [hold("block.bottom", 0), hold("block.bottom", 1),
                                       {"on": "block.top", "u_x": ramp(PULL, 1e-3), "u_y": 0.0, "until": 1e-3}],
                   material={"rho": 7800.0}, **more)
    found = walked(half, list(np.linspace(0.0, 2e-3, 21)))
    top = np.unique(half.system.interface.surfaces["block.top"])
    u = np.array([(out["x"] - half.system.interface.nodes)[top, 0].mean() for _, out in found])
    assert u[10] == pytest.approx(PULL)
    assert u[11:].min() < 0.0 < u[11:].max()


@pytest.mark.parametrize(("entry", "text"), [
    ({"on": "lower.top", "pressure": 1.0, "until": 1.0}, "only a displacement is released"),
    ({"on": "lower.top", "u_x": 0.0, "until": -1.0}, "must be greater than zero"),
    ({"on": "lower.top", "u_x": 0.0, "until": {"face": "closes"}}, r"until\.face: there is no contact pair 'face'"),
    ({"on": "lower.top", "u_x": 0.0, "until": {"interface": "opens"}}, "until"),
    ({"on": "lower.bottom", "u_x": 0.0, "until": 1.0}, "which ends another time"),
])
def test_what_does_not_fit_is_told(entry, text):
    with pytest.raises(ValueError, match=text):
        elastic(blocks(2, 2), [*FOOT, entry])
