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
from coupler.study.plan import Planned
from coupler.study.score import Point

# Schemes whose limit is known.
KNOWN = ("staggered", "extrapolated")


@dataclass(frozen=True)
class Limit:
    """series : the curve it belongs to.  windows : the largest stable factor on the scenario's windows.

    half_solves : what a run with it costs.
    """

    series: str
    windows: float
    half_solves: float


def limits_of(prediction: Prediction, scenario: Scenario, runs: Sequence[Planned],
              points: Sequence[Point]) -> list[Limit]:
    """The limit of every curve that is a scheme over windows and nothing else.

    The factor is the least over the pilot's looks of limit/size of the scenario's own window at that time; its cost is
    read off the curve, along which cost goes as 1/factor.
    """
    found = []
    for series in dict.fromkeys(run.cell.series for run in runs):
        on = [(run, p) for run, p in zip(runs, points, strict=True) if run.cell.series == series]
        if any(set(run.cell.at) - {"scheme", "windows"} or "windows" not in run.cell.at for run, _ in on):
            continue
        scheme = str(on[0][0].cell.at.get("scheme", scenario.coupling.scheme.value))
        costs = [(float(run.cell.at["windows"]), p.half_solves) for run, p in on if not math.isnan(p.error)]
        if scheme not in KNOWN or not costs:
            continue
        factor = _factor(prediction, scenario, scheme)
        if math.isfinite(factor):
            cost = math.exp(float(np.mean([math.log(f * c) for f, c in costs]))) / factor
            found.append(Limit(series, factor, cost))
    return found


def _factor(prediction: Prediction, scenario: Scenario, scheme: str) -> float:
    schedule = plan_of(scenario).schedule
    ends = [schedule.clock.seconds(k) for k in schedule.bounds]

    def size(t: float) -> float:
        k = min(bisect.bisect_right(ends, t * (1 + 1e-9)), len(ends) - 1)
        return ends[k] - ends[k - 1]

    return min((getattr(limits(f, prediction.method), scheme) / size(f.t) for f in prediction.seen), default=math.inf)
