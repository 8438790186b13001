"""Writes the files of a study: its page, its data as JSON and CSV, and the cheapest settings as scenarios."""

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

from jinja2 import Environment, StrictUndefined

from coupler.experiments.study import Study
from coupler.experiments.study_chart import draw, svg_text
from coupler.experiments.study_plan import PlannedRun
from coupler.experiments.work_precision import LEVELS, Point, cheapest
from coupler.report.figures import Picture, duration, number
from coupler.running.safe_write import write_whole
from coupler.scenario.document import Document, dumped, layout
from coupler.scenario.edits import apply_overrides

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
             "floor": _finite(p.floor), "below_floor": p.below_floor, "message": p.message, "run": run.key,
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
    tree = dict(apply_overrides(document, run.job.overrides).tree)
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
             "below": p.below_floor, "errors": [relative(e) for e in (p.by_probe or {}).values()]}
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
    caption = ("Hollow markers at the upper border: runs that failed, or whose error is above 100 %. The pale band "
               "joins the Pareto optimal runs: no other has both less cost and less error.")
    if study.limits:
        caption += (" Dotted lines: the longest stable windows of a curve, as a pilot run predicts them; runs to their "
                    "left have longer ones.")
    return Picture(src, f"Error against solver calls and wall time: {_summary(study)}", caption)
