"""Errors that are shifts of time: a run that is late stays late, and errs wherever something moves later on.

Where data stay as they are the velocity of a solution solves the same linear equation as a small difference of two of
them (the variational equation; Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, chapter I.14).  So
the part of an error that goes along the velocity, V dt, neither dies out nor grows: dt stays, and the error grows and
falls as the velocity does.  A limit cycle forgets all errors but this one, its phase.

At a look at a window the error of the whole field of temperatures is projected on its velocity.  Where that explains
most of it the window shifts the run by dt, with its sign.  Windows in between shift it by their own size, times how
much the velocity turns in them, |H dV/dt|/|V|, times what looks at windows that turn about as much found (of second
order: less in the measure in which they turn less).  A probe is off by how far it went within the shift, which is at
most its swing, however large the shift.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from coupler.schemes.levels import Level

Array = NDArray[np.float64]

# An error is a shift of time where its part along the velocity is this share of the squares of all of it.
MOST_OF_IT = 0.5
# A velocity that turns by more than this share of itself is not resolved, and tells no more of what follows.
TURN = 0.5
# Windows that turn about as much turn by the same within 10^(1/4); the first class begins at 1e-6.
CLASSES, CLASS, LEAST = 24, 0.25, -6.0
# A velocity that turns so many times as fast as in the window before jumps: a front passes a node.
JUMP = 4.0
# Temperatures that change by less of themselves in a window move by what solvers leave.
SOLVED = 1e-6
# The course of the probes is kept at so many levels at most.
LEVELS = 256


@dataclass(frozen=True)
class Turning:
    """Of the field of temperatures in one window.  turn : |H dV/dt|/|V|, at most TURN.  jumps : V does.

    scheme : by which it was solved.
    """

    turn: float = 0.0
    jumps: bool = False
    scheme: str = ""


@dataclass(frozen=True)
class Shift:
    """What a look found: kept, in_one [s]: by how much the window shifts the run, and one solved in one would.

    order : of its error.
    """

    kept: float
    in_one: float
    order: int


def turning(levels: Sequence[Level], scheme: str = "") -> Turning | None:
    """Return how a window turns the velocity; None where nothing moves but what solvers leave.

    levels : at its end, its start, and before, newest first.
    """
    V = [(a.T - b.T) / (a.t - b.t) for a, b in pairwise(levels[:4])]
    speed, H = float(np.linalg.norm(V[0])), levels[0].t - levels[1].t
    # fault: what solvers leave moves -> if not speed > 0.0: | coupler/test_time_shift
    if not speed * H > SOLVED * float(np.linalg.norm(levels[0].T)):
        return None
    # A front of freezing or melting passes nodes all the time, each at a window of its own.
    # fault: what freezes shifts the run -> front = False | coupler/test_time_shift
    front = any(level.f_s is not None and bool(((level.f_s > 0.0) & (level.f_s < 1.0)).any()) for level in levels[:2])
    if len(V) < 2:
        return Turning(TURN, front, scheme)
    by = float(np.linalg.norm(V[0] - V[1]))
    before = float(np.linalg.norm(V[1] - V[2])) / (levels[1].t - levels[2].t) if len(V) > 2 else np.inf
    # fault: a front that passes a node shifts the run -> return Turning(min(by / speed, TURN), scheme=scheme) |
    #   coupler/test_time_shift
    return Turning(min(by / speed, TURN), front or bool(by / H > JUMP * before), scheme)


def shift(start: Level, end: Level, error: Array) -> float:
    """Return by how much an error of the temperatures at the end of a window shifts the run [s]; 0.0: it does not.

    error : (n_nodes,) [K].
    """
    V = (end.T - start.T) / (end.t - start.t)
    along, all_of_it, square = float(error @ V), float(error @ error), float(V @ V)
    # fault: an error that does not go along the velocity shifts the run -> if not square > 0.0: |
    #   coupler/test_time_shift
    if not square > 0.0 or along**2 < MOST_OF_IT * all_of_it * square:
        return 0.0
    return along / square


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True)
class ShiftLog:
    """known [s]: the sum of the shifts of windows looked at, with their signs.

    rest : (CLASSES,) sums of size times turn of the others [s].  shifts, turns : (CLASSES,) sums over those looked at
    of shift over size, and of turn.  order : of the last.  scheme : of the last window that shifts; what looks at
    windows of another tell is of those before it.
    t, values, known_at, rest_at : of m levels, (m,) [s], (m, n) of the probes, (m,), (m, CLASSES); `every` so many
    windows are between two of them, but the last, which is `since` windows from the one before.
    """

    known: float = 0.0
    rest: Array = field(default_factory=lambda: np.zeros(CLASSES))
    shifts: Array = field(default_factory=lambda: np.zeros(CLASSES))
    turns: Array = field(default_factory=lambda: np.zeros(CLASSES))
    order: int = 1
    scheme: str = ""
    t: Array = field(default_factory=_none)
    values: Array = field(default_factory=_none)
    known_at: Array = field(default_factory=_none)
    rest_at: Array = field(default_factory=_none)
    every: int = 1
    since: int = 0


def begun(values: Array, t: float) -> ShiftLog:
    """Return the log at the start.  values : (n,) of the probes in SI, at t [s]."""
    return ShiftLog(t=np.array([t]), values=values[None, :], known_at=np.zeros(1), rest_at=np.zeros((1, CLASSES)))


def watched(log: ShiftLog, t: float, values: Array, seen: Turning | None, found: Shift | None,
            switch: bool) -> ShiftLog:
    """Return the log after a window to t [s].

    values : (n,) of the probes, numbers.  found : where it was looked at.  switch : contact switches in it or before.
    """
    if seen is None:
        return _kept(log, t, values)
    # fault: a scheme is told to shift as another one did -> if False: | coupler/test_time_shift
    if seen.scheme != log.scheme:
        log = _settled(log, seen.scheme)
    H, k = t - float(log.t[-1]), _class(seen.turn)
    # fault: what switches inside a window shifts the run -> if not seen.jumps: | coupler/test_time_shift
    if not (switch or seen.jumps):
        if found is None:
            log = replace(log, rest=_plus(log.rest, k, H * seen.turn))
        else:
            # fault: shifts lose their signs -> log = replace(log, known=log.known + abs(found.kept),
            #   order=found.order, | coupler/test_time_shift
            log = replace(log, known=log.known + found.kept, order=found.order,
                          shifts=_plus(log.shifts, k, found.in_one / H), turns=_plus(log.turns, k, seen.turn))
    return _kept(log, t, values)


def _settled(log: ShiftLog, scheme: str) -> ShiftLog:
    """The log with the shifts of windows so far as they are known now, before the first one by another scheme."""
    if not log.rest.any() and not log.turns.any():
        return replace(log, scheme=scheme)
    ratios, none = _ratios(log), np.zeros(CLASSES)
    return replace(log, known=abs(log.known) + float(log.rest @ ratios), rest=none, shifts=none, turns=none,
                   scheme=scheme, known_at=np.abs(log.known_at) + log.rest_at @ ratios,
                   rest_at=np.zeros_like(log.rest_at))


def _class(turn: float) -> int:
    place = int(np.floor((np.log10(max(turn, 10.0**LEAST)) - LEAST) / CLASS))
    return min(place, CLASSES - 1)


def _plus(sums: Array, k: int, value: float) -> Array:
    added = sums.copy()
    added[k] += value
    return added


def _kept(log: ShiftLog, t: float, values: Array) -> ShiftLog:
    """The log with one more level; thinned where there are too many."""
    # The last level is not kept for good unless it is `every` windows from the one before.
    keep = len(log.t) if log.since == 0 else len(log.t) - 1
    thin = log.since == 0 and keep > LEVELS
    step, every = (2, 2 * log.every) if thin else (1, log.every)
    new = (np.array([t]), values[None, :], np.array([log.known]), log.rest[None, :])
    t_, v, known, rest = (np.concatenate([rows[:keep:step], row]) for rows, row in
                          zip((log.t, log.values, log.known_at, log.rest_at), new, strict=True))
    return replace(log, t=t_, values=v, known_at=known, rest_at=rest, every=every, since=(log.since + 1) % every)


def estimated(log: ShiftLog) -> Array:
    """Return how far each probe is off for shifts of time, at most, (n,) in SI."""
    shifts = np.abs(log.known_at) + log.rest_at @ _ratios(log)
    found = np.zeros(log.values.shape[1])
    for i in range(1, len(log.t)):
        from_ = float(log.t[i] - shifts[i])
        j = int(np.searchsorted(log.t, from_))
        went = np.abs(log.values[j:i + 1] - log.values[i]).max(axis=0)
        if j > 0:
            part = (from_ - log.t[j - 1]) / (log.t[j] - log.t[j - 1])
            at = (1.0 - part) * log.values[j - 1] + part * log.values[j]
            # fault: a shift shorter than a window is none -> pass | coupler/test_time_shift
            went = np.maximum(went, np.abs(at - log.values[i]))
        found = np.maximum(found, went)
    return found


def _ratios(log: ShiftLog) -> Array:
    """Shift over size and turn of windows not looked at, (CLASSES,): that of the nearest class which was."""
    ratios, known = np.zeros(CLASSES), np.flatnonzero(log.turns)
    for k in np.flatnonzero(log.rest) if known.size else ():
        nearest = int(known[np.abs(known - k + 0.1).argmin()])
        # fault: windows that turn less shift as much for it -> less = 1.0 | coupler/test_time_shift
        less = float(10.0 ** ((log.order - 1) * CLASS * min(int(k) - nearest, 0)))
        ratios[k] = less * abs(log.shifts[nearest]) / log.turns[nearest]
    return ratios
