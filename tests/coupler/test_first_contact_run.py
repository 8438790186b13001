"""A run whose bodies fall onto each other first: told once, with what it took, and repeatable to the bit."""

from __future__ import annotations

import json
import sys
from itertools import pairwise
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


def falling(weight: float, heights: tuple[float, ...] = (0.05, 0.03, 0.02), gap: float = 1e-5) -> Scene:
    """Cylinders above each other, each a gap above the one below; a share of their weight comes on within a second."""
    names, y, bodies, pairs = "abc", 0.0, {}, {}
    for i, (name, h) in enumerate(zip(names, heights, strict=True)):
        bodies[name] = {"mesh": {"rectangle": {"origin": [0, y], "size": [0.03, h], "cells": [3 + i % 2, 4]}},
                        "material": "steel", "T0": 300}
        y += h + gap
    for below, above in pairwise(names):
        pairs[above] = {"slave": f"{above}.bottom", "master": f"{below}.top", "gap_max": 1e-3}
    return Scene({
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "axisymmetric",
        "materials": {"steel": {"rho": 7800, "k": 45, "c": 480, "E": 2e11, "nu": 0.3, "alpha": 0}},
        "bodies": bodies, "contact": pairs, "thermal": {},
        "mechanical": {"half": "elastic", "elastic": {
            "gravity": {"y": {"t": [0, 1], "value": [0, -9.81 * weight]}}, "boundary": [{"on": "a.bottom", "u_y": 0}]}},
        "coupling": {"end": 1, "windows": [{"until": 1, "size": 1}]},
        "probes": {"lower": {"p": {"mean": "a.top"}}, "upper": {"p": {"mean": "b.top"}}}}, {})


@pytest.mark.parametrize("weight", [1.0, pytest.param(0.01, marks=pytest.mark.slow), 1e-4])
def test_blocks_above_each_other_fall_and_press_by_their_weight(weight: float) -> None:
    """Whatever share of it: each overshoots its gap, and comes to where that just closes."""
    story = told(falling(weight))
    assert story.outcome == COMPLETED, story.message
    assert len(story.levels) == 2, "in one window"
    of = 7800 * 9.81 * weight
    settles = 1e-3 * of * 0.05  # augmented.tolerance, of the largest pressure
    assert story.probes["lower"][-1] == pytest.approx(of * 0.05, abs=settles)
    assert story.probes["upper"][-1] == pytest.approx(of * 0.02, abs=settles)
