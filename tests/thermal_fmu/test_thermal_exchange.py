"""Exchange between surfaces at any conductance: signs of the matrix, exact fields, order, and data that are kept."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).parent))

from thermal_scenes import Box, Ran, run, scene, spec

from contact.half.interface import Interface, Pair
from contact.rpc.link import DirectLink
from contact.service import ContactService
from thermal_fmu.exchange import between_nodes

PRESSED = -1e6
H = 1.0 / 8.0  # of a cell of eight on a side, k = 1: the cell Biot number is h H


def blocks(cells_a: tuple[int, int], cells_b: tuple[int, int], shift: float = 0.0, **more: Any) -> Interface:
    """Two unit squares, "a" on "b", "a" moved along by shift."""
    return scene(Box(shift, 1 + shift, 0, 1, *cells_a), Box(0, 1, -1, 0, *cells_b),
                 pairs=(Pair("p", "a.bottom", "b.top", gap_max=1.0, eps_N=1.0),), **more)


def solved(mesh: Interface, h: float, boundary: list[dict[str, Any]], dt: float, n: int, T_b: float = 0.0,
           law: dict[str, Any] | None = None, **more: Any) -> Ran:
    model = spec(boundary, pairs={"p": {"conduction": {"closed": law or {"law": "constant", "h": h}, "open": None}}},
                 **more)
    model["bodies"]["b"] = {"material": "m", "T0": T_b}
    return run(mesh, model, dt, n, t_N=np.full(len(mesh.contact_nodes), PRESSED))


MESHES = [((8, 8), (8, 8), 0.0), ((8, 8), (11, 8), 0.0), ((16, 2), (9, 2), 0.31), ((4, 16), (4, 16), 0.0),
          ((4, 16), (7, 16), 0.0), ((7, 16), (4, 16), 0.31), ((8, 8), (8, 8), 0.31)]
FEW = (MESHES[0], MESHES[2], MESHES[4])  # nodes that meet; that do not, in long cells; in flat ones
WALL = [{"on": "a.left", "temperature": 1.0}]


@pytest.mark.few(
    "((8, 8), (8, 8), 0.0)-10.0-midpoint", "((16, 2), (9, 2), 0.31)-100000.0-sdirk2",
    "((4, 16), (7, 16), 0.0)-100000.0-backward_euler", "((4, 16), (7, 16), 0.0)-100000.0-steady")
@pytest.mark.parametrize("method", ["backward_euler", "midpoint", "sdirk2", "steady"])
@pytest.mark.parametrize("Bi", [10.0, 1e5])
@pytest.mark.parametrize("meshes", [pytest.param(m, marks=() if m in FEW else pytest.mark.slow) for m in MESHES],
                         ids=str)
def test_a_jump_beside_a_contact_stays_within_its_data(meshes: Any, Bi: float, method: str) -> None:
    """A wall jumps beside the contact: 5 to 45 % of the jump outside before, whatever the windows."""
    a, b, shift = meshes
    boundary = [*WALL, {"on": "b.bottom", "temperature": 0.0}]
    for r in (0.01, 1.0, 100.0) if method != "steady" else (1.0,):
        ran = solved(blocks(a, b, shift), Bi / H, boundary, r * H**2, 6, method=method)
        assert ran.T.min() >= -1e-8, r
        assert ran.T.max() <= 1.0 + 1e-8, r
        assert ran.imbalance() < 1e-10


def test_what_goes_from_node_to_node_has_the_right_sign_and_sums() -> None:
    """All couplings between nodes <= 0, rows and columns sum to 0, and a uniform jump flows as by shape functions."""
    at = np.random.default_rng(3).random((50, 2))
    N_s, N_m = np.stack([1 - at[:, 0], at[:, 0]], axis=1), np.stack([1 - at[:, 1], at[:, 1]], axis=1)
    P = between_nodes(N_s, N_m)
    assert P[:, ~np.eye(4, dtype=bool)].max() <= 0.0
    assert np.abs(P.sum(axis=1)).max() < 1e-15
    assert np.abs(P.sum(axis=2)).max() < 1e-15
    np.testing.assert_allclose(P @ np.array([1.0, 1, 0, 0]), np.concatenate([N_s, -N_m], axis=1), atol=1e-15)


@pytest.mark.parametrize("h", [1.0, 1e2, 1e4])
@pytest.mark.parametrize("cells", [(3, 4), (7, 5), (4, 8), (6, 6)])
def test_a_temperature_linear_along_the_surface_is_exact(cells: tuple[int, int], h: float) -> None:
    a, b = cells
    held = {"terms": [{"t": 1.0, "x": {"polynomial": [1.0, 2.0]}}]}
    ran = solved(blocks((a, a), (b, b)), h, [{"on": f"{s}.{side}", "temperature": held} for s in "ab" for side in
                                             ("left", "right")], 1.0, 1, method="steady")
    assert np.abs(ran.T[-1] - (1.0 + 2.0 * ran_x(a, b))).max() < 1e-11


@pytest.mark.parametrize("cells", [(3, 4), (7, 5), (4, 8)])
def test_a_uniform_flow_across_any_two_meshes_is_exact(cells: tuple[int, int]) -> None:
    a, b = cells
    mesh = blocks((a, a), (b, b))
    ran = solved(mesh, 4.0, [{"on": "a.top", "temperature": 9.0}, {"on": "b.bottom", "temperature": 0.0}], 1.0, 1,
                 method="steady")
    y = mesh.nodes[:, 1]
    exact = np.where(np.array(mesh.node_body) == 0, 5.0 + 4.0 * y, 4.0 + 4.0 * y)
    assert np.abs(ran.T[-1] - exact).max() < 1e-11


def ran_x(a: int, b: int) -> np.ndarray:
    return np.asarray(blocks((a, a), (b, b)).nodes[:, 0])


def lateral(h: float, a: int, b: int) -> float:
    """The largest error at the surfaces of a steady field cos(pi x) times hyperbolic functions of y."""
    mesh = blocks((a, a), (b, b))
    x = np.linspace(0, 1, 4 * a * b + 1)
    top = {"terms": [{"t": 1.0, "x": {"at": x.tolist(), "value": np.cos(np.pi * x).tolist()}}]}
    ran = solved(mesh, h, [{"on": "a.top", "temperature": top}, {"on": "b.bottom", "temperature": 0.0}], 1.0, 1,
                 method="steady")
    ch, sh = np.cosh(np.pi), np.sinh(np.pi)
    A, _, C = np.linalg.solve([[ch, sh, 0], [0, 1, -ch], [-h, np.pi, h * sh]], [1, 0, 0])
    X, surface = mesh.nodes, np.abs(mesh.nodes[:, 1]) < 1e-12
    exact = np.where(np.array(mesh.node_body) == 0, A, C * sh) * np.cos(np.pi * X[:, 0])
    return float(np.abs(ran.T[-1] - exact)[surface].max())


@pytest.mark.few("cells0-1.0", "cells1-100.0", "cells2-10000.0")
@pytest.mark.parametrize("h", [1.0, 100.0, 1e4])
@pytest.mark.parametrize("cells", [(8, 8), (8, 11), (11, 8)])
def test_the_order_in_space_along_a_contact_is_two(cells: tuple[int, int], h: float) -> None:
    """Errors of 8 cells: 1.1e-3 to 3.9e-3, those of shape functions: within the data nothing is taken off."""
    a, b = cells
    errors = [lateral(h, a * f, b * f) for f in (1, 2, 4)]
    assert errors[0] < 4.2e-3
    assert all(one / two > 3.6 for one, two in pairwise(errors))


@pytest.mark.few("((16, 2), (9, 2), 0.31)")
@pytest.mark.parametrize("meshes", MESHES, ids=str)
def test_a_conductance_of_temperature_stays_within_too(meshes: Any) -> None:
    a, b, shift = meshes
    law = {"law": "table", "x": [0.0, 1.0], "h": [50.0 / H, 100.0 / H], "variable": "T"}
    ran = solved(blocks(a, b, shift), 0.0, WALL, 0.1 * H**2, 6, law=law)
    assert ran.T.min() >= -1e-8
    assert ran.T.max() <= 1.0 + 1e-8


@pytest.mark.parametrize(("cells", "low", "high"), [((3, 4), 0.014, 0.018), ((4, 3), 0.007, 0.010)])
@pytest.mark.parametrize("h", [1.0, 1e4])
def test_one_point_a_node_fails_it_by_what_check_says(cells: tuple[int, int], low: float, high: float,
                                                      h: float) -> None:
    """Of the span, in the uniform flow between edges of 3 and 4 cells that points of edges pass on exactly."""
    a, b = cells
    mesh = scene(Box(0, 1, 0, 1, a, a), Box(0, 1, -1, 0, b, b),
                 pairs=(Pair("p", "a.bottom", "b.top", gap_max=1.0, eps_N=1.0, by_node=True),))
    model = spec([{"on": "a.top", "temperature": 9.0}, {"on": "b.bottom", "temperature": 0.0}], method="steady",
                 pairs={"p": {"conduction": {"closed": {"law": "constant", "h": h}, "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": 0.0}
    ran = run(mesh, model, 1.0, 1, DirectLink(ContactService().handle), t_N=np.full(len(mesh.pair_nodes), PRESSED))
    y, q = mesh.nodes[:, 1], 9.0 / (2.0 + 1.0 / h)
    exact = np.where(np.array(mesh.node_body) == 0, 9.0 - q * (1.0 - y), q * (1.0 + y))
    assert low < np.abs(ran.T[-1] - exact).max() / 9.0 < high
