"""What halved cells have goes to the nodes of the half with all its means: lengths, bends and mean temperatures."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_extremes import STEADY, stepped
from thermal_scenes import Box, scene, spec

from thermal_fmu.cells import cell_mesh, shapes_of
from thermal_fmu.halved import halved
from thermal_fmu.halved_means import Means


def integral(mesh, *fields):
    """The integral of a product of fields at nodes, each on straight lines in its cells, over the mesh as drawn."""
    volume, found = cell_mesh(mesh), 0.0
    for block, shape in zip(volume.blocks, shapes_of(volume, mesh.nodes), strict=True):
        product = shape.dV.copy()
        for field in fields:
            product *= field[block.cells] @ block.table.N.T
        found += float(product.sum())
    return found


def cell_means(mesh, field):
    """Of a field at nodes, on straight lines in the mesh's cells, as drawn."""
    volume, found = cell_mesh(mesh), np.empty(len(mesh.quads) + len(mesh.triangles))
    for block, shape in zip(volume.blocks, shapes_of(volume, mesh.nodes), strict=True):
        found[block.numbers] = (shape.dV * (field[block.cells] @ block.table.N.T)).sum(axis=1) / shape.dV.sum(axis=1)
    return found


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_it_keeps_the_means(geometry, triangles):
    old = scene(Box(0, 1, 0, 1, 3, 2, triangles=triangles), Box(0.2, 0.7, 1.1, 1.5, 2, 1), geometry=geometry)
    new = halved(old)
    means = Means(cell_mesh(new.interface), new)
    c = np.random.default_rng(3).normal(size=len(new.interface.nodes))
    e = means.at_nodes(c)
    # Of bodies in full, of quads nearly: of the whole mesh a thousandth of what c swings by.
    bodies = np.array([(old.node_body == b).astype(float) for b in range(2)])
    for body in bodies:
        on_halved = [integral(new.interface, field, new.P @ body) for field in (new.P @ e, c)]
        assert on_halved[0] == pytest.approx(on_halved[1], rel=1e-9, abs=1e-12)
    if not triangles and geometry == "plane":
        of_cells = np.bincount(new.parent, cell_means(new.interface, c)) / 4.0
        assert np.ptp(of_cells) > 0.5
        assert cell_means(old, e) == pytest.approx(of_cells, abs=0.01)
    # A field that the half's cells have stays what it is, and each body has its own.
    linear = old.nodes @ [2.0, -3.0] + old.node_body
    assert means.at_nodes(new.P @ linear) == pytest.approx(linear, abs=1e-9)
    alone = np.where(new.interface.node_body == 1, c, 0.0)
    assert (means.at_nodes(alone)[old.node_body == 0] == 0.0).all()


def test_a_single_row_keeps_its_slope():
    """Means of the cells of a plate tell nothing of how it bends: what c has across it is kept."""
    old = scene(Box(0, 4, 0, 1, 4, 1))
    new = halved(old)
    y = new.interface.nodes[:, 1]
    bent = (y - 0.5) * np.where((y > 0.4) & (y < 0.6), 0.0, 1.0) + 0.2 * (np.abs(y - 0.5) < 0.1)
    e = Means(cell_mesh(new.interface), new).at_nodes(bent)
    arm = old.nodes[:, 1] - 0.5
    assert integral(new.interface, new.P @ e, new.P @ arm) == pytest.approx(
        integral(new.interface, bent, new.P @ arm), rel=1e-6)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_even_heat_is_right_at_nodes_and_wrong_between(n):
    """T = x (1 - x)/2 has a mean of 1/12, of which straight lines between exact nodes leave out 1/(12 n^2)."""
    mesh = scene(Box(0, 1, 0, 0.1, n, 1))
    model = spec([{"on": f"a.{side}", "temperature": 0.0} for side in ("left", "right")], **STEADY)
    model["bodies"]["a"]["Q_T"] = 1.0
    out = stepped(mesh, model, 1.0, 1)
    x = mesh.nodes[:, 0]
    assert out["T"] == pytest.approx(x * (1 - x) / 2, abs=1e-9)
    told = integral(mesh, np.asarray(out["mesh.halved.T_mean"])) / 0.1
    # A quarter of it is left by halved cells: 3/4 is found, and told 1.5 times.
    assert told == pytest.approx(1.125 / (12 * n**2), rel=1e-6)


def test_a_single_row_is_told_how_it_would_bend():
    """A plate warmed on one side; by the size of nodes 0.3 to 0.4 of what it bends too little was told."""
    mesh = scene(Box(0, 4, 0, 1, 4, 1))
    fine = halved(halved(halved(mesh).interface).interface).interface
    model = spec([{"on": "a.bottom", "flux": 1.0}], method="sdirk2")

    def bend(of, T):
        return integral(of, np.asarray(T), of.nodes[:, 1] - 0.5)

    for k in (2, 5, 20):
        out, exact = (stepped(of, model, 0.02, k) for of in (mesh, fine))
        true = bend(fine, exact["T"]) - bend(mesh, out["T"])
        assert bend(mesh, out["mesh.halved.T_mean"]) == pytest.approx(true, rel=0.2)
