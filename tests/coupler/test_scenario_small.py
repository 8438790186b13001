"""Scenarios that choose the small halves: what they hand on, and what they refuse before any solver starts."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from coupler import ScenarioError, load_scenario

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import ROOT

CASTING = ROOT / "scenarios/casting_1d.yaml"


def refused(words: str, **overrides: Any) -> None:
    with pytest.raises(ScenarioError, match=words):
        load_scenario(CASTING, overrides={key.replace("__", "."): value for key, value in overrides.items()})


def test_what_the_halves_are_given() -> None:
    s = load_scenario(CASTING)
    assert (s.thermal_half, s.mechanical_half) == ("thermal_rod", "mechanical_rod")
    mechanical = s.models["mechanical"]
    assert mechanical["materials"]["aluminium"]["liquid"]["shrinkage"] == 0.0225026
    assert mechanical["bodies"] == {"rod": {"material": "aluminium"}, "mould": {"material": "die"}}
    assert mechanical["held"] == {"rod": {"left": 0.0}, "mould": {"left": 0.0, "right": 0.0}}
    assert load_scenario(CASTING, overrides={"thermal.half": "lumped"}).thermal_half == "lumped"


def test_refusals() -> None:
    refused("no inner steps", thermal__adaptive={"max_dT": 1.0})
    refused("no method 'steady'", thermal__method="steady")
    refused("time alone", thermal__boundary=[{"on": "mould.top", "temperature": {"terms": [{"t": 400}, {"x": {
        "polynomial": [0, 1]}}]}}])
    refused("nothing holds body 'mould'", mechanical__rod__held={"rod": {"left": 0}})
    refused("left or its right end", mechanical__rod__held={"rod": {}, "mould": {"left": 0}})
    refused("no body 'rood'", mechanical__rod__held={"rood": {"left": 0}, "rod": {"left": 0}, "mould": {"left": 0}})
    refused("straight", geometry="axisymmetric")
    refused("nothing melts", materials__aluminium={"rho": 1, "k": 1, "c": 1, "alpha": 0, "E": 1})
    refused("no thermal half of kind 'rigid'", thermal__half="rigid")
    refused("no mechanical half of kind 'lumped'", mechanical__half="lumped")
