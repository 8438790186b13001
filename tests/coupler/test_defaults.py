"""Runs that say nothing of windows and schemes but their end: what they mean, cost and come to."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from coupler import Results, ScenarioError, run
from coupler.scenario import Scenario
from coupler.scenario.load import scenario_from
from coupler.scenario.options import OnCycle, Scheme

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fresh_scenes import Doc, two_rods, two_sided_rod

LOOSE = {"temperature": {"atol": 0.1, "rtol": 1e-2}, "gap": {"atol": 1e-6, "rtol": 0.1}, "heat": {"rtol": 0.1},
         "displacement": {"atol": 1e-6, "rtol": 0.1}}


def unsaid(doc: Doc, **more: object) -> Scenario:
    """The scene with nothing but its end in `coupling`."""
    text = {**doc, "slideline": 2, "coupling": {"end": doc["coupling"]["end"], **more}}
    return scenario_from(json.dumps(text), Path("scene.yaml"), {})


def solves(results: Results) -> int:
    return int(results.windows.thermal_solves.sum() + results.windows.mechanical_solves.sum())


def test_an_end_is_enough():
    coupling = unsaid(two_rods(1.0, end=60.0)).coupling
    assert coupling.scheme is Scheme.AUTO
    assert coupling.adaptive is not None
    assert coupling.adaptive.first == pytest.approx(0.06)
    assert coupling.adaptive.most == 60.0
    assert coupling.locate
    assert coupling.on_cycle is OnCycle.ITERATE


def test_bounds_of_sizes_hold_for_a_first_window_that_is_not_stated():
    first = [unsaid(two_rods(1.0, end=60.0), adaptive=bounds).coupling.adaptive for bounds in (
        {"most": 0.01}, {"least": 0.1}, {"least": 0.1, "most": 0.2})]
    assert [a.first for a in first] == [0.01, 0.1, 0.1]
    assert all(a.least <= a.first <= a.most for a in first)
    with pytest.raises(ScenarioError, match="the longest window is shorter than the least"):
        unsaid(two_rods(1.0), adaptive={"least": 0.2, "most": 0.1})


def test_listed_windows_are_as_listed_and_never_both():
    listed = unsaid(two_rods(1.0), windows=[{"until": 60, "size": 1}]).coupling
    assert listed.scheme is Scheme.AUTO
    assert listed.adaptive is None
    assert not listed.locate
    with pytest.raises(ScenarioError, match="not both"):
        unsaid(two_rods(1.0), windows=[{"until": 60, "size": 1}], adaptive={})


def test_a_file_of_version_1_keeps_its_scheme():
    doc = two_rods(1.0)
    old = {**doc, "slideline": 1, "coupling": {"end": 60, "windows": [{"until": 60, "size": 1}]}}
    found = scenario_from(json.dumps(old), Path("scene.yaml"), {})
    assert found.coupling.scheme is Scheme.STAGGERED
    assert any("`staggered`" in note for note in found.notes)


@pytest.mark.few("ten times as loose")
@pytest.mark.parametrize("more", [{}, {"adaptive": {"tolerance": LOOSE}}], ids=["default", "ten times as loose"])
def test_a_rod_between_open_and_closed_comes_to_rest_and_windows_grow_there(tmp_path, more):
    """Its contraction grows from 1e-6 to 20 as the gap closes: measured while it was wide, windows solved once went on
    beyond their limit and never came to rest (2998 solves to 60 s with loose tolerances).
    """
    results = run(unsaid(two_sided_rod(1.0, end=100.0), **more), tmp_path / "run.h5")
    assert results.outcome == "completed"
    assert results.probe("gap")[1][-1] == pytest.approx(0.90984e-6, rel=2e-3)
    assert results.probe("TL")[1][-1] == pytest.approx(348.975, abs=0.1)
    assert solves(results) < 1200
    late = np.diff(results.t)[results.t[1:] > 5.0]
    assert late.size < 15
    w = results.windows
    assert (w.thermal_solves + w.mechanical_solves)[w.t > 5.0].sum() < 100, "95 s of nothing: 8782 calls, once"


@pytest.mark.slow
def test_two_rods_swing_as_they_should(tmp_path):
    """Between 20.33 and 48.86 K, by own finite differences; listed windows of 0.05 s take 2400 solves to 60 s."""
    results = run(unsaid(two_rods(1.0, end=60.0)), tmp_path / "run.h5")
    late = results.probe("T2")[1][results.t > 45.0] - 300.0
    assert late.min() == pytest.approx(20.33, abs=0.6)
    assert late.max() == pytest.approx(48.86, abs=0.6)
    assert solves(results) < 2400
    assert not results.broken
    # While they swing the contraction is measured, here at 23 and 27 s; their windows do not need iterating.
    assert "iterated" in set(results.windows.scheme[results.windows.t > 20.0])


def test_windows_are_put_back_only_for_errors_that_were_measured(tmp_path):
    """What is carried on from windows before may see a kink that solving in one and in two makes."""
    results = run(unsaid(two_rods(1.0, end=30.0)), tmp_path / "run.h5")
    put_back = results.windows[results.windows.verdict == "error too large"]
    assert len(put_back)
    # Once in one, and once in either half.
    assert (put_back.thermal_solves >= 3).all()
