"""The demo and `build` in folders that will not do: one error, and what stands there stays."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupler.cli.running import run_demo
from coupler.errors import ScenarioError
from coupler.fmu.launch import build_halves
from coupler.init.templates import SCENARIO, shipped_scenarios
from coupler.scenario import load_scenario


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
