"""The thermal half in space: patches, manufactured fields, steady cases (A6, A13, A14)."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, run, scene, spec

from contact.half.functions import table_of
from thermal_fmu.half import load
from thermal_fmu.scene import freeze

SIDES = ("left", "right", "bottom", "top")


@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_the_tables_are_nodal_bases(kind):
    """Partition of unity, derivatives that reproduce the coordinates, positive weights of the reference area."""
    table = table_of(kind)
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]] if kind == "quad" else [[0, 0], [1, 0], [0, 1]], dtype=float)
    assert np.abs(table.N.sum(axis=1) - 1).max() < 1e-15
    assert np.abs(np.einsum("qij,ik->qjk", table.dN, corners) - np.eye(2)).max() < 1e-15
    assert (table.w > 0).all()
    assert abs(table.w.sum() - (1.0 if kind == "quad" else 0.5)) < 1e-15


def distorted(X):
    """Inner nodes of a unit-ish square moved by a fixed pattern, up to a third of a cell."""
    rng = np.random.default_rng(7)
    low, high = X.min(axis=0), X.max(axis=0)
    inner = ((low + 1e-9 < X) & (high - 1e-9 > X)).all(axis=1)
    return X + np.where(inner[:, None], rng.uniform(-0.06, 0.06, X.shape), 0.0)


def fixed_to(interface, values):
    """Temperatures prescribed node by node along the boundary, as node sets of one node each."""
    nodes = np.unique(np.concatenate([interface.surfaces[f"a.{s}"].ravel() for s in SIDES]))
    for node in nodes:
        interface.node_sets[f"n{node}"] = np.array([node], dtype=np.int32)
    return [{"at": f"n{node}", "temperature": float(values[node])} for node in nodes]


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize(("geometry", "slope"), [("plane", (30.0, -17.0)), ("axisymmetric", (0.0, -17.0))])
def test_a13_patch(triangles, geometry, slope):
    """A field linear in (x, y) in the plane, in z when axisymmetric (linear in r is no solution there)."""
    mesh = scene(Box(0.5, 1.5, 0, 1, 5, 5, triangles=triangles), geometry=geometry, move=distorted)
    exact = 300.0 + mesh.nodes @ np.array(slope)
    ran = run(mesh, spec(fixed_to(mesh, exact), k=12.0, method="steady", T0=300.0), 1.0, 1)
    assert np.abs(ran.T[-1] - exact).max() < EXPECTED["A13"]["tolerance"]
    assert ran.outputs[-1]["iterations"] == 1


@pytest.mark.parametrize("triangles", [False, True])
def test_a13_patch_on_the_mesh_that_came_in(triangles):
    """Conduction is on x, not on the reference: the field is linear in the current coordinates."""
    mesh = scene(Box(0.5, 1.5, 0, 1, 5, 5, triangles=triangles))
    x = distorted(mesh.nodes) @ np.array([[1.2, 0.1], [0.3, 0.9]])
    exact = 300.0 + x @ np.array([30.0, -17.0])
    from thermal_scenes import FlatContact, inputs_of

    from thermal_fmu.half import load

    half = load(mesh, spec(fixed_to(mesh, exact), method="steady", T0=300.0))
    state, _ = half.start(inputs_of(mesh, half), 0.0, FlatContact())
    done = half.step(state, inputs_of(mesh, half, x=x), 0.0, 1.0, FlatContact())
    assert np.abs(done.outputs["T"] - exact).max() < EXPECTED["A13"]["tolerance"]


def test_cylinder_wall_is_logarithmic():
    """T(r) between 300 at r = .5 and 400 at r = 1.5: within 2e-3 with 40 cells, the heat within 1e-3 of 2 pi k/ln 3."""
    mesh = scene(Box(0.5, 1.5, 0, 1, 40, 1), geometry="axisymmetric")
    model = spec([{"on": "a.left", "temperature": 300.0},
                  {"on": "a.right", "flux": 200.0 / (3.0 * np.log(3.0))}], k=1.0, method="steady",
                 T0=300.0)
    ran = run(mesh, model, 1.0, 1)
    exact = 300.0 + 100.0 * np.log(mesh.nodes[:, 0] / 0.5) / np.log(3.0)
    assert np.abs(ran.T[-1] - exact).max() < 2e-2
    through = 2.0 * np.pi * 100.0 / np.log(3.0)
    assert abs(ran.outputs[-1]["heat.flux"] / through - 1.0) < 1e-12
    assert abs(sum(ran.outputs[-1][f"heat.temperature.{way}"] for way in ("in", "out")) / through + 1.0) < 1e-12


def test_a6_nafems_t4():
    """Steady, on 12 x 20 cells graded toward the jump at (.6, 0): within .05 of 18.2538."""
    def graded(X):
        out = X.copy()
        out[:, 0] = 0.6 * (1 - (1 - X[:, 0] / 0.6) ** 1.6)
        fine, coarse = np.arange(11) / 10, np.arange(1, 11) / 10
        y = np.concatenate([0.2 * fine**1.6, 0.2 + 0.8 * coarse**1.5])
        out[:, 1] = np.interp(X[:, 1] * 20, np.arange(21), y)
        return out

    mesh = scene(Box(0, 0.6, 0, 1.0, 12, 20), move=graded)
    model = spec([{"on": "a.bottom", "temperature": 100.0},
                  *[{"on": f"a.{s}", "convection": {"h": 750.0, "T": 0.0}} for s in ("right", "top")]], k=52.0,
                 method="steady")
    ran = run(mesh, model, 1.0, 1)
    node = int(np.argmin(np.hypot(mesh.nodes[:, 0] - 0.6, mesh.nodes[:, 1] - 0.2)))
    assert abs(ran.T[-1, node] - EXPECTED["A6"]["expected"]) < EXPECTED["A6"]["tolerance"]


@pytest.mark.parametrize("method", ["midpoint", "backward_euler", "sdirk2"])
@pytest.mark.parametrize("triangles", [False, True])
def test_a14_manufactured(method, triangles):
    """u = 1 + x2 + 3 y2 + 1.2 t is nodally exact on a uniform mesh (consistent source terms), for any method."""
    mesh = scene(Box(0, 1, 0, 1, 4, 4, triangles=triangles))
    u0 = 1.0 + mesh.nodes[:, 0] ** 2 + 3.0 * mesh.nodes[:, 1] ** 2
    t_end = 0.5
    boundary = fixed_to(mesh, u0)
    for b, node in zip(boundary, sorted(int(k[1:]) for k in mesh.node_sets), strict=True):
        b["temperature"] = {"t": [0.0, t_end], "value": [u0[node], u0[node] + 1.2 * t_end]}
    from thermal_scenes import FlatContact, inputs_of

    from thermal_fmu.half import ThermalState, load

    model = spec(boundary, method=method)
    model["bodies"]["a"]["Q_T"] = 1.2 - 2.0 - 6.0
    half = load(mesh, model)
    state = ThermalState(u0, mesh.nodes, 0, 1, 0.0)
    for i in range(5):
        state = half.step(state, inputs_of(mesh, half), 0.1 * i, 0.1, FlatContact()).state
    assert np.abs(state.s - u0 - 1.2 * t_end).max() < EXPECTED["A14"]["tolerance"]


def test_a_film_around_the_axis_takes_the_area_of_each_node():
    """Over an edge from r_a to r_b the shape function of the inner node holds 2 pi L (r_a / 3 + r_b / 6)."""
    mesh = scene(Box(0.0, 0.3, 0.0, 0.1, 3, 1), geometry="axisymmetric")
    half = load(mesh, spec([{"on": "a.top", "convection": {"h": 1.0, "T": 0.0}}]))
    sc = half._scene
    points = freeze(sc, sc.masses(mesh.nodes), mesh.nodes, np.zeros(3), None).films[0].points
    r, area = mesh.nodes[:, 0], np.zeros(len(mesh.nodes))
    for a, b in mesh.surfaces["a.top"]:
        for near, far in ((a, b), (b, a)):
            area[near] += 2.0 * np.pi * abs(r[b] - r[a]) * (r[near] / 3.0 + r[far] / 6.0)
    assert np.bincount(points.node, points.area, len(area)) == pytest.approx(area, rel=1e-13)
