"""A body that only contact holds, and nothing presses, is pushed ahead but does not follow what draws back from it."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import STEEL, blocks, done, elastic, hold, inputs_of

from contact.rpc.link import open_link
from mechanical_fmu import stabilisation

GAP, WAY, WARM = 1e-4, 1e-3, 100.0
METHODS = [None, "uzawa", "semi_smooth"]


def course(boundary, warmth, enforcement, steps, **more):
    """Mean u_y [m] of the upper block at t = 1 and 2 s; it begins GAP above the lower one, free along y.

    warmth : [K] of the lower block over T_ref at t = 0, 1 and 2 s.
    """
    interface = blocks(4, 3, gap=GAP)
    upper = interface.nodes[:, 1] >= 1.0 + 0.5 * GAP
    if enforcement is not None:
        more["pairs"] = {"interface": {"augmented": {"method": enforcement, "tolerance": 1e-8}}}
    half = elastic(interface, [hold("upper.top", 0), *boundary], **more)
    means = []
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half, STEEL["T_ref"] + np.where(upper, 0.0, warmth[0])), 0.0, link)
        for i in range(1, 2 * steps + 1):
            T = STEEL["T_ref"] + np.where(upper, 0.0, np.interp(i / steps, [0.0, 1.0, 2.0], warmth))
            state, outputs = done(half.step(state, inputs_of(half, T), (i - 1) / steps, 1 / steps, link))
            assert np.abs(outputs["contact.t_N"]).max() <= 1e-5 * STEEL["E"] * GAP
            if i % steps == 0:
                means.append(float((outputs["x"] - interface.nodes)[upper, 1].mean()))
    return means


def lift(then=0.0):
    return [hold("lower.bottom", 0), hold("lower.bottom", 1, {"t": [0.0, 1.0, 2.0], "value": [0.0, WAY, then]})]


@pytest.mark.parametrize("steps", [1, 3])
@pytest.mark.parametrize("enforcement", METHODS)
def test_a_block_stays_where_a_ram_left_it(enforcement, steps):
    there, then = course(lift(), [0.0, 0.0, 0.0], enforcement, steps)
    assert there == pytest.approx(WAY - GAP, rel=1e-4)
    assert then == pytest.approx(there, rel=1e-9)


@pytest.mark.few("semi_smooth-3", "uzawa-1")
@pytest.mark.parametrize("steps", [1, 3])
@pytest.mark.parametrize("enforcement", METHODS)
def test_a_block_stays_where_a_warm_one_left_it_when_that_cools(enforcement, steps):
    foot = [hold("lower.bottom", 1), hold("lower.left", 0)]
    there, then = course(foot, [0.0, WARM, 0.0], enforcement, steps)
    # Plane strain: the height grows by (1 + nu) alpha dT of 1 m.
    grown = (1.0 + STEEL["nu"]) * STEEL["alpha"] * WARM
    assert there == pytest.approx(grown - GAP, rel=2e-3)
    assert then == pytest.approx(there, rel=1e-9)


def test_a_block_is_pushed_on_as_long_as_something_drives_it():
    there, then = course(lift(2.0 * WAY), [0.0, 0.0, 0.0], None, 3)
    assert (there, then) == pytest.approx((WAY - GAP, 2.0 * WAY - GAP), rel=1e-4)


def test_a_rigid_block_stays_too():
    interface = blocks(4, 3, gap=GAP)
    rigid = {"bodies": {"lower": {"material": "m"}, "upper": {"material": "m", "rigid": True}}}
    half = elastic(interface, [*lift(), hold("upper", 0), hold("upper", 2)], **rigid)
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        state, there = done(half.step(state, inputs_of(half), 0.0, 1.0, link))
        _, then = done(half.step(state, inputs_of(half), 1.0, 1.0, link))
    upper = interface.nodes[:, 1] >= 1.0 + 0.5 * GAP
    went = [float((told["x"][:len(upper)] - interface.nodes)[upper, 1].mean()) for told in (there, then)]
    assert went == pytest.approx([WAY - GAP, WAY - GAP], rel=1e-4)


def test_a_block_in_the_air_soon_takes_its_shape_though_it_is_firmly_damped(monkeypatch):
    """As if contact had let go of it three times, and flung it away: it is damped a billion times as much since."""
    flung, solves, solve_step = iter([True] * 3), [], stabilisation.solve_step

    def counted(*args):
        solves.append(args)
        return solve_step(*args)

    monkeypatch.setattr(stabilisation, "_flung", lambda *_: next(flung, False))
    monkeypatch.setattr(stabilisation, "solve_step", counted)
    interface = blocks(4, 3, gap=GAP)
    upper = interface.nodes[:, 1] >= 1.0 + 0.5 * GAP
    half = elastic(interface, [hold("lower.bottom", 0), hold("lower.bottom", 1), hold("upper.middle", 0)])
    warm = STEEL["T_ref"] + np.where(upper, WARM * interface.nodes[:, 0], 0.0)
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half, STEEL["T_ref"]), 0.0, link)
        _, outputs = done(half.step(state, inputs_of(half, warm), 0.0, 1.0, link))
    assert outputs["residual"] <= 1e-8
    assert len(solves) <= 25  # 38 where its way only doubles from increment to increment
