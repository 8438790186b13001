"""What a search has found out about a scenario, and which simplifications it accepts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from coupler.experiments.goals import Deviations, Goal, largest_ratio
from coupler.experiments.trial import TrialResult
from coupler.experiments.variants import Aspect, Edit, Simplification

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
