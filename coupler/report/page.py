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

from jinja2 import Environment, FunctionLoader, StrictUndefined, Template

from coupler.errors import ResultsError
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
from coupler.report.pressure import largest_at, pressure_pictures
from coupler.schemes.state import HEATS
from coupler.trust.checks import TrustVerdict

# The numbers of a run in words.

LISTED_AT_MOST = 100

# What became of a run, as its banner says it; a completed run has none.
BANNERS = {
    "failed": "This run failed.",
    "interrupted": "This run was interrupted.",
    "stopped": "This run was stopped before its end.",
    "killed": "This run was killed.",
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
    return headline, (f"It reached t = {number(reached, 6)} s of {number(end, 6)} s."
                      + (f"\n{results.message.rstrip('.')}." if results.message else ""))


def about(results: Results) -> str:
    """What the scenario says of itself: its comment at the top, up to the first empty line."""
    lines = []
    for line in str(results.header["scenario"]["text"]).splitlines():
        words = line.removeprefix("#").strip()
        if not line.startswith("#") or not words:
            break
        lines.append(words)
    return " ".join(lines)


def summary(results: Results) -> str:
    """The run in one paragraph."""
    w = results.windows
    good, rejected = w[w.taken], int((~w.taken).sum())
    reached = float(results.t[-1]) if len(results.t) else 0.0
    text = (f"The run {_became(results.outcome)}: {number(reached, 6)} s of simulated time in "
            f"{counted(len(good), 'window')} ({rejected or 'none'} rejected) with "
            f"{counted(int(w.solves.sum()), 'half-solve')}, in {duration(wall_seconds(results))} of wall-clock time.")
    if not len(good):
        return text
    if results.ledger:
        text += (f" The heat ledger closes to {number(results.heat_imbalance, 2)} of the heat moved.")
    if told := iteration_words(results):
        text += f" {told[0].upper()}{told[1:]}."
    T = shown("K", 0.0, results.header["temperature_unit"])
    text += f" The highest temperature was {T.text(results.max_T, 5)}"
    # The start is no window, and may have the highest of all.
    # fault: report: the pressure at the start is left out of the headline -> of_t = {0.0: 0.0} |
    #   coupler/test_one_pressure
    of_t = {0.0: largest_at(results, 0)}
    of_t |= dict(zip((good.t + good.H).tolist(), good.max_p.tolist(), strict=True))
    p = max(of_t.values())
    if p > 0:
        first, peak = next(t for t, at in of_t.items() if at > 0.0), max(of_t, key=lambda t: of_t[t])
        return text + (f", the highest contact pressure {shown('Pa', p).text(p, 5)} at t = {number(peak, 6)} s; "
                       f"contact pressed first at t = {number(first, 6)} s.")
    return text + "; no contact pressure was seen."


def _became(outcome: str) -> str:
    return {"completed": "completed", "failed": "failed"}.get(outcome, f"was {outcome}")


def wall_seconds(results: Results) -> float:
    """Wall-clock seconds of a run, set-up included; from its windows where it left no totals."""
    w, totals = results.windows, results.totals
    run = float(totals.get("seconds", w.seconds.sum() + w.recording_seconds.sum()))
    return run + float(totals.get("setup_seconds", 0.0))


def scenario_facts(results: Results) -> list[tuple[str, str]]:
    """What was run: rows of a table."""
    h, c = results.header, results.header["coupling"]
    end, planned = float(c["end"]), int(c["windows"])
    facts = [
        ("scenario", f"{h['scenario']['file']} (hash {str(h['scenario']['hash'])[:12]})"),
        ("halves", ", ".join(f"{side}: {kind}" for side, kind in h["halves"].items())),
        ("geometry", f"{h['geometry']}; bodies {', '.join(h['bodies'])}"),
        ("contact pairs", "; ".join(f"{p['name']}: slave {p['slave']}, master {p['master']}"
                                    + ", tied" * bool(p.get("tied")) for p in h["pairs"])
         or "none"),
        ("coupling", f"{c['scheme']}, {counted(planned, 'window')} planned to t = {number(end, 6)} s; "
         + ", ".join(f"{counted(int(n), side + ' substep')} a window" for side, n in c["substeps"].items())),
        ("kinks", ", ".join(f"{number(float(k), 6)} s" for k in c["kinks"]) or "none"),
        ("ran", f"{h['started']}, {'each half in its own process' if h['processes'] else 'in one process'}, "
         f"on {h['machine']}"),
    ]
    if overrides := h["scenario"].get("overrides"):
        facts.insert(1, ("overrides", ", ".join(f"{k} = {v}" for k, v in dict(overrides).items())))
    for name in HEATS.values():
        heat = results.totals.get(name.replace(" ", "_"), {})
        if not (heat.get("made") or heat.get("carried")):
            continue
        facts.append((name, f"made {number(heat['made'])} J, delivered {number(heat['delivered'])} J, "
                      f"carried past the end {number(heat['carried'])} J"))
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
        return f"No. What does not hold: {names}. What the checks measured in every window:"
    noted = sum(c.verdict is TrustVerdict.NOTED for c in checks)
    return ("Nothing was found that says otherwise" + (f"; {counted(noted, 'small thing')} noted" if noted else "")
            + ". What the checks measured in every window:")


TEMPLATE = "page.html.j2"


def write_page(results: Results, path: Path) -> Path:
    """Render the report of a run and put it at `path` whole.  Raises ResultsError if it cannot be written."""
    return put_page(path, lambda: render(results), results)


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


def render(results: Results) -> str:
    """The page as text."""
    template = template_of(TEMPLATE)
    fields, remarks = field_pictures(results)
    parts, (rejected, rejected_count) = shares(results), rejected_windows(results)
    return template.render(
        title=results.header["title"], banner=banner(results), about=about(results),
        summary=summary(results),
        facts=scenario_facts(results), probes=probe_pictures(results), fields=fields,
        contact=[*contact_pictures(results), *pressure_pictures(results)],
        heat=heat_table(results), heat_picture=heat_picture(results), depth=depth_of(results),
        conditions=condition_tables(results), condition_pictures=condition_pictures(results),
        choices=choices(results), stretches=stretches(results), every=every_window(results),
        tried=len(results.windows), short=short_windows(results), events=event_rows(results),
        errors=errors_picture(results), windows=windows_picture(results),
        iterates=iterates_picture(results), shares=parts, asked=asked(results),
        shares_picture=shares_picture(parts), duration=duration, rejected=rejected,
        rejected_count=rejected_count, rules=rules_that_fired(results), watched=watched_pictures(results),
        notes=[*_notes(results), *remarks], trust=trust_rows(results), trust_in_a_word=trust_in_a_word(results),
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
