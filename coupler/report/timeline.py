"""Where the time went, window by window, and in one window call by call."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupler.fmu.metered import CALLS, SIDES
from coupler.record.results import Results
from coupler.report.figures import COLOURS, Picture, legend_below, number, page_figure, styled, svg

BINS = 240  # of the run's wall-clock time
Array = NDArray[np.float64]
LAYERS = (("thermal half", ("thermal",)), ("mechanical half", ("mechanical",)),
          ("waiting for contact", ("thermal_contact", "mechanical_contact")), ("inputs and outputs", ("border",)),
          ("messages", ("transport",)), ("states kept", ("states",)), ("coupler", ("coupler",)),
          ("recording", ("record",)))
SHADES = (*COLOURS, "#B0B0B0")
LANES = ("coupler", *SIDES)


def timeline_picture(results: Results) -> Picture | None:
    """The share of each part of the seconds over the run's wall-clock time; None where no timings are known."""
    edges, shares = shares_over_time(results)
    if not len(edges):
        return None
    figure = page_figure(2.8)
    ax = styled(figure.subplots(), "wall-clock time [s]", "share of it")
    low = np.zeros(len(edges) - 1)
    for k, (name, _) in enumerate(LAYERS):
        if shares[k].any():
            ax.stairs(low + shares[k], edges, baseline=low, fill=True, color=SHADES[k], label=name)
            low = low + shares[k]
    ax.set_xlim(edges[0], edges[-1])
    ax.set_ylim(0.0, 1.0)
    legend_below(figure, ax, columns=4)
    return svg(figure, "Where the time went while the run went on.",
               "Where the time went while the run went on; what is left white was spent outside of windows.")


def shares_over_time(results: Results) -> tuple[Array, Array]:
    """Return edges (n + 1,) [s] of wall-clock time since the first window, and of each of LAYERS its share (8, n) [1].

    A window's parts are spread evenly over its seconds.
    """
    rows = results.timings[np.isfinite(results.timings.begun)]
    if not len(rows):
        return np.empty(0), np.empty((len(LAYERS), 0))
    ended = rows.begun + rows.seconds + rows.record
    edges = np.linspace(rows.begun[0], ended.max(), min(BINS, max(len(rows), 2)) + 1)
    # What both halves did at the same time counts in the share of each as far as it goes; files before have none.
    overlap = rows.overlap if "overlap" in rows.dtype.names else np.zeros(len(rows))
    once = rows.seconds / np.maximum(rows.seconds + overlap, 1e-12)
    solved = (rows.begun, rows.begun + rows.seconds)
    recorded = (rows.begun + rows.seconds, ended)
    shares = np.array([sum(_spread(rows[part], *recorded, edges) if part == "record" else
                           # fault: what was done at the same time counts twice -> _spread(rows[part], *solved, edges)
                           #   | coupler/test_overlap
                           _spread(rows[part] * once, *solved, edges)
                           for part in parts) for _, parts in LAYERS])
    return edges, shares / np.diff(edges)


def _spread(seconds: Array, begun: Array, ended: Array, edges: Array) -> Array:
    """Return (n,) [s] of amounts that fall between edges (n + 1,) [s], each spread evenly from `begun` to `ended`."""
    # Up to a time: all of the windows that ended before it, and of the one that goes on then its part so far.
    before = np.concatenate([[0.0], np.cumsum(seconds)])
    k = np.searchsorted(begun, edges, side="right") - 1
    of = np.clip(k, 0, None)
    part = np.clip((edges - begun[of]) / np.maximum(ended[of] - begun[of], 1e-12), 0.0, 1.0)
    # fault: of a window that is not over yet all is counted -> return np.diff(np.where(k < 0, 0.0, before[of + 1])) |
    #   coupler/test_timings::test_shares_of_time_are_those_of_the_windows
    return np.diff(np.where(k < 0, 0.0, before[of] + seconds[of] * part))


def window_picture(results: Results) -> Picture | None:
    """One window call by call: the one whose seconds are the median of those taken; None where none is known."""
    k = typical(results)
    if k is None:
        return None
    calls, row = results.calls[results.calls.window == k], results.timings[k]
    figure = page_figure(2.2)
    ax = styled(figure.subplots(), "time since the window began [ms]", "")
    bars: dict[tuple[str, str], list[tuple[int, float, float]]] = {
        ("solving and judging", SHADES[6]): [(0, 0.0, float(row.seconds))],
        ("recording", SHADES[7]): [(0, float(row.seconds), float(row.record))]}
    for call in calls:
        lane = 1 + int(call.side)
        for name, colour, begun, seconds in _pieces(call):
            bars.setdefault((name, colour), []).append((lane, begun, seconds))
    for (name, colour), each in bars.items():
        ax.barh([b[0] for b in each], [1e3 * b[2] for b in each], left=[1e3 * b[1] for b in each], color=colour,
                label=name, height=0.6)
    ax.set_yticks(range(len(LANES)), LANES)
    ax.invert_yaxis()
    ax.set_xlim(0.0, 1e3 * float(row.seconds + row.record))
    legend_below(figure, ax, columns=4)
    text = (f"One window, call by call: the one from t = {number(float(results.windows.t[k]), 6)} s, whose "
            f"{number(1e3 * float(row.seconds), 3)} ms are the median")
    return svg(figure, f"{text}.", f"{text}; where in its step a half waited for contact is not known.")


def typical(results: Results) -> int | None:
    """Return the row of the window taken whose seconds are the median; None where no timing is known."""
    rows = np.flatnonzero(np.isfinite(results.timings.begun) & results.windows.taken[:len(results.timings)])
    if not len(rows):
        return None
    order = np.argsort(results.timings.seconds[rows], kind="stable")
    return int(rows[order[(len(rows) - 1) // 2]])


def _pieces(call: np.record) -> list[tuple[str, str, float, float]]:
    """Name, colour, begin and length [s] of what a call is drawn as."""
    name, begun, seconds = CALLS[call.call], float(call.begun), float(call.seconds)
    if name != "advance":
        return [("outputs read", SHADES[3], begun, seconds) if name == "read" else
                ("states kept", SHADES[5], begun, seconds)]
    work, contact = float(call.work), float(call.contact)
    at = begun + 0.5 * (seconds - work - contact)
    return [("inputs, outputs, messages", SHADES[4], begun, seconds), (f"{LANES[1 + int(call.side)]} work",
            SHADES[int(call.side)], at, work), ("waiting for contact", SHADES[2], at + work, contact)]
