"""The error of a run against the reference, and what a list of errors says: the front, and the cheapest setting."""

from __future__ import annotations

import bisect
import csv
import io
import json
import math
import os
import sys
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from scipy.interpolate import PchipInterpolator

from coupler.control.auto import chooses
from coupler.control.window_limits import longest
from coupler.errors import ResultsError, ScenarioError
from coupler.experiments.grid import PLAIN, Cell, cell_at, cells_of
from coupler.experiments.pool import run_here, run_there
from coupler.experiments.trial import LEAN, Job, Store, Trial, key_of, scenario_of, sources
from coupler.record.paths import part_of
from coupler.record.results import Results
from coupler.running.pilot import Prediction, is_quick, pilot
from coupler.running.setup import plan_of
from coupler.scenario import Scenario
from coupler.scenario.document import Document, did_you_mean, dumped, layout, read_document
from coupler.scenario.edits import apply_overrides
from coupler.scenario.load import checked
from coupler.scenario.schema import StudyReference, StudySpec
from coupler.schemes.table import scheme_of

# What errors are measured against: an answer made by another method, with an estimate of its own error.

Array = NDArray[np.float64]
Curve = Callable[[Array], Array]

# Windows of the three runs a computed reference is made of, in units of the finest.
RATIOS = (1, 2, 4)
# An order this near a whole one is taken for it, and what is left of the error is extrapolated away.
NEAR = 0.3


@dataclass(frozen=True)
class Reference:
    """curves : probe -> its values [SI] over time.  other : the same, off by the reference's own error; empty: unknown.

    error : relative, stated by a file's author; nan: not stated.  order : seen when windows were halved; nan: unknown.
    t : (n,) [s], where it is known.  words : what it is.
    """

    curves: Mapping[str, Curve]
    other: Mapping[str, Curve]
    error: float
    order: float
    t: Array
    words: str


def richardson(runs: Sequence[Trial], words: str, measure: Sequence[str] = (),
               span: tuple[float, float] = (0.0, math.inf)) -> Reference:
    """The reference of three runs, finest first, each with windows twice as long as the one before.

    p = log2 |y_4 - y_2|/|y_2 - y_1| over the probes of `measure` (none: all) in the span [s].  Near 1 or 2 the
    reference is y_1 + (y_1 - y_2)/(2^p - 1), and the error taken for its own is that of y_1, the second term; elsewhere
    it is y_1, and the error y_1 - y_2.
    Raises ResultsError where one of the runs failed.
    """
    for ratio, run in zip(RATIOS, runs, strict=True):
        if run.failed:
            raise ResultsError(f"the reference with windows {ratio} times its finest failed: {run.failed}; "
                               "give another one (study.reference), or coarser windows")
    t = np.array(runs[0].t)
    values = [_curves(run) for run in runs]
    fine, middle, coarse = ({n: c(t) for n, c in v.items()} for v in values)
    inside = (t >= span[0]) & (t <= span[1])
    seen = [n for n in fine if not measure or n in measure] if inside.any() else []
    order = _order([(middle[n] - fine[n])[inside] for n in seen], [(coarse[n] - middle[n])[inside] for n in seen],
                   [float(np.ptp(fine[n][inside])) for n in seen])
    near = min((1, 2), key=lambda p: abs(order - p)) if math.isfinite(order) else 0
    # fault: a first-order factor for every order of the reference -> factor = 1.0 if near and abs(order - near) <= NEAR
    #   else 0.0 | coupler/test_study
    factor = 1.0 / (2.0**near - 1.0) if near and abs(order - near) <= NEAR else 0.0
    answer = {n: _curve(t, fine[n] + factor * (fine[n] - middle[n])) for n in fine}
    off = factor or 1.0
    other = {n: _curve(t, answer[n](t) + off * (fine[n] - middle[n])) for n in fine}
    return Reference(answer, other, math.nan, order, t, words)


def _order(near: Sequence[Array], far: Sequence[Array], scales: Sequence[float]) -> float:
    """From the differences of three runs, each probe in units of its range."""
    known = [k for k, scale in enumerate(scales) if scale > 0.0]
    small, large = (sum(float(np.mean((d[k] / scales[k])**2)) for k in known) for d in (near, far))
    return 0.5 * math.log2(large / small) if small > 0.0 and large > 0.0 else math.nan


def from_file(path: Path, error: float | None) -> Reference:
    """A stored answer: a results file, or a table .csv with the columns t [s] and probes by name [SI].

    Raises ScenarioError for a file that is neither, ResultsError for a results file that cannot be read.
    """
    t, values = _table(path) if path.suffix == ".csv" else _results(path)
    stated = math.nan if error is None else error
    curves = {n: _curve(t, v) for n, v in values.items()}
    return Reference(curves, {}, stated, math.nan, t, f"the answer in {path.name}")


def _results(path: Path) -> tuple[Array, dict[str, Array]]:
    results = Results(path)
    return results.t, {name: results.probe(name)[1] for name in results.probe_names}


def _table(path: Path) -> tuple[Array, dict[str, Array]]:
    def wrong(what: str) -> ScenarioError:
        return ScenarioError(what, file=str(path), key="study.reference.file",
                             remedy="A table has a first line `t,PROBE,PROBE,...`, and numbers below it, t ascending.")

    try:
        with path.open(newline="", encoding="utf-8") as file:
            head, *rows = [row for row in csv.reader(file) if row]
        table = np.array(rows, dtype=float)
    except (OSError, ValueError) as exc:
        raise wrong(f"not a table of numbers ({exc})") from exc
    if head[:1] != ["t"] or table.ndim != 2 or table.shape[1] != len(head):
        raise wrong("not a table whose first column is t")
    if len(table) < 2 or not np.isfinite(table).all() or not (np.diff(table[:, 0]) > 0.0).all():
        raise wrong("times do not ascend, or a value is not a number")
    return table[:, 0], {name: table[:, k] for k, name in enumerate(head) if k}


def _curves(run: Trial) -> dict[str, Curve]:
    return {name: _curve(np.array(run.t), np.array(v)) for name, v in run.probes.items()}


def _curve(t: Array, value: Array) -> Curve:
    """Monotone cubic: third order in smooth parts, and it does not overshoot at a kink."""
    curve = PchipInterpolator(t, value, extrapolate=False)
    return lambda at: np.asarray(curve(at), dtype=float)


LEVELS = (1e-2, 1e-3, 1e-4)
# A probe whose range is this share of its size is taken not to change: round-off is no range.
STILL = 1e-9


@dataclass(frozen=True)
class Scale:
    """probes : those measured -> range of the reference over the span [SI].  span [s].

    floor : the reference's own error, measured at its own times as that of a run, of the worst probe; nan: unknown.
    """

    probes: Mapping[str, float]
    span: tuple[float, float]
    floor: float


@dataclass(frozen=True)
class Point:
    """One run on the chart.  error : relative, nan where it failed.  floor : the reference's own, nan where it is
    unknown."""

    label: str
    series: str
    half_solves: int
    seconds: float
    error: float
    floor: float
    message: str = ""
    by_probe: Mapping[str, float] | None = None

    @property
    def known(self) -> float:
        """What the error is known to be below."""
        # fault: what lies below the reference's own error counts as it is -> return self.error if
        #   math.isnan(self.floor) else self.error | coupler/test_study
        return self.error if math.isnan(self.floor) else max(self.error, self.floor)

    @property
    def below(self) -> bool:
        """Whether the reference cannot tell this run from the truth."""
        return self.error < self.floor


def scale_of(reference: Reference, measure: Sequence[str], span: tuple[float, float]) -> Scale:
    """What is measured: the probes named, or all that change.  Raises ScenarioError where there is none."""
    t = reference.t[(reference.t >= span[0]) & (reference.t <= span[1])]
    if len(t) < 2:
        raise ScenarioError("the reference has no two times in the span", key="study.span", value=list(span),
                            remedy=f"It is known from {reference.t[0]:g} to {reference.t[-1]:g} s.")
    ranges = {name: _range(curve(t)) for name, curve in reference.curves.items()}
    for name in measure:
        if name not in ranges:
            raise ScenarioError("no such probe in the reference", key="--measure", value=name,
                                remedy=did_you_mean(name, ranges))
        if ranges[name] == 0.0:
            raise ScenarioError("this probe does not change, so no error relative to its range can be told",
                                key="--measure", value=name, remedy="Leave it out.")
    chosen = {n: r for n, r in ranges.items() if (n in measure if measure else r > 0.0)}
    if not chosen:
        raise ScenarioError("no probe changes, so there is nothing to measure", key="probes",
                            remedy="Add a probe of what the study is about.")
    own = [_l2(t, reference.other[n](t) - reference.curves[n](t)) / size
           for n, size in chosen.items() if n in reference.other]
    return Scale(chosen, span, max(own, default=reference.error))


def _range(values: Array) -> float:
    found = float(np.ptp(values))
    return found if found > STILL * float(np.abs(values).max()) else 0.0


def errors_of(run: Trial, reference: Reference, scale: Scale) -> dict[str, float]:
    """Probe -> relative error: e = sqrt(int (y - y_ref)^2 dt / int dt)/range, by the trapezoidal rule over the window
    ends of the run in the span.

    Raises ScenarioError for a run without a measured probe.
    """
    missing = [n for n in scale.probes if n not in run.probes]
    if missing:
        raise ScenarioError("a run of the grid has no such probe", key="--measure", value=missing[0],
                            remedy=did_you_mean(missing[0], run.probes))
    t = np.array(run.t)
    inside = (t >= scale.span[0]) & (t <= scale.span[1]) & (t <= reference.t[-1])
    at = t[inside]
    found = {n: _l2(at, np.array(run.probes[n])[inside] - reference.curves[n](at)) / size
             for n, size in scale.probes.items()}
    return found


def _l2(t: Array, e: Array) -> float:
    if len(t) < 2:
        return float(np.abs(e).max()) if len(t) else math.nan
    # fault: the error of a study not a mean over time -> return math.sqrt(float(np.trapezoid(e**2, t)) / 1.0) |
    #   coupler/test_study
    return math.sqrt(float(np.trapezoid(e**2, t)) / float(t[-1] - t[0]))


def point_of(label: str, series: str, run: Trial, reference: Reference, scale: Scale) -> Point:
    """A run as a point; the worst probe counts."""
    if run.failed:
        return Point(label, series, run.half_solves, run.seconds, math.nan, math.nan, run.failed)
    found = errors_of(run, reference, scale)
    worst = max(found.values())
    message = "" if math.isfinite(worst) else "it has no window end in the span"
    return Point(label, series, run.half_solves, run.seconds, worst, scale.floor, message, found)


def front(points: Sequence[Point], cost: str = "half_solves") -> list[Point]:
    """Those that no other point beats in both cost and error, the cheapest first."""
    best: list[Point] = []
    for p in sorted((p for p in points if math.isfinite(p.error)), key=lambda p: (getattr(p, cost), p.known)):
        if not best or p.known < best[-1].known:
            best.append(p)
    return best


def cheapest(points: Sequence[Point], level: float, cost: str = "half_solves") -> Point | None:
    """The cheapest run whose error is known to be at most `level`; None where there is none."""
    good = [p for p in points if p.known <= level]
    return min(good, key=lambda p: (getattr(p, cost), p.known), default=None)


# What a study will run: every cell checked and named before the first run begins.

# Keys of this part change how a scene is solved, not the scene.
OF_THE_COUPLING = ("coupling", "scheme", "windows", "tolerance", "substeps")


@dataclass(frozen=True)
class Planned:
    """One run.  key : its name in the store."""

    cell: Cell
    job: Job
    key: str


@dataclass(frozen=True)
class StudyPlan:
    """runs : of the grid.  references : of the reference, finest first; empty: it is a file.  base : the scenario."""

    runs: tuple[Planned, ...]
    references: tuple[Planned, ...]
    base: Scenario
    spec: StudySpec
    notes: tuple[str, ...]

    @property
    def span(self) -> tuple[float, float]:
        """Over which errors are measured [s]."""
        return self.spec.span or (0.0, self.base.coupling.end)


def study_plan_of(document: Document, overrides: Mapping[str, Any], options: Mapping[str, Any],
                  packages: str) -> StudyPlan:
    """Check everything a study will run.

    options : of the command line, in place of the keys of the scenario's `study`.  packages : hash of the sources.
    Raises ScenarioError that names the setting of the grid which is wrong.
    """
    changed = apply_overrides(document, overrides)
    written = changed.tree.get("study") or {}
    sets = {**overrides, "study": {**written, **options}} if isinstance(written, dict) else overrides
    base = checked(document, sets)
    spec = StudySpec.model_validate(base.resolved["study"])
    if spec.span is not None and spec.span[0] >= base.coupling.end:
        raise ScenarioError(f"the span begins after the run ends, at {base.coupling.end:g} s", key="study.span",
                            value=list(spec.span))
    planner = _Planner(document, overrides, packages)
    runs = tuple(planner.planned(cell, f"run {cell.label!r}") for cell in cells_of(changed, spec.grid))
    references = tuple(planner.planned(cell, "the reference") for cell in _reference_cells(changed, spec))
    return StudyPlan(runs, references, base, spec, tuple(_notes(spec)))


@dataclass(frozen=True)
class _Planner:
    document: Document
    overrides: Mapping[str, Any]
    packages: str

    def planned(self, cell: Cell, who: str) -> Planned:
        sets = {**self.overrides, **cell.sets}
        try:
            scenario = checked(self.document, {**sets, **LEAN})
        except ScenarioError as exc:
            raise ScenarioError(f"{who}: {exc.message}", file=exc.file, line=exc.line, key=exc.key, value=exc.value,
                                remedy=exc.remedy) from exc
        job = Job(self.document.text, str(Path(self.document.path).absolute()), sets)
        return Planned(cell, job, key_of(scenario, self.packages))


def _reference_cells(document: Document, spec: StudySpec) -> list[Cell]:
    """Windows `finer` times as fine as the finest of the grid, then twice and four times as long."""
    r = spec.reference
    if r.file is not None:
        return []
    finest = min((float(v) for grid in spec.grid for v in grid.get("windows", ())), default=1.0)
    cells = []
    for ratio in RATIOS:
        try:
            cell = cell_at(document, {"scheme": r.scheme.value, **r.set, "windows": finest * ratio / r.finer})
        except ScenarioError as exc:
            raise ScenarioError(f"the reference: {exc.message}", key=exc.key, value=exc.value, remedy=(
                "Give it windows: study.reference.set: {coupling.windows: [...]}, or a file.")) from exc
        cells.append(replace(cell, at={"reference": ratio, **cell.at}))
    return cells


def reference_words(r: StudyReference, runs: Sequence[Planned]) -> str:
    """What the reference is, in words."""
    if r.file is not None:
        return f"the answer in {Path(r.file).name}"
    finest = runs[0].cell.at["windows"]
    more = "".join(f", {axis} {value}" for axis, value in r.set.items() if not isinstance(value, list | dict))
    return f"{r.scheme.value} with windows of {finest:g} times those of the scenario{more}"


def _notes(spec: StudySpec) -> list[str]:
    axes = {axis for grid in spec.grid for axis in grid if axis.split(".")[0] not in OF_THE_COUPLING}
    if not axes:
        return []
    against = "the stored answer" if spec.reference.file else "the scenario as it is"
    if spec.reference.set:
        against = "the scenario with " + ", ".join(f"{a} {v}" for a, v in spec.reference.set.items())
    return [f"The grid changes {', '.join(sorted(axes))}, and its errors are to {against}. The reference's own error, "
            "as it is estimated here, is that of its windows alone."]


# Where on the chart a scheme's longest stable windows lie, as a pilot run predicts them.

# A pilot of the scenario says nothing of other physics, or of windows of several substeps.
SAME_SCENE = {"scheme", PLAIN["scheme"], "windows", "coupling.windows"}


@dataclass(frozen=True)
class Limit:
    """series : the curve it belongs to.  windows : the largest stable factor on its windows; inf: none is too long.

    half_solves : what a run with it costs; 0 where there is no limit.
    """

    series: str
    windows: float
    half_solves: float


def limits_of(prediction: Prediction, runs: Sequence[Planned], points: Sequence[Point]) -> list[Limit]:
    """The limit of every curve that is a scheme over windows and nothing else.

    The factor is the least over the pilot's looks of limit/size of the window at that time; its cost is read off the
    curve, along which cost goes as 1/factor.
    """
    found = []
    for series in dict.fromkeys(run.cell.series for run in runs):
        on = [(run, p) for run, p in zip(runs, points, strict=True) if run.cell.series == series]
        costs = [(_size(run), p.half_solves) for run, p in on if not math.isnan(p.error)]
        if not costs or any(set(run.cell.at) - SAME_SCENE or "windows" not in run.cell.at for run, _ in on):
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
            found.append(Limit(series, factor, cost))
    return found


def _size(run: Planned) -> float:
    return float(run.cell.at.get("windows", math.nan))


def _factor(prediction: Prediction, scenario: Scenario, gain: float) -> float:
    """gain : of what alternates, by the scheme."""
    schedule = plan_of(scenario).schedule
    ends = [schedule.clock.seconds(k) for k in schedule.bounds]

    def size(t: float) -> float:
        k = min(bisect.bisect_right(ends, t * (1 + 1e-9)), len(ends) - 1)
        return ends[k] - ends[k - 1]

    return min((longest(f, prediction.method, gain) / size(f.t) for f in prediction.seen), default=math.inf)


# What a study shows while it runs: runs done and left, and those that failed.

class StudyLine:
    """A bar on a terminal, a line a run elsewhere.  console : default standard error."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(file=sys.stderr, highlight=False)
        self._bar = Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                             console=self._console, transient=True)
        self._began = time.monotonic()
        self._done = self._total = 0

    def __enter__(self) -> StudyLine:
        return self

    def begin(self, total: int, kept: int) -> None:
        """total : runs of the study, the reference's too.  kept : those done by an earlier call."""
        self._total, self._done = total, kept
        self._print(f"{total} runs, {kept} of them done before" if kept else f"{total} runs")
        if self._console.is_terminal and kept < total:
            self._task = self._bar.add_task("runs", total=total, completed=kept)
            self._bar.start()

    def __call__(self, label: str, trial: Trial) -> None:
        """A run is done."""
        self._done += 1
        if trial.failed:
            self._print(f"failed: {label}: {trial.failed}")
        if self._console.is_terminal:
            self._bar.update(self._task, completed=self._done)
        elif not trial.failed:
            self._print(f"{self._done} of {self._total}, {self._total - self._done} left, "
                        f"{time.monotonic() - self._began:.0f} s: {label}: {trial.half_solves} half-solves")

    def _print(self, text: str) -> None:
        if self._console.is_terminal:
            self._bar.console.print(text, markup=False)
        else:
            print(text, file=self._console.file, flush=True)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._bar.stop()


# A study, from a scenario to a folder: plan, run what is not kept, measure, write.

@dataclass(frozen=True)
class How:
    """processes : of this machine, one thread each; 0: as many as it has cores.  cluster : a Dask scheduler's address
    instead; empty: none.  limit [s] : of wall time for one run; not with a cluster.

    pilot : predict limits even where it takes time.
    """

    processes: int = 0
    cluster: str = ""
    limit: float | None = None
    pilot: bool = False


@dataclass(frozen=True)
class Study:
    """What a study found.  points : of plan.runs, in order."""

    document: Document
    plan: StudyPlan
    trials: Sequence[Trial]
    points: Sequence[Point]
    reference: Reference
    scale: Scale
    limits: Sequence[Limit] = ()
    notes: Sequence[str] = field(default=())


def conduct(path: Path, out: Path, overrides: Mapping[str, Any], options: Mapping[str, Any], how: How,
            show: StudyLine) -> Study:
    """Run the study of the scenario file `path`; trials are kept in out/runs, and what is there is not run again.

    overrides : dotted key -> value, of every run.  options : keys of `study` in place of the file's own.
    Raises ScenarioError before anything runs, ResultsError for a folder that cannot be used or a reference that
    failed.  Ctrl-C leaves a folder from which the same call goes on.
    """
    if how.cluster and how.limit is not None:
        raise ScenarioError("a run on a cluster cannot be given up", key="--limit", value=how.limit,
                            remedy="Leave --limit or --cluster out.")
    document = read_document(path)
    plan = study_plan_of(document, overrides, options, sources())
    _make(out)
    store = Store(out / "runs")
    answer = from_file(path.parent / plan.spec.reference.file, plan.spec.reference.error) \
        if plan.spec.reference.file else None
    every = {run.key: run for run in (*plan.references, *plan.runs)}
    trials = _run(every, store, how, show)
    if answer is None:
        words = reference_words(plan.spec.reference, plan.references)
        answer = richardson([trials[r.key] for r in plan.references], words, plan.spec.measure, plan.span)
    scale = scale_of(answer, plan.spec.measure, plan.span)
    found = [trials[run.key] for run in plan.runs]
    points = [point_of(run.cell.label, run.cell.series, o, answer, scale)
              for run, o in zip(plan.runs, found, strict=True)]
    limits = _limits(plan, points, how)
    return Study(document, plan, found, points, answer, scale, limits, plan.notes)


def _make(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise ResultsError(f"{out}: the folder of the study cannot be made ({exc.strerror})") from exc


def _run(every: Mapping[str, Planned], store: Store, how: How, show: StudyLine) -> dict[str, Trial]:
    """The trial of every run, by its key."""
    trials = {key: kept for key in every if (kept := store.get(key)) is not None}
    # fault: a study runs again what it has -> left = {key: run.job for key, run in every.items()} |
    #   coupler/test_study_run
    left = {key: run.job for key, run in every.items() if key not in trials}
    try:
        show.begin(len(every), len(trials))
        with closing(_running(left, how)) as running:
            for key, trial in running:
                trials[key] = trial
                if trial.kept:
                    store.put(key, trial)
                show(every[key].cell.label, trial)
    except KeyboardInterrupt as exc:
        exc.add_note(f"stopped; {len(trials)} of {len(every)} runs are kept, and the same command goes on from them")
        raise
    return trials


def _running(jobs: Mapping[str, Job], how: How) -> Generator[tuple[str, Trial], None, None]:
    if jobs:
        yield from (run_there(jobs, how.cluster) if how.cluster
                    else run_here(jobs, how.processes or os.cpu_count() or 1, how.limit))


def _limits(plan: StudyPlan, points: Sequence[Point], how: How) -> Sequence[Limit]:
    if plan.base.coupling.adaptive is not None or not (how.pilot or is_quick(plan.base)):
        return ()
    return limits_of(pilot(plan.base), plan.runs, points)


# What a study leaves as data: study.json, study.csv, and the cheapest settings as scenario files.

FORMAT, VERSION = "slideline.study", 1


def percent(level: float) -> str:
    """1 %, .1 %, .01 %."""
    return f"{100 * level:g} %".removeprefix("0")


def put(path: Path, text: str) -> Path:
    """Write a text whole or not at all.  Raises ResultsError."""
    try:
        part_of(path).write_text(text, encoding="utf-8")
        os.replace(part_of(path), path)
    except OSError as exc:
        raise ResultsError(f"{path}: cannot be written ({exc.strerror})") from exc
    return path


def rows(runs: Sequence[Planned], points: Sequence[Point]) -> list[dict[str, Any]]:
    """One mapping a run; numbers that are not known are None."""
    return [{"label": p.label, **{f"at.{axis}": value for axis, value in run.cell.at.items()},
             "half_solves": p.half_solves, "seconds": _known(p.seconds), "error": _known(p.error),
             "floor": _known(p.floor), "below_floor": p.below, "message": p.message, "run": run.key,
             **{f"error.{n}": _known(e) for n, e in (p.by_probe or {}).items()}}
            for run, p in zip(runs, points, strict=True)]


def as_json(facts: Mapping[str, Any], runs: Sequence[Planned], points: Sequence[Point]) -> str:
    """All of a study as JSON; `facts` stand beside the runs."""
    best = {percent(level): (p.label if (p := cheapest(points, level)) else None) for level in LEVELS}
    whole = {"format": FORMAT, "version": VERSION, **facts, "cheapest": best, "runs": rows(runs, points)}
    return json.dumps(whole, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def as_csv(runs: Sequence[Planned], points: Sequence[Point]) -> str:
    """The runs as a table; columns of all runs, empty where a run has none."""
    table = rows(runs, points)
    file = io.StringIO()
    writer = csv.DictWriter(file, list(dict.fromkeys(name for row in table for name in row)), lineterminator="\n")
    writer.writeheader()
    for row in table:
        writer.writerow({n: json.dumps(v) if isinstance(v, dict | list) else v for n, v in row.items()})
    return file.getvalue()


def setting(document: Document, run: Planned, point: Point, level: float) -> str:
    """A scenario file of one run, complete but for the study itself."""
    # fault: the cheapest setting without what makes it so -> tree = dict(document.tree) | coupler/test_study_run
    tree = dict(apply_overrides(document, run.job.overrides).tree)
    tree.pop("study", None)
    for body in tree["bodies"].values():
        if file := body.get("mesh", {}).get("file"):
            file["path"] = str((document.path.parent / file["path"]).resolve())
    yaml = layout()
    yaml.default_flow_style = None
    return (f"# {document.path.name}, {point.label}: the cheapest run of a study with an error of at most "
            f"{percent(level)}.\n# Its error is {100 * point.known:.2g} %, it costs {point.half_solves} half-solves.\n"
            f"{dumped(tree, yaml)}")


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None
