"""Stable equilibria and others: columns under less and more than Euler's load, and what only looks unstable."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags_array

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, elastic, hold, inputs_of

from contact.half.linalg import negative_pivots
from mechanical_fmu.system import Loading
from mechanical_fmu.unstable import NAME, unstable_directions

H, L, E = 0.05, 1.0, 1e9
# Of a column held at one end and free at the other, plane strain with nu 0.
EULER = np.pi**2 * E * H**3 / 12.0 / (4.0 * L**2)


def column(load: float, angle: float = 0.0, element: str = "enhanced", **more):
    """The half of a column pressed by a dead load [N] along itself, turned by an angle; and its start."""
    interface = block(np.linspace(0.0, H, 3), np.linspace(0.0, L, 41))
    c, s = np.cos(angle), np.sin(angle)
    interface = replace(interface, nodes=interface.nodes @ np.array([[c, s], [-s, c]]))
    force = load / H
    half = elastic(interface, [hold("block.bottom", 0), hold("block.bottom", 1),
                               {"on": "block.top", "t_x": s * force, "t_y": -c * force}],
                   {"E": E, "nu": 0.0, "rho": 1000.0}, element=element, **more)
    return half, half.start(inputs_of(half), 0.0, NoLink())


@pytest.mark.parametrize("angle", [0.0, 0.7])
@pytest.mark.parametrize(("loads", "directions"), [(-1.0, 0), (0.97, 0), (1.03, 1), (8.0, 1), (9.8, 2)])
def test_a_column_leaves_its_straight_line_in_a_direction_for_each_load_of_euler(loads, directions, angle):
    """(2 n - 1)^2 times the first; 9 times it, shear makes it 1 % less.  Where it stands does not matter."""
    _, (_, outputs) = column(loads * EULER, angle)
    assert outputs[NAME] == directions


@pytest.mark.parametrize(("loads", "directions"), [(0.0, 0), (0.9, 0), (2.0, 1)])
def test_cells_of_mean_dilatation_leave_too(loads, directions):
    """They bend by up to a third too stiffly, two across the column: it leaves at less than twice Euler's load."""
    _, (_, outputs) = column(loads * EULER, element="mean_dilatation")
    assert outputs[NAME] == directions


def test_what_has_no_stress_is_stable_without_a_count(monkeypatch):
    """As drawn, moved and turned far, and pressed by what solvers leave; what is pressed by more is counted."""
    def refuse(K):
        raise AssertionError("counted")

    half = elastic(block(np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 5)), [hold("block.bottom", 0)],
                   {"E": 2e11, "nu": 0.3, "alpha": 0.0})
    free, X = half.system.without((0,)), half.system.interface.nodes
    loading = Loading(free.moduli(np.full(len(X), 293.15)), np.zeros(0), np.zeros(0), None)
    c, s = np.cos(0.7), np.sin(0.7)
    turned = X @ np.array([[c, s], [-s, c]]) + 3.0 - X
    monkeypatch.setattr("mechanical_fmu.unstable.negative_pivots", refuse)
    for u in (np.zeros_like(X), turned, 1e-11 * X):
        assert unstable_directions(free, free.balance(u, loading), loading) == 0.0
    with pytest.raises(AssertionError, match="counted"):
        unstable_directions(free, free.balance(-1e-9 * X, loading), loading)


def test_with_inertia_motion_tells():
    assert NAME not in {v.name for v in column(2.0 * EULER, dynamics={})[0].variables}


def test_what_nothing_resists_is_not_unstable():
    """A block that nothing holds may go along x, along y, and turn, at no work."""
    half = elastic(block(np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 5)), [hold("block.bottom", 0)])
    free = half.system.without((0,))
    n = len(free.interface.nodes)
    loading = Loading(free.moduli(np.full(n, 293.15)), np.zeros(0), np.zeros(0), None)
    assert unstable_directions(free, free.balance(np.zeros((n, 2)), loading), loading) == 0


@pytest.mark.parametrize("solver", ["superlu", "pardiso"])
def test_negative_eigenvalues_are_counted(solver, monkeypatch):
    """Of Laplace's matrix less a multiple of one, whose eigenvalues are known, in any order of its unknowns."""
    if solver == "pardiso":
        pytest.importorskip("pypardiso")
    monkeypatch.setenv("SLIDELINE_SOLVER", solver)
    n, order = 60, np.random.default_rng(3).permutation(60)
    values = 2.0 - 2.0 * np.cos(np.pi * np.arange(1, n + 1) / (n + 1))
    for k in (0, 1, 7, 59):
        shift = 0.5 * (values[k - 1] + values[k]) if k else -0.1
        A = csr_matrix(diags_array([-1.0, 2.0 - shift, -1.0], offsets=[-1, 0, 1], shape=(n, n)))[order][:, order]
        assert negative_pivots(csr_matrix(A)) == k
