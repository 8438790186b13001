"""A run whose bodies fall onto each other first: told once, with what it took, and repeatable to the bit."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import run
from coupler.scenario.load import scenario_from

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, told
from thermal_page import scenes

PAGE = Path(__file__).resolve().parents[2] / "docs" / "elements.md"
FALLS = scenes(PAGE)["falls"]
WEIGHT, LOWER = 7800 * 9.81 * 0.05 * 0.05, 7800 * 9.81 * 0.1 * 0.05


def fallen(**coupling: Any) -> Scene:
    return Scene(FALLS | {"coupling": FALLS["coupling"] | coupling}, {})


def test_a_block_that_falls_is_told_of_with_its_work() -> None:
    story = told(fallen())
    assert story.outcome == COMPLETED, story.message
    notes = [words for words in story.words if "nothing held a body until contact did" in words]
    assert len(notes) == 1
    work = story.probes["took"]
    assert work[-1] == work[1] == pytest.approx(0.25 * (WEIGHT + 5e4) * 1e-4, rel=1e-2)  # a quarter is on then
    assert story.probes["carried"][-1] == pytest.approx(WEIGHT + LOWER + 5e4, rel=1e-6)


def test_the_results_hold_the_note(tmp_path: Path) -> None:
    """Who runs it quietly, or reads the results later, knows of it too."""
    results = run(scenario_from(json.dumps(FALLS), tmp_path / "falls.yaml", {}), tmp_path / "run.h5")
    assert len([note for note in results.notes if "nothing held a body until contact did" in note]) == 1


def test_the_codec_and_halved_windows_end_in_the_same() -> None:
    direct, coded = told(fallen()), told(fallen(link="codec"))
    np.testing.assert_array_equal(direct.t_N, coded.t_N)
    finer = told(fallen(windows=[{"until": 1, "size": 0.125}]))
    assert finer.outcome == COMPLETED, finer.message
    # Friction depends on the way of the load: at the ends of the surface, where it slips.
    assert np.abs(direct.t_N[-1] - finer.t_N[-1]).max() <= 1e-3 * np.abs(direct.t_N[-1]).max()
