"""What is known of a scene at some time of a climb."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from coupler.advise.edit import Edit
from coupler.advise.rung import Kind, Rung
from coupler.advise.weigh import Goal, Moves, share_of
from coupler.trials.trial import Trial

# Physics is left out unless a run then takes this much more; a number is changed if that saves this much: half-solves.
DEARER, WORTH = 0.05, 0.02


@dataclass(frozen=True)
class Step:
    """A rung that was tried.  moves : by it, from `base` (a scheme: from the top); {} where it failed."""

    rung: Rung
    trial: Trial
    base: Trial
    moves: Moves = field(default_factory=dict)

    @property
    def share(self) -> float:
        """Farthest move in tolerances; infinite where it failed."""
        return share_of(self.moves) if self.moves else float("inf")

    @property
    def saves(self) -> float:
        """Share of the half-solves that it saves."""
        return 1.0 - self.trial.half_solves / max(self.base.half_solves, 1)

    @property
    def good(self) -> bool:
        """Whether it stays inside the tolerances and is worth it; a coarser mesh always saves."""
        least = -DEARER if self.rung.simpler or self.rung.kind is Kind.MESH else WORTH
        # fault: advice: what moves too far is taken -> return self.saves >= least | coupler/test_advise
        return self.share <= 1.0 and self.saves >= least


@dataclass(frozen=True)
class Known:
    """whole : the scene as written, on the mesh and windows of the trials; top : the same iterated.

    mesh, windows : factors of the trials.  exchange : move of `whole` from `top`, {} where the scene cannot iterate.
    guard : move of the base, iterated if it can be, from itself in windows half as long.  base : what effects were
    tried on, with `ground` left out.  fine : move of `base` from the scenario's own mesh and windows.
    taken : what the combination leaves out; iterate : whether it iterates though the scene does not; final : its
    move from `top`; all {} where not known.  stopped : why it ended early.  untried : for lack of time.
    """

    goals: tuple[Goal, ...] = ()
    mesh: float = 1.0
    windows: float = 1.0
    whole: Trial | None = None
    top: Trial | None = None
    exchange: Moves = field(default_factory=dict)
    guard: Moves = field(default_factory=dict)
    base: Trial | None = None
    ground: tuple[Rung, ...] = ()
    fine: Moves = field(default_factory=dict)
    steps: tuple[Step, ...] = ()
    taken: tuple[Rung, ...] = ()
    iterate: bool = False
    combined: Trial | None = None
    final: Moves = field(default_factory=dict)
    stopped: str = ""
    untried: tuple[str, ...] = ()

    @property
    def own_mesh(self) -> bool:
        """Whether the advice keeps the scenario's mesh, and so its windows: a coarser one moves too much, or nobody
        knows."""
        return self.mesh == 1.0 or share_of(self.fine) > 1.0 or not self.fine

    @property
    def factors(self) -> tuple[float, float]:
        """(on cells along an edge, on windows) of the advised scenario: a coarse mesh takes the windows of the trials
        with it, the scenario's own mesh keeps its own."""
        # fault: advice: the mesh of the trials is told for the scenario's own -> if False: | coupler/test_advise
        if self.own_mesh and self.mesh < 1.0:
            return 1.0, 1.0
        mesh, windows = self.mesh, self.windows
        for rung in self.taken:
            mesh, windows = mesh * rung.mesh, windows * rung.windows
        return mesh, windows

    @property
    def reference(self) -> Trial:
        """What all is held against."""
        found = self.top or self.whole
        assert found is not None, "asked after the first trial only"
        return found

    @property
    def final_share(self) -> float:
        """Farthest move of the combination, and of its mesh where that is coarser, one after the other at most."""
        if not self.final:
            return float("inf")
        coarse = {} if self.own_mesh else self.fine
        # fault: advice: the mesh is not counted -> return max(m.share for n, m in self.final.items()) |
        #   coupler/test_advise
        return max(m.share + (coarse[n].share if n in coarse else 0.0) for n, m in self.final.items())


def picked(known: Known, out: Sequence[Rung] = ()) -> tuple[Rung, ...]:
    """What the combination leaves out: of each kind but effects the first (of windows the longest) that is good;
    without those that are `out`."""
    good = [s.rung for s in known.steps if s.good and s.rung not in out]
    # fault: advice: windows tried on a coarse mesh go with a fine one -> if False: | coupler/test_advise
    if known.own_mesh and known.mesh < 1.0:
        # Tried on a coarser mesh, where windows may be longer.
        good = [r for r in good if r.kind not in (Kind.MESH, Kind.WINDOWS)]
    chosen: dict[object, Rung] = {}
    for rung in good:
        one_only = rung if rung.kind is Kind.EFFECT else rung.kind
        if rung.kind is Kind.WINDOWS or one_only not in chosen:
            chosen[one_only] = rung
    rigid = any(r.rigid for r in chosen.values())
    return tuple(r for r in chosen.values() if not (rigid and r.deforms))


def edits_of(rungs: Sequence[Rung], iterate: Edit | None = None) -> list[Edit]:
    """Of the models; not of mesh and windows, which go by factors."""
    return [*([iterate] if iterate else []), *(r.edit for r in rungs)]
