"""The work-precision chart: error against half-solves and against wall time, both logarithmic."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coupler.report.picture import GRID, INK, line_style, new_figure, plain, styled
from coupler.study.limits import Limit
from coupler.study.score import Point, front

MARKERS = "os^Dvp*hX"
COSTS = (("half_solves", "half-solves"), ("seconds", "wall time [s]"))
PALE, GREY = "#f0e2a8", "#777777"
# Errors beyond this are no answers: their markers are hollow, at the upper border.
MOST = 1.0
MARGIN = 2.0  # factor between the outermost points and the border


def draw(points: Sequence[Point], limits: Sequence[Limit]) -> Figure:
    """The chart; errors are relative.  Raises ValueError where no run has an error."""
    if not any(math.isfinite(p.error) for p in points):
        raise ValueError("no run of the study has an error that could be drawn")
    figure = new_figure(4.9)
    axes = figure.subplots(1, 2, sharey=True)
    low, high = _errors(points)
    for ax, (cost, label) in zip(axes, COSTS, strict=True):
        styled(ax, label, "relative error (L2 in time)" if cost == COSTS[0][0] else "")
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_ylim(low, high)
        ax.set_xlim(*_costs(points, cost))
        ax.grid(True, which="major", color=GRID, linewidth=0.6)
        _front(ax, points, cost, high)
        _guides(ax)
        _floor(ax, points)
        _curves(ax, points, cost, high)
    _limits(axes[0], points, limits)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(4, len(handles)), frameon=False, fontsize=9)
    return figure


def svg_text(figure: Figure) -> str:
    """The figure as SVG; equal numbers make equal files.  Its text stays text, which keeps the file small."""
    file = io.StringIO()
    with rc_context({"svg.hashsalt": "slideline", "svg.fonttype": "none",
                     "font.sans-serif": ["Helvetica", "Arial", "DejaVu Sans", "sans-serif"]}):
        figure.savefig(file, format="svg", metadata={"Date": None})
    return file.getvalue()


def _errors(points: Sequence[Point]) -> tuple[float, float]:
    """Bounds of the error axis, on whole steps of 1, 2, 5 as little as need be."""
    shown = [e for p in points for e in (p.error, p.floor) if 0.0 < e <= MOST]
    if not shown:
        return 0.1 * MOST, MARGIN * MOST
    return min(shown) / MARGIN, max(shown) * MARGIN**2


def _costs(points: Sequence[Point], cost: str) -> tuple[float, float]:
    values = [c for p in points if (c := getattr(p, cost)) > 0.0]
    return min(values) / MARGIN, max(values) * MARGIN


def _at(p: Point, cost: str, ax: Axes, high: float) -> tuple[float, float]:
    """Where a point goes: one without a cost to the left border, one without an answer to the upper."""
    left = ax.get_xlim()[0]
    low = ax.get_ylim()[0]
    y = high / 1.15 if not p.error <= MOST else max(p.error, low * 1.15)
    return max(getattr(p, cost), left * 1.1), y


def _curves(ax: Axes, points: Sequence[Point], cost: str, high: float) -> None:
    for k, series in enumerate(dict.fromkeys(p.series for p in points)):
        on = sorted((p for p in points if p.series == series), key=lambda p: getattr(p, cost))
        style, marker = line_style(k), MARKERS[k % len(MARKERS)]
        good = [p for p in on if p.error <= MOST]
        x, y = np.array([_at(p, cost, ax, high) for p in good]).reshape(-1, 2).T
        ax.plot(x, y, marker=marker, markersize=5, zorder=4, label=plain(series),
                **{**style, "linewidth": style["linewidth"] * 0.6})
        bad = np.array([_at(p, cost, ax, high) for p in on if not p.error <= MOST]).reshape(-1, 2).T
        ax.plot(*bad, marker=marker, markersize=7, linestyle="none", markerfacecolor="white", clip_on=False, zorder=5,
                markeredgecolor=style["color"], gid="failed")
        below = np.array([_at(p, cost, ax, high) for p in good if p.below]).reshape(-1, 2).T
        ax.plot(*below, marker="o", markersize=11, linestyle="none", markerfacecolor="none", markeredgecolor=GREY,
                zorder=5, gid="below")
    for name, marker, size in (("failed, or no answer", "o", 7), ("below the reference's own error", "o", 11)):
        if any((p.below if "below" in name else not p.error <= MOST) for p in points):
            ax.plot([], [], marker=marker, markersize=size, linestyle="none", markerfacecolor="none",
                    markeredgecolor=GREY, label=name)


def _front(ax: Axes, points: Sequence[Point], cost: str, high: float) -> None:
    best = [p for p in front(points, cost) if p.known <= MOST]
    if best:
        x, y = [getattr(p, cost) for p in best], [max(p.known, ax.get_ylim()[0]) for p in best]
        ax.step([x[0], *x, ax.get_xlim()[1]], [high, *y, y[-1]], where="post", color=PALE, linewidth=5, zorder=1,
                solid_joinstyle="round", label="not beaten by any other")


def _floor(ax: Axes, points: Sequence[Point]) -> None:
    floors = [p.floor for p in points if math.isfinite(p.floor) and p.floor > 0.0]
    if floors:
        ax.axhline(max(floors), color=INK, linewidth=1.0, linestyle=(0, (6, 3)), zorder=2,
                   label="the reference's own error")


def _guides(ax: Axes) -> None:
    """Slopes of order 1 and 2, where a chart is empty: what is cheap is not exact."""
    (left, right), (low, high) = np.log10(ax.get_xlim()), np.log10(ax.get_ylim())
    x = left + np.array([0.04, 0.24]) * (right - left)
    top = low + 0.42 * (high - low)
    for p in (1, 2):
        down = top - p * (x[1] - x[0])
        if down < low:
            x_p = np.array([x[0], x[0] + (top - low) / p])
            down = low
        else:
            x_p = x
        ax.plot(10**x_p, [10**top, 10**down], color=GREY, linewidth=0.9, zorder=1)
        ax.annotate(f"{p}", (10**x_p[1], 10**down), xytext=(3, 2), textcoords="offset points", color=GREY, fontsize=8)
    ax.annotate("order", (10**x[0], 10**top), xytext=(0, 3), textcoords="offset points", color=GREY, fontsize=8)


def _limits(ax: Axes, points: Sequence[Point], limits: Sequence[Limit]) -> None:
    names = list(dict.fromkeys(p.series for p in points))
    left, right = ax.get_xlim()
    for limit in limits:
        if left < limit.half_solves < right:
            k = names.index(limit.series)
            colour = line_style(k)["color"]
            ax.axvline(limit.half_solves, color=colour, linewidth=1.0, linestyle=":", zorder=2)
            ax.annotate("predicted limit", (limit.half_solves, 0.02), xycoords=("data", "axes fraction"), rotation=90,
                        xytext=(-9, 0), textcoords="offset points", color=colour, fontsize=8)
