"""Draws the work-precision chart: error against solver calls and against wall time, both logarithmic."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from coupler.experiments.study import StabilityLimit
from coupler.experiments.work_precision import Point, pareto_front
from coupler.report.figures import GRID, INK, line_style, new_figure, plain, styled

MARKERS = "os^Dvp*hX"
COSTS = (("solver_calls", "solver calls"), ("seconds", "wall time [s]"))
PALE, GREY = "#f0e2a8", "#777777"
# Runs with a larger error have no answer: their markers are hollow, at the upper border.
MOST = 1.0
TICKS = 2.5  # decades from which powers of ten are ticks enough
LETTERS, MARK = 130, 8  # of a row of the legend, and what a marker takes of them
MARGIN = 2.0  # factor between the outermost points and the border


def draw(points: Sequence[Point], limits: Sequence[StabilityLimit]) -> Figure:
    """Draw the chart; errors are relative.  Raises ValueError where no run has an error."""
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
        _ticks(ax)
        _front(ax, points, cost, high)
        _guides(ax)
        _floor(ax, points)
        _curves(ax, points, cost, high)
    _limits(axes[0], points, limits)
    handles, labels = axes[0].get_legend_handles_labels()
    columns = max(1, min(4, len(handles), LETTERS // (max(map(len, labels)) + MARK)))
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, frameon=False, fontsize=9)
    return figure


def svg_text(figure: Figure) -> str:
    """Return the figure as SVG; equal numbers make equal files.  Its text stays text, which keeps the file small."""
    file = io.StringIO()
    with rc_context({"svg.hashsalt": "slideline", "svg.fonttype": "none",
                     "font.sans-serif": ["Helvetica", "Arial", "DejaVu Sans", "sans-serif"]}):
        figure.savefig(file, format="svg", metadata={"Date": None})
    return file.getvalue()


def _ticks(ax: Axes) -> None:
    """Label whole powers of ten with plain numbers, 1, 2 and 5 where there are few; errors in percent."""
    for axis, (low, high), form in ((ax.xaxis, ax.get_xlim(), "{:g}"), (ax.yaxis, ax.get_ylim(), "{:g} %")):
        subs = (1.0,) if math.log10(high / low) > TICKS else (1.0, 2.0, 5.0)
        scale = 100.0 if axis is ax.yaxis else 1.0
        axis.set_major_locator(LogLocator(subs=subs))
        axis.set_major_formatter(FuncFormatter(lambda v, _, form=form, scale=scale: form.format(scale * v)))
        axis.set_minor_formatter(NullFormatter())


def _errors(points: Sequence[Point]) -> tuple[float, float]:
    """Return the bounds of the error axis, with room above for runs without an answer."""
    errors = [e for e in (*(p.error for p in points), _reference_error(points)) if 0.0 < e <= MOST]
    if not errors:
        return 0.1 * MOST, MARGIN * MOST
    return min(errors) / MARGIN, max(errors) * MARGIN**2


def _costs(points: Sequence[Point], cost: str) -> tuple[float, float]:
    values = [c for p in points if (c := getattr(p, cost)) > 0.0]
    return min(values) / MARGIN, max(values) * MARGIN


def _at(p: Point, cost: str, ax: Axes, high: float) -> tuple[float, float]:
    """Place a point: one without a cost at the left border, one without an answer at the upper one."""
    left = ax.get_xlim()[0]
    low = ax.get_ylim()[0]
    y = high / 1.15 if not p.error <= MOST else max(p.error, low * 1.15)
    return max(getattr(p, cost), left * 1.1), y


def _curves(ax: Axes, points: Sequence[Point], cost: str, high: float) -> None:
    for k, series in enumerate(dict.fromkeys(p.series for p in points)):
        # Joined by solver calls on both charts: on a busy machine wall times are not monotone.
        on = sorted((p for p in points if p.series == series), key=lambda p: p.solver_calls)
        style, marker = line_style(k), MARKERS[k % len(MARKERS)]
        good = [p for p in on if p.error <= MOST]
        _marks(ax, [_at(p, cost, ax, high) for p in good], marker=marker, markersize=5, zorder=4,
               label=plain(series), **{**style, "linewidth": style["linewidth"] * 0.6})
        _marks(ax, [_at(p, cost, ax, high) for p in on if not p.error <= MOST], marker=marker, markersize=7,
               # fault: failures of a study filled -> linestyle="none", markerfacecolor="black", clip_on=False,
               #   zorder=5, markeredgecolor=style["color"], | coupler/test_study
               linestyle="none", markerfacecolor="white", clip_on=False, zorder=5, markeredgecolor=style["color"],
               gid="failed")
        _marks(ax, [_at(p, cost, ax, high) for p in good if p.below_floor], marker="o", markersize=11, linestyle="none",
               markerfacecolor="none", markeredgecolor=GREY, zorder=5, gid="below")
    for name, marker, size in (("failed, or above 100 %", "o", 7), ("below the reference's own error", "o", 11)):
        if any((p.below_floor if "below" in name else not p.error <= MOST) for p in points):
            ax.plot([], [], marker=marker, markersize=size, linestyle="none", markerfacecolor="none",
                    markeredgecolor=GREY, label=name)


def _marks(ax: Axes, at: Sequence[tuple[float, float]], **style: Any) -> None:
    """Plot points, if any; an empty line that is not clipped would take all the room."""
    if at:
        ax.plot(*zip(*at, strict=True), **style)[0].set_in_layout(False)


def _front(ax: Axes, points: Sequence[Point], cost: str, high: float) -> None:
    best = [p for p in pareto_front(points, cost) if p.bound <= MOST]
    if best:
        x, y = [getattr(p, cost) for p in best], [max(p.bound, ax.get_ylim()[0]) for p in best]
        ax.step([x[0], *x, ax.get_xlim()[1]], [high, *y, y[-1]], where="post", color=PALE, linewidth=5, zorder=1,
                solid_joinstyle="round", label="Pareto optimal")


def _floor(ax: Axes, points: Sequence[Point]) -> None:
    if _reference_error(points) > 0.0:
        ax.axhline(_reference_error(points), color=INK, linewidth=1.0, linestyle=(0, (6, 3)), zorder=2,
                   label="the reference's own error")


def _reference_error(points: Sequence[Point]) -> float:
    """Return the reference's own error, the same for every run; 0 where it is unknown."""
    return max((p.floor for p in points if math.isfinite(p.floor)), default=0.0)


def _guides(ax: Axes) -> None:
    """Draw slopes of order 1 and 2 at the lower left, where cheap and accurate runs would be."""
    (left, right), (low, high) = np.log10(ax.get_xlim()), np.log10(ax.get_ylim())
    begin, top, width = left + 0.04 * (right - left), low + 0.42 * (high - low), 0.2 * (right - left)
    for p in (1, 2):
        run = min(width, (top - low) / p)
        end = 10 ** (begin + run), 10 ** (top - p * run)
        ax.plot([10**begin, end[0]], [10**top, end[1]], color=GREY, linewidth=0.9, zorder=1)
        _note(ax, f"{p}", end, (3, 2), GREY)
    _note(ax, "order", (10**begin, 10**top), (0, 3), GREY)


def _note(ax: Axes, text: str, at: tuple[float, float], offset: tuple[float, float], colour: str) -> None:
    """Write small text at a point; the layout does not make room for it."""
    ax.annotate(text, at, xytext=offset, textcoords="offset points", in_layout=False, color=colour, fontsize=8)


def _limits(ax: Axes, points: Sequence[Point], limits: Sequence[StabilityLimit]) -> None:
    """Draw a line at the stability limit of a curve; runs to its left have longer windows.

    The legend says where the limit lies outside of the chart.
    """
    names = list(dict.fromkeys(p.series for p in points))
    left, right = ax.get_xlim()
    for limit in limits:
        style = {"color": line_style(names.index(limit.series))["color"], "linewidth": 1.2, "linestyle": ":",
                 "zorder": 2, "label": f"{plain(limit.series)}: {_limit_text(limit, left, right)}"}
        if left < limit.solver_calls < right:
            ax.axvline(limit.solver_calls, gid="limit", **style)
        else:
            ax.plot([], [], **style)


def _limit_text(limit: StabilityLimit, left: float, right: float) -> str:
    # fault: no limit is reported as one -> if False: | coupler/test_study
    if math.isinf(limit.windows):
        return "no limit predicted"
    return "all within the predicted limit" if limit.solver_calls <= left else (
        "all beyond the predicted limit" if limit.solver_calls >= right else "predicted limit")
