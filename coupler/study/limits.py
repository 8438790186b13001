"""Where on the chart a scheme's longest stable windows lie, as a pilot run predicts them."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coupler.control.predict import limits
from coupler.outset import plan_of
from coupler.pilot import Prediction
from coupler.scenario import Scenario
from coupler.study.axes import PLAIN
from coupler.study.plan import Planned
from coupler.study.score import Point
from coupler.trials.trial import scenario_of

# Schemes whose limit is known.
KNOWN = ("staggered", "extrapolated")
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
        if (scheme := scenario.coupling.scheme.value) in KNOWN:
            factor = _size(shortest) * _factor(prediction, scenario, scheme)
            # fault: predicted limits at the wrong cost -> cost = math.exp(float(np.mean([math.log(f * c) for f, c in
            #   costs]))) * factor | coupler/test_study_run
            cost = math.exp(float(np.mean([math.log(f * c) for f, c in costs]))) / factor
            found.append(Limit(series, factor, cost))
    return found


def _size(run: Planned) -> float:
    return float(run.cell.at.get("windows", math.nan))


def _factor(prediction: Prediction, scenario: Scenario, scheme: str) -> float:
    schedule = plan_of(scenario).schedule
    ends = [schedule.clock.seconds(k) for k in schedule.bounds]

    def size(t: float) -> float:
        k = min(bisect.bisect_right(ends, t * (1 + 1e-9)), len(ends) - 1)
        return ends[k] - ends[k - 1]

    return min((getattr(limits(f, prediction.method), scheme) / size(f.t) for f in prediction.seen), default=math.inf)
