"""Tables of conductance over pressure: surfaces that are pressed beyond their ends are told, on the mean."""

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
from coupler.trust.surfaces.pressures import NAME, PressureLog, PressureTables

TABLE = {"law": "table", "x": [0.0, 2e6, 1e7], "h": [500, 2000, 4000]}


def scene(closed: dict[str, Any], pressure: float = 1e6) -> Scenario:
    """Two blocks on each other, pressed."""
    def block(y: float) -> dict[str, Any]:
        return {"mesh": {"rectangle": {"origin": [0, y], "size": [1, 1], "cells": [4, 1]}}, "material": "m", "T0": 300}

    return scenario_from(json.dumps({
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"m": {"rho": 7800, "c": 500, "k": 50}}, "bodies": {"one": block(0.0), "two": block(1.0)},
        "contact": {"face": {"slave": "two.bottom", "master": "one.top", "gap_max": 0.1,
                             "conduction": {"closed": closed, "open": None}}},
        "thermal": {}, "mechanical": {"half": "rigid", "rigid": {"pressure": {"face": pressure}}},
        "coupling": {"end": 1, "windows": [{"until": 1, "size": 0.5}]}}), Path("scene.yaml"), {})


def told(closed: dict[str, Any], *pressures: list[float]) -> Check | None:
    """pressures : [Pa] of the five nodes of each side at each level."""
    of = scene(closed)
    watch, log = PressureTables(of.interface, of.models["thermal"]), PressureLog()
    for k, p in enumerate(pressures):
        t_N = -np.array([*p, *p])
        log = watch.watched(log, Level(float(k), np.zeros(0), of.interface.nodes, t_N, 0.0 * t_N, 0.0 * t_N + 1.0))
    checks = watch.checks(log)
    return checks[0] if checks else None


def test_what_does_not_end_on_the_way_has_no_row() -> None:
    for law in ({"law": "constant", "h": 10}, {"law": "power", "h0": 0, "h1": 1, "p0": 1e6, "exponent": 1},
                TABLE | {"h": [500, 4000, 4000]}, {"law": "table", "x": [300, 900], "h": [1, 2], "variable": "T"}):
        assert told(law, [1e9] * 5) is None


@pytest.mark.parametrize("law", [TABLE, {"law": "sum", "of": [{"law": "constant", "h": 10}, TABLE]}])
def test_how_far_beyond_its_end_a_table_was_asked(law: dict[str, Any]) -> None:
    """By the mean of what touches: a peak at a corner, which has no bound, is none."""
    for level, share in (([9e6] * 5, 0.0), ([0.0, 0.0, 0.0, 1.5e7, 1.5e7], 0.5), ([1e6, 1e6, 1e6, 1e6, 4e7], 0.0)):
        check = told(law, [0.0] * 5, level, [2e6] * 5)
        assert check is not None
        assert (check.name, check.number) == (NAME, pytest.approx(share))
        assert (check.verdict, check.t) == (("noted" if share else "holds"), 1.0)
        assert ("pressed by 15 MPa" in check.what) is bool(share)


def test_pressures_in_MPa_are_noted(tmp_path: Path) -> None:
    for x, verdict in (([0, 2e6, 1e7], "holds"), ([0, 2, 10], "noted")):
        result = run(scene(TABLE | {"x": x}), tmp_path / "run.h5")
        assert [c.verdict for c in result.trust if c.name == NAME] == [verdict]
