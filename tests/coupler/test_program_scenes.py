"""What a half around a program cannot do of a scene is told by `check`, with its key, before anything is built."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from coupler import load_scenario
from coupler.errors import ScenarioError

sys.path.insert(0, str(Path(__file__).parent))
from foreign_scenes import TEXT

AXES = {"k_1": 30, "k_2": 10}
CASES: list[tuple[str, str, Any, str, str]] = [
    ("thermal", "geometry", "axisymmetric", "geometry", "for the plane"),
    ("mechanical", "geometry", "axisymmetric", "geometry", "for the plane"),
    ("thermal", "thermal.method", "steady", "thermal.method", "steps in time"),
    ("thermal", "thermal.adaptive", {"tolerance": 0.1}, "thermal.adaptive", "matrices"),
    ("thermal", "materials.steel.k", AXES, "materials.steel.k", "one conductivity"),
    ("thermal", "materials.steel.latent", {"L": 1e5, "T_m": 900.0}, "materials.steel.latent", "does not understand"),
    ("mechanical", "materials.steel.plastic", {"s_y": 1e8}, "materials.steel.plastic", "does not understand"),
    ("mechanical", "mechanical.elastic.state", "plane_stress", "mechanical.elastic.state", "does not understand"),
    ("mechanical", "mechanical.elastic.dynamics", {}, "mechanical.elastic.dynamics", "does not understand")]


def text_of(folder: Path) -> Path:
    (folder / "s.yaml").write_text(TEXT)
    return folder / "s.yaml"


@pytest.mark.parametrize(("role", "key", "value", "at", "said"), CASES, ids=[f"{c[0]} {c[1]}" for c in CASES])
def test_what_a_program_cannot_do_is_an_error_of_its_key(
        role: str, key: str, value: Any, at: str, said: str, tmp_path: Path) -> None:
    scene = text_of(tmp_path)
    with pytest.raises(ScenarioError) as found:
        load_scenario(scene, overrides={f"{role}.half": "ccx", key: value})
    told = [e for e in (found.value, *found.value.others) if str(e.key).startswith(at) and said in str(e)]
    assert told, str(found.value)
    assert told[0].remedy


@pytest.mark.parametrize("role", ["thermal", "mechanical"])
def test_a_scene_that_a_program_can_do_is_valid(role: str, tmp_path: Path) -> None:
    assert load_scenario(text_of(tmp_path), overrides={f"{role}.half": "ccx"}).foreign[role]
