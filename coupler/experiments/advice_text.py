"""What a climb has found, in words."""

from __future__ import annotations

import math
import os
import re
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from textwrap import shorten, wrap
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.live import Live
from rich.text import Text

from coupler.errors import ResultsError
from coupler.experiments.advice_search import Goal, Known, Moves, Step, both, edits_of, range_of, share_of, worst
from coupler.experiments.trial import Trial
from coupler.experiments.variants import OWN, Edit, Kind, Rung, at, edited, iterated, meshed, timed
from coupler.record.paths import part_of
from coupler.scenario.document import WIDTH, Document, document_from, dumped, layout

# Numbers as a reader wants them.

# unit -> (below this, times this, is called this), the first that fits
READABLE = {"m": ((1e-3, 1e6, "um"), (1.0, 1e3, "mm")), "Pa": ((1e3, 1.0, "Pa"), (1e6, 1e-3, "kPa"),
                                                              (float("inf"), 1e-6, "MPa"))}


def amount(value: float, unit: str) -> str:
    """A number with its unit: 3.5 um, 12.1 MPa, 1 K."""
    for below, factor, name in READABLE.get(unit, ()):
        if abs(value) < below:
            return f"{value * factor:.3g} {name}"
    return f"{value:.3g} {unit}" if unit != "1" else f"{value:.3g}"


def percent(share: float) -> str:
    """Two digits: .2 as 20 %."""
    return f"{100 * share:.2g} %" if abs(share) < 0.995 else f"{100 * share:.0f} %"


def of_range(share: float) -> str:
    """20 % of its range; from twice on 2.1 times its range."""
    return f"{share:.2g} times its range" if share > 2.0 else f"{percent(share)} of its range"


# What the advised model would show wrong beside what was asked for, measured against the scene whole.

# What is told: a probe that moves by this share of its range, a largest pressure this much above the mean.
TOLD, UNEVEN = 0.01, 1.05
STILL = 1e-9  # m


def misses(known: Known) -> Iterator[str]:
    """A line each.  Only pairs and probes that the combination has."""
    full, simple = known.reference, known.combined
    assert simple is not None
    own = [n.removeprefix(OWN) for n in full.probes if n.startswith(OWN)]
    pairs = [n.removesuffix(".p.max") for n in own if n.endswith(".p.max")]
    for pair in pairs:
        yield from _pressure(pair, full, simple)
        yield from _spring_back(pair, full, simple)
    asked = {goal.probe for goal in known.goals}
    for name in full.probes:
        if not name.startswith(OWN) and name not in asked:
            yield from _probe(name, full, simple)


def _pressure(pair: str, full: Trial, simple: Trial) -> Iterator[str]:
    """The largest pressure, and how much of it is that of corners and edges."""
    name = f"{OWN}{pair}.p.max"
    if name not in simple.probes or max(full.probes[name]) <= 0.0:
        return
    t, p, other = both(full, simple, name)
    k = int(p.argmax())
    mean = float(np.interp(t[k], full.t, full.probes[f"{OWN}{pair}.p.mean"]))
    text = f"pressure at {pair}: up to {amount(float(p[k]), 'Pa')} at t = {t[k]:.5g} s"
    if p[k] > UNEVEN * mean > 0.0:
        text += f", {p[k] / mean:.2g} times the mean (corners and edges)"
    if abs(other[k] - p[k]) > TOLD * p[k]:
        yield f"{text}; without it {amount(float(other[k]), 'Pa')} there and then"


def _spring_back(pair: str, full: Trial, simple: Trial) -> Iterator[str]:
    """How far the surface is from where the simpler model has it, and what of that goes when contact is lost."""
    for axis in ("u_x", "u_y"):
        name = f"{OWN}{pair}.{axis}"
        if name not in simple.probes:
            continue
        t, u, other = both(full, simple, name)
        off = u - other
        if np.abs(off).max() <= STILL:
            continue
        k = int(np.abs(off).argmax())
        text = f"the slave side of {pair} is off by {amount(float(off[k]), 'm')} along {axis[-1]} at t = {t[k]:.5g} s"
        lost = _lost(np.interp(t, full.t, full.probes[f"{OWN}{pair}.p.max"]))
        back = float(abs(off[k] - off[lost])) if lost > k else 0.0
        if back > TOLD * abs(off[k]):
            text += f"; it has sprung back by {amount(back, 'm')} when contact is lost, at t = {t[lost]:.5g} s"
        yield text


def _lost(p: NDArray[np.float64]) -> int:
    """The last time at which a pressure went to nothing; 0 where it never did."""
    found = np.flatnonzero((p[:-1] > 0.0) & (p[1:] <= 0.0))
    return int(found[-1]) + 1 if len(found) else 0


def _probe(name: str, full: Trial, simple: Trial) -> Iterator[str]:
    if name not in simple.probes:
        yield f"{name}: not there"
        return
    t, a, b = both(full, simple, name)
    off, unit = np.abs(a - b), full.units[name]
    k, scale = int(off.argmax()), range_of(name, full)
    if off[k] > TOLD * scale:
        yield f"{name}: by {amount(float(off[k]), unit)} at t = {t[k]:.5g} s ({of_range(float(off[k]) / scale)})"


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


# What is shown while trials run: one live line on a terminal, a line a trial elsewhere.

class TrialLine:
    """Called with the name of each trial before it runs; gives what is told the share that is done."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(file=sys.stderr, highlight=False)
        self._live = Live(console=self._console, refresh_per_second=8, transient=True)
        self._began = time.monotonic()
        self._number = 0

    def __enter__(self) -> TrialLine:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __call__(self, name: str) -> Callable[[float], object]:
        self._number += 1
        head = f"trial {self._number}, {time.monotonic() - self._began:.0f} s: {name}"
        if not self._console.is_terminal:
            print(head, file=self._console.file, flush=True)
            return lambda share: None
        self._live.update(Text(head))
        return lambda share: self._live.update(Text(f"{head}, {100 * share:.0f} %"))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._console.is_terminal:
            self._live.stop()


# The advised scenario as a file: that of the user, comments kept, with what can go taken out.

# Merged keys and anchors: an edit in one place would be one in several.
_SHARED = re.compile(r"<<\s*:|(?:^|[\s\[{,:])[&*][A-Za-z_]", re.MULTILINE)


def advised(document: Document, known: Known) -> list[Edit]:
    """The edits that make a scenario of what was found."""
    edits = edits_of(known.taken, iterated(document.tree) if known.iterate else None)
    mesh, windows = known.factors
    tree = edited(document.tree, edits)
    # fault: advice: an advised mesh in the windows of the file -> return [*edits, meshed(tree, mesh), timed(tree, 1.0)]
    #   | coupler/test_advise
    return [*edits, meshed(tree, mesh), timed(tree, windows)]


def text_of(document: Document, edits: Sequence[Edit], head: Sequence[str], path: Path) -> str:
    """The scenario file with edits, to stand at `path`; head : lines of a comment at its top.

    Comments stay where the file can be edited in place; with merged or shared parts it is written anew without them.
    """
    edits = [*edits, _moved(document, path.parent)]
    wanted = edited(document.tree, edits)
    yaml = layout()
    top = "".join(f"{part}\n" for line in head for part in wrap(
        line, WIDTH, initial_indent="# ", subsequent_indent="#     ", replace_whitespace=False))
    if not _SHARED.search(document.text):
        tree = yaml.load(document.text)
        _override(tree, document)
        text = top + "#\n" + dumped(edited(tree, edits), yaml)
        if document_from(path, text).tree == wanted:
            return text
    yaml.default_flow_style = None
    text = top + dumped(wanted, yaml)
    assert document_from(path, text).tree == wanted, "plain values survive being written"
    return text


def _override(tree: Any, document: Document) -> None:
    """Bring what overrides put into the plain values into the commented ones."""
    for key in sorted(document.overridden, key=len):
        # Where an override made a mapping on its way, the whole of that is put.
        n = next((n for n in range(1, len(key)) if at(tree, key[:n]) is None), len(key))
        holder, plain = at(tree, key[:n - 1]), at(document.tree, key[:n - 1])
        holder[key[n - 1]] = plain[key[n - 1]]
        for gone in [k for k in holder if isinstance(holder, dict) and k not in plain]:
            del holder[gone]


def write(path: Path, text: str) -> Path:
    """Whole or not at all.  Raises ResultsError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part_of(path).write_text(text, encoding="utf-8")
        os.replace(part_of(path), path)
    except OSError as exc:
        raise ResultsError(f"{path}: cannot be written ({exc.strerror})") from exc
    return path


def _moved(document: Document, folder: Path) -> Edit:
    """Mesh files are looked for beside a scenario: elsewhere they need their whole path."""
    if folder.resolve() == document.path.parent.resolve():
        return Edit()
    files = {("bodies", name, "mesh", "file", "path"): body["mesh"]["file"]["path"]
             for name, body in document.tree["bodies"].items() if at(body, ("mesh", "file", "path")) is not None}
    return Edit({key: str((document.path.parent / path).resolve()) for key, path in files.items()})
