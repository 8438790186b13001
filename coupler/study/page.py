"""The page of a study, and all that is written beside it."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from coupler.report.picture import Picture
from coupler.report.units import duration, number
from coupler.study.chart import draw, svg_text
from coupler.study.conduct import Study
from coupler.study.score import LEVELS, Point, cheapest
from coupler.study.tables import as_csv, as_json, percent, put, setting

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
