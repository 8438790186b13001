"""Levels: what the halves have told each other at one time, and what a scheme makes of two of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Level:
    """The exchanged fields at one time.

    t [s].  T : (n_nodes,) [K].  x : (n_nodes, 2) [m].  t_N : (n_s,) [Pa], <= 0.
    gap : (n_s,) [m], covered : (n_s,) in [0, 1]; for records.
    f_s : (n_nodes,) solid fraction, where the thermal half has it: something melts.
    heat : (n_bodies,) [J] stored since the start of the run, bodies in the order of their names; None: not told yet.
    """

    t: float
    T: Array
    x: Array
    t_N: Array
    gap: Array
    covered: Array
    f_s: Array | None = None
    heat: Array | None = None


Slope = tuple[Level, Level]  # two levels, the earlier first, between which x and t_N change as over the window


def geometry_at(now: Level, slope: Slope | None, t: float) -> tuple[Array, Array]:
    """x and t_N that the thermal half is given for a substep with its middle at t [s]: on a line from `now`.

    slope : None holds them as they are now.  t_N stays <= 0: an extrapolated tension means "open".
    """
    if slope is None:
        return now.x, now.t_N
    earlier, later = slope
    # fault: extrapolation switched off -> w = 0.0 | coupler/test_coupling
    w = (t - now.t) / (later.t - earlier.t)
    return now.x + w * (later.x - earlier.x), np.minimum(now.t_N + w * (later.t_N - earlier.t_N), 0.0)


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
    """What the mechanical half takes of a level: T, and f_s where there is one."""
    # fault: solid fraction of the outcome, not of the guess -> return {"T": level.T} if True else {"T": level.T, "f_s":
    #   level.f_s} | coupler/test_iterated
    return {"T": level.T} if level.f_s is None else {"T": level.T, "f_s": level.f_s}


def between(start: Level, end: Mapping[str, Array], fraction: float) -> dict[str, Array]:
    """T, and f_s where the thermal half gives it to the other, interpolated linearly within a window.

    end : the same at the end of the window, known or guessed.
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
