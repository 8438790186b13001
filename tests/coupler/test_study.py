"""Studies: the grid, the reference, errors, the pareto_front, the chart; all of made-up numbers."""

from __future__ import annotations

import json
import math
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler.errors import ResultsError, ScenarioError
from coupler.experiments import pool, trial
from coupler.experiments.grid import grid_of, parse_axis, settings_of
from coupler.experiments.pool import run_there
from coupler.experiments.study import StabilityLimit, describe_reference, study_plan_of
from coupler.experiments.study_files import draw
from coupler.experiments.trial import Job, TrialStore
from coupler.experiments.work_precision import (
    cheapest,
    errors_of,
    from_file,
    pareto_front,
    point_of,
    richardson,
    scale_of,
)
from coupler.scenario.document import read_document
from coupler.scenario.options import Scheme

sys.path.insert(0, str(Path(__file__).parent))
from study_scenes import FAKE, FELL, T_END, decay, document, point


def test_a_grid_is_every_combination():
    cells = settings_of(document(), [grid_of([parse_axis("scheme=staggered,iterated"), parse_axis("windows=0.5,2")])])
    assert [c.label for c in cells] == [f"{s}, windows {w}" for s in ("staggered", "iterated") for w in (0.5, 2)]
    assert cells[0].sets == {"coupling.scheme": "staggered", "coupling.windows": [{"until": 20, "size": 0.5}]}
    assert {c.series for c in cells} == {"staggered", "iterated"}


def test_a_setting_in_two_grids_is_run_once():
    assert len(settings_of(document(), [{"windows": (1, 2)}, {"windows": (2, 4)}])) == 3


def test_windows_stay_in_their_range():
    cell, = settings_of(document(), [{"windows": (50,)}])
    assert cell.sets["coupling.windows"] == [{"until": 20, "size": 20}]


def test_a_factor_is_on_what_the_other_axes_left():
    tolerance, = settings_of(document(), [{"tolerance": (10,), "coupling.adaptive": ({"first": 1.0, "tolerance": {
        "temperature": {"atol": 0.5}}},)}])
    assert tolerance.sets["coupling.adaptive.tolerance.temperature"] == {"atol": 5.0, "rtol": 0.01}
    assert tolerance.sets["coupling.adaptive.tolerance.gap"] == {"rtol": 0.1}, "atol goes with it"
    mesh, = settings_of(document(), [{"bodies.body.mesh.rectangle.cells": ([3, 2],), "mesh": (2,)}])
    assert mesh.sets["bodies.wall.mesh.rectangle.cells"] == [1, 1]
    doubled, = settings_of(document(), [{"mesh": (2,), "bodies.body.mesh.rectangle.cells": ([3, 2],)}])
    assert doubled.sets["bodies.body.mesh.rectangle.cells"] == [6, 4]


def test_every_scheme_is_an_axis_value():
    assert len(settings_of(document(), [{"scheme": tuple(s.value for s in Scheme)}])) == len(Scheme)


@pytest.mark.parametrize(("axis", "key", "says"), [
    ("scheme=stagered", "grid scheme", "staggered"),
    ("windos=1", "grid windos", "Did you mean 'windows'"),
    ("windows=-1", "grid windows", "greater than zero"),
    ("windows=long", "grid windows", "a factor"),
    ("tolerance=1", "grid tolerance", "coupling.adaptive"),
    ("coupling.windows.7.size=1", "coupling.windows.7.size", "a list of 1"),
    ("windows", "--grid", "AXIS=VALUE"),
    ("windows=", "--grid", "AXIS=VALUE"),
])
def test_what_is_wrong_in_a_grid_is_named(axis, key, says):
    with pytest.raises(ScenarioError) as error:
        settings_of(document(), [grid_of([parse_axis(axis)])])
    assert error.value.key == key
    assert says in str(error.value)


def test_an_axis_twice_and_no_grid():
    with pytest.raises(ScenarioError, match="given twice"):
        grid_of([parse_axis("windows=1"), parse_axis("windows=2")])
    with pytest.raises(ScenarioError, match="there is no grid"):
        settings_of(document(), [])


@pytest.mark.parametrize("order", [1, 2])
def test_a_reference_of_three_runs_knows_its_order_and_its_error(order):
    """The error left after extrapolation is far below the estimate, which is that of the finest run."""
    H = 0.01
    r = richardson([decay(H * k, order) for k in (1, 2, 4)], "made up")
    assert r.order == pytest.approx(order, abs=0.01)
    t = np.array(decay(H, order).t)
    estimate = np.abs(r.other["T"](t) - r.curves["T"](t)).max()
    assert estimate == pytest.approx(0.1 * H**order, rel=0.01)
    assert np.abs(r.curves["T"](t) - np.exp(-t)).max() < 0.02 * estimate


@pytest.mark.parametrize(("windows", "grid", "at"), [
    ("windows: [{until: 8, size: 2}]", {"windows": [2, 0.5]}, {"windows": [0.125, 0.25, 0.5]}),
    # The error of a window goes with the third power of its size.
    ("adaptive: {}", {"tolerance": [4, 0.5]}, {"tolerance": [0.5 / 4**3, 0.5 / 2**3, 0.5]}),
    ("adaptive: {}", {"scheme": ["auto", "iterated"]}, {"tolerance": [1 / 4**3, 1 / 2**3, 1.0]}),
])
def test_a_reference_is_finer_by_what_the_windows_have(windows, grid, at, tmp_path):
    bars = (Path(__file__).parents[2] / "scenarios" / "heated_bars.yaml").read_text(encoding="utf-8")
    head, _, tail = bars.partition("\ncoupling:")
    probes = tail[tail.index("\nprobes:"):]
    file = tmp_path / "s.yaml"
    file.write_text(f"{head}\ncoupling:\n  end: 8\n  {windows}\n{probes}", encoding="utf-8")
    plan = study_plan_of(read_document(file), {}, {"grid": grid}, "")
    (axis, values), = at.items()
    assert [run.setting.at[axis] for run in plan.references] == pytest.approx(values, rel=1e-12)
    assert [run.setting.at["reference"] for run in plan.references] == [1, 2, 4]
    assert describe_reference(plan.spec.reference, plan.references).startswith("iterated with ")


def test_a_reference_of_no_whole_order_is_not_extrapolated():
    runs = [decay(0.01 * k, 0, factor) for k, factor in ((1, 1e-3), (2, 2e-3), (4, 2.2e-3))]
    r = richardson(runs, "made up")
    assert r.order < 0.0
    assert r.curves["T"](np.array(runs[0].t)) == pytest.approx(np.array(runs[0].probes["T"]), abs=1e-15)
    assert np.ptp(r.other["T"](np.array(runs[0].t)) - np.array(runs[0].probes["T"])) > 9e-4


def test_a_reference_that_failed_is_an_error():
    with pytest.raises(ResultsError, match="did not converge"):
        richardson([decay(0.01, 2), FELL, decay(0.04, 2)], "made up")


def test_the_error_is_the_root_mean_square_over_the_range():
    r = richardson([decay(0.01 * k, 2) for k in (1, 2, 4)], "made up")
    scale = scale_of(r, (), (0.0, T_END))
    assert list(scale.probes) == ["T"]
    found = errors_of(decay(0.1, 1), r, scale)
    t = np.linspace(0.0, T_END, 2001)
    expected = 0.01 * math.sqrt(np.trapezoid(np.sin(t)**2, t) / T_END) / (1.0 - math.exp(-T_END))
    assert found["T"] == pytest.approx(expected, rel=2e-3)
    assert scale.floor == pytest.approx(expected * 1e-3, rel=2e-2)


def test_measured_probes_are_those_named_and_must_change():
    r = richardson([decay(0.01 * k, 2) for k in (1, 2, 4)], "made up")
    with pytest.raises(ScenarioError, match="does not change"):
        scale_of(r, ("still",), (0.0, T_END))
    with pytest.raises(ScenarioError, match="no such probe"):
        scale_of(r, ("gap",), (0.0, T_END))
    with pytest.raises(ScenarioError, match="no two times"):
        scale_of(r, ("T",), (5.0, 6.0))


def test_a_run_that_failed_is_a_point_without_an_error():
    r = richardson([decay(0.01 * k, 2) for k in (1, 2, 4)], "made up")
    p = point_of("a", "a", FELL, r, scale_of(r, (), (0.0, T_END)))
    assert math.isnan(p.error)
    assert (p.solver_calls, p.message) == (12, FELL.failed)
    assert pareto_front([p]) == []
    assert cheapest([p], 1.0) is None


def test_a_point_says_which_checks_of_its_run_failed():
    r = richardson([decay(0.01 * k, 2) for k in (1, 2, 4)], "made up")
    run = replace(decay(0.1, 2), broken=["heat balance"])
    assert tuple(point_of("a", "a", run, r, scale_of(r, (), (0.0, T_END))).broken) == ("heat balance",)


def test_a_stored_answer(tmp_path):
    file = tmp_path / "answer.csv"
    t = np.linspace(0.0, T_END, 201)
    file.write_text("t,T\n" + "".join(f"{a},{math.exp(-a)}\n" for a in t), encoding="utf-8")
    r = from_file(file, 1e-7)
    scale = scale_of(r, (), (0.0, T_END))
    assert 5e-3 < errors_of(decay(0.1, 1), r, scale)["T"] < 1e-2
    assert scale.floor == 1e-7
    for text, says in (("t,T\n0,1\n0,2\n", "ascend"), ("x,T\n0,1\n1,2\n", "first column"), ("t,T\n0,a\n", "numbers")):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(ScenarioError, match=says):
            from_file(file, None)


POINTS = (point("a", 10, 0.5), point("a", 100, 0.04), point("b", 60, 0.009), point("b", 200, 0.02),
          point("b", 300, 1e-7, 5e-4), point("c", 20, math.nan), point("c", 40, 7.0))


def test_the_front_is_what_nothing_beats():
    assert [(p.solver_calls, p.bound) for p in pareto_front(POINTS)] == [(10, 0.5), (60, 0.009), (300, 5e-4)]


def test_the_cheapest_that_is_known_to_be_good_enough():
    """The last point's error is below what the reference can tell: it counts as the reference's own."""
    assert [None if p is None else p.solver_calls for p in (cheapest(POINTS, x) for x in (1e-2, 1e-3, 1e-4))] == [
        60, 300, None]


def test_the_chart_shows_failures_hollow_and_what_is_below_the_floor():
    figure = draw(POINTS, [StabilityLimit("a", 2.0, 50.0)])
    left = figure.axes[0]
    lines = {line.get_gid(): line for line in left.lines if line.get_gid()}
    failed = [line for line in left.lines if line.get_gid() == "failed"]
    assert [len(line.get_xdata()) for line in failed] == [2]
    assert failed[0].get_markerfacecolor() == "white"
    assert list(failed[0].get_xdata()) == [20, 40]
    assert min(failed[0].get_ydata()) > 0.8 * left.get_ylim()[1]
    assert list(lines["below"].get_xdata()) == [300]
    assert any(list(line.get_xdata()) == [50.0, 50.0] for line in left.lines)
    assert any(list(line.get_ydata()) == [5e-4, 5e-4] for line in left.lines)


def test_runs_that_say_do_not_trust_are_crossed_out_whether_right_or_wrong():
    said = [replace(POINTS[0], broken=("heat balance",)), POINTS[1],
            replace(POINTS[-1], broken=("exchange is stable",))]
    figure = draw(said, [])
    crossed = [x for line in figure.axes[0].lines if line.get_gid() == "broken" for x in line.get_xdata()]
    assert sorted(crossed) == sorted(p.solver_calls for p in said if p.broken)
    assert "says itself: do not trust" in [text.get_text() for text in figure.legends[0].get_texts()]
    assert "says itself: do not trust" not in [text.get_text() for text in draw(POINTS, []).legends[0].get_texts()]


@pytest.mark.parametrize(("limit", "says"), [
    (StabilityLimit("a", 2.0, 50.0), "a: predicted limit"),
    (StabilityLimit("a", math.inf, 0.0), "a: no limit predicted"),
    (StabilityLimit("a", 9.0, 1.0), "a: all within the predicted limit"),
    (StabilityLimit("a", 0.1, 1e6), "a: all beyond the predicted limit")])
def test_the_legend_says_what_limit_is_predicted(limit, says):
    figure = draw(POINTS, [limit])
    assert says in [text.get_text() for text in figure.legends[0].get_texts()]
    lines = [line for line in figure.axes[0].lines if line.get_gid() == "limit"]
    assert [list(line.get_xdata()) for line in lines] == ([[50.0, 50.0]] if limit.solver_calls == 50.0 else [])


def test_fixed_windows_are_told_by_their_size():
    cell, = settings_of(document(), [{"coupling.windows": ([{"until": 20, "size": 12.5}],), "windows": (2,)}])
    assert (cell.series, cell.label) == ("windows of 12.5 s", "windows of 12.5 s, windows 2")


def test_a_chart_of_failures_alone_is_none():
    with pytest.raises(ValueError, match="no run"):
        draw([POINTS[5]], [])


def test_a_trial_comes_back_from_the_store(tmp_path):
    store = TrialStore(tmp_path / "runs")
    assert store.get("a") is None
    store.put("a", decay(0.5, 1))
    assert store.get("a") == decay(0.5, 1)
    (tmp_path / "runs/a.json").write_text(json.dumps({"verdict": 1}), encoding="utf-8")
    with pytest.raises(ResultsError, match="remove it"):
        store.get("a")


def test_what_no_trial_depends_on_is_left_out_of_its_key():
    coupler = Path(trial.__file__).parent.parent
    assert [name for name in trial.APART if not (coupler / name).is_dir()] == []
    assert coupler.joinpath("experiments") == Path(trial.__file__).parent


def test_a_trial_of_another_version_is_run_again(tmp_path, monkeypatch):
    monkeypatch.setattr("coupler.experiments.trial.VERSION", 0)
    store = TrialStore(tmp_path)
    store.put("a", decay(0.5, 1))
    assert store.get("a") is not None
    monkeypatch.undo()
    assert store.get("a") is None


def jobs(*texts: str) -> dict[str, Job]:
    return {f"{k} {text}": Job(text, "", {}) for k, text in enumerate(texts)}


def test_a_process_that_dies_is_one_failure(monkeypatch):
    monkeypatch.setattr(pool, "WORKER", FAKE)
    done = {job.name: job.result for job in pool.run_here(jobs("a", "die", "abc", "ab"), 1)}
    assert [done[n].solver_calls for n in ("0 a", "2 abc", "3 ab")] == [1, 3, 2]
    assert "no such thing" in done["1 die"].failed
    assert not done["1 die"].storable


def test_a_run_that_takes_too_long_is_given_up(monkeypatch):
    monkeypatch.setattr(pool, "WORKER", FAKE)
    began = time.monotonic()
    done = {job.name: job.result for job in pool.run_here(jobs("sleep", "a"), 1, limit=0.5)}
    assert time.monotonic() - began < 30.0
    assert "longer than 0.5 s" in done["0 sleep"].failed
    assert not done["1 a"].failed


def test_leaving_early_ends_every_process(monkeypatch):
    monkeypatch.setattr(pool, "WORKER", FAKE)
    began = time.monotonic()
    running = pool.run_here(jobs("a", "sleep", "sleep"), 2)
    assert not next(running).result.failed
    running.close()
    assert time.monotonic() - began < 30.0


def test_dask_is_asked_for_by_name_where_it_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ScenarioError, match=r"slideline\[cluster\]"):
        next(run_there(jobs("a"), "tcp://127.0.0.1:8786"))
