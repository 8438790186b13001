"""Slideline's own half of a scene: when another one is compared with it, and what a verdict depends on by it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from coupler import load_scenario
from coupler.errors import HalfError
from coupler.scenario import Scenario
from coupler.verify.reference import built, reference_of
from coupler.verify.verdicts import _key

sys.path.insert(0, str(Path(__file__).parent))
from foreign_scenes import install_mine

READS = frozenset({"boundary", "bodies", "pairs", "materials"})
SCENE = """
slideline: 2
title: One block
units: {temperature: K}
geometry: plane
materials: {steel: {rho: 8000, c: 500, k: 30, E: 2.0e11, nu: 0.3, alpha: 0, T_ref: 300}}
bodies: {block: {mesh: {rectangle: {origin: [0, 0], size: [1, 1], cells: [1, 1]}}, material: steel, T0: 300}}
thermal: {boundary: [{on: block.left, convection: {h: 100, T: 400}}]}
mechanical: {half: rigid, rigid: {}}
coupling: {scheme: staggered, end: 12, windows: [{until: 12, size: 1}]}
"""
ELASTIC = {"mechanical.elastic": {"boundary": [{"on": "block.left", "u_x": 0, "u_y": 0}]}}


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A function that returns the scene with a half of another package in a role."""
    install_mine(monkeypatch)
    (tmp_path / "s.yaml").write_text(SCENE)

    def made(role: str = "thermal", **overrides: Any) -> Scenario:
        return load_scenario(tmp_path / "s.yaml", overrides={f"{role}.half": "mine", **overrides})

    return made


def test_a_thermal_half_is_compared_with_the_half_thermal(scene: Any) -> None:
    found = reference_of(scene(), "thermal", READS)
    assert (found.why_none, found.role) == ("", "thermal")
    assert found.scenario is not None
    assert found.scenario.models["thermal"]["half"] == "thermal"
    assert found.scenario.models["thermal"]["boundary"], "it has the conditions of the scene"


def test_a_mechanical_half_is_compared_with_the_half_elastic(scene: Any) -> None:
    found = reference_of(scene("mechanical", **ELASTIC), "mechanical", READS)
    assert found.scenario is not None
    assert found.scenario.models["mechanical"]["half"] == "elastic"


@pytest.mark.parametrize(("role", "overrides", "reads", "why"), [
    ("thermal", {"thermal.half": "lumped"}, READS, "it is one of Slideline's own"),
    ("thermal", {}, None, "it does not declare what it reads of a scene"),
    ("thermal", {"thermal.options": {"A": 1}}, READS, "thermal.options give it physics"),
    ("thermal", {"thermal.ignore": ["boundary.flux"]}, READS, "the scenario lets it leave out boundary.flux"),
    ("mechanical", {}, READS, "the scenario has no mechanical.elastic"),
    ("mechanical", {"mechanical.elastic": {"boundary": []}}, READS, "Slideline's own half does not take this scene: "),
    ("thermal.one", {}, READS, "it is one of several halves in a role")])
def test_where_there_is_none_it_says_why(role: str, overrides: dict[str, Any], reads: frozenset[str] | None, why: str,
                                         scene: Any, tmp_path: Path) -> None:
    found = reference_of(scene(role.partition(".")[0], **overrides), role, reads)
    assert found.scenario is None
    assert found.why_none.startswith(why)
    assert built(found, tmp_path / "own") == (None, found.why_none)


@pytest.mark.parametrize(("overrides", "same"), [
    ({"title": "another"}, True), ({"coupling.scheme": "iterated"}, True), ({"materials.steel.k": 31}, False),
    ({"thermal.boundary.0.convection.h": 101}, False)])
def test_a_verdict_depends_on_the_laws_of_the_scene(overrides: dict[str, Any], same: bool, scene: Any) -> None:
    keys = [_key(Path(__file__), None, 1.0, READS, reference_of(scene(**more), "thermal", READS))
            for more in ({}, overrides)]
    assert (keys[0] == keys[1]) == same


def test_an_own_half_that_cannot_be_built_is_no_fault_of_the_other(scene: Any, tmp_path: Path,
                                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(kind: str, folder: Path) -> Path:
        raise HalfError("no room on the disk")

    monkeypatch.setattr("coupler.verify.reference.build_half", fails)
    assert built(reference_of(scene(), "thermal", READS), tmp_path / "own") == (
        None, "Slideline's own half cannot be built: no room on the disk")
