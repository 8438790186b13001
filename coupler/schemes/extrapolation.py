"""Extrapolation of x and t_N past the last levels: one number from -1 to 1, damped to the left, accurate to the right.

    extrapolation  -1  the line through the level two windows back: an alternation from window to window is not
                       extrapolated; x and t_N of the start, held, where no level is so far back
                    0  the line through the last window (scheme `extrapolated`)
                    1  the parabola through three levels

In windows of one size the middle of the next is seen as x_n + 0.25 (x_n - x_{n-2}), 1.5 x_n - 0.5 x_{n-1},
1.875 x_n - 1.25 x_{n-1} + 0.375 x_{n-2}: an alternation of 1 as 1, 2 and 3.5 (`alternating_gain`), and a curvature
x'' H^2 with an error of 0.625, 0.375 and 0.  In between the two neighbours are mixed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from coupler.schemes.state import Level, Slope

DAMPED, CLOSEST = -1.0, 1.0


def extrapolated_slope(now: Level, past: Sequence[Level], end: float, extrapolation: float) -> Slope | None:
    """Returns the line of x and t_N through a window up to `end` [s] that meets the extrapolation at its middle.

    past : levels before `now`, the newest first.  Where there is none: None, x and t_N are held; where there is one:
    the line through the last window.  A t_N extrapolated to a tension is held at 0 by geometry_at.
    """
    if not past:
        return None
    if extrapolation == 0.0 or (len(past) < 2 and extrapolation > 0.0):
        return past[0], now
    levels = (now, *past[:2])
    w = weights([level.t for level in levels], end, extrapolation)
    x, t_N = (sum([a * getattr(level, name) for a, level in zip(w, levels, strict=True)]) for name in ("x", "t_N"))
    return now, replace(now, t=end, x=2.0 * x - now.x, t_N=2.0 * t_N - now.t_N)


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


def _mixed(a: Sequence[float], b: Sequence[float], share: float) -> tuple[float, ...]:
    return tuple(float(v) for v in (1.0 - share) * np.array(a) + share * np.array(b))
