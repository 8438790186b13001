"""Halved edges: the same bodies, surfaces, sets and starts, and what faces what as if it were searched again."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import Box, FlatContact, scene

from contact.half.contact_client import ContactSurfaces
from contact.half.interface import Interface, Pair
from thermal_fmu.cells import cell_mesh, shapes_of
from thermal_fmu.halved import halved, halved_facing

PAIR = (Pair("p", "b.bottom", "a.top", 0.1, 0.0),)


def blocks(geometry: str = "plane", triangles: bool = False) -> Interface:
    """A narrow block on a wide one, nodes nowhere face to face."""
    return scene(Box(0, 1, 0, 1, 5, 2, triangles=triangles), Box(0.13, 0.71, 1, 1.5, 3, 2), geometry=geometry,
                 pairs=PAIR)


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_bodies_and_surfaces_stay(geometry: str, triangles: bool) -> None:
    old = blocks(geometry, triangles)
    new = halved(old)
    fine = new.interface
    V_old, V_new = ([s.dV.sum() for s in shapes_of(cell_mesh(of), of.nodes)] for of in (old, fine))
    assert V_new == pytest.approx(V_old, rel=1e-12)
    assert len(np.unique(fine.nodes, axis=0)) == len(np.unique(old.nodes, axis=0)) + len(fine.nodes) - len(old.nodes)
    for name, edges in fine.surfaces.items():
        ends = fine.nodes[edges]
        assert np.array_equal(edges[::2, 0], old.surfaces[name][:, 0])
        assert np.array_equal(edges[::2, 1], edges[1::2, 0])
        assert np.allclose(np.linalg.norm(ends[::2, 1] - ends[::2, 0], axis=1),
                           np.linalg.norm(ends[1::2, 1] - ends[1::2, 0], axis=1))
    linear = old.nodes @ [2.0, -3.0]
    assert new.P @ linear == pytest.approx(fine.nodes @ [2.0, -3.0])
    assert (fine.node_body == np.round(new.P @ old.node_body)).all()


def test_sets_and_starts_reach_between_nodes() -> None:
    old = blocks()
    x, y = old.nodes.T
    own, b = y < 1e-9, old.node_body == 1
    old = replace(old, node_sets={"line": np.flatnonzero(own).astype(np.int32), "one": np.array([7], np.int32)},
                  start={"T": 3.0 * x, "t.b": np.array([0.0, 1.0]), "T.b": np.array([x[b], 2.0 * x[b]]),
                         "u": np.zeros((len(x), 2)), "plastic.cells": np.zeros(3)})
    fine = halved(old).interface
    x, y = fine.nodes.T
    assert set(fine.node_sets["line"]) == set(np.flatnonzero(y < 1e-9))
    assert list(fine.node_sets["one"]) == [7]
    assert set(fine.start) == {"T", "t.b", "T.b"}, "heat reads no more of another run"
    b = fine.node_body == 1
    assert fine.start["T"] == pytest.approx(3.0 * x)
    assert fine.start["T.b"] == pytest.approx(np.array([x[b], 2.0 * x[b]]))


@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_what_faces_what_is_what_a_search_finds(geometry: str) -> None:
    old = blocks(geometry)
    new = halved(old)
    surfaces = [ContactSurfaces(of) for of in (old, new.interface)]
    coarse, found = (s.facing(FlatContact(), s.interface.nodes) for s in surfaces)
    cut = halved_facing(coarse)

    def places(facing):
        """Of each point: edges of both sides, and place and area on them; in one order."""
        rows = np.stack([facing.slave_edge, facing.master_edge, facing.xi_s, facing.xi_m, facing.area, facing.area_m,
                         facing.gap], axis=1)
        return rows[np.lexsort((np.round(rows[:, 2], 6), facing.master_edge, facing.slave_edge))]

    assert len(cut.pair) > len(coarse.pair)
    assert places(cut) == pytest.approx(places(found), rel=1e-9, abs=1e-12)


def test_pair_nodes_between_have_what_lies_between() -> None:
    old = blocks()
    new = halved(old)
    p = old.nodes[old.pair_nodes] @ [1.0, 5.0]
    assert new.at_pair_nodes(p) == pytest.approx(new.interface.nodes[new.interface.pair_nodes] @ [1.0, 5.0])
