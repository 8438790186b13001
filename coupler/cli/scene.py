"""Verbs about scenarios that run none: `check`, `schema`, `migrate`."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer

from contact.half.diagnostics import gaps_at_start
from coupler.cli.codes import BAD_INPUT
from coupler.cli.failure import failure
from coupler.cli.options import JsonOption, ScenarioFile, SetOption, SwapOption, scenario_of
from coupler.control.plan import Plan
from coupler.errors import ScenarioError
from coupler.fmu.bind import check_bindings
from coupler.record.paths import check_free, new_files
from coupler.record.results import Results
from coupler.running.pilot import is_quick
from coupler.running.pilot import pilot as pilot_run
from coupler.running.replay import rules_report
from coupler.running.setup import plan_of
from coupler.scenario import Scenario
from coupler.scenario.kinds import words_of
from coupler.scenario.load import checked_form
from coupler.scenario.schema import VERSION
from coupler.scenario.versions import json_schema, migrated, unsaid

SAME_GAP = 0.01  # of the largest: gaps that differ by less are told as one


def check_command(scenario: ScenarioFile, sets: SetOption = None, swaps: SwapOption = None,
                  rules: Annotated[Path | None, typer.Option(
                      "--rules", metavar="RUN", help="Print which rules would have fired in this run.")] = None,
                  pilot: Annotated[bool, typer.Option(
                      "--pilot", help="Run a few long windows first, to predict the longest stable ones.")] = False,
                  as_json: JsonOption = False) -> None:
    """Check a scenario and print what it would run, without running it."""
    if as_json and rules is not None:
        raise ScenarioError("what rules would have done is told in words", key="--json",
                            remedy="Leave --json or --rules out.")
    try:
        s = scenario_of(scenario, sets, swaps)
        _check_bindings(s)
    except ScenarioError as exc:
        if not as_json:
            raise
        told = failure(exc, BAD_INPUT)
        # Version 0.1 had these two beside the message.
        for error in told["errors"]:
            error |= {name: error["where"][name] for name in ("line", "key")}
        # fault: a check that fails has a form of its own -> told = {"errors": told["errors"]} | coupler/test_cli
        typer.echo(json.dumps({"file": str(scenario), "valid": False, **told}, indent=1))
        raise typer.Exit(BAD_INPUT) from None
    if rules is not None:
        for line in rules_report(s, Results(rules)):
            typer.echo(line)
        return
    if as_json:
        facts = {"file": str(scenario), "valid": True, "outcome": "completed", "exit_code": 0, "errors": [],
                 **_facts(s, pilot=pilot)}
        typer.echo(json.dumps(facts, indent=1, allow_nan=False))
        return
    plan = plan_of(s)
    i, clock = s.interface, plan.schedule.clock
    sizes = [clock.seconds(b) - clock.seconds(a)
             for a, b in pairwise(plan.schedule.bounds)]
    breakpoints = ", ".join(f"{clock.seconds(k):.6g}" for k in sorted(plan.schedule.kinks))
    gaps = gaps_at_start(i)
    pairs = "; ".join(f"{p.name} (slave {p.slave}, master {p.master}{apart(gaps.get(p.name))})" for p in i.pairs)
    halves = ", ".join(f"{role} {kind}" for role, kind in words_of(s.thermal_half, s.mechanical_half).items())
    # Pairs and sources have theirs too; what a user can forget is the name of a condition.
    named = [n for n, c in s.conditions.items() if c.kind not in ("contact pair", "source")]
    typer.echo(f"{scenario}: valid\n"
               f"  {s.title}\n"
               f"{_units(s)}"
               f"  {s.geometry}, bodies {', '.join(i.bodies)}; {len(i.nodes)} nodes, "
               f"{len(i.quads)} quads, {len(i.triangles)} triangles\n"
               f"  contact pairs: {pairs or 'none'}\n"
               f"  halves: {halves}; scheme {plan.scheme.value}\n"
               f"  {_sizes(sizes, plan)} to t = {s.coupling.end:g} s; "
               f"{f'breakpoints at {breakpoints} s' if breakpoints else 'no breakpoints'}\n"
               f"  probes: {', '.join(s.probes) or 'none'}"
               + (f"\n  heat and force by name: {', '.join(named)}" if named else ""))
    for note in (*s.notes, *s.mesh_notes):
        typer.echo(f"  note: {note}")
    if pilot or is_quick(s):
        typer.echo(f"  stable windows, from a pilot run: {pilot_run(s).summary}")


def _check_bindings(s: Scenario) -> None:
    with tempfile.TemporaryDirectory(prefix="slideline-") as scratch:
        check_bindings(s, Path(scratch))


def _facts(s: Scenario, *, pilot: bool) -> dict[str, Any]:
    """What a script reads of a valid scenario, in SI.  windows : their sizes; of adaptive ones the bounds."""
    plan, i = plan_of(s), s.interface
    gaps = gaps_at_start(i)
    clock = plan.schedule.clock
    bounds = [clock.seconds(b) for b in plan.schedule.bounds]
    sizes = [b - a for a, b in pairwise(bounds)]
    a = plan.adaptive
    windows = {"adaptive": False, "count": len(sizes), "least": min(sizes), "most": max(sizes)} if a is None else {
        "adaptive": True, "first": a.first, "least": a.least, "most": a.most}
    return {"title": s.title, "hash": s.hash, "units": s.units.symbols if s.units else "SI", "geometry": s.geometry,
            "bodies": list(i.bodies),
            "nodes": len(i.nodes), "quads": len(i.quads), "triangles": len(i.triangles),
            "pairs": [{"name": p.name, "slave": p.slave, "master": p.master, "gap": gaps.get(p.name)}
                      for p in i.pairs],
            "halves": words_of(s.thermal_half, s.mechanical_half), "scheme": plan.scheme.value,
            "end": s.coupling.end, "windows": windows,
            "breakpoints": [clock.seconds(k) for k in sorted(plan.schedule.kinks)],
            "probes": {name: probe.unit for name, probe in s.probes.items()}, "conditions": list(s.conditions),
            "notes": [*s.notes, *s.mesh_notes],
            "stable_windows": pilot_run(s).summary if pilot or is_quick(s) else None}


def apart(gap: tuple[float, float] | None) -> str:
    """Say how a pair begins; nothing where it faces nothing, which a note tells."""
    if gap is None:
        return ""
    least, most = gap
    # fault: a gap that was not meant is not told -> if True: | coupler/test_cli
    if least == most == 0.0:
        return ", in touch"
    if most <= 0.0:
        return f", up to {-least:.3g} m into each other"
    if least >= 0.0:
        return f", {f'{least:.3g} to ' if most - least > SAME_GAP * most else ''}{most:.3g} m apart"
    return f", {-least:.3g} m into each other to {most:.3g} m apart"


def _units(s: Scenario) -> str:
    """The line on the units of the file; none where all is SI."""
    deep = f"; forces and energies per {s.units.length} of depth" if s.units and s.geometry == "plane" else ""
    return f"  {s.units.sentence}{deep}\n" if s.units else ""


def _sizes(sizes: Sequence[float], plan: Plan) -> str:
    if plan.adaptive is not None:
        a = plan.adaptive
        return f"adaptive windows, {a.first:.3g} s at first, {a.least:.3g} to {a.most:.3g} s,"
    least, most = f"{min(sizes):.3g}", f"{max(sizes):.3g}"
    return f"{len(sizes)} window{'s' if len(sizes) > 1 else ''} of {least if least == most else f'{least} to {most}'} s"


def schema_command(out: Annotated[Path | None, typer.Option("--out", "-o", help="A new file for it.")] = None) -> None:
    """Write the JSON Schema of a scenario, for editors that complete and check keys."""
    text = json.dumps(json_schema(), indent=1) + "\n"
    if out is None:
        typer.echo(text, nl=False)
        return
    check_free(out)
    with new_files({out: text}):
        typer.echo(f"{out}: the keys of a scenario of version {VERSION}.\n"
                   f"  In the first line of a scenario: # yaml-language-server: $schema={out}")


def migrate_command(scenario: Annotated[Path, typer.Argument(help="The scenario, a YAML file.", show_default=False)]
                    ) -> None:
    """Write a scenario of an older version as the newest version, with the same numbers."""
    document, file = checked_form(scenario)
    if file.slideline == VERSION:
        typer.echo(f"{scenario} is of version {VERSION} already.")
        return
    said = unsaid(file)
    _replace(scenario, migrated(document.text, file))
    typer.echo(f"{scenario}: version {file.slideline} -> {VERSION}")
    for at, key, value in said:
        typer.echo(f"  {'.'.join(map(str, at))}: {key}: {value}, as version {file.slideline} had it")


def _replace(path: Path, text: str) -> None:
    """Write a file anew, whole or not at all.  Raises ScenarioError."""
    aside = path.with_name(f".{path.name}.new")
    try:
        aside.write_text(text, encoding="utf-8")
        os.replace(aside, path)
    except OSError as exc:
        aside.unlink(missing_ok=True)
        raise ScenarioError(f"the file cannot be written ({exc.strerror})", file=str(path),
                            remedy="Check that you may write there; the file is as it was.") from exc
