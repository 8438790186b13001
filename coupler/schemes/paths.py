"""Where nodes are between two levels: straight on, but bodies that turn go along their arcs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from contact.half.turns import turn_between

Array = NDArray[np.float64]
Bodies = NDArray[np.int32]

# Bodies that turn by less than this [rad] between two levels go straight: off the arc by 1e-11 of their size.
STRAIGHT = 1e-5
# By half a turn, to round-off, all bodies go the same way round.
HALF_TURN = np.pi + 1e-6
# Bodies that turn by more than this in a window are extrapolated from the last one alone.
FAR = 0.4 * np.pi


def carried_along(x: Array, earlier: Array, later: Array, w: float, bodies: Bodies | None) -> Array:
    """Return coordinates (n, 2) [m], carried on from x by w times the motion from `earlier` to `later`.

    x : either of the two.  earlier, later : (n, 2) [m].  bodies : (n,) body of each node, -1 for none; None: all go
    straight.  A body's motion is a turn about its pole by the angle that fits best, up to half a turn, and what it
    deforms besides goes straight in the frame that turns along.
    """
    d = later - earlier
    straight = x + w * d
    if bodies is None or not _may_turn(earlier, d, bodies):
        return straight
    for body in range(int(bodies.max()) + 1):
        here = bodies == body
        a, b = earlier[here], later[here]
        middle, to = a.mean(axis=0), b.mean(axis=0)
        p, q = a - middle, b - to
        angle = turn_between(p, q)
        if abs(angle) < STRAIGHT:
            continue
        if angle < HALF_TURN - 2.0 * np.pi:
            angle += 2.0 * np.pi
        # The pole stays: pole + R (middle - pole) = to.
        way, half = to - middle, 0.5 * angle
        pole = middle + 0.5 * way + 0.5 * np.array([-way[1], way[0]]) * (np.cos(half) / np.sin(half))
        now = 0.0 if x is earlier else angle
        stretch = _turned(_turned(b - pole, -angle) - (a - pole), now)
        # fault: bodies that turn go along the chord -> continue | coupler/test_paths
        straight[here] = pole + _turned(x[here] - pole + w * stretch, w * angle)
    return straight


def extrapolated(levels: Sequence[Array], at: Sequence[float], t: float, weights: Sequence[float],
                 bodies: Bodies | None) -> Array:
    """Return coordinates (n, 2) [m] at t [s], extrapolated with weights from two or three levels, the newest first.

    levels : (n, 2) each [m], at the times `at` [s].  weights : of each, 1 together.  bodies : as of `carried_along`.
    With bodies that turn it is a mean of the arcs through the newest level and each of the others: a sum of places on
    a circle lies on none, and makes a body larger or smaller.
    """
    straight = np.asarray(sum([w * x for w, x in zip(weights, levels, strict=True)]))
    now, before = levels[0], levels[1]
    # fault: bodies that turn are extrapolated along straight lines -> if True: | coupler/test_paths
    if bodies is None or not _may_turn(before, now - before, bodies):
        return straight
    ahead = (t - at[0]) / (at[0] - at[1])
    if len(levels) == 2:
        return carried_along(now, before, now, -weights[1], bodies)
    near = carried_along(now, before, now, ahead, bodies)
    far = carried_along(now, levels[2], now, (t - at[0]) / (at[0] - at[2]), bodies)
    share = -weights[1] / ahead
    mixed = share * near + (1.0 - share) * far
    for body in range(int(bodies.max()) + 1):
        here = bodies == body
        angle = abs(turn_between(*(x[here] - x[here].mean(axis=0) for x in (before, now))))
        # Over two windows it might be more than half a turn, which is taken for one the other way round.
        # fault: bodies that turn far are extrapolated from two windows -> mixed[here] = mixed[here] |
        #   coupler/test_paths
        mixed[here] = near[here] if angle > FAR else mixed[here]
    return mixed


def _may_turn(x: Array, d: Array, bodies: Bodies) -> bool:
    """Whether displacements d : (n, 2) [m] differ enough for a turn; most windows need no closer look."""
    return bool(np.ptp(d, axis=0).max() >= STRAIGHT * min(np.ptp(x[bodies == body], axis=0).max()
                                                         for body in range(int(bodies.max()) + 1)))


def _turned(arm: Array, angle: float) -> Array:
    """(n, 2) R(angle) arm."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * arm[:, 0] - s * arm[:, 1], s * arm[:, 0] + c * arm[:, 1]], axis=1)
