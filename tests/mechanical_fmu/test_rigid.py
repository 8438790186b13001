"""The rigid half follows its signals and presses where it touches."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.rpc.link import open_link
from mechanical_fmu.small_halves import load_rigid

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, blocks, done

STROKE = {"t": [0, 1, 2], "value": [0, -0.05, -0.0501]}
SLIDE = {"t": [0, 2, 3, 3], "value": [0, 0, 1.1, 2.0]}
PRESSURE = {"t": [0, 1, 2], "value": [1e6, 1e6, 1e7]}


def rigid(interface, **more):
    return load_rigid(interface, {"half": "rigid", "format": 2} | more)


def scene():
    interface = blocks(4, 5, gap=0.05)
    return interface, rigid(interface, motion={"upper": {"u_x": SLIDE, "u_y": STROKE}},
                            pressure={"interface": PRESSURE})


def test_bodies_follow_their_signals_and_those_not_named_stay():
    interface, half = scene()
    state, outputs = half.start({}, 0.0, link := open_link("direct"))
    assert np.array_equal(outputs["x"], interface.nodes)
    upper = interface.node_body == 1
    for t0, t1, u in ((0.0, 0.5, (0, -0.025)), (0.5, 2.0, (0, -0.0501)), (2.0, 3.0, (1.1, -0.0501)),
                      (3.0, 4.0, (2.0, -0.0501))):
        state, outputs = done(half.step(state, {}, t0, t1 - t0, link))
        assert state.t == t1
        assert np.array_equal(outputs["x"][~upper], interface.nodes[~upper])
        assert np.abs(outputs["x"][upper] - interface.nodes[upper] - u).max() <= 1e-15


def test_t_n_is_the_prescribed_pressure_wherever_the_pair_touches():
    interface, half = scene()
    link = open_link("direct")
    state, outputs = half.start({}, 0.0, link)
    assert not outputs["contact.t_N"].any()
    assert outputs["contact.gap"] == pytest.approx(0.05)
    for t0, t1, p in ((0.0, 0.999, 0.0), (0.999, 1.5, 5.5e6), (1.5, 2.5, 1e7), (2.5, 2.99, 0.0)):
        state, outputs = done(half.step(state, {}, t0, t1 - t0, link))
        assert outputs["contact.t_N"] == pytest.approx(np.full(interface.pair_nodes.size, -p), rel=1e-12), t1
        assert (outputs["contact.touching"] > 0) == (p > 0)
    assert outputs["contact.gap"].min() > 0.04  # slipped off: nothing is faced
    assert not outputs["contact.covered"].any()


def test_a_pair_without_pressure_touches_with_none():
    interface = blocks(4, 4)
    _, outputs = rigid(interface, motion={"upper": {"u_y": -1e-6}}).start({}, 0.0, open_link("direct"))
    assert not outputs["contact.t_N"].any()
    assert outputs["contact.gap"] == pytest.approx(-1e-6, rel=1e-6)
    assert outputs["contact.covered"] == pytest.approx(1.0)


@pytest.mark.parametrize("size", [2.0**-27, 1.0, 2.0**13])
def test_what_touches_does_not_depend_on_the_size_of_the_scene(size):
    """From 7 nm to 8 km: a gap of a millionth of the bodies is open, one of 1e-12 of them is round-off."""
    interface = blocks(4, 4, gap=1e-3 * size, L=size)
    for gap, pressed in ((1e-6, False), (1e-12, True)):
        half = rigid(interface, motion={"upper": {"u_y": size * (gap - 1e-3)}}, pressure={"interface": 1e6})
        _, outputs = half.start({}, 0.0, open_link("direct"))
        assert bool(outputs["contact.t_N"].any()) is pressed


def test_without_pairs_nobody_is_asked():
    half = rigid(block([0, 1], [0, 1]), motion={"block": {"u_x": 2.0}})
    _, outputs = half.start({}, 0.0, NoLink())
    assert list(outputs) == [v.name for v in half.variables] == ["x"]


@pytest.mark.parametrize(("more", "text"), [
    ({"motion": {"midle": {}}}, "motion.midle: there is no body 'midle'"),
    ({"motion": {"upper": {"u_z": 0}}}, "motion.upper.u_z: unknown key"),
    ({"motion": {"upper": {"u_x": {"t": [1, 0], "value": [0, 0]}}}}, "motion.upper.u_x.t.1: time goes backwards"),
    ({"pressure": {"interface": -1.0}}, "pressure.interface: must not be negative, not -1.0"),
    ({"pressure": {"other": 0.0}}, "pressure.other: there is no contact pair 'other'"),
    ({"format": 1}, "format 1 is not rigid, 2"),
])
def test_a_wrong_model_is_refused_with_its_key(more, text):
    with pytest.raises(ValueError, match=text):
        rigid(blocks(2, 2), **more)
