"""What a run cost: windows and iterations over time, and where the seconds went."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from coupler.record.results import Results
from coupler.report.curves import kinks_of
from coupler.report.kinks import draw_kinks
from coupler.report.picture import COLOURS, Picture, legend_below, page_figure, styled, svg
from coupler.report.units import counted, number


@dataclass(frozen=True)
class Share:
    """A part of a run's seconds."""

    name: str
    seconds: float
    percent: str


def windows_picture(results: Results) -> Picture | None:
    """Window size (log) and iterations over time; rejected windows are crosses."""
    w = results.windows
    good, bad = w[w.taken], w[~w.taken]
    if not len(good):
        return None
    figure = page_figure(5.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    styled(upper, "", "window size [s]")
    styled(lower, "time [s]", "iterations a window")
    edges = np.append(good.t, good.t[-1] + good.H[-1])
    upper.stairs(good.H, edges, baseline=None, color=COLOURS[0], linewidth=1.4, label="window size")
    upper.set_yscale("log")
    plain_log(upper)
    if good.H.max() < 10 * good.H.min():
        upper.set_ylim(good.H.min() / 4, good.H.max() * 4)
    if len(bad):
        upper.plot(bad.t, bad.H, "x", color=COLOURS[1], markersize=6, label="rejected")
    lower.stairs(good.thermal_iterations, edges, baseline=None, color=COLOURS[1], linewidth=1.2,
                 label="thermal iterations")
    lower.stairs(good.mechanical_iterations, edges, baseline=None, color=COLOURS[2], linewidth=1.2,
                 linestyle="--", label="mechanical iterations")
    lower.set_ylim(0, max(good.thermal_iterations.max(), good.mechanical_iterations.max(), 1) * 1.1)
    lower.yaxis.set_major_locator(MaxNLocator(integer=True))
    upper.set_xlim(edges[0], edges[-1])
    draw_kinks(upper, kinks_of(results))
    for k in kinks_of(results):
        lower.axvline(k, color="#999999", linewidth=0.7, zorder=1)
    legend_below(figure, (upper, lower))
    least, most = number(float(good.H.min()), 3), number(float(good.H.max()), 3)
    sizes = f"Windows of {most} s" if least == most else f"Window size from {least} s to {most} s"
    text = f"{sizes}: {counted(len(good), 'window')} accepted, {len(bad) or 'none'} rejected"
    return svg(figure, f"{text}; iterations of each half below.",
               f"{text}. Below: iterations of each half in a window.")


def plain_log(ax: Axes) -> None:
    """Numbers as they are spoken beside a logarithmic axis: .2, .5, 1, and no powers of ten."""
    axis = ax.yaxis
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: number(value, 2)))
    axis.set_minor_locator(NullLocator())  # a tick costs a millisecond


def iterates_picture(results: Results) -> Picture | None:
    """Iterations of each window and the contraction measured in it, for a scheme that iterates."""
    w = results.windows
    good = w[w.taken & (w.iterations > 0)]
    if not len(good):
        return None
    figure = page_figure(5.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    styled(upper, "", "iterations a window")
    styled(lower, "time [s]", "contraction")
    edges = np.append(good.t, good.t[-1] + good.H[-1])
    upper.stairs(good.iterations, edges, baseline=None, color=COLOURS[0], linewidth=1.4, label="iterations")
    upper.set_ylim(0, good.iterations.max() * 1.1)
    upper.yaxis.set_major_locator(MaxNLocator(integer=True))
    known = good[np.isfinite(good.contraction) & (good.contraction > 0)]
    lower.set_yscale("log")
    lower.yaxis.set_minor_locator(NullLocator())
    lower.plot(known.t + known.H, known.contraction, ".", color=COLOURS[1], markersize=3, label="contraction")
    lower.axhline(1.0, color="#999999", linewidth=0.7, zorder=1, label="plain iteration diverges above")
    legend_below(figure, (upper, lower), columns=3)
    text = f"{good.iterations.sum()} iterations in {len(good)} windows, {good.iterations.max()} at most in one"
    return svg(figure, f"{text}; the contraction of plain iteration below.",
               f"{text}. Below: by what plain iteration would multiply a difference, as measured in the window.")


def shares(results: Results) -> list[Share]:
    """Where the seconds went, and the share of each in percent."""
    parts = results.seconds_by_part
    whole = sum(parts.values())
    return [Share(n, s, number(100 * s / whole if whole > 0 else 0.0, 3)) for n, s in parts.items()]


def asked(results: Results) -> list[tuple[str, ...]]:
    """What the contact service was asked, where it had a process of its own: rows of a table."""
    return [(verb, str(v["count"]), *(number(1e3 * v[key], 3) for key in ("typical", "most")), number(v["total"], 3),
             *(number(v[key] / 1e6, 3) for key in ("bytes_in", "bytes_out")))
            for verb, v in results.totals.get("contact", {}).items()]


def shares_picture(parts: list[Share]) -> Picture | None:
    """One bar of where the seconds went."""
    if not sum(p.seconds for p in parts) > 0:
        return None
    figure = page_figure(1.7)
    ax = styled(figure.subplots(), "seconds of wall-clock time [s]", "")
    left = 0.0
    for k, part in enumerate(parts):
        ax.barh([0], [part.seconds], left=[left], color=COLOURS[k % len(COLOURS)], label=part.name, height=0.6)
        left += part.seconds
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.set_xlim(0, left)
    legend_below(figure, ax, columns=6)
    text = ", ".join(f"{p.name} {number(p.seconds, 3)} s" for p in parts)
    return svg(figure, f"Where the time went: {text}.")
