"""The page: every part of the report put into its template, written in one atomic step."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable
from importlib import resources
from pathlib import Path

from jinja2 import Environment, FunctionLoader, StrictUndefined, Template

from coupler.errors import ResultsError
from coupler.record.results import Results
from coupler.report.contact import contact_pictures
from coupler.report.control import choices, errors_picture, event_rows, every_window, short_windows, stretches
from coupler.report.curves import probe_pictures
from coupler.report.facts import about, banner, rejected_windows, scenario_facts, summary
from coupler.report.heat import depth_of, heat_picture, heat_table
from coupler.report.rules import rules_that_fired
from coupler.report.snapshots import field_pictures
from coupler.report.units import duration
from coupler.report.watched import watched_pictures
from coupler.report.work import asked, iterates_picture, shares, shares_picture, windows_picture

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
        facts=scenario_facts(results), probes=probe_pictures(results), fields=fields, contact=contact_pictures(results),
        heat=heat_table(results), heat_picture=heat_picture(results), depth=depth_of(results),
        choices=choices(results), stretches=stretches(results), every=every_window(results),
        tried=len(results.windows), short=short_windows(results), events=event_rows(results),
        errors=errors_picture(results), windows=windows_picture(results),
        iterates=iterates_picture(results), shares=parts, asked=asked(results),
        shares_picture=shares_picture(parts), duration=duration, rejected=rejected,
        rejected_count=rejected_count, rules=rules_that_fired(results), watched=watched_pictures(results),
        notes=[*_notes(results), *remarks],
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
