"""Bodies that meet where no pair names their surfaces: contact sees nothing, so the run must tell."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from ruamel.yaml import YAML

from coupler import load_scenario, run
from coupler.trust.checks import Check
from coupler.trust.surfaces.unpaired import NAME

STEEL = {"rho": 7800, "k": 45, "c": 480, "E": 2.0e11, "nu": 0.3, "alpha": 1.2e-5, "T_ref": 300}


def rectangle(origin: list[float], size: list[float], cells: list[int]) -> dict[str, Any]:
    return {"mesh": {"rectangle": {"origin": origin, "size": size, "cells": cells}}, "material": "steel", "T0": 300}


# A bar grows by 0.31 mm (plane strain), to a wall 0.1 mm away.
GROWS: dict[str, Any] = {
    "slideline": 2, "title": "a bar and a wall", "units": {"temperature": "K"}, "geometry": "plane",
    "materials": {"steel": STEEL},
    "bodies": {"bar": rectangle([0, 0], [0.1, 0.02], [10, 2]), "wall": rectangle([0.1001, 0], [0.02, 0.02], [2, 2])},
    "thermal": {"boundary": [{"body": "bar", "temperature": {"t": [0, 10], "value": [300, 500]}}]},
    "mechanical": {"half": "elastic", "elastic": {"boundary": [
        {"on": "bar.left", "u_x": 0}, {"on": "bar.bottom", "u_y": 0},
        {"on": "wall.right", "u_x": 0}, {"on": "wall.bottom", "u_y": 0}]}},
    "coupling": {"scheme": "staggered", "end": 10, "windows": [{"until": 10, "size": 2.5}]}}
PAIR = {"slave": "bar.right", "master": "wall.left", "gap_max": 0.001}


def row(tmp_path, doc: dict[str, Any], **changes: Any) -> Check | None:
    overrides = {name.replace("__", "."): value for name, value in changes.items()}
    file = tmp_path / "scene.yaml"
    with file.open("w", encoding="utf-8") as f:
        YAML(typ="safe", pure=True).dump(doc, f)
    found = run(load_scenario(file, overrides=overrides), tmp_path / "run.h5")
    return next((c for c in found.trust if c.name == NAME), None)


def test_a_bar_that_grows_into_a_wall_without_a_pair_is_broken(tmp_path):
    """By 0.21 mm: a fiftieth of an edge, but two thirds of the way that the end of the bar goes."""
    check = row(tmp_path, GROWS)
    assert check is not None
    assert check.verdict == "broken"
    assert check.number == pytest.approx(2.0 / 3.0, abs=0.01)
    assert "lies 0.212 mm" in check.what
    assert "inside wall" in check.what or "inside bar" in check.what
    assert "Name the surfaces" in check.sentence


def test_with_a_pair_or_with_room_it_holds(tmp_path):
    # Without augmentation surfaces overlap: "penetration of pressed surfaces" tells of that.
    for changes in ({"contact": {"face": PAIR}}, {"contact": {"face": PAIR | {"augmented": None}}},
                    {"bodies__wall__mesh__rectangle__origin": [0.1005, 0]}):
        check = row(tmp_path, GROWS, **changes)
        assert check is not None
        assert (check.verdict, check.number) == ("holds", 0.0), check.sentence


def test_a_pair_of_other_surfaces_does_not_count(tmp_path):
    check = row(tmp_path, GROWS, contact={"face": PAIR | {"slave": "bar.top", "master": "wall.top"}})
    assert check is not None
    assert check.verdict == "broken"


def test_what_is_drawn_inside_another_body_is_meant(tmp_path):
    check = row(tmp_path, GROWS, bodies__wall__mesh__rectangle__origin=[0.09, 0])
    assert check is not None
    assert check.verdict == "holds"


def test_of_bodies_moved_as_prescribed_it_is_noted(tmp_path):
    motion = {"half": "rigid", "rigid": {"motion": {"bar": {"u_x": {"t": [0, 10], "value": [0, 2.0e-3]}}}}}
    check = row(tmp_path, GROWS, mechanical=motion)
    assert check is not None
    assert check.verdict == "noted"


def test_one_body_meets_none(tmp_path):
    alone = copy.deepcopy(GROWS)
    del alone["bodies"]["wall"]
    alone["mechanical"]["elastic"]["boundary"] = alone["mechanical"]["elastic"]["boundary"][:2]
    assert row(tmp_path, alone) is None
