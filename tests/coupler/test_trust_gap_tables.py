"""Tables of conductance over the gap: surfaces that go apart beyond their ends are told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import run
from coupler.scenario.load import Scenario, scenario_from
from coupler.schemes.levels import Level
from coupler.trust.checks import Check
from coupler.trust.surfaces.gap_tables import NAME, GapLog, GapTables

TABLE = {"law": "table", "x": [0.0, 1e-4, 1e-3], "h": [5000, 490, 50]}


def scene(opened: dict[str, Any] | None, up: float = 0.0) -> Scenario:
    """Two blocks, the upper one rises by up [m]."""
    def block(y: float) -> dict[str, Any]:
        return {"mesh": {"rectangle": {"origin": [0, y], "size": [1, 1], "cells": [4, 1]}}, "material": "m", "T0": 300}

    return scenario_from(json.dumps({
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"m": {"rho": 7800, "c": 500, "k": 50}}, "bodies": {"one": block(0.0), "two": block(1.0)},
        "contact": {"face": {"slave": "two.bottom", "master": "one.top", "gap_max": 0.01,
                             "conduction": {"closed": None, "open": opened}}},
        "thermal": {}, "mechanical": {"half": "rigid", "rigid": {"motion": {"two": {
            "u_y": {"t": [0, 1], "value": [0, up]}}}}},
        "coupling": {"end": 1, "windows": [{"until": 1, "size": 0.5}]}}), Path("scene.yaml"), {})


def told(opened: dict[str, Any] | None, *gaps: list[float], covered: float = 1.0) -> Check | None:
    """gaps : [m] of the five nodes of each side at each level.  covered : share of them that faces something."""
    of = scene(opened)
    watch, log = GapTables(of.interface, of.models["thermal"]), GapLog()
    for k, g in enumerate(gaps):
        gap = np.array([*g, *g])
        log = watch.watched(log, Level(float(k), np.zeros(0), of.interface.nodes, 0.0 * gap, gap, 0.0 * gap + covered))
    checks = watch.checks(log)
    return checks[0] if checks else None


def test_what_does_not_end_on_the_way_has_no_row() -> None:
    for law in (None, {"law": "constant", "h": 10}, {"law": "gas", "k_g": 0.05, "g_m": 1e-6},
                TABLE | {"h": [5000, 490, 0]}, TABLE | {"h": [5000, 50, 50]},
                {"law": "table", "x": [300, 900], "h": [1, 2], "variable": "T"}):
        assert told(law, [5e-3] * 5) is None


@pytest.mark.parametrize("law", [TABLE, {"law": "sum", "of": [{"law": "constant", "h": 10}, TABLE]}])
def test_how_far_beyond_its_end_a_table_was_asked(law: dict[str, Any]) -> None:
    """By the widest gap; what the pair does not reach, or faces nothing, does not count."""
    for level, share in (([9e-4] * 5, 0.0), ([0.0, 0.0, 1e-4, 1e-3, 1.5e-3], 0.5), ([0.0, 0.0, 0.0, 0.0, 0.02], 0.0)):
        check = told(law, [0.0] * 5, level, [2e-4] * 5)
        assert check is not None
        assert (check.name, check.number) == (NAME, pytest.approx(share))
        assert check.verdict == ("noted" if share else "holds")
        assert ("1.5 mm apart at t = 1 s" in check.what) is bool(share)
    nothing = told(law, [5e-3] * 5, covered=0.0)
    assert nothing is not None
    assert nothing.number == 0.0


def test_a_gap_that_opens_beyond_its_table_is_noted(tmp_path: Path) -> None:
    """50 W/m2K were kept to 5 mm, where gas has 10, with exit 0 and without a word."""
    for up, verdict in ((9e-4, "holds"), (5e-3, "noted")):
        result = run(scene(TABLE, up), tmp_path / "run.h5")
        assert [c.verdict for c in result.trust if c.name == NAME] == [verdict]
