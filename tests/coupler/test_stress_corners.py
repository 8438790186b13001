"""Where a drawing lets stress grow without bound: told by angles and by what is held, not of curves and symmetry."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mesh_scenes import rectangles

from contact.half.interface import Interface
from coupler.trust.in_space.stress_corners import curve_centres, places_without_bound

MODEL = {"bodies": {"b": {"material": "m"}}}


def body(nodes, quads, surfaces):
    quads = np.asarray(quads, np.int32)
    return Interface("plane", np.asarray(nodes, float), quads, np.empty((0, 3), np.int32),
                     np.zeros(len(quads), np.int32), np.empty(0, np.int32), ("b",), ("m",), surfaces, {})


def ring(around, quarter, r=(1.0, 2.0, 3.0)):
    """A ring of so many edges, all of it or the quarter of it above both axes."""
    angle = np.linspace(0.0, np.pi / 2 if quarter else 2 * np.pi, around + 1)[:around + quarter]
    n = len(angle)
    nodes = (np.array(r)[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)).reshape(-1, 2)
    k = np.arange(around)
    ahead = (k + 1) % n
    quads = np.concatenate([np.stack([m * n + k, m * n + n + k, m * n + n + ahead, m * n + ahead], axis=1)
                            for m in range(len(r) - 1)])
    ends = {name: np.array([[m * n + at, m * n + n + at] for m in range(len(r) - 1)], np.int32)
            for name, at in (("b.x", 0), ("b.y", n - 1))}
    return body(nodes, quads, ends if quarter else {})


@pytest.mark.parametrize("around", [8, 48])
def test_a_hole_of_few_edges_is_no_corner(around):
    assert places_without_bound(ring(around, False), MODEL) == {}


@pytest.mark.parametrize("around", [2, 12])
def test_a_quarter_of_it_on_rollers_has_none_either_and_clamped_has(around):
    scene = ring(around, True)
    rollers = {**MODEL, "boundary": [{"on": "b.x", "u_y": 0.0}, {"on": "b.y", "u_x": 0.0}]}
    assert places_without_bound(scene, rollers) == {}
    clamped = {**MODEL, "boundary": [{"on": "b.x", "u_y": 0.0, "u_x": 0.0}, {"on": "b.y", "u_x": 0.0}]}
    n = around + 1
    assert places_without_bound(scene, clamped) == {0: "what is held ends there", 2 * n: "what is held ends there"}


@pytest.mark.parametrize("quarter", [True, False])
def test_the_centre_of_a_hole(quarter):
    """Of a quarter at its two ends too, which are corners of the body alone.  The outside of a ring is none."""
    scene = ring(12, quarter)
    found = curve_centres(replace(scene, nodes=scene.nodes + (3.0, -1.0)))
    inside = np.hypot(*scene.nodes.T) < 1.5
    assert found[inside] == pytest.approx(np.tile([3.0, -1.0], (int(inside.sum()), 1)))
    assert np.isnan(found[~inside]).all()


def test_the_tip_of_an_ellipse_is_no_corner():
    """Four edges a quarter, 0.4 to 1: they turn in by 0.77 rad beside the tip, by 0.24 next to that."""
    scene = ring(4, True)
    tip = curve_centres(replace(scene, nodes=scene.nodes * (0.4, 1.0)))[4]
    assert np.abs(tip[0]) < 1e-9
    assert 0.7 < tip[1] < 0.84  # 1 - 0.4^2 in the limit


def test_a_corner_that_goes_into_a_body():
    """An L of three cells: its inner corner, and where what is held on its lower side ends within a straight edge."""
    nodes = [(x, y) for y in range(3) for x in range(3)]
    of = body(nodes, [(0, 1, 4, 3), (1, 2, 5, 4), (3, 4, 7, 6)], {"b.half": np.array([[0, 1]], np.int32)})
    assert places_without_bound(of, MODEL) == {4: "a corner goes into the body"}
    held = {**MODEL, "boundary": [{"on": "b.half", "u_y": 0.0}]}
    assert set(places_without_bound(of, held)) == {1, 4}


def test_points_that_are_held_or_loaded_and_surfaces_that_meet():
    scene = rectangles({"low": (2, 2), "up": (2, 2)})
    model = {"bodies": {"low": {"material": "m"}, "up": {"material": "m"}}}
    assert set(places_without_bound(scene, model)) == set(scene.contact_nodes.tolist())
    free = np.setdiff1d(np.arange(len(scene.nodes)), scene.contact_nodes)[0]
    pointed = replace(scene, node_sets={"low.p": np.array([free], np.int32)})
    for what in ({"u_x": 0.0}, {"f_y": 1.0}):
        found = places_without_bound(pointed, {**model, "boundary": [{"at": "low.p", **what}]})
        assert found[int(free)] == "a single point is held or loaded"


def test_two_materials_that_meet_on_the_outside():
    scene = replace(rectangles({"low": (2, 2), "up": (1, 1)}), pairs=(), regions=("low.r",),
                    quad_region=np.array([0, -1, 0, -1, -1], np.int32), triangle_region=np.empty(0, np.int32))
    found = {}
    for material in ("m", "other"):
        low = {"material": "m", "regions": {"r": {"material": material}}}
        model = {"bodies": {"low": low, "up": {"material": "m"}}}
        found[material] = places_without_bound(scene, model)
    assert found["m"] == {}
    assert set(found["other"].values()) == {"two materials meet on the outside"}
    assert len(found["other"]) == 2
