"""Measures error against cost: the error of each run, the Pareto pareto_front, the cheapest run within an error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from coupler.errors import ScenarioError
from coupler.experiments.reference import Array, ReferenceSolution
from coupler.experiments.trial import TrialResult
from coupler.scenario.document import did_you_mean

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
    floor : the reference's own error, nan where that is unknown.  by_probe : probe -> error.
    """

    label: str
    series: str
    solver_calls: int
    seconds: float
    error: float
    floor: float
    message: str = ""
    by_probe: Mapping[str, float] | None = None

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
    return Point(label, series, run.solver_calls, run.seconds, worst, scale.floor, message, errors)


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
