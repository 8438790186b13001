"""A study of the lumped scene, through both FMUs: interrupted, gone on with, its page and its table."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import psutil
import pytest
from typer.testing import CliRunner

from coupler import load_scenario, run
from coupler.cli.cli import app
from coupler.errors import ScenarioError
from coupler.experiments.pool import StudyLine
from coupler.experiments.study import Study, StudyOptions, _drowned, conduct
from coupler.experiments.study_files import write_study
from coupler.experiments.trial import TrialResult

sys.path.insert(0, str(Path(__file__).parent))
from study_scenes import E8, LUMPED

# The wrong number of iterations fails in the first window.
GRID = [{"scheme": ["staggered", "extrapolated"], "windows": [0.5, 0.25]},
        {"scheme": ["iterated"], "coupling.iteration.max_iterations": [1], "coupling.iteration.on_max": ["stop"]}]
OPTIONS = {"grid": GRID, "reference": {"finer": 2}, "measure": ["T"]}


class Told(StudyLine):
    """Counts the runs it is told of; Ctrl-C after so many."""

    def __init__(self, stop_after: int = 0) -> None:
        super().__init__()
        self.told: list[str] = []
        self._stop_after = stop_after

    def __call__(self, label: str, trial: TrialResult) -> None:
        self.told.append(label)
        if len(self.told) == self._stop_after:
            raise KeyboardInterrupt


def studied(out: Path, show: Told) -> Study:
    return conduct(LUMPED, out, {}, OPTIONS, StudyOptions(processes=2), show)


@pytest.fixture(scope="module", autouse=True)
def same_sources() -> Iterator[None]:
    """Outcomes are kept by the sources too; an edit while these tests run is not what they are about."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(import_module("coupler.experiments.study"), "sources", lambda: "as they are")
        yield


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path, list[str], list[str]]:
    """A study stopped after three of its eight runs and gone on with: it, its folder, what was told before, after."""
    out = tmp_path_factory.mktemp("study")
    first, second = Told(stop_after=3), Told()
    with pytest.raises(KeyboardInterrupt) as stopped:
        studied(out, first)
    assert "3 of 8 runs are stored" in stopped.value.__notes__[0]
    assert not [p for p in psutil.Process().children(recursive=True) if "worker" in " ".join(p.cmdline())]
    study = studied(out, second)
    write_study(study, out)
    return study, out, first.told, second.told


def test_a_study_that_was_stopped_repeats_nothing(done):
    study, out, before, after = done
    assert len(before) == 3
    assert len(after) == 5
    assert not set(before) & set(after)
    assert len(list((out / "runs").glob("*.json"))) == 8
    again = Told()
    assert [p.error for p in studied(out, again).points[:4]] == [p.error for p in study.points[:4]]
    assert again.told == []


def test_orders_and_errors_are_those_of_e8(done):
    study, _, _, _ = done
    staggered, extrapolated = ([p.error for p in study.points if p.series == s] for s in ("staggered", "extrapolated"))
    assert np.log2(staggered[0] / staggered[1]) == pytest.approx(E8["order_staggered"], abs=0.1)
    assert np.log2(extrapolated[0] / extrapolated[1]) == pytest.approx(E8["order_extrapolated"], abs=0.1)
    assert study.reference.order == pytest.approx(E8["order_iterated"], abs=0.05)
    assert float(study.reference.curves["T"](np.array([20.0]))[0]) == pytest.approx(E8["T"], abs=1e-4)
    assert max(p.floor for p in study.points[:4]) < 0.1 * min(p.error for p in study.points[:4])


def test_half_solves_are_counted_and_limits_predicted(done):
    study, _, _, _ = done
    assert [p.solver_calls for p in study.points[:4]] == [80, 160, 80, 160]
    limits = {x.series: x for x in study.limits}
    assert set(limits) == {"staggered", "extrapolated"}
    assert limits["extrapolated"].windows == pytest.approx(0.5 * limits["staggered"].windows)
    for x in limits.values():
        assert x.solver_calls == pytest.approx(40 / x.windows)


def test_a_window_that_cannot_be_solved_is_a_failure_with_its_words(done):
    study, out, _, _ = done
    assert study.trials[4].failed
    assert "on_max says to stop" in study.points[4].message
    assert "1 failed" in (out / "study.html").read_text(encoding="utf-8")
    assert 'id="failed"' in (out / "study.svg").read_text(encoding="utf-8")


def test_what_is_written(done):
    study, out, _, _ = done
    data = json.loads((out / "study.json").read_text(encoding="utf-8"))
    assert data["cheapest"] == {"1 %": "extrapolated, windows 0.5", ".1 %": None, ".01 %": None}
    rows = list(csv.DictReader((out / "study.csv").read_text(encoding="utf-8").splitlines()))
    assert [float(r["error"]) for r in rows[:4]] == [p.error for p in study.points[:4]]
    assert rows[4]["error"] == ""
    page = (out / "study.html").read_text(encoding="utf-8")
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert "cheapest_1_percent.yaml" in page
    assert not (out / "cheapest_0.1_percent.yaml").exists()


def test_the_cheapest_setting_is_a_scenario_that_does_what_was_measured(done, tmp_path):
    study, out, _, _ = done
    scenario = load_scenario(out / "cheapest_1_percent.yaml")
    results = run(scenario, tmp_path / "run.h5")
    assert results.probe("T")[1].tolist() == study.trials[2].probes["T"]
    assert "study" not in scenario.resolved


def test_runs_say_themselves_whether_to_trust_them(done, tmp_path):
    """The page and the table hold it against the error; a run that was not trusted was solved all the same."""
    study, _, _, _ = done
    assert [tuple(t.broken) for t in study.trials] == [tuple(p.broken) for p in study.points]
    points = [replace(p, broken=("heat balance", "exchange is stable") if k == 1 else ())
              for k, p in enumerate(study.points)]
    page = write_study(replace(study, points=points), tmp_path).read_text(encoding="utf-8")
    rows = list(csv.DictReader((tmp_path / "study.csv").read_text(encoding="utf-8").splitlines()))
    assert [json.loads(r["broken"]) for r in rows] == [list(p.broken) for p in points]
    assert page.count("heat balance, exchange is stable") == 1
    assert 'id="broken"' in (tmp_path / "study.svg").read_text(encoding="utf-8")


def test_a_probe_that_hardly_moves_is_told(done):
    study, _, _, _ = done
    scale = replace(study.scale, probes={"T": 5e-4, "gap": 1e-3})
    note, = _drowned(study.plan, scale)
    assert "Probe T moves by 0.0005 K in all" in note
    assert "coupling.iteration.tolerance.temperature.atol" in note
    assert not _drowned(study.plan, replace(study.scale, probes={"T": 2e-3, "gap": 1e-3}))


def test_a_study_does_not_change_what_a_scenario_is(tmp_path):
    text = LUMPED.read_text(encoding="utf-8")
    (tmp_path / "bare.yaml").write_text(text[:text.index("\nstudy:")], encoding="utf-8")
    assert load_scenario(LUMPED).hash == load_scenario(tmp_path / "bare.yaml").hash


@pytest.mark.parametrize(("options", "says"), [
    ({"grid": {"scheme": ["iterated"], "thermal.method": ["midpoint", "middle"]}}, "iterated, thermal.method middle"),
    ({"grid": {"windows": []}}, "an axis is a list of values"),
    ({"grid": {"windows": [1]}, "span": [30, 40]}, "begins after the run ends"),
    ({"grid": {"windows": [1]}, "reference": {"set": {"meshes": 2}}}, "the reference: not an axis .*'mesh'"),
    ({"grid": {"windows": [1]}, "reference": {"set": {"thermal.method": "middle"}}}, "the reference: not known here"),
    ({"grid": {"windows": [1]}, "reference": {"error": 0.1}}, "is measured"),
    ({"grid": {"windows": [1]}, "measure": ["T", "gab"]}, "no such probe .*Did you mean 'gap'"),
])
def test_what_is_wrong_is_said_before_anything_runs(tmp_path, options, says):
    with pytest.raises(ScenarioError, match=says):
        conduct(LUMPED, tmp_path / "out", {}, options, StudyOptions(1), Told())
    assert not (tmp_path / "out").exists()


def test_a_limit_of_time_is_refused_where_it_would_not_hold(tmp_path):
    with pytest.raises(ScenarioError, match="cannot be given up"):
        conduct(LUMPED, tmp_path / "out", {}, OPTIONS, StudyOptions(cluster="tcp://127.0.0.1:1", limit=60.0), Told())
    assert not (tmp_path / "out").exists()


def test_the_command_line_says_what_is_wrong(tmp_path):
    said = CliRunner().invoke(app, ["study", str(LUMPED), "-o", str(tmp_path / "out"), "--grid", "shceme=staggered"])
    assert isinstance(said.exception, ScenarioError)
    assert "Did you mean 'scheme'" in str(said.exception)


def test_an_interrupt_is_told_and_has_its_exit_code(tmp_path, monkeypatch):
    monkeypatch.setattr(StudyLine, "begin", interrupted)
    said = CliRunner().invoke(app, ["study", str(LUMPED), "-o", str(tmp_path / "out"), "--grid", "windows=1"])
    assert said.exit_code == 130
    assert "the same command continues" in said.output


def interrupted(line: StudyLine, total: int, stored: int) -> None:
    raise KeyboardInterrupt
