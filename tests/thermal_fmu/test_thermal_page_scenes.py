"""The scenes of docs/thermal.md are understood by the half and take a step, their heat balanced."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from thermal_page import scenes
from thermal_runs import drive, scenario

HEATED = {"contact_t_N": -1e6}


@pytest.mark.few("axes", "melting", "near", "friction", "prescribed")
@pytest.mark.parametrize("name", scenes())
def test_a_scene_takes_a_step(name: str) -> None:
    scene = scenario(name)
    size = scene.coupling.windows[0].first
    run = drive(scene, [size], **(HEATED if scene.interface.pairs else {}))
    terms = {k: v for k, v in run.outputs[0].items() if k.startswith("heat.")}
    signed = [-v if k.startswith("heat.stored.") else v for k, v in terms.items()]
    assert abs(sum(signed)) <= 1e-9 * sum(map(abs, signed))
    assert np.isfinite(run.T).all()
