"""Up the ladder: the scene whole, without this and without that, then without all that can go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from statistics import median

from coupler.advise.coarse import CELLS, cells_of, mesh_factor, meshed, timed, watched, windows_factor
from coupler.advise.edit import Edit, at, edited
from coupler.advise.known import Known, Step, edits_of, picked
from coupler.advise.ladder import iterated, ladder
from coupler.advise.rung import Kind, Rung
from coupler.advise.trial import LateError, Trials, variant
from coupler.advise.weigh import goals_of, moves, share_of
from coupler.errors import CouplingError
from coupler.outset import plan_of
from coupler.trials.trial import StoppedError, Trial

# Kept back of the time there is, in runs of the base: for the combination and what may have to be put back into it.
RESERVE = 2.0
# Wall time a second of processor time takes at least, where others may come to use the machine.
SHARED = 2.0
HALF_MESH, HALF_WINDOWS = 0.5, 0.5
SHORT_WINDOWS = "windows half as long"
OWN_MESH = "the scenario's own mesh and windows"

Asked = Sequence[tuple[str, float, str]]
Tell = Callable[[str], Callable[[float], object]]


class Climb:
    """One climb.  known : what it has found up to now, also after it was stopped.

    trials : runs and keeps them, and knows the time there is.  tell : told the name of each trial before it runs,
    gives what is told its progress.  cells : most cells of a body in trials.
    """

    def __init__(self, trials: Trials, asked: Asked, tell: Tell, cells: int = CELLS) -> None:
        self._trials, self._asked, self._tell = trials, asked, tell
        self._tree = trials.document.tree
        mesh = min(mesh_factor(self._tree, cells), 1.0)
        plan = plan_of(variant(trials.document, []))
        count = len(plan.schedule.bounds) - 1 if plan.adaptive is None else 0
        self.known = Known(mesh=mesh, windows=windows_factor(count, mesh))

    def run(self) -> Known:
        """Climb, as far as time and Ctrl-C let.  Raises CouplingError where the scene itself cannot be run."""
        try:
            self._reference()
            self._ladder()
            self._combine()
        except (StoppedError, KeyboardInterrupt) as exc:
            self.known = replace(self.known, stopped=str(exc) or "stopped by Ctrl-C")
        return self.known

    def _reference(self) -> None:
        whole = self._trial("the scene whole", [])
        if whole.failed:
            raise CouplingError(f"the scene itself cannot be run on the mesh of the trials: {whole.failed}",
                                remedy="Give the trials more cells: --cells")
        self.known = replace(self.known, whole=whole, base=whole, goals=goals_of(self._asked, whole))
        top = self._trial("the scene whole, iterated", [iterated(self._tree)])
        if not top.failed:
            self.known = replace(self.known, top=top, exchange=moves(whole, top, self.known.goals))

    def _ladder(self) -> None:
        rungs = ladder(self._tree)
        for kinds in ((Kind.MECHANICS,), (Kind.HEAT,), (Kind.SCHEME,), (Kind.EFFECT,), (Kind.WINDOWS,)):
            for rung in (r for r in rungs if r.kind in kinds):
                if not (rung.deforms and any(r.rigid for r in self.known.ground)):
                    self._try(rung)
            self._settle(kinds[0])
        if self.known.mesh * max(n for n in self._cells()) > 2:
            self._try(Rung("half as many cells along an edge", Kind.MESH, mesh=HALF_MESH))
        self._guard()
        self._fine()

    def _settle(self, kind: Kind) -> None:
        """What is left of the ladder stands on the simplest mechanics and heat flow that will do."""
        if kind not in (Kind.MECHANICS, Kind.HEAT):
            return
        good = next((s for s in self.known.steps if s.rung.kind is kind and s.good), None)
        if good is not None:
            self.known = replace(self.known, ground=(*self.known.ground, good.rung), base=good.trial)

    def _try(self, rung: Rung) -> None:
        k = self.known
        ground = [] if rung.kind is Kind.MECHANICS else edits_of(k.ground)
        trial = self._in_time(rung.name, [*ground, rung.edit], rung.windows, rung.mesh)
        if trial is None or k.base is None:
            return
        against = k.reference if rung.kind is Kind.SCHEME and not k.ground else k.base
        found = {} if trial.failed else moves(trial, against, k.goals)
        self.known = replace(k, steps=(*k.steps, Step(rung, trial, k.base, found)))

    def _guard(self) -> None:
        """How far the windows of the trials are from short ones, their exchange agreed upon where that can be."""
        k = self.known
        if at(self._tree, ("coupling", "windows")) is None:
            return
        edits = edits_of(k.ground, iterated(self._tree) if k.top else None)
        long = self._in_time("windows as they are", edits)
        short = self._in_time(SHORT_WINDOWS, edits, windows=HALF_WINDOWS)
        if long and short and not long.failed and not short.failed:
            self.known = replace(k, guard=moves(long, short, k.goals))

    def _fine(self) -> None:
        """How far the mesh of the trials is from the scenario's own."""
        k = self.known
        if k.mesh == 1.0:
            return
        coarse = cells_of(edited(self._tree, [meshed(self._tree, k.mesh)]))
        dearer = k.windows * cells_of(self._tree) / coarse
        trial = self._in_time(OWN_MESH, edits_of(k.ground), 1 / k.windows, 1 / k.mesh, dearer)
        if trial and k.base and not trial.failed:
            self.known = replace(k, fine=moves(k.base, trial, k.goals))

    def _combine(self) -> None:
        """Run the combination; what moves most is put back until it stays inside the tolerances."""
        out: list[Rung] = []
        iterate = share_of(self.known.exchange) > 1.0
        while True:
            taken = picked(self.known, out)
            # A scheme that is near enough alone is not to be iterated.
            dear = iterate and not any(r.kind is Kind.SCHEME for r in taken)
            windows, mesh = _factor(taken, Kind.WINDOWS), _factor(taken, Kind.MESH)
            edits = edits_of(taken, iterated(self._tree) if dear else None)
            trial = self._trial("the combination", edits, windows, mesh)
            final = {} if trial.failed else moves(trial, self.known.reference, self.known.goals)
            self.known = replace(self.known, taken=taken, iterate=dear, combined=trial, final=final)
            if self.known.final_share <= 1.0 or not taken:
                return
            out.append(max((s for s in self.known.steps if s.rung in taken), key=lambda s: s.share).rung)

    def _in_time(self, name: str, edits: Sequence[Edit], windows: float = 1.0, mesh: float = 1.0,
                 dearer: float = 1.0) -> Trial | None:
        """One trial; None where there is no time for it, which is remembered.  dearer : than the base."""
        k = self.known
        done = [t for t in (k.whole, k.top, *(s.trial for s in k.steps)) if t and not t.failed]
        # The first run on a machine compiles for minutes: the quickest start tells what another one takes.
        start = min((t.wall - t.processor for t in done), default=0.0)
        # Where others use the machine too, as much as they did until now.
        slow = median([t.seconds / t.processor for t in done if t.processor > 0.0] or [SHARED])
        need = start + (dearer + RESERVE) * max(slow, SHARED) * (k.base.processor if k.base else 0.0)
        try:
            return self._trial(name, edits, windows, mesh, need)
        except LateError:
            self.known = replace(self.known, untried=(*self.known.untried, name))
            return None

    def _trial(self, name: str, edits: Sequence[Edit], windows: float = 1.0, mesh: float = 1.0,
               need: float = 0.0) -> Trial:
        """One trial; windows, mesh : factors on those of the trials.  need [s]: as Trials.run has it."""
        k = self.known
        # Pairs, ranges and bodies are those of the scenario as edited: an edit may take some out.
        tree = edited(self._tree, edits)
        return self._trials.run([*edits, meshed(tree, k.mesh * mesh), timed(tree, k.windows * windows), watched(tree)],
                                lambda: self._tell(name), need)

    def _cells(self) -> list[int]:
        """Cells along the longer edge of every body that can be coarsened."""
        found = (at(body, ("mesh", "rectangle", "cells")) for body in self._tree["bodies"].values())
        return [max(n) for n in found if n is not None] or [0]


def _factor(rungs: Sequence[Rung], kind: Kind) -> float:
    return next((r.windows if kind is Kind.WINDOWS else r.mesh for r in rungs if r.kind is kind), 1.0)
