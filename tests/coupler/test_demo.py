"""The demo and `build` in folders that will not do: one error, and what stands there stays."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from coupler.cli.running import run_demo
from coupler.errors import ScenarioError
from coupler.fmu.launch import build_halves
from coupler.init.shipped import SCENARIO, shipped_scenarios
from coupler.scenario import load_scenario


def test_the_demo_is_to_be_trusted(tmp_path: Path) -> None:
    """A first result that warns of itself teaches nobody.  Its probes stay within 3 K of the scene's own.

    487.97 degC: the top of the lower block while the blocks are pressed face to face (docs/tutorial.md).
    """
    results = run_demo(tmp_path / "demo", lambda s: nullcontext(lambda p: None)).results
    assert results.outcome == "completed"
    assert results.broken == ()
    t, T = results.probe("lower.top.left", unit="degC")
    assert float(np.interp(12500.0, t, T)) == pytest.approx(487.97, abs=3.0)


def unused(scenario: object) -> None:
    raise AssertionError("the demo went on")


def test_a_changed_scenario_is_left_as_it_is(tmp_path: Path) -> None:
    (tmp_path / SCENARIO).write_text("mine")
    with pytest.raises(ScenarioError, match="nothing was written"):
        run_demo(tmp_path, unused)
    assert (tmp_path / SCENARIO).read_text() == "mine"


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    bars = load_scenario(shipped_scenarios() / "heated_bars.yaml")
    for ask in (lambda: run_demo(tmp_path / "file", unused), lambda: build_halves(bars, tmp_path / "file")):
        with pytest.raises(ScenarioError, match="this folder cannot be made"):
            ask()


def test_the_demo_runs_from_its_own_folder_again(tmp_path: Path) -> None:
    (tmp_path / SCENARIO).write_bytes((shipped_scenarios() / SCENARIO).read_bytes())
    with pytest.raises(AssertionError, match="went on"):
        run_demo(tmp_path, unused)
