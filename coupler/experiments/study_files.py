"""Writes the files of a study: its page with the work-precision chart, its data (JSON, CSV), the cheapest scenarios."""

from __future__ import annotations

import base64
import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
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

from coupler.experiments.study import PlannedRun, StabilityLimit, Study
from coupler.experiments.work_precision import LEVELS, Point, cheapest, pareto_front
from coupler.record.paths import write_whole
from coupler.report.figures import GRID, INK, Picture, duration, line_style, new_figure, number, plain, styled
from coupler.scenario.document import Document, dumped, layout
from coupler.scenario.quantities import with_overrides

# Draws the work-precision chart: error against solver calls and against wall time, both logarithmic.

MARKERS = "os^Dvp*hX"
COSTS = (("solver_calls", "solver calls"), ("seconds", "wall time [s]"))
PALE, GREY, ALARM = "#f0e2a8", "#777777", "#b00020"
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
        _marks(ax, [_at(p, cost, ax, high) for p in on if p.broken], marker="x", markersize=9, linestyle="none",
               markeredgecolor=ALARM, markeredgewidth=1.6, zorder=6, gid="broken")
    if any(p.broken for p in points):
        ax.plot([], [], marker="x", markersize=9, linestyle="none", markeredgecolor=ALARM, markeredgewidth=1.6,
                label="says itself: do not trust")
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


# Writes the files of a study: its page, its data as JSON and CSV, and the cheapest settings as scenarios.

FORMAT, VERSION = "slideline.study", 1


TEMPLATE = "page.html.j2"


@dataclass(frozen=True)
class CheapestRun:
    """A row of the table of cheapest settings.  file : the scenario written for it.  why : there is none."""

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
    write_whole(out / "study.json", as_json(_facts_as_data(study), study.plan.runs, study.points))
    write_whole(out / "study.csv", as_csv(study.plan.runs, study.points))
    best = _best(study, out)
    picture = None
    if any(math.isfinite(p.error) for p in study.points):
        text = svg_text(draw(study.points, study.limits))
        write_whole(out / "study.svg", text)
        picture = _picture(text, study)
    return write_whole(out / "study.html", render(study, best, picture))


def percent(level: float) -> str:
    """Format an error level: 1 %, 0.1 %, 0.01 %."""
    return f"{100 * level:g} %"


def rows(runs: Sequence[PlannedRun], points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return one mapping a run; numbers that are not finite are None."""
    return [{"label": p.label, **{f"at.{axis}": value for axis, value in run.setting.at.items()},
             "half_solves": p.solver_calls, "seconds": _finite(p.seconds), "error": _finite(p.error),
             "floor": _finite(p.floor), "below_floor": p.below_floor, "message": p.message,
             "broken": list(p.broken), "run": run.key,
             **{f"error.{n}": _finite(e) for n, e in (p.by_probe or {}).items()}}
            for run, p in zip(runs, points, strict=True)]


def as_json(facts: Mapping[str, Any], runs: Sequence[PlannedRun], points: Sequence[Point]) -> str:
    """Return a study as JSON, with `facts` beside the runs."""
    # Keys of this file, which programs read, stay `.1 %`.
    best = {percent(level).removeprefix("0"): (p.label if (p := cheapest(points, level)) else None) for level in LEVELS}
    whole = {"format": FORMAT, "version": VERSION, **facts, "cheapest": best, "runs": rows(runs, points)}
    return json.dumps(whole, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def as_csv(runs: Sequence[PlannedRun], points: Sequence[Point]) -> str:
    """Return the runs as a table with the columns of all runs, empty where a run has none."""
    table = rows(runs, points)
    file = io.StringIO()
    writer = csv.DictWriter(file, list(dict.fromkeys(name for row in table for name in row)), lineterminator="\n")
    writer.writeheader()
    for row in table:
        writer.writerow({n: json.dumps(v) if isinstance(v, dict | list) else v for n, v in row.items()})
    return file.getvalue()


def setting_text(document: Document, run: PlannedRun, point: Point, level: float) -> str:
    """Return the scenario file of one run, complete but for the study itself."""
    # fault: the cheapest setting without what makes it so -> tree = dict(document.tree) | coupler/test_study_run
    tree = dict(with_overrides(document, run.job.overrides).tree)
    tree.pop("study", None)
    for body in tree["bodies"].values():
        if file := body.get("mesh", {}).get("file"):
            file["path"] = str((document.path.parent / file["path"]).resolve())
    yaml = layout()
    yaml.default_flow_style = None
    return (f"# {document.path.name}, {point.label}: the cheapest run of a study with an error of at most "
            f"{percent(level)}.\n"
            f"# Its error is {100 * point.bound:.2g} %, it costs {point.solver_calls} solver calls.\n"
            f"{dumped(tree, yaml)}")


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def render(study: Study, best: Sequence[CheapestRun], picture: Picture | None) -> str:
    """Return the page as text."""
    # Names and texts of a scenario are a stranger's: everything is escaped, and a slip in the template is an error.
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(resources.files(__package__).joinpath(TEMPLATE).read_text("utf-8"))
    points = study.points
    return template.render(
        title=study.plan.base.title, summary=_summary(study), notes=[*study.notes, *_remarks(study)], picture=picture,
        cheapest=best, probes=list(study.scale.probes), rows=_rows(study), starred=any(p.below_floor for p in points),
        facts=_facts(study), scenario=study.document.text)


def relative(error: float) -> str:
    """Format a relative error in percent with two figures."""
    return "unknown" if math.isnan(error) else f"{number(100 * error, 2)} %"


def _best(study: Study, out: Path) -> list[CheapestRun]:
    """Write the cheapest settings as scenarios; remove one of an earlier study that no longer holds."""
    rows = []
    for level in LEVELS:
        path = out / f"cheapest_{100 * level:g}_percent.yaml"
        p = cheapest(study.points, level)
        if p is None:
            path.unlink(missing_ok=True)
            why = "no run is that accurate"
            if study.scale.floor > level:
                why = f"unknown: the reference's own error is {relative(study.scale.floor)}"
            rows.append(CheapestRun(percent(level), None, why=why))
            continue
        run = study.plan.runs[list(study.points).index(p)]
        write_whole(path, setting_text(study.document, run, p, level))
        rows.append(CheapestRun(percent(level), p, relative(p.bound), duration(p.seconds), path.name))
    return rows


def _rows(study: Study) -> list[dict[str, Any]]:
    return [{"label": p.label, "solver_calls": p.solver_calls, "windows": o.windows, "rejected": o.rejected,
             "seconds": duration(p.seconds), "order": order, "message": p.message, "error": relative(p.error),
             "below": p.below_floor, "broken": ", ".join(p.broken),
             "errors": [relative(e) for e in (p.by_probe or {}).values()]}
            for p, o, order in zip(study.points, study.trials, _orders(study), strict=True)]


def _orders(study: Study) -> list[str]:
    """Return log(e/e')/log(F/F') of each run and the next shorter windows on its curve; empty for the shortest."""
    sizes = [float(run.setting.at.get("windows", math.nan)) for run in study.plan.runs]
    on = list(zip(sizes, study.points, strict=True))
    orders = []
    for F, p in on:
        shorter = [(G, q) for G, q in on if q.series == p.series and F > G]
        text = ""
        if shorter:
            G, q = max(shorter, key=lambda pair: pair[0])
            if min(p.error, q.error) > 0.0 and not (p.below_floor or q.below_floor):
                text = f"{math.log(p.error / q.error) / math.log(F / G):.2f}"
        orders.append(text)
    return orders


def _summary(study: Study) -> str:
    failed = sum(bool(o.failed) for o in study.trials)
    text = f"{len(study.points)} runs against {study.reference.description}"
    return f"{text}; {failed} failed." if failed else f"{text}; none failed."


def _remarks(study: Study) -> list[str]:
    """Return what a reader must know of the reference."""
    r, notes = study.reference, []
    if not r.other and math.isnan(r.error):
        notes.append("The reference's own error is unknown: errors of its size look larger or smaller than they are.")
    if r.other and not any(abs(r.order - p) <= 0.3 for p in (1, 2)):
        notes.append(f"When its windows were halved the reference converged with order {r.order:.2f}, near "
                     "neither 1 nor 2: nothing was extrapolated, and the last change is taken for its own error.")
    return notes


def _facts(study: Study) -> list[tuple[str, str]]:
    r, (a, b) = study.reference, study.scale.span
    return [("reference", r.description),
            ("its order, measured", f"{r.order:.2f}" if math.isfinite(r.order) else "not measured"),
            ("its own error", relative(study.scale.floor)),
            ("span", f"{a:g} to {b:g} s"),
            *((f"range of {name}", f"{number(size, 4)} {study.plan.base.probes[name].unit}"
               if name in study.plan.base.probes else number(size, 4)) for name, size in study.scale.probes.items()),
            *((f"predicted limit, {x.series}", "none" if math.isinf(x.windows) else f"windows of "
               f"{number(x.windows, 3)} times those of the scenario, about {x.solver_calls:.0f} solver calls")
              for x in study.limits)]


def _facts_as_data(study: Study) -> dict[str, Any]:
    r = study.reference
    return {"title": study.plan.base.title, "scenario": study.document.path.name,
            "reference": {"words": r.description, "order": r.order if math.isfinite(r.order) else None},
            "span": list(study.scale.span), "ranges": dict(study.scale.probes), "notes": list(study.notes),
            "limits": [{"series": x.series, "windows": _finite(x.windows), "half_solves": x.solver_calls}
                       for x in study.limits]}


def _picture(text: str, study: Study) -> Picture:
    src = f"data:image/svg+xml;base64,{base64.b64encode(text.encode()).decode()}"
    caption = ("Hollow markers at the upper border: runs that failed, or whose error is above 100 %. Crossed out: runs "
               "that end with 'do not trust', which the table of all runs says why. The pale band "
               "joins the Pareto optimal runs: no other has both less cost and less error.")
    if study.limits:
        caption += (" Dotted lines: the longest stable windows of a curve, as a pilot run predicts them; runs to their "
                    "left have longer ones.")
    return Picture(src, f"Error against solver calls and wall time: {_summary(study)}", caption)
