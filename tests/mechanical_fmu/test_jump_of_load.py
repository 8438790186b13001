"""A load that begins or ends at once pushes bodies with inertia for as long as it acts, whatever the step."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.rpc.link import open_link

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import done, elastic, inputs_of
from test_impact import bars

A, RHO, END = 10.0, 7800.0, 0.1  # [m/s2] up to END [s], then 0


@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize("rho_inf", [0.5, 1.0])
@pytest.mark.parametrize("n", [5, 20])
def test_a_body_goes_on_with_the_speed_that_it_was_given(n: int, rho_inf: float, rigid: bool) -> None:
    """In steps of 20 ms it went on by 20 % too fast: half a step more of the load."""
    pull = {"t": [0.0, END, END, 10.0], "value": [A, A, 0.0, 0.0]}
    bodies = {b: {"material": "m"} | ({"rigid": True} if rigid and b == "lower" else {}) for b in ("lower", "upper")}
    half = elastic(bars("bars", 6, 1.0, 0.3, grade=1.3), [], {"E": 1e7, "nu": 0.3, "rho": RHO}, tolerance=1e-11,
                   bodies=bodies, dynamics={"rho_inf": rho_inf}, gravity={"x": pull})
    link, h = open_link("direct"), END / n
    state, _ = half.start(inputs_of(half), 0.0, link)
    for k in range(3 * n):
        state, _ = done(half.step(state, inputs_of(half), k * h, h, link))
    link.close()
    nodes = half.system.interface.node_body >= 0
    moves = half.system.interface.node_body == 1  # nodes of a rigid body have no speed of their own, its point has
    if half.system.rigid is not None:
        moves[half.system.rigid.point_rows] = True
    np.testing.assert_allclose(np.array(state.v)[moves, 0], A * END, rtol=1e-7)
    np.testing.assert_allclose(np.array(state.u)[nodes, 0], A * END * (0.5 * END + 2.0 * END), rtol=1e-7)


@pytest.mark.parametrize("load", ["gravity", "pressure"])
@pytest.mark.parametrize("rho_inf", [0.5, 1.0])
def test_so_it_does_where_a_rule_ends_the_load(rho_inf: float, load: str) -> None:
    """The input load.NAME goes from 1 to 0 between two steps; a pressure on one end of a bar 1 m long does as much."""
    pull = {"gravity": {"x": 0.0, "y": -A, "name": "pull"}} if load == "gravity" else {}
    press = [] if load == "gravity" else [{"on": "upper.top", "pressure": A * RHO, "name": "pull"}]
    half = elastic(bars("bars", 6, 1.0, 0.0, grade=1.3, swapped=True), press, {"E": 1e9, "nu": 0.0, "rho": RHO},
                   tolerance=1e-11, bodies={"lower": {"material": "m", "rigid": True}, "upper": {"material": "m"}},
                   dynamics={"rho_inf": rho_inf}, **pull)
    link, h, t = open_link("direct"), 1e-6, 0.0
    state, _ = half.start(inputs_of(half, pull=1.0), 0.0, link)
    for k in range(6):
        state, _ = done(half.step(state, inputs_of(half, pull=1.0 if k < 3 else 0.0), t, h, link))
        t += h
    link.close()
    upper = half.system.interface.node_body == 1
    M = half.system.masses.matrix(False)
    speeds = np.where(upper, 1.0, 0.0) if upper.size == half.system.masses.n else np.r_[
        np.where(upper, 1.0, 0.0), np.zeros(half.system.masses.n - upper.size)]
    down = np.stack([0.0 * speeds, speeds], axis=1).ravel()
    momentum = float(down @ (M @ np.array(state.v).ravel()))
    assert momentum == pytest.approx(-A * RHO * 0.1 * 3 * h, rel=1e-6)
