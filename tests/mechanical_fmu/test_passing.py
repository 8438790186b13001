"""No body goes through another in one step: the touch is found, or the run fails by name.  Nor does a drawn overlap."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_scenes.by_hand import HELD, box, two_blocks
from random_scenes.change import sides_swapped, turned
from random_scenes.invariants_contact import passing
from random_scenes.scene import Scene
from random_scenes.story import told

from contact.half.interface import Interface, Pair
from contact.half.passing import passage, sides_of
from contact.half.register import register_message
from contact.messages import Facing, Passes, Project, Register, Registered
from contact.service import ContactService

REMEDY = ("unseen by contact", "smaller windows", "elastic.cuts")


def driven(value: float, *, t: float = 8.0, **more: object) -> Scene:
    """The upper block, 1 mm above the lower, driven down by `value` [m] until t [s]."""
    size = more.pop("size", 1.0)
    boundary = [{"on": "lower.bottom", **HELD},
                {"on": "upper.top", "u_x": 0, "u_y": {"t": [0, t], "value": [0, value]}}]
    return two_blocks(gap=1e-3, size=size, mechanical__elastic__boundary=boundary, **more)


def test_a_touch_deep_inside_one_window_is_found():
    """17 mm of 40 mm in a window: before, nothing pressed and the top edge lay 17 mm inside."""
    fine = told(driven(-0.018, size=0.5))
    for size in (8.0, 1.0):
        story = told(driven(-0.018, size=size))
        assert story.outcome == "completed", story.message
        assert not passing(story)
        assert story.t_N[-1].min() == pytest.approx(fine.t_N[-1].min(), rel=1e-3)
        assert np.abs(story.x[-1] - fine.x[-1]).max() < 1e-5


def test_a_jump_into_a_body_is_found_too():
    boundary = [{"on": "lower.bottom", **HELD},
                {"on": "upper.top", "u_x": 0, "u_y": {"t": [4, 4], "value": [0, -0.018]}}]
    story = told(two_blocks(gap=1e-3, mechanical__elastic__boundary=boundary))
    assert story.outcome == "completed", story.message
    assert story.t_N[-1].min() < -1e11
    assert not passing(story)


@pytest.mark.slow
@pytest.mark.parametrize("way", [-0.05, -0.06])
def test_what_no_step_is_small_enough_for_is_refused_by_name(way):
    """50 or 60 mm of the 41 mm there are: crushed so far, either a node goes in unseen or there is no equilibrium."""
    story = told(driven(way, t=4.0, size=4.0))
    assert story.outcome == "failed"
    assert "pair face" in story.message
    assert "of upper.bottom" in story.message
    assert all(word in story.message for word in REMEDY) or "no equilibrium" in story.message


def across(way: float, size: float, *, thickness: float, cells: int) -> Scene:
    """A block of 30 mm driven `way` [m] in 2 s, in windows of `size` [s], at a post 2 mm beside it."""
    doc = two_blocks(end=2.0, size=size).copied_doc()
    doc["contact"]["face"] |= {"slave": "upper.right", "master": "lower.left"}
    doc["mechanical"]["elastic"]["boundary"] = [
        {"on": "lower.bottom", **HELD}, {"on": "lower.top", **HELD},
        {"on": "upper.left", "u_y": 0, "u_x": {"t": [0, 2], "value": [0, way]}}]
    return Scene(doc, {"upper": box(-0.032, 0.005, 0.03, 0.02, (cells, cells)),
                       "lower": box(0, 0, thickness, 0.03, (2, 2 * cells))})


@pytest.mark.few("3", "8")
@pytest.mark.parametrize("seed", range(12))
def test_never_through_at_any_speed(seed):
    rng = np.random.default_rng(seed)
    way, size = 10.0 ** rng.uniform(-3.0, -1.8), float(rng.choice([2.0, 1.0, 0.5]))
    thickness, cells = 10.0 ** rng.uniform(-2.7, -1.7), int(rng.integers(2, 6))
    story = told(across(way, size, thickness=thickness, cells=cells))
    if story.outcome == "completed":
        assert not passing(story)
        assert (story.t_N.min() < 0.0) == (way > 2e-3)
    else:
        assert any(word in story.message for word in (*REMEDY, "turned inside out", "no equilibrium")), story.message


@pytest.mark.few("newmark")
@pytest.mark.parametrize("method", ["newmark", "explicit"])
def test_a_thrown_body_is_not_thrown_through(method):
    """10 m/s in windows of 1 ms: 10 mm, through a plate of 4 mm."""
    scene = two_blocks(end=3e-3, size=1e-3)
    doc = scene.copied_doc()
    doc["bodies"]["upper"]["T0"] = 300  # an explicit run begins with no jolt of expansion
    elastic = doc["mechanical"]["elastic"]
    elastic["boundary"] = [{"on": "lower.left", **HELD}, {"on": "lower.right", **HELD}]
    elastic["bodies"] = {"upper": {"v0": [0.0, -10.0]}}
    elastic |= {"method": "explicit"} if method == "explicit" else {"dynamics": {"beta": 0.25, "gamma": 0.5}}
    story = told(Scene(doc, {"lower": box(0, 0.016, 0.04, 0.004, (12, 2)),
                             "upper": box(0.015, 0.022, 0.01, 0.004, (3, 2))}))
    if story.outcome == "completed":
        assert not passing(story)
        assert story.x[-1][story.nodes_of("upper"), 1].min() > 0.015
    else:
        assert any(word in story.message for word in REMEDY), story.message


# Two strips in a row, 2 mm apart.
ALONG = Scene(two_blocks().copied_doc(), {"upper": box(-0.032, 0.0, 0.03, 0.02, (4, 1)),
                                          "lower": box(0.0, 0.0, 0.05, 0.02, (8, 1))}).edited(
    contact__face__slave="upper.right", contact__face__master="lower.left",
    mechanical__elastic__boundary=[{"on": "lower.right", **HELD}, {"on": "upper.left", "u_y": 0, "u_x": {
        "t": [0, 4], "value": [0, -2e-3]}}])


@pytest.mark.few("2")
@pytest.mark.parametrize("cells", [1, 2])
def test_bodies_of_one_cell_driven_along_each_other_press_in_any_frame_and_either_way_round(cells):
    """By 30 mm in one window, where 2 mm are between: the edges of their sides lie on one line."""
    doc = ALONG.edited(coupling__windows=[{"until": 8.0, "size": 8.0}]).copied_doc()
    doc["mechanical"]["elastic"]["boundary"][1]["u_x"]["value"] = [0, 0.03]
    doc["materials"]["steel"] |= {"nu": 0, "alpha": 0}
    scene = Scene(doc, {b: {**recipe, "cells": [recipe["cells"][0], cells]} for b, recipe in ALONG.recipes.items()})
    others = turned(scene, 233.465), turned(scene, 90.0), sides_swapped(scene)
    found = [told(s) for s in (scene, *(o.scene for o in others))]
    for story, rel in zip(found, (1e-9, 1e-9, 1e-9, 1e-3), strict=True):
        assert story.outcome == "completed", story.message
        assert story.t_N.min() < -5e10
        assert story.t_N[-1].min() == pytest.approx(found[0].t_N[-1].min(), rel=rel)


# As drawn

def test_a_drawn_overlap_of_more_than_an_edge_presses():
    """7.5 mm, 1.25 edges of the slave: the state that a motion of the same blocks leads to, drawn in touch."""
    drawn, moved = told(two_blocks(gap=-7.5e-3, push=-1e-5)), told(two_blocks(push=-7.51e-3))
    assert drawn.outcome == moved.outcome == "completed"
    assert moved.t_N[-1].min() < -1e10
    assert drawn.t_N[-1] == pytest.approx(moved.t_N[-1], rel=1e-4, abs=1.0)


def test_a_drawn_overlap_deeper_than_half_a_body_is_refused_by_name():
    story = told(two_blocks(gap=-0.015, push=-1e-5))
    assert story.outcome == "failed"
    assert "pair face" in story.message
    assert "drawn" in story.message
    assert "inside lower" in story.message


# The geometry

def squares(x: np.ndarray, *, gap_max: float = 0.5) -> Interface:
    """A square of 1 m of 2 x 2 cells, and one of 0.5 m whose nodes are at x : (4, 2) [m]."""
    line = np.linspace(0.0, 1.0, 3)
    grid = np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
    n = np.arange(9).reshape(3, 3)
    quads = [[n[i, j], n[i + 1, j], n[i + 1, j + 1], n[i, j + 1]] for i in range(2) for j in range(2)]
    return Interface("plane", np.vstack([grid, x]), np.array([*quads, [9, 10, 11, 12]], np.int32),
                     np.empty((0, 3), np.int32), np.array([0, 0, 0, 0, 1], np.int32), np.empty(0, np.int32),
                     ("low", "high"), ("m", "m"),
                     {"low.top": np.array([[8, 5], [5, 2]], np.int32), "high.bottom": np.array([[9, 10]], np.int32)},
                     {}, (Pair("face", "high.bottom", "low.top", gap_max, 1e9),))


SQUARE = 0.5 * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@pytest.mark.parametrize(("start", "move", "deep"), [
    ((0.25, 1.1), (0.0, -2.5), True),  # across
    ((0.0, 1.1), (0.0, -0.6), True),  # into, along the left side and through a node of the middle
    ((0.5, 1.1), (0.0, -0.6), True),  # straight down on nodes
    ((0.25, 1.1), (0.0, -0.12), False),  # 20 mm in: as deep as curved meshes may
    ((0.25, 0.99), (2.0, 0.0), False),  # pressed, and slides off the end
    ((0.25, 0.99), (0.0, -2.5), True),  # pressed, and goes out at the bottom
    ((1.2, 1.1), (0.0, -2.5), False),  # passes by
    ((0.25, 1.1), (0.0, 2.0), False)])
def test_which_ways_lead_through_a_body(start, move, deep):
    before = squares(SQUARE + start)
    side = next(s for s in sides_of(before) if s.surface == "high.bottom")
    found = passage(side, np.ones(len(side.points), bool), before.nodes, squares(SQUARE + start + move).nodes)
    assert (found is not None) == deep
    if found is not None:
        assert found.depth > 0.05


@pytest.mark.parametrize("angle", [0.0, 0.6])
@pytest.mark.parametrize(("start", "move", "deep"), [
    ((0.0, 1.1), (0.0, -2.5), 0.5),  # across, its sides along those of the other
    ((0.02, 1.1), (0.0, -0.5), 0.4),  # in, and stays; one of its sides is 20 mm in, which is no passage
    ((0.0, 1.1), (0.0, -0.12), 0.0),  # 20 mm in
    ((0.0, 0.99), (0.0, -0.01), 0.0),  # pressed
    ((1.0, 1.1), (0.0, -2.5), 0.0),  # passes by, flush
    ((1.0, 0.0), (0.0, 0.2), 0.0)])  # beside it
def test_a_body_of_one_cell_driven_through_another_along_its_edges_is_seen(start, move, deep, angle):
    """Every node stays on the other's outline, or by less than what is a passage beside it: the middle goes in."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    before, after = (squares(2.0 * SQUARE + np.add(start, way)).nodes @ turn for way in ((0.0, 0.0), move))
    interface = replace(squares(2.0 * SQUARE + start), nodes=before)
    found = [passage(side, np.ones(len(side.points), bool), before, after) for side in sides_of(interface)]
    assert max(f.depth if f else 0.0 for f in found) == pytest.approx(deep, abs=1e-5)


def test_bodies_that_move_and_turn_together_do_not_pass():
    """The way is that of straight lines: turned by 40 degrees a square keeps its inside."""
    before = squares(SQUARE + [0.25, 1.05])
    c, s = np.cos(0.7), np.sin(0.7)
    after = before.nodes @ np.array([[c, s], [-s, c]]) + [5.0, 3.0]
    for side in sides_of(before):
        assert passage(side, np.ones(len(side.points), bool), before.nodes, after) is None


def test_how_deep_contact_looks():
    """Half of what the thinner body is thick; a surface that faces itself stays at a share of its edges."""
    assert register_message(squares(SQUARE)).passes.depth == pytest.approx([0.25])


def chain(points: np.ndarray, h: float) -> np.ndarray:
    """Nodes (n, 2) along a polyline, h [m] apart."""
    return np.vstack([np.linspace(a, b, round(float(np.linalg.norm(b - a)) / h) + 1)[:-1]
                      for a, b in pairwise(points)] + [points[-1:]])


@pytest.mark.parametrize(("left", "bottom", "faces"), [
    (-0.02, 0.2, False),  # 20 mm into the riser of a step whose top is 100 mm higher: that top is not faced
    (-0.5, 0.2, True)])  # over the step, 100 mm deep in it: ten edges
def test_what_is_met_deep_is_the_nearest(left, bottom, faces):
    master = chain(np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 0.3], [-1.0, 0.3]]), 0.01)
    slave = chain(np.array([[left, bottom], [left + 0.2, bottom]]), 0.01)
    x = np.vstack([slave, master])
    edges = np.array([[i, i + 1] for i in range(len(x) - 1) if i != len(slave) - 1], np.int32)
    n = len(slave) - 1
    one, none = np.ones(1), np.zeros(1, np.int32)
    service = ContactService()
    passes = Passes(none, none, none + 1, one, none, 0.05 * one, one, one, 0.0 * one, 0.25 * one)
    surface = np.repeat([0, 1], [n, len(edges) - n]).astype(np.int32)
    known = service.handle(Register(len(x), edges, surface, False, passes))
    assert isinstance(known, Registered)
    found = service.handle(Project(known.surfaces, x))
    assert isinstance(found, Facing)
    assert (found.gap.size > 0) == faces
    if faces:
        assert found.gap == pytest.approx(-0.1)
        assert found.area.sum() == pytest.approx(0.2)
