"""Laws of conductance whose pressures or lengths were meant in another unit are told with it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from coupler.scenario.load import scenario_from

POWER = {"law": "power", "h0": 500, "h1": 3000, "p0": 1e7, "exponent": 0.95}
CMY = {"law": "cmy", "k_s": 74, "m": 0.1, "sigma": 2e-6, "H": 3e9}
GAS = {"law": "gas", "k_g": 0.03, "g_m": 6e-5}
TABLE = {"law": "table", "x": [0, 5e6, 1e8], "h": [500, 2000, 8000]}


def notes(closed: dict[str, Any] | None, opened: dict[str, Any] | None = None, units: Any = None) -> list[str]:
    def block(y: float) -> dict[str, Any]:
        return {"mesh": {"rectangle": {"origin": [0, y], "size": [1, 1], "cells": [1, 1]}}, "material": "m", "T0": 300}

    scene = scenario_from(json.dumps({
        "slideline": 2, "units": units or {"temperature": "K"}, "geometry": "plane",
        "materials": {"m": {"rho": "7800 kg/m3", "c": "500 J/kgK", "k": "50 W/mK"}},
        "bodies": {"one": block(0.0), "two": block(1.0)},
        "contact": {"face": {"slave": "two.bottom", "master": "one.top", "gap_max": 0.1,
                             "conduction": {"closed": closed, "open": opened}}},
        "thermal": {}, "mechanical": {"half": "rigid"}, "coupling": {"end": 1}}), Path("scene.yaml"), {})
    return [note for note in scene.notes if note.startswith("the conductance of pair face")]


def test_what_surfaces_have_is_not_told() -> None:
    for closed in (POWER, CMY, TABLE, {"law": "sum", "of": [POWER, TABLE]}, {"law": "constant", "h": 1e9},
                   TABLE | {"x": [300, 500, 900], "variable": "T"}):
        for opened in (GAS, GAS | {"g_m": 0}, TABLE | {"x": [0, 1e-4, 1e-3]}):
            assert notes(closed, opened) == []


@pytest.mark.parametrize(("closed", "opened", "told"), [
    (POWER | {"p0": 10}, None, "p0 is 10 Pa (in MPa it would be 1e+07)"),
    (CMY | {"H": 3}, None, "H is 3 Pa (in GPa it would be 3e+09)"),
    (CMY | {"H": 3000}, None, "H is 3000 Pa (in MPa it would be 3e+09)"),
    (CMY | {"sigma": 2}, None, "sigma is 2 m (in um it would be 2e-06)"),
    (TABLE | {"x": [0, 5, 100]}, None, "the end of x is 100 Pa (in MPa it would be 1e+08)"),
    ({"law": "sum", "of": [CMY, POWER | {"p0": 10}]}, None, "p0 is 10 Pa"),
    (None, GAS | {"k_g": 30}, "k_g is 30 W/mK (in mW/mK it would be 0.03)"),
    (None, GAS | {"g_m": 60}, "g_m is 60 m (in um it would be 6e-05)")])
def test_a_unit_that_was_not_meant_is_told(closed: Any, opened: Any, told: str) -> None:
    (note,) = notes(closed, opened)
    assert told in note


def test_in_a_file_in_mm_and_MPa_numbers_are_its_own() -> None:
    units = {"temperature": "K", "length": "mm", "stress": "MPa"}
    assert notes(POWER | {"p0": 10}, units=units) == []
    (note,) = notes(POWER, units=units)
    assert "p0 is 1e+07 MPa (in Pa it would be usual)" in note


def test_a_resistance_in_mm2_is_told() -> None:
    def told(R: float) -> list[str]:
        scene = scenario_from(json.dumps({
            "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
            "materials": {"m": {"rho": 7800, "c": 500, "k": 50}},
            "bodies": {name: {"mesh": {"rectangle": {"origin": [0, y], "size": [1, 1], "cells": [1, 1]}},
                              "material": "m", "T0": 300} for name, y in (("one", 0.0), ("two", 1.0))},
            "contact": {"face": {"slave": "two.bottom", "master": "one.top", "gap_max": 0.1, "tied": True,
                                 "resistance": R}},
            "thermal": {}, "mechanical": {"half": "rigid"}, "coupling": {"end": 1}}), Path("scene.yaml"), {})
        return [note for note in scene.notes if "resistance" in note]

    assert told(1e-4) == told(5.0) == []
    (note,) = told(100.0)
    assert "resistance is 100 m2K/W (in mm2K/W it would be 0.0001)" in note
