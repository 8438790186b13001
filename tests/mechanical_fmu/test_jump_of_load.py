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
