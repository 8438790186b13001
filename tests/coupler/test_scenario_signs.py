"""Meshes that let temperatures leave their data, and contact that fails the patch test: told by `slideline check`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from random_scenes.scene import Scene

from coupler.cli.cli import app

STEEL = {"rho": 7800, "c": 480, "k": 45}


def plate(k: Any = 45, geometry: str = "plane", **recipe: Any) -> Scene:
    """A plate whose corners may be moved."""
    doc = {"slideline": 2, "units": {"temperature": "K"}, "geometry": geometry, "materials": {"st": {**STEEL, "k": k}},
           "bodies": {"p": {"material": "st", "T0": 300}}, "thermal": {"half": "thermal", "boundary": []},
           "mechanical": {"half": "rigid"}, "coupling": {"end": 1, "windows": [{"until": 1, "size": 1}]}}
    return Scene(doc, {"p": {"patch": [[0, 0], [0.01, 0], [0.01, 0.01], [0, 0.01]], "cells": [4, 4], **recipe}})


SKEW = [[0, 0], [0.01, 0], [0.016, 0.004], [0.006, 0.004]]
AXES = {"k_1": 90, "k_2": 1, "angle": 30}


@pytest.mark.parametrize(("scene", "word"), [
    (plate(patch=SKEW), "quads nearer to rectangles"),
    (plate(patch=SKEW, triangles=1.0), "triangles without angles beyond 90 degrees"),
    (plate(k=AXES), "rectangles along the axes of conductivity"),
], ids=["skewed quads", "obtuse triangles", "skewed axes"])
def test_check_tells_where_a_mesh_couples_with_the_wrong_sign(scene: Scene, word: str, tmp_path: Path) -> None:
    said = CliRunner().invoke(app, ["check", str(scene.written(tmp_path))]).output
    assert "conduct with the wrong sign" in said
    assert word in said


@pytest.mark.parametrize("scene", [
    plate(), plate(cells=[2, 16]), plate(cells=[16, 2]), plate(triangles=1.0),
    plate(geometry="axisymmetric", cells=[16, 2]), plate(geometry="axisymmetric", cells=[2, 16]),
])
def test_rectangles_of_any_sides_are_silent(scene: Scene, tmp_path: Path) -> None:
    assert scene.checked(tmp_path).mesh_notes == ()


@pytest.mark.parametrize(("other", "tells"), [(4, True), (3, False)])
def test_one_point_a_node_is_told_to_fail_the_patch_test(other: int, tells: bool, tmp_path: Path) -> None:
    scene = plate(cells=[3, 3])
    doc = scene.copied_doc()
    doc["bodies"]["q"] = {"material": "st", "T0": 300}
    doc["contact"] = {"face": {"slave": "p.bottom", "master": "q.top", "gap_max": 1e-3, "form": "nodes",
                               "conduction": {"closed": {"law": "constant", "h": 1e3}, "open": None}}}
    below = {"patch": [[0, -0.01], [0.01, -0.01], [0.01, 0], [0, 0]], "cells": [other, 3]}
    notes = Scene(doc, {**scene.recipes, "q": below}).checked(tmp_path).notes
    assert any("fails" in note and "patch test" in note for note in notes) == tells
