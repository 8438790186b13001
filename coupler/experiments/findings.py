"""What an advice is asked for and what its search has found: goals, deviations, simplifications that are accepted."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from contact.problem.values import did_you_mean
from coupler.errors import ScenarioError
from coupler.experiments.trial import TrialResult
from coupler.experiments.variants import OWN, Aspect, Edit, Simplification
from coupler.record.results import UNITS

Array = NDArray[np.float64]


# What an advice is asked for: goals, and how far one trial deviates from another in them.

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


def own_probes(names: Iterable[str]) -> list[str]:
    """Return the probes that a scenario states.  Raises ScenarioError where there is none."""
    own = [name for name in names if not name.startswith(OWN)]
    if not own:
        raise ScenarioError("the scenario has no probe, so no deviation can be measured", key="probes",
                            remedy="Add probes of what the scene is about.")
    return own


def goals_of(requests: Sequence[GoalRequest], full: TrialResult) -> tuple[Goal, ...]:
    """Resolve the requests by the probes of the full model; without any, every probe within 1 % of its range.

    Where several requests name a probe the last one holds.  Raises ScenarioError for unknown probes and wrong units.
    """
    own = own_probes(full.probes)
    goals: dict[str, Goal] = {}
    for request in requests or (GoalRequest("*", 100 * DEFAULT_TOLERANCE, "%"),):
        goals |= {name: _goal(name, request, full) for name in named(request.pattern, own)}
    return tuple(goals.values())


def named(pattern: str, probes: Iterable[str]) -> list[str]:
    """Return the probes that a pattern names.  Raises ScenarioError where there is none."""
    own = list(probes)
    found = [name for name in own if name == pattern] or [n for n in own if fnmatchcase(n, pattern)]
    if not found:
        raise ScenarioError("no such probe", key="--for", value=pattern, remedy=did_you_mean(pattern, own))
    return found


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


# What a search has found out about a scenario, and which simplifications it accepts.

# A simpler physics is accepted unless it costs this much more; a larger window or another scheme if it saves this
# much: of the solver calls.
MAX_EXTRA_COST, MIN_SAVING = 0.05, 0.02


@dataclass(frozen=True)
class SimplificationTrial:
    """A simplification that was tried.

    base : the trial it is compared with for cost.  deviations : from `base` (a scheme: from the iterated model); {}
    where the trial failed.
    """

    simplification: Simplification
    trial: TrialResult
    base: TrialResult
    deviations: Deviations = field(default_factory=dict)

    @property
    def ratio(self) -> float:
        """Largest deviation in tolerances; infinite where the trial failed."""
        return largest_ratio(self.deviations) if self.deviations else float("inf")

    @property
    def saving(self) -> float:
        """Fraction of the solver calls that it saves."""
        return 1.0 - self.trial.solver_calls / max(self.base.solver_calls, 1)

    @property
    def acceptable(self) -> bool:
        """Whether it is within the tolerances and no more expensive; a coarser mesh always saves."""
        simplification = self.simplification
        cheaper = simplification.removes_physics or simplification.aspect is Aspect.MESH
        least = -MAX_EXTRA_COST if cheaper else MIN_SAVING
        # fault: advice: what moves too far is taken -> return self.saving >= least | coupler/test_advise
        return self.ratio <= 1.0 and self.saving >= least


@dataclass(frozen=True)
class Findings:
    """The findings of a search so far; deviations are {} where they are not measured yet.

    mesh, windows : factors of the trials on the scenario's cells along an edge and on its windows.
    full : the scenario as written, on the mesh and windows of the trials.  iterated : the same, iterated.
    coupling_error : of `full` from `iterated`, {} where the scenario cannot be iterated.
    window_error : of the base, iterated if it can be, from itself in windows half as long.
    base : what effects are tried on, with `base_simplifications`.
    mesh_error : of `base` from the same on the scenario's own mesh and windows.
    accepted : simplifications of the combination.  iterate : it iterates though the scenario does not.
    combined : its trial.  combined_error : of `combined` from `iterated`.
    stopped : why the search ended early.  untried : names of trials for which there was no time.
    """

    goals: tuple[Goal, ...] = ()
    mesh: float = 1.0
    windows: float = 1.0
    full: TrialResult | None = None
    iterated: TrialResult | None = None
    coupling_error: Deviations = field(default_factory=dict)
    window_error: Deviations = field(default_factory=dict)
    base: TrialResult | None = None
    base_simplifications: tuple[Simplification, ...] = ()
    mesh_error: Deviations = field(default_factory=dict)
    trials: tuple[SimplificationTrial, ...] = ()
    accepted: tuple[Simplification, ...] = ()
    iterate: bool = False
    combined: TrialResult | None = None
    combined_error: Deviations = field(default_factory=dict)
    stopped: str = ""
    untried: tuple[str, ...] = ()

    @property
    def own_mesh(self) -> bool:
        """Whether the advice keeps the scenario's mesh and windows: a coarser mesh errs too much, or by an unknown
        amount."""
        return self.mesh == 1.0 or largest_ratio(self.mesh_error) > 1.0 or not self.mesh_error

    @property
    def mesh_factor(self) -> float:
        """Factor on the cells along an edge of the advised scenario."""
        # fault: advice: the mesh of the trials is told for the scenario's own -> if False: | coupler/test_advise
        if self.own_mesh and self.mesh < 1.0:
            return 1.0
        factor = self.mesh
        for simplification in self.accepted:
            factor *= simplification.mesh
        return factor

    @property
    def windows_factor(self) -> float:
        """Factor on the windows of the advised scenario: a coarse mesh takes the windows of the trials with it."""
        if self.own_mesh and self.mesh < 1.0:
            return 1.0
        factor = self.windows
        for simplification in self.accepted:
            factor *= simplification.windows
        return factor

    @property
    def reference(self) -> TrialResult:
        """The trial that all others are compared with."""
        trial = self.iterated or self.full
        assert trial is not None, "asked for after the first trial only"
        return trial

    @property
    def combined_ratio(self) -> float:
        """Largest deviation of the combination, in tolerances; that of a coarser mesh is added, at worst."""
        if not self.combined_error:
            return float("inf")
        coarse = {} if self.own_mesh else self.mesh_error
        # fault: advice: the mesh is not counted -> return max(d.ratio for n, d in self.combined_error.items()) |
        #   coupler/test_advise
        return max(d.ratio + (coarse[n].ratio if n in coarse else 0.0) for n, d in self.combined_error.items())


def combination_of(findings: Findings, rejected: Sequence[Simplification] = ()) -> tuple[Simplification, ...]:
    """Choose what the combination simplifies, without those `rejected`.

    All effects that are acceptable; of every other aspect the first one, of windows the longest.
    """
    good = [t.simplification for t in findings.trials if t.acceptable and t.simplification not in rejected]
    # fault: advice: windows tried on a coarse mesh go with a fine one -> if False: | coupler/test_advise
    if findings.own_mesh and findings.mesh < 1.0:
        # Tried on a coarser mesh, where windows may be longer.
        good = [s for s in good if s.aspect not in (Aspect.MESH, Aspect.WINDOWS)]
    chosen: dict[object, Simplification] = {}
    for simplification in good:
        one_only = simplification if simplification.aspect is Aspect.EFFECT else simplification.aspect
        if simplification.aspect is Aspect.WINDOWS or one_only not in chosen:
            chosen[one_only] = simplification
    rigid = any(s.rigid for s in chosen.values())
    return tuple(s for s in chosen.values() if not (rigid and s.needs_deformation))


def edits_of(simplifications: Sequence[Simplification], iterate: Edit | None = None) -> list[Edit]:
    """Collect the edits of the models; mesh and windows are changed by factors instead."""
    return [*([iterate] if iterate else []), *(s.edit for s in simplifications)]
