"""Before a run: rigid motions that nothing will ever hold are told with body, motion and why, and no others."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_scenes.scene import Scene

from coupler.errors import ScenarioError

FOOT = {"on": "low.bottom", "u_x": 0, "u_y": 0}
PUSH = {"on": "high.top", "t_y": -1e6}


def scene(*boundary: dict[str, Any], mu: float = 0.0, bodies: dict[str, Any] | None = None, pair: bool = True,
          third: bool = False, **elastic: Any) -> Scene:
    """A block on another, and perhaps a third on top."""
    blocks = {"low": ([0, 0], [0.1, 0.05]), "high": ([0.02, 0.05], [0.06, 0.05])}
    contact = {"face": {"slave": "high.bottom", "master": "low.top", "gap_max": 0.02, "friction": {"mu": mu}}}
    if third:
        blocks["lid"] = ([0.03, 0.1], [0.04, 0.02])
        contact["top"] = contact["face"] | {"slave": "lid.bottom", "master": "high.top"}
    doc = {"slideline": 2, "units": {"temperature": "K"}, "geometry": "plane", "thermal": {},
           "materials": {"al": {"rho": 2700, "c": 1000, "k": 200, "E": 7e10, "nu": 0.3, "alpha": 0}},
           "bodies": {name: {"material": "al", "T0": 300,
                             "mesh": {"rectangle": {"origin": at, "size": size, "cells": [4, 2]}}}
                      for name, (at, size) in blocks.items()},
           "mechanical": {"half": "elastic",
                          "elastic": {"boundary": list(boundary), "bodies": bodies or {}, **elastic}},
           "coupling": {"end": 1, "windows": [{"until": 1, "size": 1}]}}
    return Scene(doc | ({"contact": contact} if pair else {}), {})


@pytest.mark.parametrize(("refused", "text"), [
    (scene(FOOT, PUSH), "nothing will ever hold body 'high' against moving along x: no condition does, and contact in "
                        "face has no friction and faces another way"),
    (scene(FOOT, PUSH, pair=False), "nothing will ever hold body 'high' against moving along"),
    (scene(FOOT, {"at": "high.top.centre", "u_x": 0, "u_y": 0}, pair=False),
     "'high' against turning: no condition does, and it is in no contact pair"),
    (scene({"on": "low.bottom", "u_y": 0}, PUSH, mu=0.3), "bodies low and high together against moving along x"),
    (scene({"at": "low.bottom.centre", "u_x": 0}, PUSH, mu=0.3), "together against moving along y and turning: "),
    (scene(FOOT, pair=False), "'high' against moving along x, moving along y and turning: no condition does"),
    (scene(FOOT, {"body": "high", "u_x": 0}, bodies={"high": {"rigid": True}}, pair=False), "against moving along y"),
    (scene(FOOT, {"at": "high.top.centre", "u_x": 0}, third=True), "body 'lid' against moving along x"),
])
def test_what_nothing_holds_is_told(refused: Scene, text: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=text):
        refused.checked(tmp_path)


LOOSE = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
1 1 "bottom"
1 2 "top"
$EndPhysicalNames
$Nodes
8
1 0 0 0
2 0.05 0 0
3 0.05 0.05 0
4 0 0.05 0
5 0.05 0 0
6 0.1 0 0
7 0.1 0.05 0
8 0.05 0.05 0
$EndNodes
$Elements
4
1 1 2 1 1 1 2
2 1 2 2 1 3 4
3 3 2 3 1 1 2 3 4
4 3 2 3 1 5 6 7 8
$EndElements
"""


def test_a_piece_that_the_mesh_does_not_join_is_told(tmp_path: Path) -> None:
    """The right half of the lower block has nodes of its own along the seam; its foot is not named."""
    (tmp_path / "low.msh").write_text(LOOSE)
    split = scene(FOOT, {"on": "high.top", "u_x": 0, "u_y": 0}).edited(
        bodies__low={"material": "al", "T0": 300, "mesh": {"file": {"path": "low.msh"}}})
    with pytest.raises(ScenarioError, match=r"hold the piece of body 'low' around \(0\.075, 0\.025\) m against moving "
                       "along x, moving along y and turning: .* Join the pieces in the mesh"):
        split.checked(tmp_path)


SLOPE = {"x": 9.81 * 0.5, "y": -9.81 * 0.75**0.5}  # as on a slope of 30 degrees
BESIDE = {"slave": "high.right", "master": "low.left", "gap_max": 0.02, "friction": {"mu": 0.3}}
RAMP = {"t": [0, 1], "value": [0, -9.81]}


@pytest.mark.parametrize(("refused", "text"), [
    (scene(FOOT, mu=0.3, gravity=SLOPE), r"'high' against its load: .* lies 13\.3 degrees outside of what contact in "
                                         r"face carries \(mu 0\.3: 16\.7 degrees to either side"),
    (scene(FOOT, mu=0.3, gravity={"y": 9.81}), "163.3 degrees outside"),
    (scene(FOOT, mu=0.3, gravity={"y": 9.81}).edited(mechanical__elastic__gravity={"x": RAMP}), "73.3 degrees outside"),
    (scene(FOOT, {"body": "high", "f_x": 4e3, "f_y": -8e3}, mu=0.3, bodies={"high": {"rigid": True}}), " 9.9 degrees"),
    (scene(FOOT, {"body": "high", "b_x": -4e3, "b_y": -8e3}, mu=0.3), " 9.9 degrees outside"),
])
def test_what_slides_down_is_told(refused: Scene, text: str, tmp_path: Path) -> None:
    """Its load lies outside the cone of Coulomb of all it may lie on, so nothing has to be run."""
    with pytest.raises(ScenarioError, match=text):
        refused.checked(tmp_path)


@pytest.mark.parametrize("good", [
    scene(FOOT, mu=0.6, gravity=SLOPE), scene(FOOT, mu=0.54, gravity=SLOPE),  # the last by the margin
    scene(FOOT, mu=0.3, gravity=SLOPE, dynamics={}),
    scene(FOOT, mu=0.3, gravity={"x": {"t": [0, 1], "value": [0, 5]}, "y": -9.81}),
    scene(FOOT, PUSH, mu=0.3, gravity=SLOPE),  # pressed on
    scene(FOOT, {"at": "high.top.centre", "u_x": 0}, mu=0.3, gravity=SLOPE),
    scene(FOOT, mu=0.3, gravity=SLOPE).edited(contact__beside=BESIDE),  # a stop across the slope
    scene({"on": "low.bottom", "rotation": {"about": [0, 0], "angle": {"t": [0, 1], "value": [0, 0.5]}}}, mu=0.3,
          gravity=SLOPE),  # the slope turns
    scene(FOOT, mu=0.3, gravity=SLOPE).edited(contact__face={"slave": "high.bottom", "master": "low.top", "gap_max":
                                                             0.02, "tied": True}),
])
def test_what_friction_or_a_stop_may_hold_is_let_pass(good: Scene, tmp_path: Path) -> None:
    good.checked(tmp_path)


@pytest.mark.parametrize("good", [
    scene(FOOT, PUSH, mu=0.3), scene(FOOT, {"at": "high.top.centre", "u_x": 0}), scene(FOOT, PUSH, dynamics={}),
    scene(FOOT, PUSH, method="explicit"), scene(FOOT, PUSH, mu=0.1, third=True),
    scene(FOOT, {"at": "high.top.centre", "rotation": {"about": [0, 0], "angle": 0.1}}),
    scene(FOOT, {"body": "high", "u_x": 0}, bodies={"high": {"rigid": True}}),
])
def test_what_a_pair_may_hold_is_let_pass(good: Scene, tmp_path: Path) -> None:
    good.checked(tmp_path)


def test_about_an_axis_bodies_move_along_it_alone(tmp_path: Path) -> None:
    disc = scene({"on": "low.bottom", "u_y": 0}).edited(geometry="axisymmetric")
    disc.checked(tmp_path)
    with pytest.raises(ScenarioError, match="'high' against moving along y"):
        disc.edited(contact=None).checked(tmp_path)
