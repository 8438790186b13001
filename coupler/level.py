"""Levels: what the halves have told each other at one time, and what a scheme makes of two of them."""

from __future__ import annotations

from collections.abc import Mapping
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
    f_s : (n_nodes,) solid fraction, where the thermal half has it and the mechanical one takes it.
    """

    t: float
    T: Array
    x: Array
    t_N: Array
    gap: Array
    covered: Array
    f_s: Array | None = None


def geometry_at(scheme: Scheme, now: Level, before: Level | None, t: float) -> tuple[Array, Array]:
    """x and t_N that the thermal half is given for a substep with its middle at t [s].

    before : the level one window earlier, None in the first window after an event (nothing is known of the new
    slope yet, so x and t_N are held flat).  t_N stays <= 0: an extrapolated tension means "open".
    """
    if scheme is Scheme.STAGGERED or before is None:
        return now.x, now.t_N
    w = (t - now.t) / (now.t - before.t)
    return now.x + w * (now.x - before.x), np.minimum(now.t_N + w * (now.t_N - before.t_N), 0.0)


def between(start: Level, end: Mapping[str, Array], fraction: float) -> dict[str, Array]:
    """T, and f_s where the thermal half gives it to the other, interpolated linearly within a window.

    end : the thermal half's outputs at the end of the window.
    """
    found = {"T": _linear(start.T, end["T"], fraction)}
    if "f_s" in end:
        assert start.f_s is not None, "a half that gives f_s gave it at the start"
        found["f_s"] = _linear(start.f_s, end["f_s"], fraction)
    return found


def _linear(start: Array, end: Array, fraction: float) -> Array:
    return end if fraction == 1.0 else (1.0 - fraction) * start + fraction * end
