"""What control can do, several at once: such runs, stopped and resumed, are the undisturbed ones to the bit."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import load_scenario, run
from coupler.running.resume import resume

sys.path.insert(0, str(Path(__file__).parent))
from killed_runs import differences
from scenario_text import ROOT

pytestmark = pytest.mark.usefixtures("unlooked")

# The blocks meet a little before 2500 s, where no kink is.
MEET: dict[str, Any] = {
    "bodies.lower.mesh.rectangle.cells": [3, 2], "bodies.upper.mesh.rectangle.cells": [3, 2],
    "signals": {"stroke": {"t": [0, 2500, 4500], "value": [0, -0.0508005, -0.0507995]}, "slide": 0, "squeeze": 0,
                "gap_gas": 1},
    "coupling.end": 2502, "coupling.kinks": [], "coupling.windows": None,
    "coupling.adaptive": {"first": 50, "most": 1000, "tolerance": {
        "temperature": {"rtol": 0.02}, "heat": {"rtol": 0.2}}},
    "output.checkpoint": 0, "output.fields.every": 20}
FREEZE: dict[str, Any] = {"coupling.end": 0.3, "output.checkpoint": 0, "output.fields.every": 9,
                          "coupling.windows": [{"until": 1, "first": 0.02, "last": 0.1}]}
RULES = [{"name": "often", "when": {"number": {"above": 2}}, "cooldown": 3,
          "do": [{"substeps": {"thermal": "x2", "most": 4}}]},
         {"name": "less", "when": {"max_dT": {"above": 30.0}}, "do": [{"retry": {"window": 0.5, "least": 20.0}}]}]
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "auto and adaptive windows": ("sliding_blocks", MEET | {"coupling.scheme": "auto"}),
    "events, rules and adaptive windows": ("sliding_blocks", MEET | {"rules": RULES}),
    "along the heat": ("casting_1d", FREEZE | {"coupling.scheme": "along_heat", "coupling.substeps": {"thermal": 3}}),
    "along the heat, adaptive": ("casting_1d", FREEZE | {
        "coupling.scheme": "along_heat", "coupling.windows": None, "coupling.adaptive": {"first": 0.02}}),
}


@pytest.mark.few("along the heat, adaptive")
@pytest.mark.parametrize("name", CASES)
def test_resumed_anywhere_it_is_the_undisturbed_run(name: str, tmp_path: Path) -> None:
    file, overrides = CASES[name]
    scenario = load_scenario(ROOT / f"scenarios/{file}.yaml", overrides)
    whole, out = tmp_path / "whole.h5", tmp_path / "run.h5"
    done = run(scenario, whole)
    rows = done.windows
    if file == "sliding_blocks":
        assert any("closes" in text for text in done.events.values()), "the touch is found"
    # Where something was put back the next try remembers it, so one stop is just before that.
    ends = (rows.t + rows.H)[rows.taken]
    tried = [float(rows[k].t) for k in np.flatnonzero(~rows.taken)]
    stops = sorted({float(ends[len(ends) // 3]), float(ends[-3]), *[t for t in tried[-1:] if t > 0.0]})
    run(scenario, out, until=stops[0])
    for t in stops[1:]:
        resume(out, until=t)
    resume(out)
    assert differences(whole, out) == []
    assert done.heat_imbalance < 1e-9
