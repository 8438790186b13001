"""What an advice is asked for: goals, and how far one trial deviates from another in them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from contact.problem.values import did_you_mean
from coupler.errors import ScenarioError
from coupler.experiments.trial import TrialResult
from coupler.experiments.variants import OWN
from coupler.record.results import UNITS

Array = NDArray[np.float64]

DEFAULT_TOLERANCE = 0.01  # of its range, where no tolerance is given
# A range below this is that of a quantity at rest: [SI] by unit, about what a solver leaves.
STILL = {"K": 1e-2, "m": 1e-9, "Pa": 1e3, "1": 1e-3}
_TOLERANCE = re.compile(r"\s*([-+.0-9eE]+)\s*([%A-Za-z]*)\s*")


@dataclass(frozen=True)
class GoalRequest:
    """A goal as the user wrote it.  pattern : of probe names.  unit : "" is SI, "%" is of the range."""

    pattern: str
    tolerance: float
    unit: str


@dataclass(frozen=True)
class Goal:
    """A probe and its tolerance [SI].  scale : its range [SI].  unit : of both."""

    probe: str
    tolerance: float
    scale: float
    unit: str


@dataclass(frozen=True)
class Deviation:
    """How far a probe is off.

    largest : of |difference| over time [SI].  when : at what time [s].  peak : change of the largest value [SI].
    ratio : the largest in tolerances.
    """

    largest: float
    when: float
    peak: float
    ratio: float


Deviations = Mapping[str, Deviation]  # by probe


def parse_goal(text: str) -> GoalRequest:
    """Read a goal such as `lower.top.*=1K`.  Raises ScenarioError for another form, sign or unit."""
    probe, equals, tolerance = text.rpartition("=")
    match = _TOLERANCE.fullmatch(tolerance)
    try:
        number = float(match[1]) if match else math.nan
    except ValueError:
        number = math.nan
    if not equals or not probe.strip() or match is None or not 0.0 < number < math.inf:
        raise ScenarioError("a goal is PROBE=TOLERANCE, with a tolerance greater than zero", key="--for", value=text,
                            remedy="For example --for lower.top.centre=1K, or --for 'lower.*=0.5%'")
    if match[2] not in ("", "%", *UNITS):
        raise ScenarioError("no such unit", key="--for", value=match[2], remedy=f"One of %, {', '.join(UNITS)}.")
    return GoalRequest(probe.strip(), number, match[2])


def goals_of(requests: Sequence[GoalRequest], full: TrialResult) -> tuple[Goal, ...]:
    """Resolve the requests by the probes of the full model; without any, every probe within 1 % of its range.

    Where several requests name a probe the last one holds.  Raises ScenarioError for unknown probes and wrong units.
    """
    own = [name for name in full.probes if not name.startswith(OWN)]
    if not own:
        raise ScenarioError("the scenario has no probe, so no deviation can be measured", key="probes",
                            remedy="Add probes of what the scene is about.")
    goals: dict[str, Goal] = {}
    for request in requests or (GoalRequest("*", 100 * DEFAULT_TOLERANCE, "%"),):
        pattern = request.pattern
        named = [name for name in own if name == pattern] or [n for n in own if fnmatchcase(n, pattern)]
        if not named:
            raise ScenarioError("no such probe", key="--for", value=pattern, remedy=did_you_mean(pattern, own))
        goals |= {name: _goal(name, request, full) for name in named}
    return tuple(goals.values())


def _goal(name: str, request: GoalRequest, full: TrialResult) -> Goal:
    own, scale, unit = full.units[name], range_of(name, full), request.unit
    if unit == "%":
        return Goal(name, request.tolerance / 100 * scale, scale, own)
    factor = UNITS[unit][0] if unit else 1.0
    if unit and {"degC": "K", "K": "K"}.get(unit, unit[-1] if unit != "Pa" else "Pa") != own and not (
            own == "Pa" and unit.endswith("Pa")):
        raise ScenarioError(f"{name} is in {own}", key="--for", value=unit, remedy=f"Give the tolerance in {own}.")
    return Goal(name, request.tolerance / factor, scale, own)


def range_of(name: str, trial: TrialResult) -> float:
    """Return the range of a probe over the run [SI]; of one at rest the largest range of its unit, at least STILL."""
    unit = trial.units[name]
    still = STILL.get(unit, 0.0)
    size = float(np.ptp(trial.probes[name]))
    if size > still:
        return size
    return max(still, *(float(np.ptp(v)) for n, v in trial.probes.items() if trial.units[n] == unit))


def compare(one: TrialResult, other: TrialResult, goals: Iterable[Goal]) -> dict[str, Deviation]:
    """Measure how far `one` is from `other`, by probe, at the window ends of the one that has fewer.

    Where one run ended early, up to its end.  A probe that one of them lacks deviates by infinity.
    """
    deviations = {}
    for goal in goals:
        if goal.probe not in one.probes or goal.probe not in other.probes:
            deviations[goal.probe] = Deviation(math.inf, 0.0, math.inf, math.inf)
            continue
        t, a, b = at_common_times(one, other, goal.probe)
        # fault: advice: a move downwards is none -> off = np.maximum(a - b, 0.0) | coupler/test_advise
        off = np.abs(a - b)
        k = int(off.argmax())
        deviations[goal.probe] = Deviation(float(off[k]), float(t[k]), float(a.max() - b.max()),
                                           float(off[k]) / goal.tolerance)
    return deviations


def at_common_times(one: TrialResult, other: TrialResult, probe: str) -> tuple[Array, Array, Array]:
    """Return (t, values of one, values of other), (n,) each, t [s] and values in SI, linear between window ends."""
    t1, t2 = np.asarray(one.t), np.asarray(other.t)
    t = min((t1, t2), key=len)
    t = t[t <= min(t1[-1], t2[-1]) * (1 + 1e-12)]
    return t, np.interp(t, t1, one.probes[probe]), np.interp(t, t2, other.probes[probe])


def largest_ratio(deviations: Deviations) -> float:
    """Return the largest deviation of all probes, in tolerances."""
    return max((d.ratio for d in deviations.values()), default=0.0)


def worst_probe(deviations: Deviations) -> str:
    """Return the probe that deviates most, in tolerances."""
    return max(deviations, key=lambda name: deviations[name].ratio)
