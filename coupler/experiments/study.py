"""Conducts a study: plans it, runs what is not stored yet, measures errors and predicts stability limits."""

from __future__ import annotations

import bisect
import math
import os
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from contact.problem.values import did_you_mean
from coupler.control.auto import chooses
from coupler.control.window_size import longest
from coupler.errors import ResultsError, ScenarioError
from coupler.experiments.grid import PLAIN, Setting, setting_at, settings_of
from coupler.experiments.pool import FinishedJob, StudyLine, run_here, run_there
from coupler.experiments.trial import LEAN, Job, TrialResult, TrialStore, key_of, scenario_of, sources
from coupler.experiments.work_precision import (
    RATIOS,
    ErrorScale,
    Point,
    ReferenceSolution,
    from_file,
    point_of,
    richardson,
    scale_of,
)
from coupler.running.pilot import Prediction, is_quick, pilot
from coupler.running.setup import plan_of
from coupler.scenario import Scenario
from coupler.scenario.document import Document, read_document
from coupler.scenario.edits import windows_times
from coupler.scenario.load import checked
from coupler.scenario.quantities import with_overrides
from coupler.scenario.schema import StudyReference, StudySpec
from coupler.schemes.schemes import scheme_of

# Plans a study: every run of the grid and of the reference, checked and named before the first one begins.

# The error of a window of an iterated exchange goes with the third power of its size: so do tolerances.
SIZE_POWER = 3.0

# Keys of this part change how a scene is solved, not the scene.
OF_THE_COUPLING = ("coupling", "scheme", "windows", "tolerance", "substeps")


@dataclass(frozen=True)
class PlannedRun:
    """A run of a study.  key : its name in the store."""

    setting: Setting
    job: Job
    key: str


@dataclass(frozen=True)
class StudyPlan:
    """The runs of a study.

    runs : of the grid.  references : of the reference, finest first; empty: it is a file.  base : the scenario.
    """

    runs: tuple[PlannedRun, ...]
    references: tuple[PlannedRun, ...]
    base: Scenario
    spec: StudySpec
    notes: tuple[str, ...]

    @property
    def span(self) -> tuple[float, float]:
        """Over which errors are measured [s]."""
        return self.spec.span or (0.0, self.base.coupling.end)


def study_plan_of(document: Document, overrides: Mapping[str, Any], options: Mapping[str, Any],
                  packages: str) -> StudyPlan:
    """Plan a study, and check everything it will run.

    options : of the command line, in place of the keys of the scenario's `study`.  packages : hash of the sources.
    Raises ScenarioError that names the setting of the grid which is wrong.
    """
    changed = with_overrides(document, overrides)
    written = changed.tree.get("study") or {}
    sets = {**overrides, "study": {**written, **options}} if isinstance(written, dict) else overrides
    base = checked(document, sets)
    spec = StudySpec.model_validate(base.resolved["study"])
    if spec.span is not None and spec.span[0] >= base.coupling.end:
        raise ScenarioError(f"the span begins after the run ends, at {base.coupling.end:g} s", key="study.span",
                            value=list(spec.span))
    if spec.reference.file is None:
        # fault: names of probes are looked at after the runs -> pass | coupler/test_study_run
        _demand_probes(spec.measure, base)
    planner = _Planner(document, overrides, packages)
    runs = tuple(planner.planned(setting, f"run {setting.label!r}") for setting in settings_of(changed, spec.grid))
    references = tuple(planner.planned(setting, "the reference") for setting in _reference_settings(changed, spec))
    return StudyPlan(runs, references, base, spec, tuple(_notes(spec)))


def _demand_probes(names: Sequence[str], base: Scenario) -> None:
    for name in names:
        if name not in base.probes:
            raise ScenarioError("no such probe", key="study.measure", value=name,
                                remedy=did_you_mean(name, base.probes))


@dataclass(frozen=True)
class _Planner:
    document: Document
    overrides: Mapping[str, Any]
    packages: str

    def planned(self, setting: Setting, who: str) -> PlannedRun:
        sets = {**self.overrides, **setting.sets}
        try:
            scenario = checked(self.document, {**sets, **LEAN})
        except ScenarioError as exc:
            raise ScenarioError(f"{who}: {exc.message}", file=exc.file, line=exc.line, key=exc.key, value=exc.value,
                                remedy=exc.remedy) from exc
        job = Job(self.document.text, str(Path(self.document.path).absolute()), sets)
        return PlannedRun(setting, job, key_of(scenario, self.packages))


def _reference_settings(document: Document, spec: StudySpec) -> list[Setting]:
    """Return the settings of the reference: windows `finer` times as fine as the finest of the grid, then twice and
    four times as long; adaptive ones by their tolerance."""
    r = spec.reference
    if r.file is not None:
        return []
    at = {"scheme": r.scheme.value, **r.set}
    try:
        # fault: a study of adaptive windows needs a reference by hand -> fixed = True | coupler/test_study
        fixed = windows_times(with_overrides(document, setting_at(document, at).sets).tree, 1.0)
        axis, power = ("windows", 1.0) if fixed else ("tolerance", SIZE_POWER)
        finest = min((float(v) for grid in spec.grid for v in grid.get(axis, ())), default=1.0)
        settings = [(n, setting_at(document, {**at, axis: finest * (n / r.finer)**power})) for n in RATIOS]
    except ScenarioError as exc:
        raise ScenarioError(f"the reference: {exc.message}", key=exc.key, value=exc.value, remedy=exc.remedy) from exc
    return [replace(setting, at={"reference": n, **setting.at}) for n, setting in settings]


def describe_reference(r: StudyReference, runs: Sequence[PlannedRun]) -> str:
    """Describe what the reference is."""
    if r.file is not None:
        return f"the answer in {Path(r.file).name}"
    at = runs[0].setting.at
    what = (f"windows of {at['windows']:g} times" if "windows" in at else
            f"tolerances of windows of {at['tolerance']:.3g} times")
    more = "".join(f", {axis} {value}" for axis, value in r.set.items() if not isinstance(value, list | dict))
    return f"{r.scheme.value} with {what} those of the scenario{more}"


def _notes(spec: StudySpec) -> list[str]:
    axes = {axis for grid in spec.grid for axis in grid if axis.split(".")[0] not in OF_THE_COUPLING}
    if not axes:
        return []
    against = "the stored answer" if spec.reference.file else "the scenario as it is"
    if spec.reference.set:
        against = "the scenario with " + ", ".join(f"{a} {v}" for a, v in spec.reference.set.items())
    return [f"The grid changes {', '.join(sorted(axes))}, and its errors are to {against}. The reference's own error, "
            "as it is estimated here, is that of its windows alone."]


# Conducts a study: plans it, runs what is not stored yet, measures errors and predicts stability limits.

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
    return Study(document, plan, results, points, answer, scale, limits, (*plan.notes, *_drowned(plan, scale)))


# Unit of a probe -> what the iterations of a window leave of it.
OF_ITERATION = {"K": "temperature", "m": "gap", "Pa": "pressure"}
# Times that: a range below it has errors of more than 10 % that no window makes better.
CLEAR = 10.0


def _drowned(plan: StudyPlan, scale: ErrorScale) -> list[str]:
    """Return a note on each measured probe that hardly moves beside what iterating leaves."""
    notes = []
    tolerance = plan.base.coupling.iteration.tolerance
    for name, size in scale.probes.items():
        unit = plan.base.probes[name].unit if name in plan.base.probes else ""
        if unit not in OF_ITERATION:
            continue
        key = OF_ITERATION[unit]
        left = getattr(tolerance, key).atol
        # fault: a probe that hardly moves is measured without a word -> if False: | coupler/test_study_run
        if size < CLEAR * left:
            notes.append(f"Probe {name} moves by {size:.3g} {unit} in all, and iterations leave up to {left:.3g} "
                         f"{unit}: its errors tell of coupling.iteration.tolerance.{key}.atol, not of the windows. "
                         "Make that smaller, or leave the probe out (study.measure).")
    return notes


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
