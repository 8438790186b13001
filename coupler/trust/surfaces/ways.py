"""How far surfaces of a pair pass each other within a window, on motions that are stated or that follow from forces.

The halves look for what faces what at single times of a window.  A surface that moves past another by more than its
own length between two of them may never be seen to face it: a hot block swept over a pin left it cold, an arm that
turned twice in a window met its pad by chance, and a ring that turned by more than half a turn slipped backwards.  A
window of half the size passes as well, so that no comparison of the two tells.  The motions themselves do: adaptive
windows are no longer than surfaces that may face take for SHARE of the shorter one, or, of a slider that stays on a
straight track, of two edges of that where they are longer (coupler.control.loop); and a row of the trust table judges
windows of any size.  Bodies that forces move are taken to go on as they went (coupler.trust.surfaces.courses); the row
judges how far they did.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Field, Signal, field_from, signal_from
from contact.half.interface import Interface
from contact.half.turns import rotated
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, measured
from coupler.trust.surfaces.courses import Course, Courses

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

NAME = "surfaces pass each other in time"
# Of the shorter surface, in one window: a half is seen in two windows or more, however it comes; past a whole one
# what lies on the way may be missed.
SHARE, LIMIT = 0.5, 1.0
# A body that forces move may go farther than it was going: it is looked ahead by less.
AHEAD = 0.8
ROUND = 1e-9  # a window of just SHARE is none beyond it
# A turn that counts as much as a whole length [rad]: from some 80 degrees on slip is no longer followed along the
# master, whose edges turn their backs (contact/slip.py).
WHOLE_TURN = 2.0
STRAIGHT = 0.01  # a track is bent across by no more than this part of its length
PIECES = 256  # of a way, looked at ahead: whoever comes nearer later is seen by a window that begins later
HALF_TURN = math.pi
STILL = 1e-3  # a turn that is none, of what slides [rad]


class Way(Protocol):
    """How a body goes in a time.  moved, turned : by how much between two times; pole : what it turns about."""

    def pole(self, x: Array, t: float) -> Array: ...
    def moved(self, t0: float, t1: float) -> Array: ...
    def turned(self, t0: float, t1: float) -> float: ...


@dataclass(frozen=True)
class Motion:
    """What a scene states of a body.  X : (1, 2) [m], the mean of its nodes.  until : [s], when it is let go.

    moves : the displacement, of each component what its conditions prescribe.  turn, about : [rad], (2,) [m].
    carried : whether the point that it turns about moves with the body.  named : a rule or a master may add to it.
    """

    X: Array
    nodes: Indices
    moves: tuple[tuple[tuple[Field, float], ...], tuple[tuple[Field, float], ...]]
    turn: Signal | None = None
    about: Array = field(default_factory=lambda: np.zeros(2))
    carried: bool = False
    until: float = math.inf
    named: bool = False

    def pole(self, x: Array, t: float) -> Array:
        """Return (2,) [m], what it turns about at t [s].  x : then."""
        if not self.carried:
            return self.about
        if all(self.moves):
            return self.about + self.moved(0.0, t)
        return np.asarray(self.about + x[self.nodes].mean(axis=0) - self.X[0])

    def moved(self, t0: float, t1: float) -> Array:
        """Return (2,) [m], by how much it is displaced from just after t0 to just before t1 [s]."""
        return np.array([_mean([float(f.at(self.X, min(t1, end), -1)[0] - f.at(self.X, min(t0, end))[0])
                                for f, end in fields]) for fields in self.moves])

    def turned(self, t0: float, t1: float) -> float:
        """Return by how much it turns in that time [rad]."""
        if self.turn is None:
            return 0.0
        return self.turn.at(min(t1, self.until), -1) - self.turn.at(min(t0, self.until))


@dataclass(frozen=True)
class Flight:
    """A body that forces move, from `start` [s] on.  stated : what is prescribed of it; None: nothing is."""

    course: Course
    body: int
    nodes: Indices
    start: float
    stated: Motion | None = None

    def pole(self, x: Array, t: float) -> Array:
        """Return (2,) [m], its mean.  x : at t [s]."""
        return np.asarray(x[self.nodes].mean(axis=0))

    def moved(self, t0: float, t1: float) -> Array:
        """Return (2,) [m], by how much it goes from t0 to t1 [s]."""
        a, b = (Courses.moved(self.course, self.body, t - self.start) for t in (t0, t1))
        if self.stated is None:
            return b - a
        known = [bool(fields) and all(t1 <= end for _, end in fields) for fields in self.stated.moves]
        return np.where(known, self.stated.moved(t0, t1), b - a)

    def turned(self, t0: float, t1: float) -> float:
        """Return by how much it turns in that time [rad]."""
        if self.stated is not None and self.stated.turn is not None and t1 <= self.stated.until:
            return self.stated.turned(t0, t1)
        return float(self.course.spin[self.body]) * (t1 - t0)


class Meeting(Enum):
    """How the sides of a pair meet in a time."""

    APART = "apart"  # neither comes within reach of the other
    STAYS = "stays"  # the shorter lies on the other all the time
    PASSES = "passes"  # it may come to face it, or cease to


@dataclass(frozen=True)
class _Passing:
    """A pair of two bodies, of which one moves past the other.

    sides : the nodes of each surface.  bodies : their numbers.  motions : of them, None: no motion is stated.  free :
    whether forces move them, as far as no motion is stated.  length : of the shorter
    surface [m].  reach : how far apart they still interact [m].  edges : two of the shortest edges of the longer over
    the length, where they are longer, else 1.0.
    """

    name: str
    sides: tuple[Indices, Indices]
    bodies: tuple[int, int]
    motions: tuple[Way | None, Way | None]
    free: tuple[bool, bool]
    length: float
    reach: float
    edges: float


@dataclass(frozen=True)
class WaysLog:
    """share : the largest way past the shorter surface over its length, of `pair`, in the window from t0 to t [s].

    by_edges : it is over two edges of the track on which the shorter stays.
    """

    share: float = 0.0
    pair: str = ""
    t0: float = 0.0
    t: float = 0.0
    by_edges: bool = False


def _is_named(m: Way | None) -> bool:
    return isinstance(m, Motion) and m.named


def _follows(p: _Passing) -> bool:
    """Whether how far bodies of a pair went is read off them, not off what is stated."""
    return any(p.free) or any(map(_is_named, p.motions))


class Ways:
    """The pairs of a scene whose bodies are told how to move past each other."""

    def __init__(self, interface: Interface, model: Mapping[str, Any], looks: int = 1) -> None:
        """model : of the mechanical half (model.json).  looks : at the geometry in a window, of the thermal half."""
        self._looks = looks
        motions, forces = dict(_stated(interface, model)), model.get("half") == "elastic"
        self._forces = forces
        pinned = {name for name in interface.bodies if _is_pinned(model, name)}
        self._courses = Courses(interface, model)
        free = {name for name in interface.bodies if forces and (name in pinned or not _is_whole(motions.get(name)))}
        stated = {name: motion for name, motion in motions.items() if name not in pinned}
        self._passings = tuple(_passings(interface, stated, free))

    def begun(self) -> Course:
        """Return how bodies go at the start."""
        return self._courses.begun()

    def after(self, course: Course, before: Level, now: Level) -> Course:
        """Return how bodies go after a window."""
        return self._courses.after(course, before, now) if any(any(p.free) for p in self._passings) else course

    def longest(self, x: Array, t0: float, t1: float, course: Course | None = None) -> float:
        """Return when a window from t0 has to end [s], at most t1, so that it passes nothing unseen.

        x : at t0.  course : how bodies go then; None: as at the start.
        """
        known = self.begun() if course is None else course
        ends = [self._end(self._going(p, known, t0), x, t0, t1) for p in self._passings]
        return min(ends, default=t1)

    def _going(self, p: _Passing, course: Course, t0: float) -> _Passing:
        """A pair with what forces do to its bodies from t0 on."""
        if not any(p.free):
            return p
        one, other = (
            # fault: bodies that forces move rest -> m | coupler/test_trust_courses
            Flight(course, b, self._courses.nodes[b], t0, m if isinstance(m, Motion) else None) if free else m
            for m, free, b in zip(p.motions, p.free, p.bodies, strict=True))
        return replace(p, motions=(one, other))

    def _end(self, p: _Passing, x: Array, t0: float, t1: float) -> float:
        share, _ = _share(p, x, t0, t1)
        most = SHARE * (AHEAD if any(p.free) else 1.0)
        if share <= most * (1.0 + ROUND):
            return t1
        piece = (t1 - t0) * most / share
        pieces = min(math.ceil((t1 - t0) / piece), PIECES)
        end = t1
        for i in range(pieces):
            meeting = _meeting(p, x, t0, t0 + i * piece, t0 + (i + 1) * piece)
            if meeting is Meeting.STAYS:
                # fault: a slider may go as far along its track as it likes -> pass | coupler/test_trust_ways
                end = min(end, t0 + p.edges * piece)
            if meeting is Meeting.PASSES or t0 + i * piece >= end:
                return min(t0 + max(i, 1) * piece, end)
        return min(t0 + pieces * piece, end)

    def watched(self, log: WaysLog, before: Level, now: Level) -> WaysLog:
        """Return the log after a window."""
        return self._watched(log, before, now, self._passings)

    def _watched(self, log: WaysLog, before: Level, now: Level, passings: tuple[_Passing, ...]) -> WaysLog:
        course = self._courses.between(before, now) if self._forces and any(map(_follows, passings)) else None
        for told in passings:
            p = told if course is None else self._gone(told, course, before.t)
            whole, turn = _share(p, before.x, before.t, now.t)
            # Between looks the path of a body is known up to half a turn.
            share = whole / (self._looks if turn < HALF_TURN else 1)
            if share <= log.share:
                continue
            # fault: what never comes near is told to have been passed -> met = {Meeting.PASSES} |
            #   coupler/test_trust_ways
            met = self._met(p, before, now, whole) - {Meeting.APART}
            stays = met == {Meeting.STAYS}
            share /= p.edges if stays else 1.0
            if met and share > log.share:
                log = WaysLog(share, p.name, before.t, now.t, stays and p.edges > 1.0)
        return log

    def outran(self, before: Level, now: Level) -> WaysLog | None:
        """Return how far bodies that forces move passed each other in a window, where that is too far; else None."""
        log = self._watched(WaysLog(), before, now, tuple(p for p in self._passings if any(p.free)))
        # fault: bodies that a force sets off outrun their window -> return None | coupler/test_trust_courses
        return log if log.share > SHARE * (1.0 + ROUND) else None

    def _gone(self, p: _Passing, course: Course, t0: float) -> _Passing:
        """A pair with how far its bodies went, where a force, a rule or a master may have moved them."""
        one, other = (
            # fault: what forces and rules did to bodies is not looked at -> m | coupler/test_trust_courses
            self._flown(m, b, course, t0) if free or _is_named(m) else m
            for m, free, b in zip(p.motions, p.free, p.bodies, strict=True))
        return replace(p, motions=(one, other))

    def _flown(self, m: Way | None, body: int, course: Course, t0: float) -> Flight:
        stated = m if isinstance(m, Motion) and not m.named else None
        return Flight(course, body, self._courses.nodes[body], t0, stated)

    def _met(self, p: _Passing, before: Level, now: Level, share: float) -> set[Meeting]:
        pieces = min(max(math.ceil(share / SHARE), 1), PIECES)
        times = np.linspace(before.t, now.t, pieces + 1).tolist()
        return {_meeting(p, before.x, before.t, a, b) for a, b in pairwise(times)}

    def checks(self, log: WaysLog) -> tuple[Check, ...]:
        """Return the row at the end, where surfaces were told to pass each other."""
        if not log.pair:
            return ()
        times = max(2, math.ceil(log.share / SHARE))
        length = "the length of two edges of its track" if log.by_edges else "the length of the shorter one"
        return (measured(NAME, log.share, (SHARE * (1.0 + ROUND), LIMIT), t=log.t,
                         what=f"pair {log.pair}: in the window from t = {log.t0:.6g} to {log.t:.6g} s one surface "
                              f"moves past the other by {log.share:.3g} times {length}; what "
                              "they face in between is not seen, so heat, pressure and friction there may be missed",
                         remedy=f"Use windows {times} times as short while these surfaces move past each other "
                                "(coupling.windows, coupling.adaptive.least), or leave coupling.windows out: adaptive "
                                "windows follow the motion"),)


def _is_whole(motion: Motion | None) -> bool:
    """Whether a scene states all of how a body goes, to the end."""
    if motion is None:
        return False
    ends = [end for fields in motion.moves for _, end in fields]
    # fault: a body that is kept from turning is told where to go -> told = all(motion.moves) or motion.turn is not None
    #   | coupler/test_trust_courses
    told = all(motion.moves) or (motion.turn is not None and not motion.carried)
    return told and min([motion.until, *ends]) == math.inf


def _is_pinned(model: Mapping[str, Any], body: str) -> bool:
    """Whether single points are all that is held of a body, so that it may swing about them."""
    held = [c for c in model.get("boundary", ()) if _body_of(c) == body
            and any(c.get(key) is not None for key in ("u_x", "u_y", "rotation", "angle"))]
    return bool(held) and all(c.get("at") is not None for c in held)


def _passings(interface: Interface, motions: Mapping[str, Motion], free: Collection[str]) -> Iterator[_Passing]:
    for pair in interface.pairs:
        one, other = (name.partition(".")[0] for name in (pair.slave, pair.master))
        a, b = motions.get(one), motions.get(other)
        moving = one in free, other in free
        if pair.tied or one == other or (a is None and b is None and not any(moving)):
            continue
        numbers = interface.bodies.index(one), interface.bodies.index(other)
        sides = tuple(np.unique(interface.surfaces[name]).astype(np.intp) for name in (pair.slave, pair.master))
        lengths = [float(np.linalg.norm(np.ptp(interface.nodes[nodes], axis=0))) for nodes in sides]
        longer = (pair.slave, pair.master)[int(np.argmax(lengths))]
        ends = interface.nodes[interface.surfaces[longer]]
        edge = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).min())
        yield _Passing(pair.name, (sides[0], sides[1]), numbers, (a, b), moving, min(lengths), pair.gap_max,
                       max(2.0 * edge / min(lengths), 1.0))


def _share(p: _Passing, x: Array, t0: float, t1: float) -> tuple[float, float]:
    """Return how far one side passes the other, in lengths of the shorter, and the larger turn [rad].  x : at t0."""
    a, b = p.motions
    if isinstance(a, Motion) and isinstance(b, Motion) and _same(a, b, t0, t1):
        # fault: bodies that move as one pass each other -> pass | coupler/test_trust_ways
        return 0.0, 0.0
    moves = [np.zeros(2) if m is None else m.moved(t0, t1) for m in p.motions]
    way, most = float(np.linalg.norm(moves[0] - moves[1])), 0.0
    for motion, nodes in zip(p.motions, p.sides, strict=True):
        turn = 0.0 if motion is None else abs(motion.turned(t0, t1))
        if motion is not None and turn > 0.0:
            way += turn * float(np.linalg.norm(x[nodes] - motion.pole(x, t0), axis=1).max())
            most = max(most, turn)
    # fault: a ring may turn as far in a window as its size allows -> return way / p.length, most |
    #   coupler/test_trust_ways
    return max(way / p.length, most / WHOLE_TURN), most


def _same(a: Motion, b: Motion, t0: float, t1: float) -> bool:
    """Whether two bodies move as one in that time."""
    turns = a.turned(t0, t1), b.turned(t0, t1)
    about = turns[0] == 0.0 or bool((a.about == b.about).all())
    return turns[0] == turns[1] and about and bool((a.moved(t0, t1) == b.moved(t0, t1)).all())


def _meeting(p: _Passing, x: Array, start: float, t0: float, t1: float) -> Meeting:
    """Return how the sides of a pair meet from t0 to t1 [s].  x : at `start` [s]."""
    if not _near(p, x, start, t0, t1):
        return Meeting.APART
    return Meeting.STAYS if all(_stays(p, x, start, t) for t in (t0, t1)) else Meeting.PASSES


def _stays(p: _Passing, x: Array, start: float, t: float) -> bool:
    """Whether the shorter side lies on the other at t [s], all of it, and no turn has carried it there.

    A slider on a long straight track faces it all the way.  What it may pass is a warmer place of the track, and none
    is narrower than two of its edges.
    """
    if any(m is not None and abs(m.turned(start, t)) > (STILL if isinstance(m, Flight) else 0.0) for m in p.motions):
        return False
    places = [x[nodes] + (0.0 if m is None else m.moved(start, t)) for m, nodes in zip(p.motions, p.sides, strict=True)]
    short, track = sorted(places, key=lambda at: float(np.linalg.norm(np.ptp(at, axis=0))))
    along = _along(track)
    across = np.array([-along[1], along[0]])
    on, beside, bent = track @ along, track @ across, np.ptp(track @ across)
    # fault: a slider that leaves its track stays on it -> inside = True | coupler/test_trust_ways
    inside = bool((short @ along >= on.min()).all() and (short @ along <= on.max()).all())
    near = bool((np.abs(short @ across - beside.mean()) <= p.reach + bent).all())
    # fault: a slider that stays on its track passes it -> return False | coupler/test_trust_ways
    return inside and near and bool(bent <= STRAIGHT * np.ptp(on))


def _along(track: Array) -> Array:
    """Return (2,) the direction in which points (n, 2) are spread most."""
    return np.asarray(np.linalg.svd(track - track.mean(axis=0), full_matrices=False)[2][0])


def _near(p: _Passing, x: Array, start: float, t0: float, t1: float) -> bool:
    """Whether the boxes that both sides sweep from t0 to t1 come within reach.  x : at `start` [s]."""
    boxes = [_swept(motion, x, nodes, (start, t0, t1)) for motion, nodes in zip(p.motions, p.sides, strict=True)]
    (low, high), (below, above) = boxes
    return bool((low - p.reach <= above).all() and (below - p.reach <= high).all())


def _swept(motion: Way | None, x: Array, nodes: Indices, times: tuple[float, float, float]) -> tuple[Array, Array]:
    """Return the corners of the box that nodes sweep: their places at both ends, and what an arc bulges by between.

    x : at the first of the times; the box is that of the time between the others [s].
    """
    x0 = x[nodes]
    if motion is None:
        return x0.min(axis=0), x0.max(axis=0)
    (start, *ends), pole = times, motion.pole(x, times[0])
    # What a turn adds to a node, as Turn.displaced.
    at = [x0 + motion.moved(start, t) for t in ends]
    both = np.concatenate([y + rotated(y - pole, motion.turned(start, t)) for y, t in zip(at, ends, strict=True)])
    arc, radius = abs(motion.turned(*ends)), float(np.linalg.norm(x0 - pole, axis=1).max())
    bulge = radius * (1.0 - math.cos(min(arc, HALF_TURN) / 2.0))
    return both.min(axis=0) - bulge, both.max(axis=0) + bulge


def _stated(interface: Interface, model: Mapping[str, Any]) -> Iterator[tuple[str, Motion]]:
    """Yield the body and the motion of each that is told how to move."""
    for number, name in enumerate(interface.bodies):
        nodes = np.flatnonzero(interface.node_body == number).astype(np.intp)
        X = interface.nodes[nodes].mean(axis=0)[None]
        given = (model.get("motion") or {}).get(name)
        entries = [dict(given)] if given is not None else [
            c for c in model.get("boundary", ()) if _body_of(c) == name]
        moves = tuple(tuple((field_from(c[key]), _until(c)) for c in entries if c.get(key) is not None)
                      for key in ("u_x", "u_y"))
        turn, about, until, carried = None, np.zeros(2), math.inf, False
        for c in entries:
            if c.get("rotation") is not None:
                turn, about, until = signal_from(c["rotation"]["angle"]), np.array(c["rotation"]["about"]), _until(c)
            elif c.get("angle") is not None:
                reference = ((model.get("bodies") or {}).get(name) or {}).get("reference")
                turn, until, carried = signal_from(c["angle"]), _until(c), True
                about = X[0] if reference is None else np.array(reference)
        if turn is not None or any(moves):
            named = any(c.get("name") for c in entries)
            yield name, Motion(X, nodes, (moves[0], moves[1]), turn, np.asarray(about, dtype=float), carried, until,
                               named)


def _body_of(condition: Mapping[str, Any]) -> str:
    return str(condition.get("body") or (condition.get("on") or condition.get("at") or "").partition(".")[0])


def _until(condition: Mapping[str, Any]) -> float:
    """Return when a condition is let go [s]; one that a pair ends is taken to hold."""
    until = condition.get("until")
    return float(until) if isinstance(until, int | float) else math.inf


def _mean(values: list[float]) -> float:
    return sum(values) / len(values) if values else 0.0
