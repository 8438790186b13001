"""Kinks as thin vertical lines with their times above, spread so that none covers another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from coupler.report.units import number

LABELLED_AT_MOST = 24  # more times than this are lines without numbers
GAP = 0.024  # least distance of two labels, in widths of the axes: the height of their letters


def draw_kinks(ax: Axes, kinks: Sequence[float]) -> None:
    """Lines at the kinks [s] inside the limits of the axes; call it after the limits are set."""
    low, high = ax.get_xlim()
    inside = sorted(k for k in kinks if low < k < high)
    for k in inside:
        ax.axvline(k, color="#999999", linewidth=0.7, zorder=1)
    if not inside or len(inside) > LABELLED_AT_MOST:
        return
    at = (np.array(inside) - low) / (high - low)
    across = ax.get_xaxis_transform()
    for k, place in zip(inside, spread(at, GAP), strict=True):
        x = low + place * (high - low)
        ax.plot([k, x], [1.0, 1.03], transform=across, color="#999999", linewidth=0.7, clip_on=False)
        ax.text(x, 1.04, f"{number(k, 6)} s", transform=across, rotation=90, ha="center", va="bottom", fontsize=7.5,
                color="#666666")


def spread(at: NDArray[np.float64], gap: float) -> NDArray[np.float64]:
    """Places in [0, 1] near ascending `at`, at least `gap` apart."""
    places = at.copy()
    for i in range(1, len(places)):
        places[i] = max(places[i], places[i - 1] + gap)
    if len(places):
        places[-1] = min(places[-1], 1.0)
    for i in range(len(places) - 2, -1, -1):
        places[i] = min(places[i], places[i + 1] - gap)
    return places
