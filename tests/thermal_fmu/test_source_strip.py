"""Sources that change over place are read as they are, however their kinks lie in cells (test_flux_strip.py: in edges).
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, run, scene, spec

from contact.half.functions import field_from, table_of
from thermal_fmu.cells import cell_mesh, shapes_of
from thermal_fmu.source_points import parted_cells
from thermal_fmu.sources import SourceCache, freeze_sources

# A strip of 3 W/m3 and 0.05 m, which begins and ends within 1e-6 m: a seventh of a cell to two.
WIDE, SHARP, VALUE = 0.05, 1e-6, 3.0


def profile(start, wide=WIDE):
    return {"at": [start, start + SHARP, start + wide - SHARP, start + wide], "value": [0.0, 1.0, 1.0, 0.0]}


def distorted(n, kind, geometry="plane", seed=0):
    """A square from 1 to 2 in r and 0 to 1 in z, its cells of any shape; coordinates (n_nodes, 2) [m]."""
    mesh = scene(Box(1.0, 2.0, 0.0, 1.0, n, n, triangles=kind == "triangles"), geometry=geometry)
    x = np.array(mesh.nodes)
    inner = ((x > [1.0, 0.0]) & (x < [2.0, 1.0])).all(axis=1)
    x[inner] += np.random.default_rng(seed).uniform(-0.2, 0.2, (int(inner.sum()), 2)) / n
    return mesh, x


def given(field, mesh, x, cache=None):
    """(n_nodes,) [W] what a source gives to each node."""
    volume = cell_mesh(mesh)
    body = SimpleNamespace(Q_T=field_from(field), Q_T_factor=None)
    sources, _ = freeze_sources(volume, shapes_of(volume, x), [body], x, cache or SourceCache())
    return sum(np.array([term.t.value[0] for term in body.Q_T.terms]) @ s.shapes for s in sources)


@pytest.mark.parametrize("kind", ["quads", "triangles"])
@pytest.mark.parametrize("n", [3, 20])
def test_a_strip_gives_its_heat_and_moment_wherever_nodes_are(kind, n):
    rng = np.random.default_rng(n)
    for start in rng.uniform(1.0, 1.9, 5):
        mesh, x = distorted(n, kind, seed=n)
        heat = given({"terms": [{"t": VALUE, "x": profile(start)}]}, mesh, x)
        power = VALUE * (WIDE - SHARP)
        assert heat.sum() == pytest.approx(power, rel=1e-12)
        assert heat @ x == pytest.approx(power * np.array([start + 0.5 * WIDE, 0.5]), rel=1e-12)


@pytest.mark.parametrize("kind", ["quads", "triangles"])
def test_so_does_a_spot(kind):
    """A table of x times one of y: a spot within a cell, and one over several."""
    mesh, x = distorted(4, kind)
    for wide in (WIDE, 0.6):
        heat = given({"terms": [{"t": VALUE, "x": profile(1.31, wide), "y": profile(0.27, wide)}]}, mesh, x)
        power = VALUE * (wide - SHARP) ** 2
        assert heat.sum() == pytest.approx(power, rel=1e-12)
        assert heat @ x == pytest.approx(power * np.array([1.31, 0.27]) + power * 0.5 * wide, rel=1e-12)


def test_rings_of_a_strip_about_an_axis_too():
    mesh, x = distorted(4, "quads", "axisymmetric")
    heat = given({"terms": [{"t": VALUE, "x": profile(1.3)}]}, mesh, x)
    assert heat.sum() == pytest.approx(VALUE * (WIDE - SHARP) * 2.0 * np.pi * (1.3 + 0.5 * WIDE), rel=1e-12)


def test_shape_functions_are_found_in_cells_of_any_shape():
    """Of each cell those of a mapped place, as the tables of cells have them."""
    for kind, name in (("quads", "quad"), ("triangles", "triangle")):
        mesh, x = distorted(3, kind)
        cells = mesh.quads if kind == "quads" else mesh.triangles
        parted = parted_cells(field_from({"terms": [{"x": profile(1.2)}]}), x[cells], False)
        assert parted is not None
        assert parted.N.sum(axis=1) == pytest.approx(1.0, abs=1e-14)
        assert parted.N.min() > 0.0
        assert np.einsum("pi,pij->pj", parted.N, x[cells[parted.cell]]) == pytest.approx(parted.x, abs=1e-14)
        assert parted.N.shape[1] == table_of(name).N.shape[1]


def test_without_kinks_in_cells_the_points_are_those_of_the_cells():
    mesh, x = distorted(3, "quads")
    whole = x[mesh.quads]
    for field in ({"terms": [{"x": {"polynomial": [1.0, 2.0]}}]}, {"terms": [{"x": profile(5.0)}]}, 2.0):
        assert parted_cells(field_from(field), whole, False) is None
    # Kinks where nodes are part nothing, either.
    even = np.array(mesh.nodes)[mesh.quads]
    at = {"at": [1.0, 1.0 + 1.0 / 3.0, 1.0 + 2.0 / 3.0, 2.0], "value": [0.0, 1.0, 1.0, 0.0]}
    assert parted_cells(field_from({"terms": [{"x": at}]}), even, False) is None


@pytest.mark.parametrize("factor", [None, {"T": [200, 400], "value": [2.0, 2.0]}], ids=["field", "factor"])
def test_a_half_reads_its_sources_so(factor):
    """Of a strip a seventh of a cell wide it made nothing, or three times the heat."""
    mesh, x = distorted(3, "quads")
    model = spec([], T0=300.0)
    model["bodies"]["a"] |= {"Q_T": {"terms": [{"t": VALUE, "x": profile(1.4)}]}}
    model["bodies"]["a"] |= {} if factor is None else {"Q_T_factor": factor}
    out = run(mesh, model, 1.0, 1, x=x).outputs[-1]
    assert out["heat.source"] == pytest.approx(VALUE * (WIDE - SHARP) * (1.0 if factor is None else 2.0), rel=1e-12)


def test_a_strip_that_stays_warms_what_moves_past_it():
    """Sources are kept as long as cells stay where they are."""
    mesh, x = distorted(3, "quads")
    cache = SourceCache()
    field = {"terms": [{"t": VALUE, "x": profile(1.4)}]}
    there, gone, back = (given(field, mesh, x + [way, 0.0], cache).sum() for way in (0.0, 1.0, 0.0))
    assert there == back == pytest.approx(VALUE * (WIDE - SHARP), rel=1e-12)
    assert gone == 0.0


@pytest.mark.parametrize("start", [0, 1, 2, 3])
def test_which_corner_comes_first_changes_nothing(start):
    """A quad that is no parallelogram, parted along one diagonal, gave its nodes 1e-9 of the heat more or less."""
    corners = np.array([[0.0, 0.0], [1.0, 0.1], [1.2, 1.3], [-0.1, 0.8]])
    field = field_from({"terms": [{"t": VALUE, "x": {"at": [0.0, 0.45, 1.0], "value": [1.0, 2.0, 0.0]},
                                   "y": {"polynomial": [1.0, 8.0, -40.0]}}]})

    def of_nodes(first):
        parted = parted_cells(field, np.roll(corners, -first, axis=0)[None], axisymmetric=False)
        values = np.array([t.x(x) * t.y(y) for t in field.terms for x, y in parted.x])
        return np.roll(parted.N.T @ (parted.volume * values), first)

    assert of_nodes(start) == pytest.approx(of_nodes(0), rel=1e-14)
