"""Error against cost: the reference solution of a study and its own error, the error of each run, the Pareto front."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from contact.problem.values import did_you_mean
from coupler.errors import ResultsError, ScenarioError
from coupler.experiments.trial import TrialResult, probe_of
from coupler.record.results import Results

Array = NDArray[np.float64]


# Makes the reference solution of a study, and estimates its own error.

Curve = Callable[[Array], Array]

# Windows of the three runs a computed reference is made of, in units of the finest.
RATIOS = (1, 2, 4)
# An order this close to 1 or 2 is taken for it, and the error of that order is extrapolated away.
NEAR = 0.3


@dataclass(frozen=True)
class ReferenceSolution:
    """What errors are measured against, with an estimate of its own error.

    curves : probe -> its values [SI] over time.  other : the same, off by the reference's own error; empty: unknown.
    error : relative, stated by a file's author; nan: not stated.
    order : of convergence, measured by halving windows; nan: unknown.
    t : (n,) times at which it is given [s].  description : of what it is.
    """

    curves: Mapping[str, Curve]
    other: Mapping[str, Curve]
    error: float
    order: float
    t: Array
    description: str


def richardson(runs: Sequence[TrialResult], description: str, measure: Sequence[str] = (),
               span: tuple[float, float] = (0.0, math.inf)) -> ReferenceSolution:
    """Extrapolate the reference from three runs, finest first, each with windows twice as long as the one before.

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
    names = [n for n in fine if not measure or n in measure] if inside.any() else []
    order = _order([(middle[n] - fine[n])[inside] for n in names], [(coarse[n] - middle[n])[inside] for n in names],
                   [float(np.ptp(fine[n][inside])) for n in names])
    near = min((1, 2), key=lambda p: abs(order - p)) if math.isfinite(order) else 0
    # fault: a first-order factor for every order of the reference -> factor = 1.0 if near and abs(order - near) <= NEAR
    #   else 0.0 | coupler/test_study
    factor = 1.0 / (2.0**near - 1.0) if near and abs(order - near) <= NEAR else 0.0
    answer = {n: _curve(t, fine[n] + factor * (fine[n] - middle[n])) for n in fine}
    off = factor or 1.0
    other = {n: _curve(t, answer[n](t) + off * (fine[n] - middle[n])) for n in fine}
    return ReferenceSolution(answer, other, math.nan, order, t, description)


def _order(near: Sequence[Array], far: Sequence[Array], scales: Sequence[float]) -> float:
    """Return the order of convergence from the differences of three runs, each probe in units of its range."""
    moving = [k for k, scale in enumerate(scales) if scale > 0.0]
    small, large = (sum(float(np.mean((d[k] / scales[k])**2)) for k in moving) for d in (near, far))
    return 0.5 * math.log2(large / small) if small > 0.0 and large > 0.0 else math.nan


def from_file(path: Path, error: float | None) -> ReferenceSolution:
    """Read a stored answer: a results file, or a table .csv with the columns t [s] and probes by name [SI].

    Raises ScenarioError for a file that is neither, ResultsError for a results file that cannot be read.
    """
    read = _table(path) if path.suffix == ".csv" else _results(path)
    t, stated = read.t, math.nan if error is None else error
    curves = {n: _curve(t, v) for n, v in read.values.items()}
    return ReferenceSolution(curves, {}, stated, math.nan, t, f"the answer in {path.name}")


@dataclass(frozen=True)
class _Series:
    """t : (n,) [s].  values : probe -> (n,) [SI]."""

    t: Array
    values: dict[str, Array]


def _results(path: Path) -> _Series:
    results = Results(path)
    return _Series(results.t, {name: probe_of(results, name)[1] for name in results.probe_names})


def _table(path: Path) -> _Series:
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
    return _Series(table[:, 0], {name: table[:, k] for k, name in enumerate(head) if k})


def _curves(run: TrialResult) -> dict[str, Curve]:
    return {name: _curve(np.array(run.t), np.array(v)) for name, v in run.probes.items()}


def _curve(t: Array, value: Array) -> Curve:
    """Interpolate by a monotone cubic: third order in smooth parts, without overshoot at a breakpoint."""
    curve = PchipInterpolator(t, value, extrapolate=False)
    return lambda at: np.asarray(curve(at), dtype=float)


# Measures error against cost: the error of each run, the Pareto pareto_front, the cheapest run within an error.

LEVELS = (1e-2, 1e-3, 1e-4)
# A probe whose range is below this fraction of its size does not change: that is round-off.
STILL = 1e-9


@dataclass(frozen=True)
class ErrorScale:
    """What errors are measured in.

    probes : those measured -> range of the reference over the span [SI].  span : begin and end [s].
    floor : the reference's own error, measured at its own times as that of a run, of the worst probe; nan: unknown.
    """

    probes: Mapping[str, float]
    span: tuple[float, float]
    floor: float


@dataclass(frozen=True)
class Point:
    """One run: its error and cost.

    series : the curve it lies on.  solver_calls, seconds : its cost.  error : relative, nan where it failed.
    floor : the reference's own error, nan where that is unknown.  by_probe : probe -> error.  broken : names of the
    checks of its trust table that failed.
    """

    label: str
    series: str
    solver_calls: int
    seconds: float
    error: float
    floor: float
    message: str = ""
    by_probe: Mapping[str, float] | None = None
    broken: Sequence[str] = ()

    @property
    def bound(self) -> float:
        """An upper bound of the error: the reference's own where the error is below it."""
        # fault: what lies below the reference's own error counts as it is -> return self.error if
        #   math.isnan(self.floor) else self.error | coupler/test_study
        return self.error if math.isnan(self.floor) else max(self.error, self.floor)

    @property
    def below_floor(self) -> bool:
        """Whether the error is below that of the reference itself."""
        return self.error < self.floor


def scale_of(reference: ReferenceSolution, measure: Sequence[str], span: tuple[float, float]) -> ErrorScale:
    """Choose what is measured: the probes named, or all that change.  Raises ScenarioError where there is none."""
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
            raise ScenarioError("this probe does not change, so it has no error relative to its range",
                                key="--measure", value=name, remedy="Leave it out.")
    chosen = {n: r for n, r in ranges.items() if (n in measure if measure else r > 0.0)}
    if not chosen:
        raise ScenarioError("no probe changes, so there is nothing to measure", key="probes",
                            remedy="Add a probe of what the study is about.")
    own = [_l2(t, reference.other[n](t) - reference.curves[n](t)) / size
           for n, size in chosen.items() if n in reference.other]
    return ErrorScale(chosen, span, max(own, default=reference.error))


def _range(values: Array) -> float:
    size = float(np.ptp(values))
    return size if size > STILL * float(np.abs(values).max()) else 0.0


def errors_of(run: TrialResult, reference: ReferenceSolution, scale: ErrorScale) -> dict[str, float]:
    """Measure the relative error of each probe: e = sqrt(int (y - y_ref)^2 dt / int dt)/range.

    By the trapezoidal rule over the window ends of the run in the span.

    Raises ScenarioError for a run without a measured probe.
    """
    missing = [n for n in scale.probes if n not in run.probes]
    if missing:
        raise ScenarioError("a run of the grid has no such probe", key="--measure", value=missing[0],
                            remedy=did_you_mean(missing[0], run.probes))
    t = np.array(run.t)
    inside = (t >= scale.span[0]) & (t <= scale.span[1]) & (t <= reference.t[-1])
    at = t[inside]
    errors = {n: _l2(at, np.array(run.probes[n])[inside] - reference.curves[n](at)) / size
             for n, size in scale.probes.items()}
    return errors


def _l2(t: Array, e: Array) -> float:
    if len(t) < 2:
        return float(np.abs(e).max()) if len(t) else math.nan
    # fault: the error of a study not a mean over time -> return math.sqrt(float(np.trapezoid(e**2, t)) / 1.0) |
    #   coupler/test_study
    return math.sqrt(float(np.trapezoid(e**2, t)) / float(t[-1] - t[0]))


def point_of(label: str, series: str, run: TrialResult, reference: ReferenceSolution, scale: ErrorScale) -> Point:
    """Return a run as a point; the worst probe counts."""
    if run.failed:
        return Point(label, series, run.solver_calls, run.seconds, math.nan, math.nan, run.failed)
    errors = errors_of(run, reference, scale)
    worst = max(errors.values())
    message = "" if math.isfinite(worst) else "it has no window end in the span"
    # fault: a study hides what its runs say of themselves -> return Point(label, series, run.solver_calls, run.seconds,
    #   worst, scale.floor, message, errors) | coupler/test_study
    return Point(label, series, run.solver_calls, run.seconds, worst, scale.floor, message, errors, tuple(run.broken))


def pareto_front(points: Sequence[Point], cost: str = "solver_calls") -> list[Point]:
    """Return the Pareto optimal points: no other has less cost and less error; the cheapest first."""
    best: list[Point] = []
    for p in sorted((p for p in points if math.isfinite(p.error)), key=lambda p: (getattr(p, cost), p.bound)):
        if not best or p.bound < best[-1].bound:
            best.append(p)
    return best


def cheapest(points: Sequence[Point], level: float, cost: str = "solver_calls") -> Point | None:
    """Return the cheapest run whose error is at most `level` for certain; None where there is none."""
    good = [p for p in points if p.bound <= level]
    return min(good, key=lambda p: (getattr(p, cost), p.bound), default=None)
