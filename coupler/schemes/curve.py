"""How x and t_N are drawn on past the last levels: one number from -1 to 1, steadier to the left, closer to the right.

    curve  -1  the line through the level two windows back: a zigzag from window to window is not drawn on; what is now,
               held, where no level is so far back
            0  the line through the last window (scheme `extrapolated`)
            1  the parabola through three levels

In windows of one size the middle of the next is seen as x_n + .25 (x_n - x_{n-2}), 1.5 x_n - .5 x_{n-1},
1.875 x_n - 1.25 x_{n-1} + .375 x_{n-2}: a zigzag of 1 as 1, 2 and 3.5 (`zigzag`), and a bend x'' H^2 with an error of
.625, .375 and 0.  In between the drawings are mixed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from coupler.schemes.level import Level, Slope

STEADIEST, CLOSEST = -1.0, 1.0


def drawn_on(now: Level, past: Sequence[Level], end: float, curve: float) -> Slope | None:
    """The straight way of x and t_N through a window up to `end` [s] that meets the drawn curve at its middle.

    past : levels before `now`, the newest first.  None, as it is now, where there is none; the line through the
    last window where there is one.  A t_N drawn on to a tension is held at 0 by who follows the way.
    """
    if not past:
        return None
    if curve == 0.0 or (len(past) < 2 and curve > 0.0):
        return past[0], now
    levels = (now, *past[:2])
    w = weights([level.t for level in levels], end, curve)
    x, t_N = (sum([a * getattr(level, name) for a, level in zip(w, levels, strict=True)]) for name in ("x", "t_N"))
    return now, replace(now, t=end, x=2.0 * x - now.x, t_N=2.0 * t_N - now.t_N)


def weights(times: Sequence[float], end: float, curve: float) -> tuple[float, ...]:
    """Of each level in what is seen at the middle of a window from times[0] to `end`.  times [s], the newest first."""
    t0, t = times[0], 0.5 * (times[0] + end)
    if len(times) == 1:
        return (1.0,)
    s = (t - t0) / (t0 - times[1])
    line = (1.0 + s, -s, 0.0)
    if len(times) == 2:
        # fault: the second window has no steadier way than the line -> return line[:2] if True else _mixed(line[:2],
        #   (1.0, 0.0), -curve) | coupler/test_auto
        return line[:2] if curve >= 0.0 else _mixed(line[:2], (1.0, 0.0), -curve)
    t1, t2 = times[1], times[2]
    if curve < 0.0:
        r = (t - t0) / (t0 - t2)
        # fault: the steadiest drawing sees a zigzag -> return _mixed(line, (1.0 + s, -s, 0.0), -curve) |
        #   coupler/test_curve
        return _mixed(line, (1.0 + r, 0.0, -r), -curve)
    parabola = ((t - t1) * (t - t2) / ((t0 - t1) * (t0 - t2)), (t - t0) * (t - t2) / ((t1 - t0) * (t1 - t2)),
                (t - t0) * (t - t1) / ((t2 - t0) * (t2 - t1)))
    return _mixed(line, parabola, curve)


def zigzag(times: Sequence[float], end: float, curve: float) -> float:
    """What is seen of a quantity that goes 1, -1, 1 from level to level."""
    return float(sum(w * (-1.0) ** i for i, w in enumerate(weights(times, end, curve))))


def closest(times: Sequence[float], end: float, most: float) -> float | None:
    """The largest curve that sees a zigzag at most `most` times; None if there is none.  times : as of `weights`."""
    knots = [STEADIEST, 0.0, CLOSEST][:len(times)]
    seen = [zigzag(times, end, c) for c in knots]
    if seen[0] > most:
        return None
    for (c0, c1), (f0, f1) in zip(pairwise(knots), pairwise(seen), strict=True):
        if f1 > most:
            return float(c0 + (c1 - c0) * (most - f0) / (f1 - f0))
    return knots[-1]


def _mixed(a: Sequence[float], b: Sequence[float], share: float) -> tuple[float, ...]:
    return tuple(float(v) for v in (1.0 - share) * np.array(a) + share * np.array(b))
