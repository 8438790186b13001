"""Where axes stand in a figure of a page: margins by what stands in them, with no measuring.

matplotlib's own layout measures each number beside each axis several times over, and a page has no use for that:
numbers beside axes are of known length, so the margins can be said.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Inches: numbers beside an axis, a line of words, the other margins, below an axis with words and without.
NUMBERS, LINE, RIGHT, TOP, WORDS, BARE = 0.62, 0.2, 0.3, 0.14, 0.55, 0.15
UPRIGHT, LETTER = 0.2, 0.062  # the small print above the axes: where it begins, and a letter of it
BAR, BAR_GAP, BAR_WIDTH = 1.0, 0.12, 0.15  # a bar of colours with its words
ENTRIES = 0.23  # a row of the legend


class PageFigure(Figure):
    """A figure whose axes stand one below the other; axes added by hand are bars of colours, or all are by hand.

    legend_rows : of the legend under them.
    """

    legend_rows: int = 0


def place(figure: PageFigure) -> None:
    """Put the axes of a figure in their places; its legend stands at its lower end.  By hand alone: nothing is done."""
    stacked = [ax for ax in figure.axes if ax.get_subplotspec() is not None]
    if not stacked:
        return
    bars = [ax for ax in figure.axes if ax not in stacked]
    width, height = (float(v) for v in figure.get_size_inches())
    left = NUMBERS + LINE * max(ax.get_ylabel().count("\n") + 1 for ax in stacked)
    right = width - (BAR if bars else RIGHT)
    bottom, top = below(stacked[-1]) + ENTRIES * figure.legend_rows, height - above(stacked[0])
    whole = top - bottom - sum(below(a) + above(b) for a, b in pairwise(stacked))
    shares = [_share(ax) for ax in stacked]
    high = top
    for k, ax in enumerate(stacked):
        tall = whole * shares[k] / sum(shares)
        ax.set_position((left / width, (high - tall) / height, (right - left) / width, tall / height))
        high -= tall + below(ax) + (above(stacked[k + 1]) if k + 1 < len(stacked) else 0.0)
    for ax in bars:
        ax.set_position(((right + BAR_GAP) / width, bottom / height, BAR_WIDTH / width, (top - bottom) / height))


def below(ax: Axes) -> float:
    """Inches under the axes."""
    return WORDS if ax.get_xlabel() else BARE


def above(ax: Axes) -> float:
    """Inches over the axes: there may be times, upright."""
    longest = max((len(text.get_text()) for text in ax.texts if text.get_rotation() == 90.0), default=0)
    return max(TOP, UPRIGHT + LETTER * longest if longest else 0.0)


def rows_of(entries: int, columns: int) -> int:
    """Of a legend."""
    return math.ceil(entries / columns)


def _share(ax: Axes) -> float:
    spec = ax.get_subplotspec()
    if spec is None:
        return 1.0
    return float(np.asarray(spec.get_gridspec().get_height_ratios(), dtype=float)[spec.rowspan.start])
