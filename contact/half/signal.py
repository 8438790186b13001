"""Signals: boundary data as a function of time, constant or piecewise linear, with jumps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

# A step's end is t + h in floating point: a time this close (relative) to a point of the table is that point.
SNAP = 1e-13


@dataclass(frozen=True)
class Signal:
    """A piecewise linear function of time, held constant outside its table.

    A jump is written as two points at one time: the first holds before it, the second from it on.

    t : (n,) [s], not decreasing.  value : (n,), unit of the quantity.
    """

    t: NDArray[np.float64]
    value: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.t.ndim != 1 or self.t.shape != self.value.shape or self.t.size == 0:
            raise ValueError("a signal needs as many values as times, and at least one")
        if not (np.isfinite(self.t).all() and np.isfinite(self.value).all()):
            raise ValueError("a signal holds finite numbers only")
        if (np.diff(self.t) < 0).any():
            raise ValueError("the times of a signal must not decrease")
        if ((np.diff(self.t[:-1]) == 0) & (np.diff(self.t[1:]) == 0)).any():
            raise ValueError("a signal has at most two values at one time (before and after a jump)")

    def at(self, t: float, side: int = 1) -> float:
        """Value at time t [s]; at a jump the limit from the left (side=-1) or from the right (side=+1)."""
        if self.t.size == 1:
            return float(self.value[0])
        nearest = self.t[min(int(np.searchsorted(self.t, t)), self.t.size - 1)]
        below = self.t[max(int(np.searchsorted(self.t, t)) - 1, 0)]
        for point in (below, nearest):
            if abs(t - point) <= SNAP * max(abs(t), abs(point)):
                t = float(point)
        i = int(np.searchsorted(self.t, t, side="right" if side > 0 else "left"))
        if i == 0:
            return float(self.value[0])
        if i == self.t.size:
            return float(self.value[-1])
        t0, t1 = self.t[i - 1], self.t[i]
        w = (t - t0) / (t1 - t0)
        return float((1.0 - w) * self.value[i - 1] + w * self.value[i])

    @property
    def kinks(self) -> NDArray[np.float64]:
        """Times [s] at which the signal jumps or changes its slope."""
        return np.unique(self.t) if self.t.size > 1 else np.empty(0)


def signal_from(spec: float | Mapping[str, Any]) -> Signal:
    """A Signal from a number or from {"t": [...], "value": [...]} (the form of model.json).

    Raises ValueError if the table is not a function of time.
    """
    if isinstance(spec, Mapping):
        return Signal(np.asarray(spec["t"], dtype=float), np.asarray(spec["value"], dtype=float))
    return Signal(np.zeros(1), np.array([float(spec)]))
