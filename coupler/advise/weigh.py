"""How far one trial is from another, in the quantities that were asked for."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from coupler.advise.coarse import OWN
from coupler.errors import ScenarioError
from coupler.record.results import UNITS
from coupler.scenario.quantity import did_you_mean
from coupler.trials.trial import Trial

Array = NDArray[np.float64]

SHARE = 0.01  # of its range, where no tolerance is given
# A range below this is that of a quantity at rest: [SI] by unit, about what a solver leaves.
STILL = {"K": 1e-2, "m": 1e-9, "Pa": 1e3, "1": 1e-3}
_TOLERANCE = re.compile(r"\s*([-+.0-9eE]+)\s*([%A-Za-z]*)\s*")


@dataclass(frozen=True)
class Goal:
    """A probe and how far it may move [SI].  scale : its range, of which the tolerance may be a share [SI]."""

    probe: str
    tolerance: float
    scale: float
    unit: str


@dataclass(frozen=True)
class Move:
    """largest : of |difference| over time [SI], and when [s].  peak : change of the largest value [SI].

    share : the largest in tolerances.
    """

    largest: float
    when: float
    peak: float
    share: float


Moves = Mapping[str, Move]  # by probe


def parse_goal(text: str) -> tuple[str, float, str]:
    """(pattern, number, unit) of `lower.top.*=1K`; unit "" is SI, "%" of the range.  Raises ScenarioError."""
    probe, equals, tolerance = text.rpartition("=")
    found = _TOLERANCE.fullmatch(tolerance)
    try:
        number = float(found[1]) if found else math.nan
    except ValueError:
        number = math.nan
    if not equals or not probe.strip() or found is None or not 0.0 < number < math.inf:
        raise ScenarioError("what matters is PROBE=TOLERANCE, a tolerance greater than zero", key="--for", value=text,
                            remedy="For example --for lower.top.centre=1K, or --for 'lower.*=0.5%'")
    if found[2] not in ("", "%", *UNITS):
        raise ScenarioError("no such unit", key="--for", value=found[2], remedy=f"One of %, {', '.join(UNITS)}.")
    return probe.strip(), number, found[2]


def goals_of(asked: Sequence[tuple[str, float, str]], full: Trial) -> tuple[Goal, ...]:
    """The goals; where nothing is asked, 1 % of its range of every probe of the scenario.

    Of several that name a probe the last holds.  Raises ScenarioError.
    """
    own = [name for name in full.probes if not name.startswith(OWN)]
    if not own:
        raise ScenarioError("the scenario has no probe, so nothing can be told to move", key="probes",
                            remedy="Add probes of what the scene is about.")
    goals: dict[str, Goal] = {}
    for pattern, number, unit in asked or (("*", 100 * SHARE, "%"),):
        named = [name for name in own if name == pattern] or [n for n in own if fnmatchcase(n, pattern)]
        if not named:
            raise ScenarioError("no such probe", key="--for", value=pattern, remedy=did_you_mean(pattern, own))
        goals |= {name: _goal(name, number, unit, full) for name in named}
    return tuple(goals.values())


def _goal(name: str, number: float, unit: str, full: Trial) -> Goal:
    own, scale = full.units[name], range_of(name, full)
    if unit == "%":
        return Goal(name, number / 100 * scale, scale, own)
    factor = UNITS[unit][0] if unit else 1.0
    if unit and {"degC": "K", "K": "K"}.get(unit, unit[-1] if unit != "Pa" else "Pa") != own and not (
            own == "Pa" and unit.endswith("Pa")):
        raise ScenarioError(f"{name} is in {own}", key="--for", value=unit, remedy=f"Give the tolerance in {own}.")
    return Goal(name, number / factor, scale, own)


def range_of(name: str, trial: Trial) -> float:
    """Of a probe over the run [SI]; of one at rest, the largest of all in its unit, or what a solver leaves."""
    unit = trial.units[name]
    still = STILL.get(unit, 0.0)
    found = float(np.ptp(trial.probes[name]))
    if found > still:
        return found
    return max(still, *(float(np.ptp(v)) for n, v in trial.probes.items() if trial.units[n] == unit))


def moves(one: Trial, other: Trial, goals: Iterable[Goal]) -> dict[str, Move]:
    """How far `one` is from `other`, by probe, at the window ends of the one that has fewer.

    Where one run ended early, up to there.  A probe that one of them has not moves by infinity.
    """
    found = {}
    for goal in goals:
        if goal.probe not in one.probes or goal.probe not in other.probes:
            found[goal.probe] = Move(math.inf, 0.0, math.inf, math.inf)
            continue
        t, a, b = both(one, other, goal.probe)
        # fault: advice: a move downwards is none -> off = np.maximum(a - b, 0.0) | coupler/test_advise
        off = np.abs(a - b)
        k = int(off.argmax())
        found[goal.probe] = Move(float(off[k]), float(t[k]), float(a.max() - b.max()), float(off[k]) / goal.tolerance)
    return found


def both(one: Trial, other: Trial, probe: str) -> tuple[Array, Array, Array]:
    """(t, values of one, values of other) : (n,) each, at common times, linear between window ends."""
    t1, t2 = np.asarray(one.t), np.asarray(other.t)
    t = min((t1, t2), key=len)
    t = t[t <= min(t1[-1], t2[-1]) * (1 + 1e-12)]
    return t, np.interp(t, t1, one.probes[probe]), np.interp(t, t2, other.probes[probe])


def share_of(found: Moves) -> float:
    """The worst of all, in tolerances."""
    return max((m.share for m in found.values()), default=0.0)


def worst(found: Moves) -> str:
    """The probe that moves farthest, in tolerances."""
    return max(found, key=lambda name: found[name].share)


def added(one: Moves, other: Moves) -> float:
    """The worst share of two moves one after the other, at most."""
    return max((one[n].share + (other[n].share if n in other else 0.0) for n in one), default=0.0)
