"""Data of flow in a unit that was not meant (MPa, GPa, kJ/mol, 1/(MPa^n s)) are told with it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from coupler.scenario.load import scenario_from

STEEL = {"rho": "7800 kg/m3", "c": "500 J/kgK", "k": "50 W/mK", "E": "200 GPa", "nu": 0.3, "alpha": 0}
LINEAR = {"s_y": "250 MPa", "hardening": {"law": "linear", "H": 1e9}}
TABLE = {"law": "table", "strain": [0, 0.1], "stress": [250e6, 400e6]}
CREEP = {"A": 1e-40, "n": 5, "Q": 142e3}
MELT = {"eta": "1e5 Pa s", "bulk": 5e10, "T_s": 900, "T_l": 950}


def notes(*flows: dict[str, Any], T0: float = 800.0, units: Any = None) -> list[str]:
    scene = scenario_from(json.dumps({
        "slideline": 2, "units": units or {"temperature": "K"}, "geometry": "plane",
        "materials": {"m": {**STEEL, **{key: value for flow in flows for key, value in flow.items()}}},
        "bodies": {"bar": {"mesh": {"rectangle": {"origin": [0, 0], "size": ["0.1 m", "0.1 m"], "cells": [1, 1]}},
                           "material": "m", "T0": T0}},
        "thermal": {}, "mechanical": {"half": "elastic", "elastic": {"boundary": [
            {"on": "bar.bottom", "u_x": 0, "u_y": 0}]}},
        "coupling": {"end": 1}}), Path("scene.yaml"), {})
    return [note for note in scene.notes if note.startswith("material m:")]


@pytest.mark.parametrize("flow", [
    {"plastic": LINEAR}, {"plastic": {"hardening": TABLE}}, {"creep": CREEP}, {"liquid": MELT},
    {"plastic": LINEAR | {"hardening": {"law": "linear", "H": 0}}},
    {"plastic": {"s_y": 250e6, "kinematic": {"C": 5e9, "gamma": 30}, "overstress": {"K": 5e7, "m": 0.1}}},
    {"plastic": {"s_y": 50e6, "hardening": {"law": "voce", "Q": 265e6, "b": 16.9, "H": 129e6}}},
    {"creep": {"A": 1e-40, "n": 5}}, {"creep": {"K": 6e8, "m": 0.6}},
    {"creep": {"A": {"T": [300, 900], "value": [0, 1e-38]}, "n": 5}},
    {"creep": {"A": 1e-9, "n": 1}}])  # a melt of 0.3 kPa s
def test_what_materials_have_is_not_told(flow: dict[str, Any]) -> None:
    assert notes(flow) == []


@pytest.mark.parametrize(("flow", "told"), [
    ({"plastic": LINEAR | {"hardening": {"law": "linear", "H": 1000}}}, "H is 1000 Pa (in MPa it would be 1e+09)"),
    ({"plastic": {"hardening": TABLE | {"stress": [250, 400]}}}, "stress is 400 Pa (in MPa it would be 4e+08)"),
    ({"plastic": {"hardening": TABLE | {"T": [300, 600], "stress": [[250, 400], [200, 300]]}}},
     "stress is 400 Pa (in MPa it would be 4e+08)"),
    ({"plastic": {"s_y": 250e6, "kinematic": {"C": 5000}}}, "C is 5000 Pa (in MPa it would be 5e+09)"),
    ({"plastic": {"s_y": 250e6, "overstress": {"K": 50, "m": 0.1}}}, "K is 50 Pa (in MPa it would be 5e+07)"),
    ({"plastic": {"s_y": 250e6, "hardening": {"law": "voce", "Q": 265, "b": 16.9}}}, "Q is 265 Pa (in MPa it would be"),
    ({"liquid": MELT | {"bulk": 50}}, "bulk is 50 Pa (in MPa it would be 5e+07)"),
    ({"creep": CREEP | {"A": 0, "Q": 142}}, "Q is 142 J/mol (in kJ/mol it would be 1.42e+05)"),
    ({"creep": CREEP | {"A": 1e-3}}, "makes bar flow by 1e18 a second under 1 MPa at its start: is 1/(MPa^5 s) meant?"),
    ({"creep": CREEP | {"A": {"T": [300, 900], "value": [1e-3, 2e-3]}}}, "is 1/(MPa^5 s) meant?"),
    ({"creep": CREEP | {"A": 1e60}}, "a second under 1 MPa at its start")])
def test_a_unit_that_was_not_meant_is_told(flow: dict[str, Any], told: str) -> None:
    (note,) = notes(flow)
    assert told in note


def test_in_a_file_in_mm_and_MPa_numbers_are_its_own() -> None:
    units = {"temperature": "K", "length": "mm", "stress": "MPa"}
    assert notes({"plastic": LINEAR | {"hardening": {"law": "linear", "H": 1000}}}, units=units) == []
    assert notes({"creep": {"A": 1e-3, "n": 5, "Q": "142 kJ/mol"}}, units=units) == []
    (note,) = notes({"plastic": LINEAR}, units=units)
    assert "H is 1e+09 MPa (in Pa it would be usual)" in note
