"""What crosses a gap that opens along coarse edges is that of closed forms, however thin the layer at its hinge."""

from __future__ import annotations

import sys
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, inputs_of, run, scene, spec

from contact.half.contact_client import ContactSurfaces
from contact.half.interface import Pair
from contact.laws import parse_law
from contact.quadrature import GAUSS
from contact.rpc.link import DirectLink
from contact.service import ContactService
from thermal_fmu import gap_pieces
from thermal_fmu.contact_quadrature import contact_points
from thermal_fmu.gap_pieces import parted
from thermal_fmu.stations.half import load_lumped

LENGTH, OPEN, K = 0.02, 2e-4, 0.03
HOT, COLD = 400.0, 300.0
SIGMA = 5.670374419e-8


def wedge(cells, geometry="plane", hinge="left", **more):
    """Two blocks, the upper one lifted at its end, or at its start, by OPEN."""
    def lifted(X):
        along = X[:, 0] / LENGTH if hinge == "left" else 1.0 - X[:, 0] / LENGTH
        return X + np.stack([0.0 * along, np.where(X[:, 1] >= 0.0, OPEN * along, 0.0)], axis=1) * apart[:, None]
    boxes = Box(0.0, LENGTH, -0.01, 0.0, cells[0], 1), Box(0.0, LENGTH, 0.0, 0.01, cells[1], 1)
    pairs = (Pair("gap", "b.bottom", "a.top", 0.01, 1e9, **more),)
    apart = (scene(*boxes, geometry=geometry, pairs=pairs).node_body == 1).astype(float)
    return scene(*boxes, geometry=geometry, pairs=pairs, move=lifted)


def heat(mesh, laws, mechanism, boundary=(), load=None):
    """What crosses in a second [W], with both bodies held at their temperatures."""
    held = [{"body": "a", "temperature": COLD}, {"body": "b", "temperature": HOT}]
    model = spec([*held, *boundary], method="backward_euler") | {
        "materials": {"m": {"rho": 1.0, "k": 1.0, "c": 1.0}},
        "bodies": {"a": {"material": "m", "T0": COLD}, "b": {"material": "m", "T0": HOT}}, "pairs": laws}
    link = DirectLink(ContactService().handle)
    if load is None:
        return abs(run(mesh, model, 1.0, 1, link).outputs[-1][mechanism])
    half = load(mesh, model | {"half": "lumped"})
    inputs = inputs_of(mesh, half)
    return abs(half.step(half.start(inputs, 0.0, link)[0], inputs, 0.0, 1.0, link).outputs[mechanism])


def conducting(law):
    return {"gap": {"conduction": {"closed": None, "open": law}}}


@pytest.mark.parametrize("layer", [1e-4, 1e-6, 2e-8])
@pytest.mark.parametrize("cells", [(4, 4), (3, 5)])
def test_a_layer_of_gas_that_opens_from_a_hinge(layer, cells):
    """k/(g + g_m) over a gap that is linear along the edge: a logarithm."""
    crosses = heat(wedge(cells), conducting({"law": "gas", "k_g": K, "g_m": layer}), "heat.gap.slave")
    exact = K * (HOT - COLD) * LENGTH / OPEN * np.log(1.0 + OPEN / layer)
    assert crosses == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("hinge", ["left", "right"])
def test_a_layer_that_opens_from_the_axis_or_towards_it(hinge):
    layer, a = 1e-6, OPEN / LENGTH
    crosses = heat(wedge((4, 4), "axisymmetric", hinge), conducting({"law": "gas", "k_g": K, "g_m": layer}),
                   "heat.gap.slave")
    log = np.log(1.0 + OPEN / layer)
    # int r/(g_m + a r) dr from the axis; from the rim the radius is LENGTH less that.
    from_axis = (LENGTH - layer / a * log) / a
    exact = from_axis if hinge == "left" else LENGTH * log / a - from_axis
    assert crosses == pytest.approx(2.0 * np.pi * K * (HOT - COLD) * exact, rel=2e-3)


def test_a_table_that_kinks_within_an_edge():
    """Conducts up to a gap that no node has, nearly none beyond."""
    law = {"law": "table", "x": [0.0, 0.31 * OPEN, 0.32 * OPEN, OPEN], "h": [2000.0, 2000.0, 1.0, 1.0]}
    exact = (HOT - COLD) * LENGTH * (0.31 * 2000.0 + 0.01 * 0.5 * 2001.0 + 0.68 * 1.0)
    assert heat(wedge((2, 2)), conducting(law), "heat.gap.slave") == pytest.approx(exact, rel=5e-4)


def test_radiation_and_films_that_fade_within_an_edge():
    near, far = 0.31 * OPEN, 0.36 * OPEN
    faced = 0.335 * LENGTH
    near_radiation = {"gap": {"radiation": {"emissivity_slave": 1.0, "emissivity_master": 1.0,
                                            "gap": {"d_near": near, "d_far": far}}}}
    crosses = heat(wedge((2, 2)), near_radiation, "heat.near_radiation.slave")
    assert crosses == pytest.approx(SIGMA * (HOT**4 - COLD**4) * faced, rel=5e-4)
    film = {"on": "a.top", "convection": {"h": 50.0, "T": HOT, "gap": {"d_cut": near, "d_full": far}}}
    given = heat(wedge((2, 2)), {}, "heat.convection", [film])
    assert given == pytest.approx(50.0 * (HOT - COLD) * (LENGTH - faced), rel=5e-4)


@pytest.mark.parametrize("narrow", [0.0, 0.35])
def test_a_layer_beside_a_surface_that_is_round(narrow):
    """A parabola that is narrowest at the end of a piece or within it, by its points and its ends: an arctangent."""
    layer, least = 1e-6, 1e-6
    at = np.array([0.0, 0.5 - GAUSS, 0.5 + GAUSS, 1.0])
    gap = least + OPEN * (at - narrow) ** 2
    whole = points_of(wedge((1, 1)))
    round_one = replace(whole, gap=gap[1:3], gap_at_end=gap[[0, 3]])
    parts = parted(round_one, model_of({"law": "gas", "k_g": K, "g_m": layer}), [False])
    crosses = float((K / (parts.gap + layer) * parts.open_area).sum())
    root = np.sqrt((least + layer) / OPEN)
    angle = np.arctan((1.0 - narrow) / root) + np.arctan(narrow / root)
    assert crosses == pytest.approx(K * whole.open_area.sum() * angle / np.sqrt(OPEN * (least + layer)), rel=1e-3)


def test_gaps_at_the_ends_of_pieces_are_those_of_nodes():
    for cells in ((3, 5), (4, 4)):
        points = points_of(wedge(cells))
        twin = np.arange(points.gap.size) + 1 - 2 * (np.arange(points.gap.size) % 2)
        on = points.gap + 0.5 * (np.sqrt(3.0) - 1.0) * (points.gap - points.gap[twin])
        assert points.gap_at_end == pytest.approx(on, abs=1e-3 * OPEN)


def test_the_half_lumped_integrates_gaps_alike():
    layer = 1e-6
    crosses = heat(wedge((4, 4)), conducting({"law": "gas", "k_g": K, "g_m": layer}), "heat.gap.slave",
                   load=load_lumped)
    assert crosses == pytest.approx(K * (HOT - COLD) * LENGTH / OPEN * np.log(1.0 + OPEN / layer), rel=5e-4)


def model_of(law):
    """As much of a model as parts are made by."""
    stated = SimpleNamespace(conduction=SimpleNamespace(open=parse_law(law)), radiation=None)
    return SimpleNamespace(films=(), radiators=(), pairs=(SimpleNamespace(stated=stated),))


def points_of(mesh):
    surfaces, link = ContactSurfaces(mesh), DirectLink(ContactService().handle)
    return contact_points(surfaces, surfaces.facing(link, mesh.nodes), np.zeros(mesh.pair_nodes.size), mesh.nodes)


def test_parts_keep_what_a_piece_covers_of_each_shape_function():
    for geometry in ("plane", "axisymmetric"):
        whole = points_of(wedge((3, 5), geometry))
        parts = parted(whole, model_of({"law": "gas", "k_g": K, "g_m": 1e-6}), [False])
        assert parts.gap.size > 2 * whole.gap.size
        for name in ("area", "open_area", "area_s", "area_m", "end_s", "end_m"):
            for N, edge in (("N_s", "slave_edge"), ("N_m", "master_edge")):
                covered = [[np.bincount(getattr(p, edge), getattr(p, name) * getattr(p, N)[:, k]) for k in (0, 1)]
                           for p in (whole, parts)]
                # At the axis a rest of negative area is left out.
                near = 1e-9 if geometry == "plane" else 1e-5
                assert np.allclose(covered[0], covered[1], rtol=near, atol=near * whole.area.max()), (name, N)


def test_pieces_that_two_points_tell_are_left_alone():
    even, opening = points_of(wedge((3, 5))), points_of(wedge((3, 5)))
    for points, law in ((even, {"law": "constant", "h": 5.0}), (opening, {"law": "gas", "k_g": K, "g_m": 100 * OPEN})):
        assert parted(points, model_of(law), [False]) is points
    gas = model_of({"law": "gas", "k_g": K, "g_m": 1e-6})
    by_node = points_of(wedge((3, 5), by_node=True))
    kept = parted(by_node, gas, [True])
    assert all(getattr(kept, f.name) is getattr(by_node, f.name) for f in fields(kept))


def test_of_a_table_of_hundreds_of_gaps_only_those_are_looked_for_that_a_piece_has(monkeypatch):
    """A rod before a wall, with a law of 400 gaps, took 3.5 times as long as it takes: each was looked for."""
    law = {"law": "table", "x": np.linspace(0.0, 100.0 * OPEN, 401).tolist(), "h": np.linspace(9.0, 1.0, 401).tolist()}
    met, looked = [], gap_pieces._kinks_along
    monkeypatch.setattr(gap_pieces, "_kinks_along", lambda gaps, kinks: met.append(looked(gaps, kinks)) or met[-1])
    opening = points_of(wedge((3, 5)))
    parted(opening, model_of(law), [False])
    assert met.pop().shape[1] <= 2 * 4  # four gaps of the table lie in that of the wedge, where 0 is one
    even = replace(opening, gap=np.full_like(opening.gap, 0.3 * OPEN), gap_at_end=None)
    assert parted(even, model_of(law), [False]) is even
    assert not met
