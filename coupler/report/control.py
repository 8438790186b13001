"""What control chose in a run: schemes and their reasons, windows cut short, events, and the errors it went by."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from coupler.record.results import FiredRule, Results
from coupler.record.tables import ERROR_QUANTITIES
from coupler.report.curves import kinks_of
from coupler.report.figures import COLOURS, Picture, counted, draw_kinks, legend_below, number, page_figure, styled, svg

# A window shorter than this share of the one before has a reason worth reading.
SHORT = 1.0 / 3.0
LISTED = 40
EACH = 200  # windows listed one by one
SCHEDULED = "as the schedule says"
NUMBER = r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?!\w)"  # no part of a name


@dataclass(frozen=True)
class Choice:
    """So many windows by a scheme; reasons : the commonest in words, numbers as ranges."""

    scheme: str
    windows: int
    sizes: str
    solves: int
    reasons: str


@dataclass(frozen=True)
class Row:
    """One window: t [s] where it begins, its size [s], and what is to be said of it."""

    t: str
    H: str
    text: str


def choices(results: Results) -> list[Choice]:
    """By scheme, where there were several or control chose the windows."""
    w = results.windows
    if not results.reasons and len(set(w.scheme[w.taken])) < 2:
        return []
    found = []
    for scheme in dict.fromkeys(w.scheme[w.taken].tolist()):
        rows = np.flatnonzero(w.taken & (w.scheme == scheme))
        sizes = w.H[rows]
        found.append(Choice(scheme, len(rows), f"{number(float(sizes.min()), 3)} to {number(float(sizes.max()), 3)} s",
                            int(w.solves[w.scheme == scheme].sum()), commonest(results, rows.tolist())))
    return found


@dataclass(frozen=True)
class Stretch:
    """Windows one after the other by one scheme, between two kinks.  worst : of their errors, in tolerances."""

    start: str
    end: str
    scheme: str
    windows: int
    rejected: int
    sizes: str
    solves: int
    worst: str
    reasons: str


def stretches(results: Results) -> tuple[list[Stretch], int]:
    """All windows in stretches (at most LISTED), and how many stretches there are."""
    w = results.windows
    kinks = np.array([float(k) for k in results.header["coupling"]["kinks"]])
    # A window begins at a kink but for round-off.
    part = np.searchsorted(kinks, w.t + 1e-6 * w.H, side="right")
    new = np.flatnonzero((w.scheme[1:] != w.scheme[:-1]) | (part[1:] != part[:-1])) + 1
    cuts = [0, *new.tolist(), len(w)] if len(w) else [0]
    found = [_stretch(results, np.arange(a, b)) for a, b in pairwise(cuts)]
    return found[:LISTED], len(found)


def _stretch(results: Results, rows: NDArray[np.integer]) -> Stretch:
    w = results.windows[rows]
    good = w[w.taken]
    sizes = (good if len(good) else w).H
    least, most = number(float(sizes.min()), 3), number(float(sizes.max()), 3)
    known = good.error[np.isfinite(good.error)]
    return Stretch(number(float(w.t[0]), 8), number(float(w.t[-1] + (w.H[-1] if w.taken[-1] else 0.0)), 8),
                   str(w.scheme[0]), len(good), len(w) - len(good), most if least == most else f"{least} to {most}",
                   int(w.solves.sum()), number(float(known.max()), 2) if len(known) else "",
                   commonest(results, rows[w.taken].tolist()))


@dataclass(frozen=True)
class Every:
    """One window tried, as a row of a table."""

    t: str
    H: str
    scheme: str
    verdict: str
    iterations: str
    error: str
    why: str


def every_window(results: Results) -> list[Every]:
    """All windows tried, rejected ones too (at most EACH)."""
    w = results.windows[:EACH]
    return [Every(number(float(row.t), 8), number(float(row.H), 4), str(row.scheme), str(row.verdict),
                  str(int(row.iterations)) if row.iterations else "",
                  number(float(row.error), 2) if np.isfinite(row.error) else "",
                  results.messages.get(k) or results.reasons.get(k, SCHEDULED)) for k, row in enumerate(w)]


def short_windows(results: Results) -> tuple[list[Row], int]:
    """Windows taken that are shorter than a third of the one before, with their reasons (at most LISTED); how many."""
    w = results.windows
    taken = np.flatnonzero(w.taken)
    short = [int(b) for a, b in pairwise(taken) if w.H[b] < SHORT * w.H[a]]
    return [_row(results, k, results.reasons.get(k, SCHEDULED)) for k in short[:LISTED]], len(short)


def event_rows(results: Results) -> list[Row]:
    """Events at the ends of windows taken (at most LISTED)."""
    w = results.windows
    found = [k for k in results.events if w.taken[k]]
    return [Row(number(float(w.t[k] + w.H[k]), 10), number(float(w.H[k]), 4), results.events[k])
            for k in found[:LISTED]]


def errors_picture(results: Results) -> Picture | None:
    """The estimated error of each window in tolerances, by quantity."""
    e, w = results.estimates, results.windows
    if not len(e):
        return None
    figure = page_figure(3.2)
    ax = styled(figure.subplots(), "time [s]", "error [tolerances]")
    ax.set_yscale("log")
    t = w.t[e.window] + w.H[e.window]
    # A file of an earlier version may have fewer.
    for k, quantity in enumerate([q for q in ERROR_QUANTITIES if q in (e.dtype.names or ())]):
        known = np.isfinite(e[quantity]) & (e[quantity] > 0.0)
        if known.any():
            ax.plot(t[known], e[quantity][known], ".", color=COLOURS[k], markersize=3,
                    label=quantity.replace("_", " "))
    ax.axhline(1.0, color="#999999", linewidth=0.7, zorder=1, label="rejected above")
    legend_below(figure, ax, columns=5)
    ax.yaxis.set_minor_locator(NullLocator())
    good = w.error[w.taken & np.isfinite(w.error)]
    middle = number(float(np.median(good)), 3) if len(good) else "unknown"
    text = f"Estimated error of each window; the median of those taken is {middle} tolerances"
    return svg(figure, f"{text}.", f"{text}.")


def commonest(results: Results, rows: list[int]) -> str:
    """The three commonest reasons; where numbers in them differ, from the least to the largest."""
    alike: dict[tuple[str, ...], list[list[str]]] = {}
    for k in rows:
        reason = results.reasons.get(k, SCHEDULED)
        alike.setdefault(tuple(re.split(NUMBER, reason)), []).append(re.findall(NUMBER, reason))
    best = sorted(alike.items(), key=lambda item: -len(item[1]))[:3]
    return "; ".join(f"{_filled(words, numbers)} ({len(numbers)})" for words, numbers in best)


def _filled(words: Sequence[str], numbers: Sequence[Sequence[str]]) -> str:
    """Text between whose words stand numbers, of several windows: (n_windows, len(words) - 1)."""
    ranges = []
    for column in zip(*numbers, strict=True):
        low, high = min(column, key=float), max(column, key=float)
        # fault: of several windows' numbers one is told -> ranges.append(low) | coupler/test_report_windows
        ranges.append(low if float(low) == float(high) else f"{low} to {high}")
    return "".join(f"{word}{text}" for word, text in zip(words, [*ranges, ""], strict=True))


def _row(results: Results, k: int, text: str) -> Row:
    w = results.windows
    return Row(number(float(w.t[k]), 8), number(float(w.H[k]), 4), text)


# What a run cost: windows and iterations over time, and where the seconds went.

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
    known = good[np.isfinite(good.contraction) & (good.contraction > 0)]
    # fault: an empty panel of contractions is drawn -> measured = True | coupler/test_report_windows
    measured = len(known) > 0
    figure = page_figure(5.0 if measured else 3.0)
    axes = [figure.subplots()] if not measured else list(figure.subplots(2, 1, sharex=True))
    upper = styled(axes[0], "" if measured else "time [s]", "iterations a window")
    edges = np.append(good.t, good.t[-1] + good.H[-1])
    upper.stairs(good.iterations, edges, baseline=None, color=COLOURS[0], linewidth=1.4, label="iterations")
    upper.set_ylim(0, good.iterations.max() * 1.1)
    upper.yaxis.set_major_locator(MaxNLocator(integer=True))
    if measured:
        lower = styled(axes[1], "time [s]", "contraction")
        lower.set_yscale("log")
        lower.yaxis.set_minor_locator(NullLocator())
        lower.plot(known.t + known.H, known.contraction, ".", color=COLOURS[1], markersize=3, label="contraction")
        lower.axhline(1.0, color="#999999", linewidth=0.7, zorder=1, label="plain iteration diverges above")
    legend_below(figure, axes, columns=3)
    text = f"{good.iterations.sum()} iterations in {len(good)} windows, {good.iterations.max()} at most in one"
    if not measured:
        return svg(figure, f"{text}.", f"{text}. The contraction of plain iteration was not measured.")
    return svg(figure, f"{text}; the contraction of plain iteration below.",
               f"{text}. Below: contraction, the factor by which an iteration without acceleration would reduce the "
               "difference of two iterates, as measured in each window.")


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


def shares_picture(parts: list[Share], both: float = 0.0) -> Picture | None:
    """One bar of where the seconds went.  both : seconds [s] in which both halves worked, which each of them has."""
    if not sum(p.seconds for p in parts) > 0:
        return None
    figure = page_figure(1.7)
    twice = f"; {number(both, 3)} s in which both halves worked count twice" if both > 0 else ""
    ax = styled(figure.subplots(), f"wall-clock time [s]{twice}", "")
    left = 0.0
    for k, part in enumerate(parts):
        ax.barh([0], [part.seconds], left=[left], color=COLOURS[k % len(COLOURS)], label=part.name, height=0.6)
        left += part.seconds
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.set_xlim(0, left)
    legend_below(figure, ax, columns=6)
    text = ", ".join(f"{p.name} {number(p.seconds, 3)} s" for p in parts)
    return svg(figure, f"Where the time went: {text}{twice}.")


# What the rules of a run did: one row a rule, then its firings.

# A drive fires in every window: the first and the last of many tell enough.
LISTED_FIRST, LISTED_LAST = 8, 2


@dataclass(frozen=True)
class Acted:
    """One firing in words.  window : row of the windows table, from 1."""

    window: int
    t: str
    did: str
    saw: str


@dataclass(frozen=True)
class Ruled:
    """A rule, how often it fired, and its first and last firings; left_out : how many lie between."""

    name: str
    times: int
    first: tuple[Acted, ...]
    last: tuple[Acted, ...] = ()

    @property
    def left_out(self) -> int:
        return self.times - len(self.first) - len(self.last)


def rules_that_fired(results: Results) -> list[Ruled]:
    """By name, in the order in which they fired first."""
    found: dict[str, list[FiredRule]] = {}
    for firing in results.firings:
        found.setdefault(firing.rule, []).append(firing)
    return [_ruled(name, firings) for name, firings in found.items()]


def _ruled(name: str, firings: list[FiredRule]) -> Ruled:
    told = [Acted(f.row + 1, number(f.t, 8), f.text, _saw(f.values)) for f in firings]
    if len(told) <= LISTED_FIRST + LISTED_LAST:
        return Ruled(name, len(told), tuple(told))
    return Ruled(name, len(told), tuple(told[:LISTED_FIRST]), tuple(told[-LISTED_LAST:]))


def _saw(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {number(value, 5)}" for name, value in values.items())
