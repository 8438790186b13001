"""Law of time: where nothing periodic drives, nothing goes up and down from window to window without end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from random_scenes.data_bounds import last_change
from random_scenes.invariant import Finding, Invariant
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, ERROR_BAR, MOST_WINDOWS, Story, told

Floats = NDArray[np.float64]

ALTERNATING = 4  # increments on end, each against the one before
SEEN = 1e-3  # of the range: an increment that counts
LONGEST_PERIOD = 7  # windows
AGAIN = 0.01  # of an increment: what comes again
APART = 0.05  # of the range, from finer windows: what a cycle must be off to be one of the exchange
UNITS = {"temperature": "K", "gap": "m", "pressure": "Pa"}
MENDED = "a disturbance alternates and"  # the words of an exchange that was unstable or rang, and was mended
FLOORS = {"temperature": 1e-3, "gap": 1e-9, "pressure": 1e3}  # [K], [m], [Pa]: less is round-off and solvers' tolerance
FINER = 8
NAMED_BY = ("up and down", "ringing", " rings", "alternat", "oscillat", "cycle")


@dataclass(frozen=True)
class Swing:
    """What goes up and down.

    quantity : its name.  column : of it.  first, last : the levels between.  size : largest increment.
    reversals : how often it turned.  lasting : whether it does not die out.
    """

    quantity: str
    column: int
    first: int
    last: int
    size: float
    reversals: int
    lasting: bool


def quantities(story: Story) -> Mapping[str, Floats]:
    """Temperature (n, n_nodes) [K], gap and pressure (n, n_q) [m], [Pa] at every level; a gap of gap_max is 0."""
    gap = np.array([level.gap for level in story.levels])
    if gap.size:
        gap_max = {pair.name: pair.gap_max for pair in story.interface.pairs}
        reach = np.concatenate([np.full(side.nodes.size, gap_max[side.pair]) for side in story.interface.pair_sides])
        gap = np.where((gap >= reach).any(axis=0), 0.0, gap)
    return {"temperature": story.T, "gap": gap, "pressure": -story.t_N}


def calm_from(story: Story) -> int:
    """The first level after which no datum changes."""
    assert story.scenario is not None
    models = [story.scenario.models[half] for half in ("thermal", "mechanical")]
    keys = ("boundary", "bodies", "pairs", "motion", "pressure", "held", "gravity")
    t = last_change(*(model.get(key, {}) for model in models for key in keys))
    return int(np.searchsorted(story.t, t * (1.0 + 1e-12)))


def _runs(d: Floats, floor: float) -> tuple[int, int, int]:
    """(length, first, last) of the longest run of increments d : (m,) that each go against the one before."""
    best, first = (0, 0, 0), 0
    for k in range(len(d)):
        if abs(d[k]) <= floor or (k > first and d[k] * d[k - 1] >= 0.0):
            first = k + (abs(d[k]) <= floor)
        best = max(best, (k + 1 - first, first, k + 1))
    return best


def swings_of(name: str, values: Floats, scale: float, calm: int) -> list[Swing]:
    """The strongest alternation and the strongest lasting cycle of a quantity, values : (n, n_columns).

    scale : its range.  calm : the level after which nothing drives.
    """
    floor = max(SEEN * scale, FLOORS[name])
    increments = np.diff(values, axis=0)
    found = []
    for column in np.flatnonzero(np.abs(increments).max(axis=0, initial=0.0) > floor):
        d = increments[:, column]
        length, first, last = _runs(d, floor)
        if length >= ALTERNATING:
            found.append(Swing(name, int(column), first, last, float(np.abs(d[first:last]).min()), length, False))
        tail = d[calm:][-4 * LONGEST_PERIOD:]
        strong = tail[np.abs(tail) > floor]
        turned = int((strong[1:] * strong[:-1] < 0.0).sum())
        half = len(tail) // 2
        lasts = np.abs(tail[half:]).sum() >= 0.5 * np.abs(tail[:half]).sum()
        if turned >= max(4, 2 * len(tail) // LONGEST_PERIOD - 1) and lasts:
            start = len(d) - len(tail)
            found.append(Swing(name, int(column), start, len(d), float(np.abs(strong).max()), turned, True))
    kinds = [[s for s in found if s.lasting == lasting] for lasting in (False, True)]
    return [max(kind, key=lambda s: s.size) for kind in kinds if kind]


def period_of(values: Floats, size: float) -> int:
    """After how many windows values (n,) are again what they were, to a hundredth of an increment; 0: after none."""
    tail = values[-3 * LONGEST_PERIOD:]
    return next((q for q in range(2, LONGEST_PERIOD + 1)
                 if len(tail) > 2 * q and np.abs(tail[q:] - tail[:-q]).max() < AGAIN * size), 0)


def finer(scene: Scene, story: Story, factor: int) -> Scene:
    """The same scene in windows that many times shorter; adaptive ones as even as the median of the story."""
    doc = scene.copied_doc()
    coupling = doc["coupling"]
    for key in ("rules", "study", "output"):
        doc.pop(key, None)
    if coupling.pop("adaptive", None) is not None or "windows" not in coupling:
        size = float(np.median(np.diff(story.t)))
        coupling["windows"] = [{"until": coupling["end"], "size": size}]
    coupling["windows"] = [_shorter(w, factor) for w in coupling["windows"]]
    return Scene(doc, scene.recipes, scene.moved)


def _shorter(window: Mapping[str, Any], factor: int) -> dict[str, Any]:
    return {k: v if k == "until" else v / factor for k, v in window.items()}


def cycles_in(story: Story, reference: Story | None) -> list[Finding]:
    """What goes up and down in a story and not in the reference; None: nothing was run yet, all is suspect."""
    calm = calm_from(story)
    findings = []
    for name, values in quantities(story).items():
        if not values.size:
            continue
        scale = float(np.ptp(values)) if name == "temperature" else float(np.ptp(values, axis=0).max())
        for swing in swings_of(name, values, scale, calm):
            v, t = values[:, swing.column], story.t
            about = (f"{name} {swing.column} turns {swing.reversals} times from t = {t[swing.first]:.6g} s to "
                     f"{t[swing.last]:.6g} s, by {swing.size:.4g} of a range of {scale:.4g}")
            if swing.lasting and (period := period_of(v, swing.size)):
                about += f", in a cycle of {period} windows"
            if reference is None:
                findings.append(Finding(about, swing.size / (SEEN * scale), NAMED_BY))
                continue
            true = np.interp(t, reference.t, quantities(reference)[name][:, swing.column])
            here = slice(swing.first, swing.last + 1)
            own = np.abs(np.diff(true[here]))
            off = float(np.abs(v - true)[here].max())
            needed = APART * scale if swing.lasting else 0.5 * swing.size
            same = _runs(np.diff(true[here]), 0.5 * swing.size)[0] >= ALTERNATING
            size = off / needed if swing.lasting else swing.size / (SEEN * scale)
            told_as = NAMED_BY if swing.lasting else (*NAMED_BY, MENDED)
            if not swing.lasting and swing.size <= story.may_be_off.get(UNITS[name], 0.0):
                told_as = (*told_as, ERROR_BAR)
            if off > needed and not same:
                findings.append(Finding(f"{about}; in finer windows it is {off:.4g} off there and moves by at most "
                                        f"{own.max():.4g} in as long", size, told_as))
    return findings


def _without_cycles(scene: Scene, story: Story, rng: np.random.Generator) -> list[Finding]:
    if not cycles_in(story, None):
        return []
    factor = min(FINER, MOST_WINDOWS // len(story.t))
    enough = factor >= FINER // 2
    other = finer(scene, story, factor) if enough else scene.edited(coupling__scheme="iterated")
    reference = told(other)
    if enough and reference.outcome == COMPLETED and cycles_in(reference, None):
        iterated = told(other.edited(coupling__scheme="iterated"))  # what cycles itself is no reference
        reference = iterated if iterated.outcome == COMPLETED else reference
    return cycles_in(story, reference) if reference.outcome == COMPLETED else []


def _at_rest_some_time(scene: Scene) -> bool:
    elastic = scene.doc["mechanical"].get("elastic", {})
    return "dynamics" not in elastic and not scene.doc.get("rules")


CYCLES = Invariant("no cycles", _at_rest_some_time, _without_cycles, runs=0)
"""Data are straight lines in time, and after the last change a scene without inertia goes to rest: temperature, gap and
pressure that go up and down window by window, or in cycles of 2 to 7 windows that do not die, are the method's.

Suspect is what alternates over 4 windows or more by over 0.1 % of its range, or after the last change turns as often as
a period of 7 windows does and loses less than half in that.  It is a finding where the scene in windows an eighth as
long (iterated, where those are too many, or go up and down too) does not do so: off by half an increment for what
alternates, by 5 % of the range for a lasting cycle.  Nothing is run where nothing is suspect.  What dies out was told
by the note of an exchange that was unstable and was mended, or where it is within the error bar that the run gives a
probe of the quantity in its trust table.
"""

INVARIANTS: Sequence[Invariant] = (CYCLES,)
