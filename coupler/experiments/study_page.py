"""The work-precision chart: error against half-solves and against wall time, both logarithmic."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from coupler.experiments.study import (
    LEVELS,
    Limit,
    Point,
    Study,
    as_csv,
    as_json,
    cheapest,
    front,
    percent,
    put,
    setting,
)
from coupler.report.figures import GRID, INK, Picture, duration, line_style, new_figure, number, plain, styled

MARKERS = "os^Dvp*hX"
COSTS = (("half_solves", "half-solves"), ("seconds", "wall time [s]"))
PALE, GREY = "#f0e2a8", "#777777"
# Errors beyond this are no answers: their markers are hollow, at the upper border.
MOST = 1.0
TICKS = 2.5  # decades from which powers of ten are ticks enough
LETTERS, MARK = 130, 8  # of a row of the legend, and what a marker takes of them
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
    """The figure as SVG; equal numbers make equal files.  Its text stays text, which keeps the file small."""
    file = io.StringIO()
    with rc_context({"svg.hashsalt": "slideline", "svg.fonttype": "none",
                     "font.sans-serif": ["Helvetica", "Arial", "DejaVu Sans", "sans-serif"]}):
        figure.savefig(file, format="svg", metadata={"Date": None})
    return file.getvalue()


def _ticks(ax: Axes) -> None:
    """Plain numbers at whole powers of ten, at 1, 2 and 5 where there are hardly any; errors in percent."""
    for axis, (low, high), form in ((ax.xaxis, ax.get_xlim(), "{:g}"), (ax.yaxis, ax.get_ylim(), "{:g} %")):
        subs = (1.0,) if math.log10(high / low) > TICKS else (1.0, 2.0, 5.0)
        scale = 100.0 if axis is ax.yaxis else 1.0
        axis.set_major_locator(LogLocator(subs=subs))
        axis.set_major_formatter(FuncFormatter(lambda v, _, form=form, scale=scale: form.format(scale * v)))
        axis.set_minor_formatter(NullFormatter())


def _errors(points: Sequence[Point]) -> tuple[float, float]:
    """Bounds of the error axis: room above for what has no answer."""
    shown = [e for e in (*(p.error for p in points), _own(points)) if 0.0 < e <= MOST]
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
        # Joined by half-solves on both charts: a busy machine must not tie a knot into a curve.
        on = sorted((p for p in points if p.series == series), key=lambda p: p.half_solves)
        style, marker = line_style(k), MARKERS[k % len(MARKERS)]
        good = [p for p in on if p.error <= MOST]
        _marks(ax, [_at(p, cost, ax, high) for p in good], marker=marker, markersize=5, zorder=4,
               label=plain(series), **{**style, "linewidth": style["linewidth"] * 0.6})
        _marks(ax, [_at(p, cost, ax, high) for p in on if not p.error <= MOST], marker=marker, markersize=7,
               # fault: failures of a study filled -> linestyle="none", markerfacecolor="black", clip_on=False,
               #   zorder=5, markeredgecolor=style["color"], | coupler/test_study
               linestyle="none", markerfacecolor="white", clip_on=False, zorder=5, markeredgecolor=style["color"],
               gid="failed")
        _marks(ax, [_at(p, cost, ax, high) for p in good if p.below], marker="o", markersize=11, linestyle="none",
               markerfacecolor="none", markeredgecolor=GREY, zorder=5, gid="below")
    for name, marker, size in (("failed, or above 100 %", "o", 7), ("below the reference's own error", "o", 11)):
        if any((p.below if "below" in name else not p.error <= MOST) for p in points):
            ax.plot([], [], marker=marker, markersize=size, linestyle="none", markerfacecolor="none",
                    markeredgecolor=GREY, label=name)


def _marks(ax: Axes, at: Sequence[tuple[float, float]], **style: Any) -> None:
    """Points, where there are any; an empty line that is not clipped would take all the room."""
    if at:
        ax.plot(*zip(*at, strict=True), **style)[0].set_in_layout(False)


def _front(ax: Axes, points: Sequence[Point], cost: str, high: float) -> None:
    best = [p for p in front(points, cost) if p.known <= MOST]
    if best:
        x, y = [getattr(p, cost) for p in best], [max(p.known, ax.get_ylim()[0]) for p in best]
        ax.step([x[0], *x, ax.get_xlim()[1]], [high, *y, y[-1]], where="post", color=PALE, linewidth=5, zorder=1,
                solid_joinstyle="round", label="not beaten by any other")


def _floor(ax: Axes, points: Sequence[Point]) -> None:
    if _own(points) > 0.0:
        ax.axhline(_own(points), color=INK, linewidth=1.0, linestyle=(0, (6, 3)), zorder=2,
                   label="the reference's own error")


def _own(points: Sequence[Point]) -> float:
    """The reference's own error, the same for every run; 0 where it is unknown."""
    return max((p.floor for p in points if math.isfinite(p.floor)), default=0.0)


def _guides(ax: Axes) -> None:
    """Slopes of order 1 and 2, where a chart is empty: what is cheap is not exact."""
    (left, right), (low, high) = np.log10(ax.get_xlim()), np.log10(ax.get_ylim())
    begin, top, width = left + 0.04 * (right - left), low + 0.42 * (high - low), 0.2 * (right - left)
    for p in (1, 2):
        run = min(width, (top - low) / p)
        end = 10 ** (begin + run), 10 ** (top - p * run)
        ax.plot([10**begin, end[0]], [10**top, end[1]], color=GREY, linewidth=0.9, zorder=1)
        _note(ax, f"{p}", end, (3, 2), GREY)
    _note(ax, "order", (10**begin, 10**top), (0, 3), GREY)


def _note(ax: Axes, text: str, at: tuple[float, float], offset: tuple[float, float], colour: str) -> None:
    """Small words at a place; the layout does not make room for them."""
    ax.annotate(text, at, xytext=offset, textcoords="offset points", in_layout=False, color=colour, fontsize=8)


def _limits(ax: Axes, points: Sequence[Point], limits: Sequence[Limit]) -> None:
    """A line where the windows of a curve become too long, those to its left; the legend says where it is not shown."""
    names = list(dict.fromkeys(p.series for p in points))
    left, right = ax.get_xlim()
    for limit in limits:
        style = {"color": line_style(names.index(limit.series))["color"], "linewidth": 1.2, "linestyle": ":",
                 "zorder": 2, "label": f"{plain(limit.series)}: {_said(limit, left, right)}"}
        if left < limit.half_solves < right:
            ax.axvline(limit.half_solves, gid="limit", **style)
        else:
            ax.plot([], [], **style)


def _said(limit: Limit, left: float, right: float) -> str:
    # fault: no limit is told as one -> if False: | coupler/test_study
    if math.isinf(limit.windows):
        return "no limit predicted"
    return "all within the predicted limit" if limit.half_solves <= left else (
        "all beyond the predicted limit" if limit.half_solves >= right else "predicted limit")


# The page of a study, and all that is written beside it.

TEMPLATE = "page.html.j2"


@dataclass(frozen=True)
class Best:
    """A row of the table of cheapest settings.  file : the scenario that was written for it."""

    level: str
    point: Point | None
    error: str = ""
    seconds: str = ""
    file: str = ""
    why: str = ""


def write_study(study: Study, out: Path) -> Path:
    """Write study.json, study.csv, study.svg, cheapest_*.yaml and the page study.html into `out`; returns the page.

    Raises ResultsError for what cannot be written.
    """
    put(out / "study.json", as_json(_facts_as_data(study), study.plan.runs, study.points))
    put(out / "study.csv", as_csv(study.plan.runs, study.points))
    best = _best(study, out)
    picture = None
    if any(math.isfinite(p.error) for p in study.points):
        text = svg_text(draw(study.points, study.limits))
        put(out / "study.svg", text)
        picture = _picture(text, study)
    return put(out / "study.html", render(study, best, picture))


def render(study: Study, best: Sequence[Best], picture: Picture | None) -> str:
    """The page as text."""
    # Names and texts of a scenario are a stranger's: everything is escaped, and a slip in the template is an error.
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(resources.files(__package__).joinpath(TEMPLATE).read_text("utf-8"))
    points = study.points
    return template.render(
        title=study.plan.base.title, summary=_summary(study), notes=[*study.notes, *_remarks(study)], picture=picture,
        cheapest=best, probes=list(study.scale.probes), rows=_rows(study), starred=any(p.below for p in points),
        facts=_facts(study), scenario=study.document.text)


def relative(error: float) -> str:
    """A relative error for a reader: in percent, two figures."""
    return "unknown" if math.isnan(error) else f"{number(100 * error, 2)} %"


def _best(study: Study, out: Path) -> list[Best]:
    """The cheapest settings, each written as a scenario; one of an earlier study that no longer holds is removed."""
    rows = []
    for level in LEVELS:
        path = out / f"cheapest_{100 * level:g}_percent.yaml"
        p = cheapest(study.points, level)
        if p is None:
            path.unlink(missing_ok=True)
            why = "no run is that exact"
            if study.scale.floor > level:
                why = f"cannot be told: the reference's own error is {relative(study.scale.floor)}"
            rows.append(Best(percent(level), None, why=why))
            continue
        run = study.plan.runs[list(study.points).index(p)]
        put(path, setting(study.document, run, p, level))
        rows.append(Best(percent(level), p, relative(p.known), duration(p.seconds), path.name))
    return rows


def _rows(study: Study) -> list[dict[str, Any]]:
    return [{"label": p.label, "half_solves": p.half_solves, "windows": o.windows, "rejected": o.rejected,
             "seconds": duration(p.seconds), "order": order, "message": p.message, "error": relative(p.error),
             "below": p.below, "errors": [relative(e) for e in (p.by_probe or {}).values()]}
            for p, o, order in zip(study.points, study.trials, _orders(study), strict=True)]


def _orders(study: Study) -> list[str]:
    """log(e/e')/log(F/F') of each run and the next shorter windows on its curve; empty for the shortest."""
    sizes = [float(run.cell.at.get("windows", math.nan)) for run in study.plan.runs]
    on = list(zip(sizes, study.points, strict=True))
    found = []
    for F, p in on:
        shorter = [(G, q) for G, q in on if q.series == p.series and F > G]
        text = ""
        if shorter:
            G, q = max(shorter, key=lambda pair: pair[0])
            if min(p.error, q.error) > 0.0 and not (p.below or q.below):
                text = f"{math.log(p.error / q.error) / math.log(F / G):.2f}"
        found.append(text)
    return found


def _summary(study: Study) -> str:
    failed = sum(bool(o.failed) for o in study.trials)
    text = f"{len(study.points)} runs against {study.reference.words}"
    return f"{text}; {failed} failed." if failed else f"{text}; none failed."


def _remarks(study: Study) -> list[str]:
    """What a reader must know of the reference."""
    r, notes = study.reference, []
    if not r.other and math.isnan(r.error):
        notes.append("The reference's own error is not known: errors near it look larger or smaller than they are.")
    if r.other and not any(abs(r.order - p) <= 0.3 for p in (1, 2)):
        notes.append(f"When its windows were halved the reference converged with order {r.order:.2f}, near "
                     "neither 1 nor 2: nothing was extrapolated, and the last change is taken for its own error.")
    return notes


def _facts(study: Study) -> list[tuple[str, str]]:
    r, (a, b) = study.reference, study.scale.span
    return [("reference", r.words),
            ("its order, measured", f"{r.order:.2f}" if math.isfinite(r.order) else "not measured"),
            ("its own error", relative(study.scale.floor)),
            ("span", f"{a:g} to {b:g} s"),
            *((f"range of {name}", f"{number(size, 4)} {study.plan.base.probes[name].unit}"
               if name in study.plan.base.probes else number(size, 4)) for name, size in study.scale.probes.items()),
            *((f"predicted limit, {x.series}", "none" if math.isinf(x.windows) else f"windows of "
               f"{number(x.windows, 3)} times those of the scenario, about {x.half_solves:.0f} half-solves")
              for x in study.limits)]


def _facts_as_data(study: Study) -> dict[str, Any]:
    r = study.reference
    return {"title": study.plan.base.title, "scenario": study.document.path.name,
            "reference": {"words": r.words, "order": r.order if math.isfinite(r.order) else None},
            "span": list(study.scale.span), "ranges": dict(study.scale.probes), "notes": list(study.notes),
            "limits": [{**vars(x), "windows": x.windows if math.isfinite(x.windows) else None} for x in study.limits]}


def _picture(text: str, study: Study) -> Picture:
    src = f"data:image/svg+xml;base64,{base64.b64encode(text.encode()).decode()}"
    caption = ("Hollow markers at the upper border: runs that failed, or whose error is above 100 %. The pale "
               "band joins runs that no other beats in cost and error." + (" Dotted lines: the longest stable windows "
               "of a curve, as a pilot run predicts them; what lies to their left has longer ones." if study.limits
               else ""))
    return Picture(src, f"Error against half-solves and wall time: {_summary(study)}", caption)
