"""Laws of contact: green on what is right, red under a planted fault."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import thermal_fmu.half
from random_scenes.by_hand import HELD, box, corner, two_blocks
from random_scenes.direct_half import DirectHalf
from random_scenes.invariants_contact import LONGER_WINDOWS, OPEN, PASSING
from random_scenes.outlines import depth, jumped, outline_of
from random_scenes.planted import pairs_otherwise
from random_scenes.scene import Scene
from random_scenes.story import told

RNG = np.random.default_rng(0)


def on_block(recipe: dict[str, object], slave: str, top: str, push: float) -> Scene:
    """A body whose top is pushed by `push` [m] into a block 40 mm wide and 20 mm high."""
    scene = two_blocks(contact__face__slave=f"upper.{slave}", mechanical__elastic__boundary=[
        {"on": "lower.bottom", **HELD}, {"on": f"upper.{top}", "u_x": 0, "u_y": {"t": [0, 4], "value": [0, push]}}])
    return Scene(scene.doc, {"lower": scene.recipes["lower"], "upper": recipe})


SCENES = {
    "blocks": two_blocks(gap=1e-5),
    "deep": two_blocks(gap=1e-3, push=-2e-3),
    "ring": on_block({"ring": [0.005, 0.015], "centre": [0.02, 0.035], "angles": [180, 360], "cells": [3, 12]}, "outer",
                     "inner", -1e-3),
    "wedge": on_block({"patch": [[0.02, 0.0201], [0.035, 0.0251], [0.03, 0.045], [0.012, 0.04]], "cells": [4, 4]},
                      "bottom", "top", -1e-3),
}


@pytest.mark.few("blocks-no passing through", "blocks-what is open does not press")
@pytest.mark.parametrize("law", [PASSING, LONGER_WINDOWS, OPEN], ids=str)
@pytest.mark.parametrize("scene", [pytest.param(scene, marks=() if name == "blocks" else pytest.mark.slow)
                                   for name, scene in SCENES.items()], ids=SCENES)
def test_bodies_that_meet_are_right(law, scene):
    story = told(scene)
    assert story.outcome == "completed", story.message
    assert story.t_N.min() < 0.0
    assert not law.check(scene, story, RNG)


def test_a_penalty_that_is_not_the_one_told_is_found(monkeypatch):
    pairs_otherwise(monkeypatch, eps_N=1 / 30)
    scene = two_blocks(push=-2e-4, pair={"augmented": None, "penalty": 2e13})
    found = PASSING.check(scene, told(scene), RNG)
    assert found
    assert "deep in lower" in found[0].what or "deep in upper" in found[0].what


def tied_blocks(gap: float, push: float) -> Scene:
    """Two blocks that are tied across `gap` [m], the upper pulled or pushed by `push` [m], by the penalty alone."""
    return two_blocks(gap=gap, push=push, pair={"conduction": None, "tied": True, "augmented": None, "penalty": 2e13})


@pytest.mark.few("0.001-0.0002")
@pytest.mark.parametrize(("gap", "push"), [(1e-3, 2e-4), (1e-3, -2e-5), (0.0, 2e-4), (0.0, -2e-5), (-1e-4, -2e-5)])
def test_what_is_tied_lies_as_it_was_drawn(gap, push):
    """Pulled and pressed, across a gap, face to face, and drawn into each other."""
    story = told(tied_blocks(gap, push))
    assert story.outcome == "completed", story.message
    assert (story.t_N[-1] > 0.0).all() == (push > 0.0)
    assert not PASSING.check(story.scene, story, RNG)


def test_a_tied_pair_that_gives_way_more_than_told_is_found(monkeypatch):
    pairs_otherwise(monkeypatch, eps_N=1 / 30)
    found = PASSING.check(scene := tied_blocks(0.0, -2e-4), told(scene), RNG)
    assert found
    assert "deep in lower" in found[0].what or "deep in upper" in found[0].what


def test_a_body_that_is_across_in_one_window_is_found():
    scene = two_blocks(gap=1e-3, mechanical={"half": "rigid", "rigid": {"motion": {
        "upper": {"u_y": {"t": [0, 1], "value": [0, -0.05]}}}}})
    found = PASSING.check(scene, told(scene), RNG)
    assert any("went across" in f.what for f in found)


def test_a_body_of_one_cell_that_is_across_along_the_edges_of_the_other_is_found():
    motion = {"half": "rigid", "rigid": {"motion": {"upper": {"u_x": {"t": [0, 1], "value": [0, -0.06]}}}}}
    scene = two_blocks(mechanical=motion, contact__face={"slave": "upper.left", "master": "lower.right",
                                                         "gap_max": 0.01})
    scene = replace(scene, recipes={"lower": box(0, 0, 0.04, 0.02, (6, 1)), "upper": box(0.041, 0, 0.01, 0.02, (2, 1))})
    found = PASSING.check(scene, told(scene), RNG)
    assert any("the edge of nodes" in f.what for f in found)
    assert not any("node " in f.what for f in found)


def test_contact_that_long_windows_lose_is_found(monkeypatch):
    right = DirectHalf.advance

    def blind(half, t, h, inputs, outputs):
        done = right(half, t, h, inputs, outputs)
        if half.name == "mechanical" and h > 1.0:
            return replace(done, outputs={n: 0.0 * v if n == "contact.t_N" else v for n, v in done.outputs.items()})
        return done

    monkeypatch.setattr(DirectHalf, "advance", blind)
    scene = two_blocks(end=16.0, size=0.5)
    found = LONGER_WINDOWS.check(scene, told(scene), RNG)
    assert any("is apart at" in f.what for f in found)


def test_a_corner_that_lends_its_pressure_is_found(monkeypatch):
    scene = corner(gap=1e-3)
    story = told(scene)
    assert story.t_N.min() < 0.0
    assert not OPEN.check(scene, story, RNG)
    right = thermal_fmu.half.contact_points

    def lent(surfaces, facing, t_N, x, *join):
        largest = np.zeros(len(x))
        np.minimum.at(largest, surfaces.interface.pair_nodes, t_N)
        return right(surfaces, facing, largest[surfaces.interface.pair_nodes], x, *join)

    monkeypatch.setattr(thermal_fmu.half, "contact_points", lent)
    found = OPEN.check(scene, told(scene), RNG)
    assert len(found) == 1
    assert "pair beside" in found[0].what


def test_the_outline_of_a_ring_has_a_hole():
    doc = two_blocks().copied_doc()
    scene = Scene(doc, {"lower": {"ring": [0.01, 0.02], "cells": [2, 24]}, "upper": box(0, 0.03, 0.01, 0.01, (2, 2))})
    doc["contact"]["face"]["master"] = "lower.outer"
    doc["mechanical"]["elastic"]["boundary"][0]["on"] = "lower.inner"
    interface = told(scene).interface
    line = outline_of(interface, "lower")
    a, b = interface.nodes[line[:, 0]], interface.nodes[line[:, 1]]
    assert len(line) == 48
    deep = depth(np.array([[0.0, 0.0], [0.013, 0.0], [0.03, 0.0]]), a, b)
    assert deep == pytest.approx([-0.01 * np.cos(np.pi / 24), 0.003, -0.01], rel=1e-2)


def test_what_crosses_what():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    still = (square, square), (np.roll(square, -1, axis=0),) * 2
    before, after = np.array([[0.5, 2.0], [0.5, 2.0], [1.5, 2.0]]), np.array([[0.5, -1.0], [0.5, 1.5], [1.5, -1.0]])
    assert [(c.point, c.depth) for c in jumped((before, after), *still)] == [(0, pytest.approx(0.5))]
    moved = (square, square + [2.0, 0.0]), (np.roll(square, -1, axis=0), np.roll(square, -1, axis=0) + [2.0, 0.0])
    rest = np.array([[1.6, 0.5], [1.6, 1.5]])
    assert [c.point for c in jumped((rest, rest), *moved)] == [0]


