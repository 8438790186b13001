"""Levels: what the halves have told each other at one time, and what a scheme makes of two of them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Scheme(Enum):
    """How the thermal half sees the geometry of a window whose end is not known yet (both solve each half once)."""

    STAGGERED = "staggered"  # the paper's: as at the start of the window; first order
    EXTRAPOLATED = "extrapolated"  # predicted to the middle of the substep; second order


@dataclass(frozen=True)
class Level:
    """The exchanged fields at one time.

    t [s].  T : (n_nodes,) [K].  x : (n_nodes, 2) [m].  t_N : (n_s,) [Pa], <= 0.
    gap : (n_s,) [m], covered : (n_s,) in [0, 1]; for records.
    """

    t: float
    T: Array
    x: Array
    t_N: Array
    gap: Array
    covered: Array


def geometry_at(scheme: Scheme, now: Level, before: Level | None, t: float) -> tuple[Array, Array]:
    """x and t_N that the thermal half is given for a substep with its middle at t [s].

    before : the level one window earlier, None in the first window after an event (nothing is known of the new
    slope yet, so x and t_N are held flat).  t_N stays <= 0: an extrapolated tension means "open".
    """
    if scheme is Scheme.STAGGERED or before is None:
        return now.x, now.t_N
    w = (t - now.t) / (now.t - before.t)
    return now.x + w * (now.x - before.x), np.minimum(now.t_N + w * (now.t_N - before.t_N), 0.0)


def temperature_at(T_start: Array, T_end: Array, fraction: float) -> Array:
    """T within a window, interpolated linearly between its start and its end."""
    return T_end if fraction == 1.0 else (1.0 - fraction) * T_start + fraction * T_end
