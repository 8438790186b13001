"""Up the ladder: the scene whole, without this and without that, then without all that can go."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray

from coupler.errors import CouplingError, ScenarioError
from coupler.experiments.trial import Job, StoppedError, Store, Trial, key_of, scenario_of, sources, tried
from coupler.experiments.variants import (
    CELLS,
    OWN,
    Edit,
    Kind,
    Rung,
    at,
    cells_of,
    edited,
    iterated,
    ladder,
    mesh_factor,
    meshed,
    timed,
    watched,
    windows_factor,
)
from coupler.record.results import UNITS
from coupler.running.setup import plan_of
from coupler.scenario import Scenario
from coupler.scenario.document import Document, did_you_mean

# How far one trial is from another, in the quantities that were asked for.

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


# What is known of a scene at some time of a climb.

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


# The trials of a climb: variants of the scenario, each run once while there is time.

class LateError(Exception):
    """A trial was not begun, because it would hardly end in time."""


def variant(document: Document, edits: Sequence[Edit]) -> Scenario:
    """The scenario with edits, as a trial runs it.  Raises ScenarioError for what cannot be."""
    return scenario_of(Job(document.text, str(document.path), edited(document.tree, edits)))


class Trials:
    """Runs trials and keeps them in a folder.

    deadline : of time.monotonic(); a trial that is not done by then is stopped.
    """

    def __init__(self, document: Document, folder: Path, deadline: float = float("inf")) -> None:
        self.document = document
        self.deadline = deadline
        self._store = Store(folder)
        self._sources = sources()

    def run(self, edits: Sequence[Edit], begin: Callable[[], Callable[[float], object]], need: float = 0.0) -> Trial:
        """The trial of these edits, run or remembered.

        begin : called before it runs, gives what is told the share that is done.  need : time it will take [s].
        What cannot be run, or fails, is a trial too.  Raises LateError where there is not so much time, StoppedError,
        ResultsError where it cannot be kept.
        """
        try:
            scenario = variant(self.document, edits)
        except ScenarioError as exc:
            return Trial(f"{exc.key}: {exc.message}" if exc.key else exc.message)
        key = key_of(scenario, self._sources)
        if (kept := self._store.get(key)) is not None:
            return kept
        if (left := self.deadline - time.monotonic()) <= 0.0:
            raise StoppedError("time is up")
        if need > left:
            raise LateError
        done = tried(scenario, self.deadline, begin())
        # fault: advice: trials are not kept -> pass | scenarios/test_advise
        self._store.put(key, done)
        return done


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
