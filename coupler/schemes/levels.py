"""Levels: what the halves have told each other at one time, and how x and t_N are extrapolated past the last ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from coupler.schemes.paths import Bodies, carried_along, extrapolated

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Level:
    """The exchanged fields at one time.

    t [s].  T : (n_nodes,) [K].  x : (n_nodes, 2) [m].  t_N : (n_q,) [Pa], <= 0.
    gap : (n_q,) [m], covered : (n_q,) in [0, 1]; for records.
    f_s : (n_nodes,) solid fraction, where the thermal half has it: something melts.
    heat : (n_bodies,) [J] stored since the start of the run, bodies in the order of their names; None: not told yet.
    elastic_strain : (n_cells, 4) [1], where the mechanical half tells it: its bodies remember, so that their stress may
    change while x and T stay.  It is not exchanged: errors of windows are measured by it.
    """

    t: float
    T: Array
    x: Array
    t_N: Array
    gap: Array
    covered: Array
    f_s: Array | None = None
    heat: Array | None = None
    elastic_strain: Array | None = None

    @property
    def pressed(self) -> Array:
        """Pressure over all of a node's part of the side, (n_q,) [Pa] >= 0: less where only a share of it is faced.

        A half that does not tell the shares has 0 in `covered`.
        """
        # fault: what slides off a node is taken for pressed as hard as ever -> share = 1.0 |
        #   coupler/test_friction_order
        share = np.where(self.covered > 0.0, self.covered, 1.0)
        return np.maximum(-self.t_N, 0.0) * share


Slope = tuple[Level, Level]  # two levels, the earlier first, between which x and t_N change as over the window


# What a single node, which stands for a body of no extent, is taken for [m].
NODE = 0.1


def extent(level: Level) -> float:
    """Return the largest extent of a scene [m], bodies apart included."""
    return float(np.ptp(level.x, axis=0).max()) or NODE


def geometry_at(now: Level, slope: Slope | None, t: float, bodies: Bodies | None = None) -> tuple[Array, Array]:
    """Return x (n_nodes, 2) [m] and t_N (n_q,) [Pa] that the thermal half is given for a substep with its middle at t.

    t : time [s].  slope : x and t_N go along a line from `now`; None holds them as they are now.
    bodies : (n_nodes,) of each node, -1 for none: those that turn go along their arcs; None: all along straight lines.
    t_N stays <= 0: an extrapolated tension means "open".
    """
    if slope is None:
        return now.x, now.t_N
    earlier, later = slope
    # fault: extrapolation switched off -> w = 0.0 | coupler/test_coupling
    w = (t - now.t) / (later.t - earlier.t)
    x = carried_along(now.x, earlier.x, later.x, w, bodies)
    return x, np.minimum(now.t_N + w * (later.t_N - earlier.t_N), 0.0)


def predicted(now: Level, before: Level | None, t: float) -> Level:
    """The level at t [s] on the line through the last two; `now` itself in the first window after an event.

    A prediction out of bounds (T > 0, f_s in [0, 1], t_N <= 0) is held at them; one of T stays what it is now.
    """
    if before is None:
        return replace(now, t=t)
    w = (t - now.t) / (now.t - before.t)
    x, t_N = geometry_at(now, (before, now), t)
    T = now.T + w * (now.T - before.T)
    f_s = now.f_s
    if f_s is not None and before.f_s is not None:
        f_s = np.clip(f_s + w * (f_s - before.f_s), 0.0, 1.0)
    return replace(now, t=t, T=np.where(T > 0.0, T, now.T), x=x, t_N=t_N, f_s=f_s)


def exchanged(level: Level) -> dict[str, Array]:
    """Return what the mechanical half takes of a level, (n_nodes,) each: T [K], and f_s [1] where there is one."""
    # fault: solid fraction of the outcome, not of the guess -> return {"T": level.T} if True else {"T": level.T, "f_s":
    #   level.f_s} | coupler/test_iterated
    return {"T": level.T} if level.f_s is None else {"T": level.T, "f_s": level.f_s}


def between(start: Level, end: Mapping[str, Array], fraction: float) -> dict[str, Array]:
    """Return T [K], and f_s [1] where the thermal half gives it to the other, (n_nodes,) each, linear within a window.

    end : (n_nodes,) each [K] and [1], the same at the end of the window, known or guessed.  fraction : 0 to 1, of it.
    """
    found = {"T": _linear(start.T, end["T"], fraction)}
    if "f_s" in end:
        assert start.f_s is not None, "a half that gives f_s gave it at the start"
        # fault: solid fraction of the end of the window for all mechanical substeps -> found["f_s"] =
        #   _linear(start.f_s, end["f_s"], 1.0) | coupler/test_accounts
        found["f_s"] = _linear(start.f_s, end["f_s"], fraction)
    return found


def _linear(start: Array, end: Array, fraction: float) -> Array:
    return end if fraction == 1.0 or end is start else (1.0 - fraction) * start + fraction * end


# Extrapolation of x and t_N past the last levels: one number from -1 to 1, damped to the left, accurate to the right.
#
#     extrapolation  -1  the line through the level two windows back: an alternation from window to window is not
#                        extrapolated; x and t_N of the start, held, where no level is so far back
#                     0  the line through the last window (scheme `extrapolated`)
#                     1  the parabola through three levels
#
# In windows of one size the middle of the next is seen as x_n + 0.25 (x_n - x_{n-2}), 1.5 x_n - 0.5 x_{n-1}, 1.875
# x_n - 1.25 x_{n-1} + 0.375 x_{n-2}: an alternation of 1 as 1, 2 and 3.5 (`alternating_gain`), and a curvature x''
# H^2 with an error of 0.625, 0.375 and 0.  In between the two neighbours are mixed.

DAMPED, CLOSEST = -1.0, 1.0


def extrapolated_slope(now: Level, past: Sequence[Level], end: float, extrapolation: float,
                       bodies: Bodies | None = None) -> Slope | None:
    """Returns the line of x and t_N through a window up to `end` [s] that meets the extrapolation at its middle.

    past : levels before `now`, the newest first.  Where there is none: None, x and t_N are held; where there is one:
    the line through the last window.  bodies : as of `geometry_at`.  A t_N extrapolated to a tension is held at 0 by
    geometry_at.
    """
    if not past:
        return None
    if extrapolation == 0.0 or (len(past) < 2 and extrapolation > 0.0):
        return past[0], now
    levels = (now, *past[:2])
    times = [level.t for level in levels]
    w = weights(times, end, extrapolation)
    x = extrapolated([level.x for level in levels], times, 0.5 * (now.t + end), w, bodies)
    t_N = sum([a * level.t_N for a, level in zip(w, levels, strict=True)])
    return now, replace(now, t=end, x=carried_along(now.x, now.x, x, 2.0, bodies), t_N=2.0 * t_N - now.t_N)


def weights(times: Sequence[float], end: float, extrapolation: float) -> tuple[float, ...]:
    """Returns the weight of each level at the middle of a window from times[0] to `end`.  times [s], newest first."""
    t0, t = times[0], 0.5 * (times[0] + end)
    if len(times) == 1:
        return (1.0,)
    s = (t - t0) / (t0 - times[1])
    line = (1.0 + s, -s, 0.0)
    if len(times) == 2:
        # fault: the second window has no damped extrapolation -> return line[:2] if True else _mixed(line[:2],
        #   (1.0, 0.0), -extrapolation) | coupler/test_auto
        return line[:2] if extrapolation >= 0.0 else _mixed(line[:2], (1.0, 0.0), -extrapolation)
    t1, t2 = times[1], times[2]
    if extrapolation < 0.0:
        r = (t - t0) / (t0 - t2)
        # fault: the damped extrapolation sees an alternation -> return _mixed(line, (1.0 + s, -s, 0.0),
        #   -extrapolation) | coupler/test_extrapolation
        return _mixed(line, (1.0 + r, 0.0, -r), -extrapolation)
    parabola = ((t - t1) * (t - t2) / ((t0 - t1) * (t0 - t2)), (t - t0) * (t - t2) / ((t1 - t0) * (t1 - t2)),
                (t - t0) * (t - t1) / ((t2 - t0) * (t2 - t1)))
    return _mixed(line, parabola, extrapolation)


def alternating_gain(times: Sequence[float], end: float, extrapolation: float) -> float:
    """Returns what is seen at the middle of a window of a quantity that goes 1, -1, 1 from level to level."""
    return float(sum(w * (-1.0) ** i for i, w in enumerate(weights(times, end, extrapolation))))


def closest(times: Sequence[float], end: float, most: float) -> float | None:
    """Returns the largest extrapolation whose alternating gain is at most `most`; None if there is none.

    times : as of `weights`.
    """
    knots = [DAMPED, 0.0, CLOSEST][:len(times)]
    gains = [alternating_gain(times, end, c) for c in knots]
    if gains[0] > most:
        return None
    for (c0, c1), (f0, f1) in zip(pairwise(knots), pairwise(gains), strict=True):
        if f1 > most:
            return float(c0 + (c1 - c0) * (most - f0) / (f1 - f0))
    return knots[-1]


def largest_trend(times: Sequence[float], end: float, most: float) -> float:
    """Returns the largest trend of what is handed over ahead whose alternating gain is at most `most`; 0.0: none is.

    Power that goes 1, -1, 1 at the ends of windows makes nothing in any of them.  With r, the next window over the
    last, 1 + r trend of its size is handed over nevertheless, and what was handed over wrongly before, (1 + trend)/r,
    is taken back at the same time; the gain is this over the half of it that iterates feel.
    times : as of `weights`.
    """
    if len(times) < 2:
        return 1.0
    r = (end - times[0]) / (times[0] - times[1])
    # fault: power of friction is extrapolated however much it feeds back -> return 1.0 | coupler/test_friction_trend
    return min(max((0.5 * most - 1.0 - 1.0 / r) / (r + 1.0 / r), 0.0), 1.0)


def _mixed(a: Sequence[float], b: Sequence[float], share: float) -> tuple[float, ...]:
    return tuple(float(v) for v in (1.0 - share) * np.array(a) + share * np.array(b))
