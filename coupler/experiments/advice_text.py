"""What a climb has found, in words."""

from __future__ import annotations

import math
from collections.abc import Iterator
from textwrap import shorten

import numpy as np

from coupler.advise.amount import amount, of_range, percent
from coupler.advise.known import Known, Step
from coupler.advise.misses import misses
from coupler.advise.rung import Kind, Rung
from coupler.advise.weigh import Goal, Moves, share_of, worst
from coupler.trials.trial import Trial

HEADS = {Kind.MECHANICS: "mechanics", Kind.HEAT: "heat flow", Kind.SCHEME: "exchange", Kind.EFFECT: "effects",
         Kind.WINDOWS: "windows", Kind.MESH: "mesh"}
REASON = 120  # letters of why a trial failed
NONE = Rung("", Kind.EFFECT)
# A move below this share of a quantity's range is no move.
NOTHING = 1e-6
# Seconds of runs shorter than this [s] tell nothing, and of others nothing nearer than this share.
SHORTEST, NOISE = 0.5, 0.05
RESTS = 0.5  # a probe whose own range is less than this of that which counts


def summary(known: Known) -> list[str]:
    """What was asked, what is advised, what it would miss."""
    return [*_asked(known), *_end(known, ""), *_left(known)]


def advice(known: Known, written: str = "") -> list[str]:
    """Every line of it.  written : the file of the advised scenario; empty where none was written."""
    if known.whole is None:
        return [f"nothing is known: {known.stopped}"] if known.stopped else []
    return [*_asked(known), *_exchange(known), *_rungs(known), *_errors(known), *_left(known), *_end(known, written)]


def _asked(known: Known) -> Iterator[str]:
    whole = known.whole
    assert whole is not None
    for goal in known.goals:
        rests = float(np.ptp(whole.probes[goal.probe])) < RESTS * goal.scale
        own = "it hardly changes; taken for its range" if rests else "it has a range of"
        yield f"asked: {goal.probe} within {amount(goal.tolerance, goal.unit)} ({own} {amount(goal.scale, goal.unit)})"
    yield f"the scene whole: {cost(whole)}{_coarse(known)}"


def _coarse(known: Known) -> str:
    if known.mesh == 1.0:
        return ""
    longer = f", windows {known.windows:g} times as long" if known.windows > 1.0 else ""
    return f", on a mesh of {known.mesh:.2g} times the cells along an edge{longer}"


def cost(trial: Trial) -> str:
    """Half-solves and seconds of processor time."""
    return f"{trial.half_solves} half-solves, {trial.processor:.2g} s of processor time"


def _exchange(known: Known) -> Iterator[str]:
    if known.top is None:
        yield "it cannot iterate, so the error of its exchange is not known"
    elif known.whole is not None and known.top.scenario == known.whole.scenario:
        yield "it iterates already"
    elif known.whole is not None:
        yield (f"iterated: moves {said(known.exchange, known.goals)} and takes "
               f"{_times(known.top.half_solves, known.whole.half_solves)} the half-solves: "
               + ("iterate" if share_of(known.exchange) > 1.0 else "once a window is enough"))


def _rungs(known: Known) -> Iterator[str]:
    head = None
    for step in known.steps:
        if step.rung.kind is not head:
            head = step.rung.kind
            on = f" (on {' and '.join(r.name for r in known.ground)})" if head is Kind.EFFECT and known.ground else ""
            yield f"{HEADS[head]}{on}:"
        yield f"  {_rung(step, known)}"


def _rung(step: Step, known: Known) -> str:
    name = step.rung.name
    if step.trial.failed:
        return f"{name}: cannot be tried ({shorten(step.trial.failed, REASON, placeholder=' ...')})"
    moved = said(step.moves, known.goals)
    if step.rung.kind is Kind.EFFECT:
        return f"{name} moves {moved} and {_costs(step)}: {'leave it out' if step.good else _needed(step)}"
    return f"{name}: moves {moved} and {_saves(step)}: {'enough' if step.good else _needed(step, 'not enough')}"


def _needed(step: Step, otherwise: str = "needed") -> str:
    return otherwise if step.share > 1.0 else "it saves nothing" if not step.rung.simpler else "dearer without it"


def _costs(step: Step) -> str:
    """What an effect costs, of a scene with it."""
    found = [f"{percent(share)} of the {what}" for share, what in (
        (step.saves, "half-solves"), (_time_saved(step), "time")) if share > 0.0]
    return f"costs {', '.join(found)}" if found else "costs next to nothing"


def _saves(step: Step) -> str:
    return _costs(step).replace("costs", "saves", 1)


def _time_saved(step: Step) -> float:
    """Share of the processor time; 0 where that tells nothing."""
    share = 1.0 - step.trial.processor / step.base.processor if step.base.processor > SHORTEST else 0.0
    return share if share > NOISE else 0.0


def _errors(known: Known) -> Iterator[str]:
    if known.guard:
        yield f"windows half as long move {said(known.guard, known.goals)}" + (
            ": the windows are too long for what is asked, and nothing above is better than that"
            if share_of(known.guard) > 1.0 else "")
    if known.fine:
        yield f"the scenario's own mesh and windows move {said(known.fine, known.goals)}: " + (
            "they are needed" if share_of(known.fine) > 1.0 else "the mesh of the trials is enough")
    elif known.mesh < 1.0:
        yield "the scenario's own mesh was not run, so it stays as written"


def _left(known: Known) -> Iterator[str]:
    """What was not asked for and goes missing."""
    told = [r for r in known.taken if r.misses]
    if not told or known.combined is None:
        return
    yield "what it would miss:"
    for rung in told:
        yield f"  {rung.name}: {rung.misses}"
    for line in misses(known):
        yield f"  {line}"


def _end(known: Known, written: str) -> Iterator[str]:
    for name in known.untried:
        yield f"not tried, for lack of time: {name}"
    if known.stopped:
        yet = "" if known.combined else "nothing is advised yet; "
        yield f"{known.stopped}; {yet}what is known is kept, and the same command goes on"
    if known.combined is None or known.whole is None:
        return
    if known.final_share > 1.0:
        why = known.combined.failed or f"it moves {said(known.final, known.goals)}"
        yield f"no scenario inside the tolerances was found: {why}"
        return
    yield f"advised: {together(known)}"
    yield _size(known)
    mesh = "" if known.own_mesh or known.mesh == 1.0 else " with the mesh"
    who = "all at once it" if len(known.taken) + known.iterate > 1 else "it"
    yield (f"{who} moves {said(known.final, known.goals)}, {known.final_share:.2g} of the tolerance{mesh}, "
           f"and {_saves(Step(NONE, known.combined, known.whole))}: {cost(known.combined)}")
    if written:
        yield f"written to {written}"


def _size(known: Known) -> str:
    """Mesh and windows of the advised scenario, and why they are no coarser."""
    mesh, windows = known.factors
    cells = "the scenario's own mesh" if mesh == 1.0 else f"{mesh:.2g} times the scenario's cells along an edge"
    ends = "its own windows" if windows == 1.0 else f"windows {windows:g} times as long"
    if mesh != 1.0 and windows == 1.0:
        ends = "the scenario's own windows"
    why = ""
    if known.own_mesh and known.mesh < 1.0:
        why = (": on the coarser mesh of the trials it would move too far" if known.fine else
               ": nobody knows how far the coarser mesh of the trials is off")
        if any(s.good for s in known.steps if s.rung.kind is Kind.WINDOWS):
            why += "; longer windows were enough there only"
    return f"it has {cells} and {ends}{why}"


def together(known: Known) -> str:
    """What the advised scenario is."""
    without = [r.name for r in known.taken if r.kind is Kind.EFFECT]
    simpler = [r.name for r in known.taken if r.kind is not Kind.EFFECT]
    if known.iterate:
        simpler.append("scheme iterated")
    if not known.own_mesh and known.mesh < 1.0:
        simpler.append(f"a mesh of {known.mesh:.2g} times the cells along an edge")
    return "; ".join(filter(None, (", ".join(simpler), f"without {', '.join(without)}" if without else ""))) or (
        f"as it is; {'of what was tried nothing' if known.untried else 'nothing'} can be left out")


def said(moved: Moves, goals: tuple[Goal, ...]) -> str:
    """The probe that moves farthest for what was asked of it, how far and when."""
    if not moved:
        return "what nobody knows"
    name = worst(moved)
    goal, m = next(g for g in goals if g.probe == name), moved[name]
    if not math.isfinite(m.largest):
        return f"{name} out of sight"
    if m.largest <= NOTHING * goal.scale:
        return "nothing"
    return f"{name} by {amount(m.largest, goal.unit)} at t = {m.when:.5g} s ({of_range(m.largest / goal.scale)})"


def _times(one: int, other: int) -> str:
    return f"{one / max(other, 1):.2g} times"
