"""What control chose in a run: schemes and their reasons, windows cut short, events, and the errors it went by."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.ticker import FuncFormatter, NullLocator
from numpy.typing import NDArray

from coupler.record.results import Results
from coupler.report.picture import COLOURS, Picture, legend_below, page_figure, styled, svg
from coupler.report.units import number

# A window shorter than this share of the one before has a reason worth reading.
SHORT = 1.0 / 3.0
LISTED = 40
EACH = 200  # windows listed one by one
SCHEDULED = "as the schedule says"


@dataclass(frozen=True)
class Choice:
    """So many windows by a scheme; reasons : the commonest in words, numbers left out."""

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
                            int(w.solves[w.scheme == scheme].sum()), _commonest(results, rows.tolist())))
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
                   _commonest(results, rows[w.taken].tolist()))


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
    for k, quantity in enumerate(("temperature", "gap", "heat", "displacement")):
        known = np.isfinite(e[quantity]) & (e[quantity] > 0.0)
        if known.any():
            ax.plot(t[known], e[quantity][known], ".", color=COLOURS[k], markersize=3, label=quantity)
    ax.axhline(1.0, color="#999999", linewidth=0.7, zorder=1, label="put back above")
    legend_below(figure, ax, columns=5)
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value, 2)))
    ax.yaxis.set_minor_locator(NullLocator())
    good = w.error[w.taken & np.isfinite(w.error)]
    middle = number(float(np.median(good)), 3) if len(good) else "unknown"
    text = f"Estimated error of each window; the median of those taken is {middle} tolerances"
    return svg(figure, f"{text}.", f"{text}.")


def _commonest(results: Results, rows: list[int]) -> str:
    """The three commonest reasons, without the numbers in them."""
    counts: dict[str, int] = {}
    for k in rows:
        text = re.sub(r"-?\d[\d.e+-]*", "#", results.reasons.get(k, SCHEDULED))
        counts[text] = counts.get(text, 0) + 1
    best = sorted(counts.items(), key=lambda item: -item[1])[:3]
    return "; ".join(f"{text} ({n})" for text, n in best)


def _row(results: Results, k: int, text: str) -> Row:
    w = results.windows
    return Row(number(float(w.t[k]), 8), number(float(w.H[k]), 4), text)
