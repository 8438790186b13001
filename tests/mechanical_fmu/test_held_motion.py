"""Prescribed motions of bodies with inertia: kinks, jumps and turns of the data neither ring nor throw anything."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, done, elastic, inputs_of

RHO, V, END = 7800.0, 2.0, 0.3  # [m/s] of a body up to END [s], then it is let go
GROWING = END * np.r_[0.0, np.cumsum(1.6 ** np.arange(8)) / (1.6 ** np.arange(8)).sum()]
METHODS: list[dict[str, Any]] = [{}, {"rho_inf": 0.6}, {"alpha": -0.1}, {"mass": "lumped"}]


def gone(boundary: list[dict[str, Any]], times: np.ndarray, rigid: bool = False, dynamics: dict[str, Any] | None = None,
         E: float = 2e11, cells: int = 3) -> tuple[Any, Any, list[Any]]:
    """The half of a block of 0.3 m times 0.1 m, (u, v) of its nodes after steps to `times` [s], the outputs of each."""
    half = elastic(block(np.linspace(0.0, 0.3, 3 * cells + 1), np.linspace(0.0, 0.1, cells + 1)), boundary,
                   {"E": E, "nu": 0.0, "rho": RHO, "alpha": 0.0}, tolerance=1e-10, dynamics=dynamics or {},
                   bodies={"block": {"material": "m"} | ({"rigid": True} if rigid else {})})
    state, _ = half.start(inputs_of(half), 0.0, NoLink())
    told = []
    for t, then in pairwise(times.tolist()):
        state, outputs = done(half.step(state, inputs_of(half), t, then - t, NoLink()))
        told.append(outputs)
    block_ = half.system.interface.node_body == 0
    return half, (np.array(state.u)[block_], np.array(state.v)[block_]), told


@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize("dynamics", METHODS)
def test_what_is_let_go_flies_on_as_it_was_driven(dynamics: dict[str, Any], rigid: bool) -> None:
    """A body that set off at 2 m/s and was let go after 0.3 s was 2.8 m behind its start after 1 s."""
    held: list[dict[str, Any]] = [{"on": "block", "u_x": {"t": [0.0, 10.0], "value": [0.0, 10.0 * V]}, "u_y": 0.0,
                                   "until": END}]
    held += [{"on": "block", "angle": 0.0}] if rigid else []
    _, (u, _), _ = gone(held, np.r_[GROWING, END + np.array([0.1, 0.4, 0.7])], rigid, dynamics)
    np.testing.assert_allclose(u[:, 0], V * 1.0, rtol=1e-9)


@pytest.mark.parametrize("rigid", [False, True])
def test_what_holds_a_body_that_goes_evenly_is_nothing(rigid: bool) -> None:
    """Its mass times its speed in the step in which it sets off, then 0; it rang by twice that, without end."""
    held: list[dict[str, Any]] = [{"on": "block", "u_x": {"t": [0.0, 10.0], "value": [0.0, 10.0 * V]}, "u_y": 0.0}]
    held += [{"on": "block", "angle": 0.0}] if rigid else []
    _, _, told = gone(held, GROWING, rigid)
    forces = np.array([outputs["reaction.block"][0] for outputs in told])
    start = RHO * 0.03 * V / GROWING[1]
    assert forces[0] == pytest.approx(start, rel=1e-6)
    np.testing.assert_allclose(forces[1:], 0.0, atol=1e-6 * start)


@pytest.mark.parametrize("rigid", [False, True])
def test_what_turns_flies_off_along_its_tangent(rigid: bool) -> None:
    """A rod swung about its end by 0.2 rad a step: let go it flies as its middle did, across the rod."""
    w, T = 2.0, 0.8
    swung = {"on": "block", "until": T, "rotation": {"about": [0.0, 0.05], "angle": {"t": [0.0, 10.0],
                                                                                      "value": [0.0, 10.0 * w]}}}
    times = np.r_[np.linspace(0.0, T, 9), T + 1e-3 * np.arange(1, 6)]
    half, (u, _), _ = gone([swung], times, rigid)
    angle, flown = w * T, times[-1] - T
    r = np.array([np.cos(angle), np.sin(angle)])
    middle = np.array([0.0, 0.05]) + 0.15 * r + 0.15 * w * flown * np.array([-r[1], r[0]])
    x = half.system.interface.nodes[: len(u)] + u
    np.testing.assert_allclose(x.mean(axis=0), middle, atol=2e-3 * 0.15 * w * flown)


def test_a_jump_is_no_throw() -> None:
    """The end of a bar that jumps by 1 % of its length sends a wave; the cells behind it were turned inside out."""
    D, c = 3e-3, np.sqrt(1e7 / RHO)
    held = [{"on": "block.left", "u_x": {"t": [0.0, 0.01, 0.01], "value": [0.0, 0.0, D]}},
            {"on": "block.bottom", "u_y": 0.0}]
    times = np.r_[0.0, 0.01, 0.01 + 1e-6 * (2.0 ** np.arange(1, 8) - 1.0)]
    times = np.r_[times, np.arange(times[-1] + 2e-4, 0.01 + 0.6 / c, 2e-4)]
    _, (u, _), _ = gone(held, times, E=1e7, cells=4)
    assert np.abs(u).max() < 3.0 * D
    # Between L/c and 2 L/c the wave comes back from the free end.
    assert 1.3 * D < u[:, 0].mean() < 2.1 * D


@pytest.mark.parametrize("rho_inf", [0.6, 1.0])
@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_a_kink_pushes_neighbours_once(mass: str, rho_inf: float) -> None:
    """Of a consistent mass what is held moves what is beside it, M_ff v = -M_fh V, in steps that grow as in one.

    The bar is so soft that nothing else does.
    """
    held = [{"on": "block.left", "u_x": {"t": [0.0, 10.0], "value": [0.0, 10.0 * V]}},
            {"on": "block.bottom", "u_y": 0.0}]
    times = 1e-7 * np.r_[0.0, np.cumsum(3.0 ** np.arange(5))]
    half, (_, v), _ = gone(held, times, dynamics={"rho_inf": rho_inf, "mass": mass}, E=1e-3)
    M = half.system.masses.matrix(mass == "lumped").toarray()[::2, ::2]
    free = np.array(half.system.constraints.free)[::2] > 0.0
    alone = -np.linalg.solve(M[np.ix_(free, free)], M[np.ix_(free, ~free)] @ np.full((~free).sum(), V))
    np.testing.assert_allclose(v[free, 0], alone, atol=1e-6 * V)
    np.testing.assert_allclose(v[~free, 0], V, rtol=1e-9)


@pytest.mark.parametrize("rigid", [False, True])
def test_what_jumped_and_is_let_go_stays(rigid: bool) -> None:
    """3 mm at once are no speed, whatever the step after the jump."""
    D = 3e-3
    held: list[dict[str, Any]] = [{"on": "block", "u_x": {"t": [0.0, 0.01, 0.01], "value": [0.0, 0.0, D]}, "u_y": 0.0,
                                   "until": 0.011}]
    held += [{"on": "block", "angle": 0.0}] if rigid else []
    _, (u, _), _ = gone(held, np.array([0.0, 0.01, 0.011, 0.1, 1.0]), rigid)
    np.testing.assert_allclose(u[:, 0], D, rtol=1e-9)
