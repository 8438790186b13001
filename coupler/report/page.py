"""The page: every part of the report put into its template, written in one atomic step."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined, Template

from coupler.errors import ResultsError
from coupler.record.paths import can_resume
from coupler.record.results import Results, depth_of, iteration_words
from coupler.report.conditions import condition_pictures, condition_tables
from coupler.report.contact import contact_pictures
from coupler.report.control import (
    asked,
    choices,
    errors_picture,
    event_rows,
    every_window,
    iterates_picture,
    rules_that_fired,
    shares,
    shares_picture,
    short_windows,
    stretches,
    windows_picture,
)
from coupler.report.curves import probe_pictures, watched_pictures
from coupler.report.fields import field_pictures
from coupler.report.figures import counted, duration, number, shown
from coupler.report.heat import heat_picture, heat_table
from coupler.report.live import live_page
from coupler.report.player import title_of
from coupler.report.pressure import largest, largest_at, place_of_peak, pressure_pictures
from coupler.report.timeline import timeline_picture, window_picture
from coupler.schemes.accounts import HEATS
from coupler.trust.checks import TrustVerdict

# The numbers of a run in words.

LISTED_AT_MOST = 100
AT_ONCE = 1e-6  # of the run: what closes so early was in touch
SAME_HEAT = 1e-12  # of the heat that was made: round-off
SAME_T = 1e-9  # of the absolute temperature: round-off of one temperature everywhere

# What became of a run, as its banner says it; a completed run has none.
BANNERS = {
    "failed": "This run failed.",
    "interrupted": "This run was interrupted.",
    "stopped": "This run was stopped before its end.",
    "killed": "This run was killed.",
    "running": "This run goes on.",
}


@dataclass(frozen=True)
class Rejected:
    """A window that was not accepted."""

    t: str
    H: str
    verdict: str
    message: str


def banner(results: Results) -> tuple[str, str] | None:
    """(headline, what follows) for a run that did not complete, or is not to be trusted."""
    if results.outcome == "completed":
        if wrong := results.broken:
            return "Do not trust this run.", "\n".join(f"{c.name}: {c.what}." for c in wrong)
        return None
    end = float(results.header["coupling"]["end"])
    reached = float(results.t[-1]) if len(results.t) else 0.0
    headline = BANNERS.get(results.outcome, f"This run did not complete ({results.outcome}).")
    at = "It is at" if results.outcome == "running" else "It reached"
    return headline, (f"{at} t = {number(reached, 6)} s of {number(end, 6)} s."
                      + (f"\n{results.message.rstrip('.')}." if results.message else "")
                      # fault: a page does not tell how a killed run goes on -> + "") | coupler/test_report
                      + (f"\nTo go on: slideline resume {results.path.name}" if can_resume(results.path) else ""))


def about(results: Results) -> str:
    """What the scenario says of itself: its comment at the top, up to the first empty line."""
    lines = []
    for line in str(results.header["scenario"]["text"]).splitlines():
        words = line.removeprefix("#").strip()
        if not line.startswith("#") or not words:
            break
        lines.append(words)
    # A file is written with letters that every keyboard has.
    return " ".join(lines).replace("degC", "°C").replace("W/m2", "W/m²")


def effort(results: Results) -> str:
    """What the run took, in one paragraph."""
    w = results.windows
    good, rejected = w[w.taken], int((~w.taken).sum())
    reached = float(results.t[-1]) if len(results.t) else 0.0
    text = (f"The run {_became(results.outcome)}: {number(reached, 6)} s of simulated time in "
            f"{counted(len(good), 'window')} ({rejected or 'none'} rejected) with "
            f"{counted(int(w.solves.sum()), 'solver call')}, in {duration(wall_seconds(results))} of wall-clock time.")
    if told := iteration_words(results):
        text += f" {told[0].upper()}{told[1:]}."
    return text


def answer(results: Results) -> list[str]:
    """What the run found, in three sentences: heat, contact, and how exact it is.  [] where no window was solved."""
    good = results.windows[results.windows.taken]
    if not len(good):
        return []
    return [_temperature_sentence(results), _contact_sentence(results), _exact_sentence(results)]


def _temperature_sentence(results: Results) -> str:
    T = shown("K", 0.0, results.header["temperature_unit"])
    hottest = f"The highest temperature is {T.text(results.max_T, 5)}"
    course = results.extremes.get("thermal.T")
    if course is None or not np.isfinite(course).any():
        return f"{hottest}."
    at, low = float(results.t[int(np.nanargmax(course[:, 1]))]), float(np.nanmin(course[:, 0]))
    # fault: report: one temperature everywhere is told as a highest and a lowest -> if False: |
    #   coupler/test_report_windows::test_a_run_that_moves_no_heat_says_so
    if results.max_T - low <= SAME_T * results.max_T:
        return f"The temperature is {T.text(low, 5)} everywhere, from start to end."
    return f"{hottest}, at t = {number(at, 6)} s, the lowest {T.text(low, 5)}."


def _contact_sentence(results: Results) -> str:
    good = results.windows[results.windows.taken]
    # The start is no window, and may have the highest of all.
    # fault: report: the pressure at the start is left out of the headline -> of_t = {0.0: 0.0} |
    #   coupler/test_one_pressure
    of_t = {0.0: largest_at(results, 0)}
    of_t |= dict(zip((good.t + good.H).tolist(), good.max_p.tolist(), strict=True))
    p = max(of_t.values())
    if not results.header["pairs"]:
        return "There is no contact in this scene."
    if p <= 0:
        return "No contact pressure was found."
    first, peak = next(t for t, at in of_t.items() if at > 0.0), max(of_t, key=lambda t: of_t[t])
    # A pair that is drawn in touch closes within the first window, wherever that ends.
    # fault: report: bodies that touch at the start are told to meet -> at_once = first == 0.0 |
    #   coupler/test_report_windows::test_what_closes_at_once_is_in_touch_from_the_start
    at_once = first <= AT_ONCE * float(results.header["coupling"]["end"])
    begins = "Bodies are pressed together from the start" if at_once else (
        f"Bodies press on each other first at t = {number(first, 6)} s")
    told = f"{begins}; the highest contact pressure is {shown('Pa', p).text(p, 5)}, at t = {number(peak, 6)} s"
    slaves = {pair["name"]: str(pair["slave"]) for pair in results.header["pairs"]}
    axisymmetric = str(results.header["geometry"]) == "axisymmetric"
    places = [place_of_peak(along, slaves[name], axisymmetric) for name, along in results.contact.items()
              if np.isclose(largest(along)[0], p, rtol=1e-5)]
    return f"{told}, {places[0]}." if places else f"{told}."


def _exact_sentence(results: Results) -> str:
    """The relative energy-balance error, and the largest estimated error of the probes."""
    parts = []
    # fault: report: a balance of no heat is told to close -> moved = bool(results.ledger) |
    #   coupler/test_report_windows::test_a_run_that_moves_no_heat_says_so
    moved = any(results.ledger.values())
    if results.ledger and not moved:
        parts.append("No heat moves in this run")
    if moved:
        off = number(results.heat_imbalance, 2) if results.heat_imbalance > 0.0 else "below round-off"
        parts.append(f"The relative energy-balance error is {off}")
    errors = {n: e for n, e in results.probe_errors.items() if e.range > 0.0}
    if errors:
        worst = max(errors, key=lambda n: errors[n].error / errors[n].range)
        share = 100 * errors[worst].error / errors[worst].range
        parts.append(f"the largest estimated error of a probe is {number(share, 3)} % of its range ({worst})")
    text = "; ".join(parts) or "The run kept no energy balance and no error estimate"
    return f"{text[0].upper()}{text[1:]}."


@dataclass(frozen=True)
class Extreme:
    """Least and largest value of a field over the run, with times [s], as shown."""

    field: str
    least: str
    least_at: str
    largest: str
    largest_at: str


def extreme_rows(results: Results) -> list[Extreme]:
    """The least and the largest value of each field, of every window; fields that are 0 throughout are left out."""
    fields, rows = results.fields, []
    for name, course in results.extremes.items():
        if name not in fields or not np.nan_to_num(np.abs(course)).any():
            continue
        # fault: report: extremes are of the last window -> low, high = len(course) - 1, len(course) - 1 |
        #   coupler/test_extremes
        low, high = int(np.nanargmin(course[:, 0])), int(np.nanargmax(course[:, 1]))
        unit = fields[name].unit
        least, most = float(course[low, 0]), float(course[high, 1])
        of = " (size)" if fields[name].components == 2 else ""
        rows.append(Extreme(f"{title_of(fields[name])}{of}", _alone(results, unit, least),
                            number(float(results.t[low]), 6), _alone(results, unit, most),
                            number(float(results.t[high]), 6)))
    return rows


def _alone(results: Results, unit: str, value: float) -> str:
    """A value in the multiple of its unit that fits it alone."""
    return shown(unit, abs(value), results.header["temperature_unit"]).text(value, 5)


def _became(outcome: str) -> str:
    return {"completed": "completed", "failed": "failed", "running": "goes on"}.get(outcome, f"was {outcome}")


def wall_seconds(results: Results) -> float:
    """Wall-clock seconds of a run, set-up included; from its windows where it left no totals."""
    w, totals = results.windows, results.totals
    run = float(totals.get("seconds", w.seconds.sum() + w.recording_seconds.sum()))
    return run + float(totals.get("setup_seconds", 0.0))


def scenario_facts(results: Results) -> list[tuple[str, str]]:
    """What was run: rows of a table."""
    h, c = results.header, results.header["coupling"]
    end = float(c["end"])
    # fault: the ends that adaptive windows must meet are told as their number -> planned = counted(int(c["windows"]),
    #   "window") | coupler/test_report
    planned = "adaptive windows" if c.get("adaptive") else counted(int(c["windows"]), "window")
    facts = [
        ("scenario", f"{h['scenario']['file']} (hash {str(h['scenario']['hash'])[:12]})"),
        ("halves", ", ".join(f"{side}: {kind}" for side, kind in h["halves"].items())),
        ("geometry", f"{h['geometry']}; bodies {', '.join(h['bodies'])}"),
        ("contact pairs", "; ".join(f"{p['name']}: slave {p['slave']}, master {p['master']}"
                                    + ", tied" * bool(p.get("tied")) for p in h["pairs"])
         or "none"),
        ("coupling", f"{c['scheme']}, {planned} to t = {number(end, 6)} s; "
         + ", ".join(f"{counted(int(n), side + ' substep')} a window" for side, n in c["substeps"].items())),
        ("breakpoints", ", ".join(f"{number(float(k), 6)} s" for k in c["kinks"]) or "none"),
        ("ran", f"{h['started']}, {'each half in its own process' if h['processes'] else 'in one process'}, "
         f"on {h['machine']}"),
    ]
    if overrides := h["scenario"].get("overrides"):
        facts.insert(1, ("overrides", ", ".join(f"{k} = {v}" for k, v in dict(overrides).items())))
    for name in HEATS.values():
        heat = results.totals.get(name.replace(" ", "_"), {})
        if not (heat.get("made") or heat.get("carried")):
            continue
        rest = float(heat["carried"])
        # Round-off of what was made is nothing that was left.
        left = (f"not yet delivered at the end {number(rest)} J" if abs(rest) > SAME_HEAT * abs(heat["made"])
                else "all of it")
        facts.append((name, f"made {number(heat['made'])} J, delivered {number(heat['delivered'])} J, {left}"))
    return facts


def rejected_windows(results: Results) -> tuple[list[Rejected], int]:
    """The rejected windows with their verdicts (at most LISTED_AT_MOST), and how many there were."""
    w = results.windows
    rows = [int(k) for k in (~w.taken).nonzero()[0]]
    return [Rejected(number(float(w.t[k]), 8), number(float(w.H[k]), 4), str(w.verdict[k]), results.messages.get(k, ""))
            for k in rows[:LISTED_AT_MOST]], len(rows)


@dataclass(frozen=True)
class TrustRow:
    """A check as a row of the page.  style : its class."""

    name: str
    verdict: str
    number: str
    limit: str
    what: str
    style: str


def trust_rows(results: Results) -> list[TrustRow]:
    """The trust table: what is broken first, what was not checked last."""
    order = (TrustVerdict.BROKEN, TrustVerdict.NOTED, TrustVerdict.HOLDS, TrustVerdict.UNCHECKED)
    rows = []
    for c in sorted(results.trust, key=lambda c: order.index(c.verdict)):
        seen = c.verdict is not TrustVerdict.UNCHECKED
        what = f"{c.what[:1].upper()}{c.what[1:]}." if c.what else ""
        rows.append(TrustRow(c.name, c.verdict.value, _size(c.number, c.unit) if seen else "",
                             _size(c.limit, c.unit) if seen else "", " ".join([what, f"{c.remedy}." * bool(c.remedy)]),
                             {TrustVerdict.UNCHECKED: "unchecked"}.get(c.verdict, c.verdict.value)))
    return rows


def _size(value: float, unit: str) -> str:
    if math.isinf(value):
        return "none"
    return number(value, 2) + ("" if unit == "1" else f" {unit}")


def trust_in_a_word(results: Results) -> str:
    """The trust table in a sentence."""
    checks, wrong = results.trust, results.broken
    if wrong:
        names = "; ".join(c.name for c in wrong)
        return f"No. Broken checks: {names}. The table has the results of all checks:"
    noted = sum(c.verdict is TrustVerdict.NOTED for c in checks)
    return ("No check is broken" + (f"; {counted(noted, 'check')} noted" if noted else "")
            + ". The table has the results of all checks:")


TEMPLATE = "page.html.j2"


def write_page(results: Results, path: Path, renew: int = 0) -> Path:
    """Render the report of a run and put it at `path` whole.  Raises ResultsError if it cannot be written.

    renew : as in `render`.
    """
    return put_page(path, lambda: render(results, renew), results)


def put_page(path: Path, page: Callable[[], str], *runs: Results) -> Path:
    """Put a page about these runs at `path` whole, rendered only if it may stand there.

    Raises ResultsError where something stands that is no page, or it cannot be written.
    """
    if path.resolve() in [run.path.resolve() for run in runs] or not _replaceable(path):
        raise ResultsError(f"{path}: is not a page that a report could replace; give another name with --out")
    text = page()
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f".{path.name}.") as scratch:
            part = Path(scratch) / path.name
            part.write_text(text, encoding="utf-8")
            os.replace(part, path)
    except OSError as exc:
        raise ResultsError(f"{path}: the report cannot be written ({exc})") from exc
    return path


def _replaceable(path: Path) -> bool:
    """True for a name that is free, an empty file and an HTML page."""
    if not path.is_file():
        return not path.exists()
    with path.open("rb") as file:
        return file.read(15).lower() in (b"", b"<!doctype html>")


def template_of(name: str) -> Template:
    """A template of this package, by the name of its file."""
    def text_of(file: str) -> str:
        return resources.files(__package__).joinpath(file).read_text("utf-8")

    # Names and texts of a scenario are a stranger's: everything is escaped, and a slip in the template is an error.
    environment = Environment(loader=FunctionLoader(text_of), autoescape=True, undefined=StrictUndefined,
                              trim_blocks=True, lstrip_blocks=True)
    return environment.get_template(name)


def render(results: Results, renew: int = 0) -> str:
    """The page as text.  renew : after so many seconds the browser reads it anew; 0: never."""
    template = template_of(TEMPLATE)
    fields, remarks = field_pictures(results)
    parts, (rejected, rejected_count) = shares(results), rejected_windows(results)
    probes, heats, conditions = probe_pictures(results), heat_picture(results), condition_pictures(results)
    charts = [p.chart for p in (*probes, *([heats] if heats else []), *conditions) if p.chart is not None]
    live = live_page(results, charts)
    return template.render(
        title=results.header["title"], banner=banner(results), about=about(results), answer=answer(results),
        effort=effort(results), extremes=extreme_rows(results), live=live, charts=charts, renew=renew,
        facts=scenario_facts(results), probes=probes, fields=fields,
        contact=contact_pictures(results), pressures=pressure_pictures(results),
        heat=heat_table(results), heat_picture=heats, depth=depth_of(results),
        conditions=condition_tables(results), condition_pictures=conditions,
        choices=choices(results), stretches=stretches(results), every=every_window(results),
        tried=len(results.windows), short=short_windows(results), events=event_rows(results),
        errors=errors_picture(results), windows=windows_picture(results),
        iterates=iterates_picture(results), shares=parts, asked=asked(results),
        shares_picture=shares_picture(parts, results.overlap_seconds),
        timelines=[timeline_picture(results), window_picture(results)],
        duration=duration, rejected=rejected,
        rejected_count=rejected_count, rules=rules_that_fired(results), watched=watched_pictures(results),
        notes=[*_notes(results), *remarks, *live.remarks], trust=trust_rows(results),
        trust_in_a_word=trust_in_a_word(results),
        versions=results.header["versions"], scenario=results.header["scenario"]["text"],
        resolved=_resolved(results), file=results.path.name,
        field_files=[p.name for p in results.field_files.values()])


def _notes(results: Results) -> list[str]:
    notes = list(results.notes)
    if results.later is not None:
        notes.append(f"A later run to the same file has not ended: {results.later.name} is beside it. "
                     f"This page shows the run before. If the later one was killed, move {results.path.name} away "
                     "and make the report again: the results file is then made from what that run had written.")
    return notes


def _resolved(results: Results) -> str:
    """The scenario as it was run, defaults and overrides filled in."""
    resolved = results.header["scenario"].get("resolved")
    return json.dumps(resolved, indent=1, ensure_ascii=False) if resolved else ""
