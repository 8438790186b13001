"""The course of the probes: how much each bends from window to window, which is what its error goes with."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _empty() -> Array:
    return np.empty(0)


@dataclass(frozen=True)
class Course:
    """The probes up to t [s], (n,) each in SI.

    values : the last that were numbers.  slope : of the last window, 1/s.  H : its size [s]; 0.0: there was none.
    low, high : the least and the largest so far.
    """

    t: float = 0.0
    values: Array = field(default_factory=_empty)
    slope: Array = field(default_factory=_empty)
    H: float = 0.0
    low: Array = field(default_factory=_empty)
    high: Array = field(default_factory=_empty)

    @property
    def range(self) -> Array:
        """How far each has gone, (n,)."""
        return self.high - self.low


def begun(t: float, values: Array) -> Course:
    """Return the course of one level.  values : (n,) in SI; what is no number counts as 0 until it is one."""
    values = np.where(np.isfinite(values), values, 0.0)
    return Course(t, values, np.zeros(len(values)), 0.0, values, values)


def after(course: Course, t: float, values: Array) -> tuple[Course, Array]:
    """Return the course after a window to t [s], and |H^2 v''| of it, (n,): the second divided difference.

    Before the start nothing moved: there the bend is the whole of the first change.
    """
    values = np.where(np.isfinite(values), values, course.values)
    H = t - course.t
    slope = (values - course.values) / H
    between = 0.5 * (H + course.H) if course.H else H
    second = H * H * np.abs(slope - course.slope) / between
    return Course(t, values, slope, H, np.minimum(course.low, values), np.maximum(course.high, values)), second
