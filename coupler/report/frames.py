"""Which frames of a run to show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from coupler.record.vtkhdf import FieldReader

Array = NDArray[np.float64]

AT_MOST = 8
TIME_COUNTS = 0.25  # weight of plain time against change: a long rest deserves a picture too


def progress(file: FieldReader) -> Array:
    """(n_frames,) how far the story has gone at each frame: change of T and of place, and a little time."""
    n = len(file.times)
    T, x = file.point_field("T", 0), file.points(0)
    size, warmth = float(np.ptp(x, axis=0).max()) or 1.0, 0.0
    change = np.zeros((2, n))
    for k in range(1, n):
        T_new, x_new = file.point_field("T", k), file.points(k)
        change[:, k] = np.abs(T_new - T).max(), np.abs(x_new - x).max() / size
        warmth = max(warmth, float(np.ptp(T_new)))
        T, x = T_new, x_new
    change[0] /= warmth or 1.0
    told = np.cumsum(change.sum(axis=0))
    time = (file.times - file.times[0]) / (float(np.ptp(file.times)) or 1.0)
    return np.asarray(told / (told[-1] or 1.0) + TIME_COUNTS * time)


def choose(times: Array, told: Array, marks: Sequence[float], most: int = AT_MOST) -> list[int]:
    """Numbers of the frames to show: first, last, those nearest to the marks [s], then where most is left untold.

    times, told : (n,), ascending; told as from `progress`.
    """
    n = len(times)
    picks = {0, n - 1} | {int(np.abs(times - m).argmin()) for m in marks if times[0] <= m <= times[-1]}
    while len(picks) > most:
        order = sorted(picks)
        inner = range(1, len(order) - 1)
        picks.remove(order[min(inner, key=lambda i: told[order[i + 1]] - told[order[i - 1]])])
    while len(picks) < min(most, n):
        order = sorted(picks)
        free = [k for k in range(n) if k not in picks]
        picks.add(max(free, key=lambda k: np.abs(told[order] - told[k]).min()))
    return sorted(picks)
