"""Probes against time: all temperatures in one figure (the paper's Figure 4), closer where most happens, the rest."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from coupler.record.results import Results
from coupler.report.figures import (
    Picture,
    Shown,
    axes_of,
    axis_names,
    counted,
    draw_kinks,
    legend_below,
    line_style,
    named,
    number,
    page_figure,
    plain,
    shown,
    svg,
)
from coupler.report.pack import Chart, Curve

Array = NDArray[np.float64]

BINS = 20  # the time axis in so many parts where kinks do not cut it
TALL, LOW = 4.5, 3.4  # inches: temperatures, and all else
ZOOM_AT_MOST = 0.6  # a closer look at more of the run than this is none
BAND = 0.3  # of the colour of a curve, for its error
NARROW = 0.004  # of the range of the curves: less is not seen
LEAST_GAIN = 0.1  # share of the movement beyond the share of the time: below it curves move about evenly
NAMES = {"T": "temperature", "u_x": "displacement u_x", "u_y": "displacement u_y", "gap": "gap", "p": "pressure",
         "f_s": "solid fraction"}
ERRORS = {"T": "temperature", "gap": "gap", "u_x": "displacement", "u_y": "displacement"}  # whose it is


def probe_pictures(results: Results) -> list[Picture]:
    """The figures of all probes: temperatures, temperatures closer, then one a quantity.  [] without probes."""
    if len(results.t) < 2:
        return []
    by_quantity: dict[str, list[str]] = {}
    for name in results.probe_names:
        by_quantity.setdefault(results.quantity(name), []).append(name)
    pictures = []
    for quantity, names in sorted(by_quantity.items(), key=lambda item: item[0] != "T"):
        pictures.append(_picture(results, quantity, names, None))
        near = eventful(results.t, [results.probe(n)[1] for n in names], kinks_of(results))
        if quantity == "T" and near:
            pictures.append(_picture(results, quantity, names, near))
    return pictures


def name_of(quantity: str, geometry: str) -> str:
    """What a quantity is called in a scene of this geometry."""
    name = NAMES.get(quantity, quantity)
    for own, here in zip(("u_x", "u_y"), axis_names(geometry), strict=True):
        name = name.replace(own, f"u_{here}")
    return name


def error_of(results: Results, quantity: str) -> Array | None:
    """Return the estimated error (n_t,) in SI of the window that ends at each of `t`, nan where unknown.

    None: of no window known.  It is the largest of all nodes, so at a probe more than its own.
    """
    if quantity not in ERRORS or not len(results.errors):
        return None
    of_row = dict(zip(results.errors.window.tolist(), results.errors[ERRORS[quantity]].tolist(), strict=True))
    rows = np.flatnonzero(results.windows.taken)
    # fault: report: an error stands at the end of the window before -> error = np.array([*(of_row.get(row, np.nan) for
    #   row in rows.tolist()), np.nan]) | coupler/test_report_windows
    error = np.array([np.nan, *(of_row.get(row, np.nan) for row in rows.tolist())])
    return error if np.isfinite(error).any() else None


def kinks_of(results: Results) -> list[float]:
    """Times [s] of kinks inside the run, as its header names them."""
    end = float(results.header["coupling"]["end"])
    return [float(k) for k in results.header["coupling"]["kinks"] if 0 < k < end]


def _values(results: Results, name: str) -> Array:
    """(n,) a probe in SI; a gap where nothing is faced is not a number: gap_max stands for it in the file."""
    value = results.probe(name)[1]
    if results.quantity(name) != "gap":
        return value
    return np.where(np.isin(value, [float(p["gap_max"]) for p in results.header["pairs"]]), np.nan, value)


def _picture(results: Results, quantity: str, names: Sequence[str], near: tuple[float, float] | None) -> Picture:
    values = [_values(results, n) for n in names]
    largest = float(np.nan_to_num(np.abs(np.concatenate(values))).max(initial=0.0))
    scale = shown(results.unit(names[0]), largest, results.header["temperature_unit"])
    what = name_of(quantity, str(results.header["geometry"]))
    figure = page_figure(TALL if quantity == "T" else LOW)
    ax = axes_of(figure, "time [s]", named(what, scale.unit))
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        ax.plot(results.t, scale(value), label=plain(name), **line_style(k))
    bands = {n: results.confidence[n] for n in names if n in results.confidence and not results.confidence[n].failed}
    error = None if bands else error_of(results, quantity)
    if error is not None:
        for k, value in enumerate(values):
            ax.fill_between(results.t, scale(value - error), scale(value + error), color=line_style(k)["color"],
                            alpha=BAND, linewidth=0)
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        if name in bands:
            wide = bands[name].error
            ax.fill_between(results.t, scale(value - wide), scale(value + wide), color=line_style(k)["color"],
                            alpha=BAND, linewidth=0)
    low, high = near or (float(results.t[0]), float(results.t[-1]))
    ax.set_xlim(low, high)
    if near:
        _fit_height(ax, results.t, [scale(v) for v in values], near)
    draw_kinks(ax, kinks_of(results))
    legend_below(figure, ax)
    span = f"from {number(low, 6)} s to {number(high, 6)} s"
    of = counted(len(names), "probe") if len(names) > 1 else f"probe {names[0]}"
    title = f"{what[0].upper()}{what[1:]} of {of} against time, {span}"
    caption = _caption(quantity, title, span, near is not None, bool(kinks_of(results)))
    if bands and not near:
        told = "; ".join(f"{plain(n)} {of.words}" for n, of in bands.items())
        caption += f" Bands: the error by {next(iter(bands.values())).by}; {told}."
    if error is not None and not near:
        worst = float(np.nanmax(error))
        apart = replace(shown(results.unit(names[0]), worst), shift=0.0)
        caption += (f" Bands: the estimated error of each window, at most {apart.text(worst, 2)}, at the node "
                    "where it is largest, without the errors of earlier windows.")
        span_of = float(np.nanmax(values) - np.nanmin(values))
        caption += " The bands are narrower than the lines." if worst < NARROW * span_of else ""
    alt = f"{title}: {_ends(names, values, scale)}."
    picture = svg(figure, alt, caption)
    if near:
        return replace(picture, still=True)
    around = {n: np.full(len(results.t), of.error) for n, of in bands.items()}
    if error is not None:
        around = dict.fromkeys(names, error)
    curves = [Curve(n, scale(v), scale.factor * around[n] if n in around else None)
              for n, v in zip(names, values, strict=True)]
    height = 300 if quantity == "T" else 230
    return replace(picture, chart=Chart(named(what, scale.unit), alt, results.t, curves, height))


def _caption(quantity: str, title: str, span: str, near: bool, lines: bool) -> str:
    if near:
        return f"Detail of the time with the largest changes, {span}."
    # fault: a caption of lines that nobody drew -> more = {"T": " Thin vertical lines: breakpoints, where boundary data
    #   jump or change slope.", | coupler/test_report
    more = {"T": " Thin vertical lines: breakpoints, where boundary data jump or change slope." if lines else "",
            "gap": " A node that faces nothing has no gap."}
    return f"{title}.{more.get(quantity, '')}"


def _ends(names: Sequence[str], values: Sequence[Array], scale: Shown) -> str:
    """First and last value of the first few curves, in words."""
    def said(v: float) -> str:
        return scale.text(v) if np.isfinite(v) else "none"

    return "; ".join(f"{n} {said(float(v[0]))} at first, {said(float(v[-1]))} at last"
                     for n, v in zip(names[:6], values, strict=False))


def _fit_height(ax: Axes, t: Array, values: Sequence[Array], near: tuple[float, float]) -> None:
    inside = (t >= near[0]) & (t <= near[1])
    low, high = min(float(v[inside].min()) for v in values), max(float(v[inside].max()) for v in values)
    margin = 0.05 * (high - low) or 1.0
    ax.set_ylim(low - margin, high + margin)


def eventful(t: Array, values: Sequence[Array], kinks: Sequence[float]) -> tuple[float, float] | None:
    """Return the range of time [s] in which curves move most for its length; None if that is about the whole run.

    t : (n,) [s], ascending.  values : (n,) each curve, all in the same unit.  kinks : times [s].
    Time is cut at the kinks (in equal parts without any); of all ranges of neighbouring parts the one is taken that has
    the most of (share of the movement - share of the time).
    """
    length = float(t[-1] - t[0])
    cuts = np.array([t[0], *[k for k in kinks if t[0] < k < t[-1]], t[-1]])
    if len(cuts) < 4:
        cuts = np.linspace(t[0], t[-1], BINS + 1)
    moved = sum((np.append(0.0, np.cumsum(np.abs(np.diff(v)))) for v in values), np.zeros(len(t)))
    if not (np.isfinite(moved).all() and moved[-1] > 0 and length > 0):
        return None
    gain = np.append(0.0, np.cumsum(np.diff(np.interp(cuts, t, moved)) / moved[-1] - np.diff(cuts) / length))
    first, last = max(((i, j) for i in range(len(cuts)) for j in range(i + 1, len(cuts))),
                      key=lambda r: gain[r[1]] - gain[r[0]])
    low, high = float(cuts[first]), float(cuts[last])
    if high - low > ZOOM_AT_MOST * length or gain[last] - gain[first] < LEAST_GAIN:
        return None
    margin = 0.05 * (high - low)
    return max(low - margin, float(t[0])), min(high + margin, float(t[-1]))


# What rules looked at and what they drove, against time: one figure a monitor, one a driven load.

# What a drive says of itself: the input of a half that it sets, and the value.
DRIVEN = re.compile(r"((?:thermal|mechanical)\.(?:load|bc)\.\S+) ([-+.\deE]+)")


def watched_pictures(results: Results) -> list[Picture]:
    """Monitors that are no probes (those are drawn already), then driven loads.  [] where no rule looked at any."""
    t = results.t
    if len(t) < 2:
        return []
    seen = {n: v for n, v in results.monitors.items() if n not in results.probe_names and np.isfinite(v).any()}
    pictures = [_watched_picture(results, name, t, values, f"Monitor {name}, which a rule looks at") for name, values in
                seen.items()]
    for name, (times, values) in driven_loads(results).items():
        pictures.append(_watched_picture(results, name, times, values, f"Factor {name} as the rules set it"))
    return pictures


def driven_loads(results: Results) -> dict[str, tuple[Array, Array]]:
    """Return by name the inputs of halves that rules set: times (n,) [s] and values (n,), in SI.

    The times are the ends of the windows after which a rule set them.  An input that was set once is left out.
    """
    ends = {float(t): float(t + h) for t, h in zip(results.windows.t, results.windows.H, strict=True)}
    found: dict[str, list[tuple[float, float]]] = {}
    for firing in results.firings:
        for name, value in DRIVEN.findall(firing.text):
            found.setdefault(name, []).append((ends.get(firing.t, firing.t), float(value)))
    return {name: (np.array([t for t, _ in points]), np.array([v for _, v in points]))
            for name, points in found.items() if len(points) > 1}


def _watched_picture(results: Results, name: str, t: Sequence[float] | Array, values: Array, what: str) -> Picture:
    figure = page_figure(LOW)
    # A load is driven by its factor.  A file of an earlier version does not know the units of its monitors.
    # fault: what a rule looks at has no unit -> unit = "1" | coupler/test_report
    unit = "1" if what.startswith("Factor") else results.header.get("monitors", {}).get(name, "1")
    scale = replace(shown(unit, float(np.nanmax(np.abs(values)))), shift=0.0)
    ax = axes_of(figure, "time [s]", named(plain(name), scale.unit))
    values = scale(values)
    # What was set holds from then on; what was seen is known at ends of windows.
    ax.plot(t, values, drawstyle="steps-post" if what.startswith("Factor") else "default", **line_style(0))
    ax.set_xlim(float(results.t[0]), float(results.t[-1]))
    draw_kinks(ax, kinks_of(results))
    known = values[np.isfinite(values)]
    of = "" if scale.unit == "1" else f" {scale.unit}"
    alt = f"{what}: {number(float(known[0]), 5)}{of} at first, {number(float(known[-1]), 5)}{of} at last."
    return svg(figure, alt, f"{what}; least {number(float(known.min()), 5)}{of}, largest "
                            f"{number(float(known.max()), 5)}{of}.")
