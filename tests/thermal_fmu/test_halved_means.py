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


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_it_keeps_every_integral(geometry, triangles):
    old = scene(Box(0, 1, 0, 1, 3, 2, triangles=triangles), Box(0.2, 0.7, 1.1, 1.5, 2, 1), geometry=geometry)
    new = halved(old)
    means = Means(cell_mesh(new.interface), new.interface.nodes, new.P)
    rng = np.random.default_rng(3)
    c = rng.normal(size=len(new.interface.nodes))
    e = means.at_nodes(c)
    for of in (np.ones(len(old.nodes)), *old.nodes.T, rng.normal(size=len(old.nodes))):
        on_halved = [integral(new.interface, field, new.P @ of) for field in (new.P @ e, c)]
        assert on_halved[0] == pytest.approx(on_halved[1], rel=1e-12, abs=1e-14)
    # A field that the half's cells have stays what it is, and each body has its own.
    linear = old.nodes @ [2.0, -3.0] + old.node_body
    assert means.at_nodes(new.P @ linear) == pytest.approx(linear, abs=1e-12)
    alone = np.where(new.interface.node_body == 1, c, 0.0)
    assert (means.at_nodes(alone)[old.node_body == 0] == 0.0).all()


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
