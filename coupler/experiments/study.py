"""Conducts a study: plans it, runs what is not stored yet, measures errors and predicts stability limits."""

from __future__ import annotations

import bisect
import math
import os
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from coupler.control.auto import chooses
from coupler.control.window_limits import longest
from coupler.errors import ResultsError, ScenarioError
from coupler.experiments.grid import PLAIN
from coupler.experiments.pool import FinishedJob, run_here, run_there
from coupler.experiments.reference import ReferenceSolution, from_file, richardson
from coupler.experiments.study_plan import PlannedRun, StudyPlan, describe_reference, study_plan_of
from coupler.experiments.trial import Job, TrialResult, TrialStore, scenario_of, sources
from coupler.experiments.trial_lines import StudyLine
from coupler.experiments.work_precision import ErrorScale, Point, point_of, scale_of
from coupler.running.pilot import Prediction, is_quick, pilot
from coupler.running.setup import plan_of
from coupler.scenario import Scenario
from coupler.scenario.document import Document, read_document
from coupler.schemes.table import scheme_of

# A pilot of the scenario says nothing of other physics, or of windows of several substeps.
SAME_SCENE = {"scheme", PLAIN["scheme"], "windows", "coupling.windows"}


@dataclass(frozen=True)
class StabilityLimit:
    """The stability limit of a curve.

    series : the curve.  windows : the largest stable factor on its windows; inf: no window is too long.
    solver_calls : what a run with it costs; 0 where there is no limit.
    """

    series: str
    windows: float
    solver_calls: float


def stability_limits(prediction: Prediction, runs: Sequence[PlannedRun],
                     points: Sequence[Point]) -> list[StabilityLimit]:
    """Predict the longest stable windows of every curve that is a scheme over windows and nothing else.

    The factor is the least over the pilot of limit/size of the window at that time; its cost is read off the
    curve, along which cost goes as 1/factor.
    """
    found_limits = []
    for series in dict.fromkeys(run.setting.series for run in runs):
        on = [(run, p) for run, p in zip(runs, points, strict=True) if run.setting.series == series]
        costs = [(_size(run), p.solver_calls) for run, p in on if not math.isnan(p.error)]
        if not costs or any(set(run.setting.at) - SAME_SCENE or "windows" not in run.setting.at for run, _ in on):
            continue
        # Long windows are cut off at the ends of their ranges; the shortest tell what factor 1 is.
        shortest = min((run for run, _ in on), key=_size)
        scenario = scenario_of(shortest.job)
        name = scenario.coupling.scheme
        if not chooses(name) and (gain := scheme_of(name).alternating_gain) is not None:
            factor = _size(shortest) * _factor(prediction, scenario, gain)
            # fault: predicted limits at the wrong cost -> cost = math.exp(float(np.mean([math.log(f * c) for f, c in
            #   costs]))) * factor | coupler/test_study_run
            cost = math.exp(float(np.mean([math.log(f * c) for f, c in costs]))) / factor
            found_limits.append(StabilityLimit(series, factor, cost))
    return found_limits


def _size(run: PlannedRun) -> float:
    return float(run.setting.at.get("windows", math.nan))


def _factor(prediction: Prediction, scenario: Scenario, gain: float) -> float:
    """Return the largest stable factor on the windows.  gain : of an alternating error, by the scheme."""
    schedule = plan_of(scenario).schedule
    ends = [schedule.clock.seconds(k) for k in schedule.bounds]

    def size(t: float) -> float:
        k = min(bisect.bisect_right(ends, t * (1 + 1e-9)), len(ends) - 1)
        return ends[k] - ends[k - 1]

    return min((longest(f, prediction.method, gain) / size(f.t) for f in prediction.feedbacks), default=math.inf)


@dataclass(frozen=True)
class StudyOptions:
    """How a study is run.

    processes : of this machine, one thread each; 0: as many as it has cores.  cluster : a Dask scheduler's address
    instead; empty: none.  limit [s] : of wall time for one run; not with a cluster.
    pilot : predict limits even where it takes time.
    """

    processes: int = 0
    cluster: str = ""
    limit: float | None = None
    pilot: bool = False


@dataclass(frozen=True)
class Study:
    """A study that is done.  trials, points : of plan.runs, in order."""

    document: Document
    plan: StudyPlan
    trials: Sequence[TrialResult]
    points: Sequence[Point]
    reference: ReferenceSolution
    scale: ErrorScale
    limits: Sequence[StabilityLimit] = ()
    notes: Sequence[str] = field(default=())


def conduct(path: Path, out: Path, overrides: Mapping[str, Any], keys: Mapping[str, Any],
            options: StudyOptions, line: StudyLine) -> Study:
    """Run the study of the scenario file `path`; trials are stored in out/runs, and what is there is not run again.

    overrides : dotted key -> value, of every run.  keys : of `study`, in place of the file's own.
    Raises ScenarioError before anything runs, ResultsError for a folder that cannot be used or a reference that
    failed.  Ctrl-C leaves a folder from which the same call goes on.
    """
    if options.cluster and options.limit is not None:
        raise ScenarioError("a run on a cluster cannot be given up", key="--limit", value=options.limit,
                            remedy="Leave --limit or --cluster out.")
    document = read_document(path)
    plan = study_plan_of(document, overrides, keys, sources())
    _make(out)
    store = TrialStore(out / "runs")
    answer = from_file(path.parent / plan.spec.reference.file, plan.spec.reference.error) \
        if plan.spec.reference.file else None
    every = {run.key: run for run in (*plan.references, *plan.runs)}
    trials = _run(every, store, options, line)
    if answer is None:
        description = describe_reference(plan.spec.reference, plan.references)
        answer = richardson([trials[r.key] for r in plan.references], description, plan.spec.measure, plan.span)
    scale = scale_of(answer, plan.spec.measure, plan.span)
    results = [trials[run.key] for run in plan.runs]
    points = [point_of(run.setting.label, run.setting.series, o, answer, scale)
              for run, o in zip(plan.runs, results, strict=True)]
    limits = _limits(plan, points, options)
    return Study(document, plan, results, points, answer, scale, limits, plan.notes)


def _make(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise ResultsError(f"{out}: the folder of the study cannot be made ({exc.strerror})") from exc


def _run(every: Mapping[str, PlannedRun], store: TrialStore, options: StudyOptions,
         line: StudyLine) -> dict[str, TrialResult]:
    """Run what is not stored, and return the trial of every run by its key."""
    trials = {key: stored for key in every if (stored := store.get(key)) is not None}
    # fault: a study runs again what it has -> missing = {key: run.job for key, run in every.items()} |
    #   coupler/test_study_run
    missing = {key: run.job for key, run in every.items() if key not in trials}
    try:
        line.begin(len(every), len(trials))
        with closing(_running(missing, options)) as running:
            for done in running:
                trials[done.name] = done.result
                if done.result.storable:
                    store.put(done.name, done.result)
                line(every[done.name].setting.label, done.result)
    except KeyboardInterrupt as exc:
        exc.add_note(f"stopped; {len(trials)} of {len(every)} runs are stored, and the same command continues")
        raise
    return trials


def _running(jobs: Mapping[str, Job], options: StudyOptions) -> Generator[FinishedJob, None, None]:
    if jobs:
        yield from (run_there(jobs, options.cluster) if options.cluster
                    else run_here(jobs, options.processes or os.cpu_count() or 1, options.limit))


def _limits(plan: StudyPlan, points: Sequence[Point], options: StudyOptions) -> Sequence[StabilityLimit]:
    if plan.base.coupling.adaptive is not None or not (options.pilot or is_quick(plan.base)):
        return ()
    return stability_limits(pilot(plan.base), plan.runs, points)
