"""The command line.

Exit codes: 0 done; 1 the run failed (a window that cannot be solved, a half that died, a broken link);
2 the input is wrong (scenario, options); 3 a results file cannot be read or written; 4 the run finished, but a check of
its own says that its answer is not to be trusted; 5 two runs that were compared differ, or are of two scenes; 130
interrupted.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer

from contact.rpc.calls import LinkError
from coupler.cli.console import ProgressLine, summary
from coupler.control.plan import Plan
from coupler.errors import ResultsError, ScenarioError, SlidelineError
from coupler.experiments.advise import AdviceOptions, advise
from coupler.experiments.confidence import check_companions
from coupler.experiments.confidence import confidence as errors_of_probes
from coupler.experiments.pool import TrialLine
from coupler.experiments.variants import CELLS
from coupler.fmu.launch import build_halves, make_folder
from coupler.init.init import init_command
from coupler.init.templates import SCENARIO, shipped_scenarios
from coupler.record.confidence import write_confidence
from coupler.record.paths import check_free, check_target, new_files
from coupler.record.results import Results
from coupler.report import write_report
from coupler.running.pilot import is_quick
from coupler.running.pilot import pilot as pilot_run
from coupler.running.progress import Progress
from coupler.running.replay import rules_report
from coupler.running.run import resume, resumed, run
from coupler.running.setup import plan_of
from coupler.scenario import Scenario, load_scenario, parse_override
from coupler.scenario.load import checked_form
from coupler.scenario.schema import VERSION
from coupler.scenario.versions import json_schema, migrated, unsaid
from coupler.verify.verify import verify_half_command

# `slideline schema` and `slideline migrate`: the form of a scenario, for editors, and of older files.

def schema_command(out: Annotated[Path | None, typer.Option("--out", "-o", help="A new file for it.")] = None) -> None:
    """Write the JSON Schema of a scenario: editors complete and check its keys by it."""
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
    """Write a scenario of an older version as one of the newest, with the same numbers."""
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
        raise ScenarioError(f"the file cannot be written ({exc.strerror})", file=str(path)) from exc


FAILED, BAD_INPUT, BAD_RESULTS, UNTRUSTED, DIFFER, INTERRUPTED = 1, 2, 3, 4, 5, 130

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False,
                  help="Heat and deformation of bodies in contact: two solvers, each an FMU, coupled.")

ScenarioFile = Annotated[Path, typer.Argument(help="The scenario, a YAML file.", show_default=False)]
SetOption = Annotated[list[str] | None, typer.Option(
    "--set", metavar="KEY=VALUE", help="Change a value: coupling.scheme=staggered. May be repeated.")]
SwapOption = Annotated[list[str] | None, typer.Option(
    "--swap", metavar="HALF=KIND", help="Use another half: mechanical=rigid. May be repeated.")]
UntilOption = Annotated[float | None, typer.Option(
    # fault: an option that the pages name is renamed -> "--til", metavar="SECONDS", help="Stop at the first window end
    #   at or after this time; `resume` goes on.")] | test_docs::test_commands_and_options_exist
    "--until", metavar="SECONDS", help="Stop at the first window end at or after this time; `resume` goes on.")]
ProcessesOption = Annotated[bool, typer.Option(
    "--processes", help="Each half and the contact service in a process of its own.")]
OutOption = Annotated[Path, typer.Option("--out", "-o", help="Where the results go.")]


def _overrides(sets: Sequence[str] | None, swaps: Sequence[str] | None) -> dict[str, Any]:
    overrides: dict[str, Any] = dict(parse_override(text) for text in sets or ())
    for text in swaps or ():
        half, sep, kind = text.partition("=")
        if not sep or half not in ("thermal", "mechanical") or not kind:
            raise ScenarioError("--swap expects thermal=KIND or mechanical=KIND", key="--swap", value=text,
                                remedy="For example --swap mechanical=rigid")
        overrides[f"{half}.half"] = kind
    return overrides


def _scenario(path: Path, sets: Sequence[str] | None, swaps: Sequence[str] | None) -> Scenario:
    return load_scenario(path, overrides=_overrides(sets, swaps))


def _tell_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"slideline {version('slideline')}")
        raise typer.Exit


@app.callback()
def options(version: Annotated[bool, typer.Option("--version", callback=_tell_version, is_eager=True,
                                                  help="Print the version and exit.")] = False) -> None:
    """Take the options that stand before a command."""


app.command("init")(init_command)
app.command("verify-half")(verify_half_command)
app.command("schema")(schema_command)
app.command("migrate")(migrate_command)


@app.command("check")
def check_command(scenario: ScenarioFile, sets: SetOption = None, swaps: SwapOption = None,
                  rules: Annotated[Path | None, typer.Option(
                      "--rules", metavar="RUN", help="Print which rules would have fired in this run.")] = None,
                  pilot: Annotated[bool, typer.Option(
                      "--pilot", help="Run a few long windows first, to predict the longest stable ones.")] = False
                  ) -> None:
    """Check a scenario and print what it would run, without running it."""
    s = _scenario(scenario, sets, swaps)
    if rules is not None:
        for line in rules_report(s, Results(rules)):
            typer.echo(line)
        return
    plan = plan_of(s)
    i, clock = s.interface, plan.schedule.clock
    sizes = [clock.seconds(b) - clock.seconds(a)
             for a, b in pairwise(plan.schedule.bounds)]
    breakpoints = ", ".join(f"{clock.seconds(k):.6g}" for k in sorted(plan.schedule.kinks))
    pairs = "; ".join(f"{p.name} (slave {p.slave}, master {p.master})" for p in i.pairs) or "none"
    # Pairs and sources have theirs too; what a user can forget is the name of a condition.
    named = [n for n, c in s.conditions.items() if c.kind not in ("contact pair", "source")]
    typer.echo(f"{scenario}: valid\n"
               f"  {s.title}\n"
               f"  {s.geometry}, bodies {', '.join(i.bodies)}; {len(i.nodes)} nodes, "
               f"{len(i.quads)} quads, {len(i.triangles)} triangles\n"
               f"  contact pairs: {pairs}\n"
               f"  halves: thermal {s.thermal_half}, mechanical {s.mechanical_half}; scheme {plan.scheme.value}\n"
               f"  {_sizes(sizes, plan)} to t = {s.coupling.end:g} s; "
               f"{f'breakpoints at {breakpoints} s' if breakpoints else 'no breakpoints'}\n"
               f"  probes: {', '.join(s.probes) or 'none'}"
               + (f"\n  heat and force by name: {', '.join(named)}" if named else ""))
    for note in (*s.notes, *s.mesh_notes):
        typer.echo(f"  note: {note}")
    if pilot or is_quick(s):
        typer.echo(f"  stable windows, from a pilot run: {pilot_run(s).summary}")


def _sizes(sizes: Sequence[float], plan: Plan) -> str:
    if plan.adaptive is not None:
        a = plan.adaptive
        return f"adaptive windows, {a.first:.3g} s at first, {a.least:.3g} to {a.most:.3g} s,"
    least, most = f"{min(sizes):.3g}", f"{max(sizes):.3g}"
    return f"{len(sizes)} window{'s' if len(sizes) > 1 else ''} of {least if least == most else f'{least} to {most}'} s"


WithinOption = Annotated[str, typer.Option(
    "--within", metavar="BOUNDS", help="How far the runs may be apart, T=1K,p=1% (of the range); else what both say "
    "that they may be off by.")]


@app.command("show")
def show_command(scenario: ScenarioFile,
                 out: Annotated[Path | None, typer.Option(
                     "--out", "-o", help="The picture: .png, .svg or .pdf; without it SCENARIO.png, here.")] = None,
                 sets: SetOption = None, swaps: SwapOption = None) -> None:
    """Draw a scenario before it runs: bodies, meshes, pairs with their sides, what acts where, probes."""
    # Here and not above: other commands start without matplotlib.
    from coupler.report.scene import write_scene

    typer.echo(write_scene(_scenario(scenario, sets, swaps), out or Path(f"{scenario.stem}.png")))


@app.command("run")
def run_command(scenario: ScenarioFile, out: OutOption = Path("run.h5"), sets: SetOption = None,
                swaps: SwapOption = None,
                processes: ProcessesOption = False, until: UntilOption = None,
                confidence: Annotated[bool, typer.Option(
                    "--confidence", help="Run it in windows of 2 and 4 times the size too, for the error of each probe."
                )] = False,
                confidence_mesh: Annotated[bool, typer.Option(
                    "--confidence-mesh", help="The same, and on a mesh of half as many cells along each edge."
                )] = False,
                report: Annotated[bool, typer.Option("--report", help="Write the report page too.")] = False,
                against: Annotated[bool, typer.Option(
                    "--compare", help="With --swap: run the scenario's own halves too (OUT-own.h5), and compare."
                )] = False, within: WithinOption = "") -> None:
    """Run a scenario; results go to run.h5 and one .vtkhdf a half."""
    if against and not swaps:
        raise ScenarioError("there is nothing to compare: no half is swapped", key="--compare",
                            remedy="Add --swap thermal=KIND or --swap mechanical=KIND")
    s = _scenario(scenario, sets, swaps)
    check_target(out, report=report)
    judged = confidence or confidence_mesh
    # Before anything runs: they may not be possible.
    companions = check_companions(s, mesh=confidence_mesh) if judged else []
    plan = plan_of(s)
    count = f"{len(plan.schedule.bounds) - 1} windows" if plan.adaptive is None else "adaptive windows"
    typer.echo(f"{s.title}: {s.thermal_half} + {s.mechanical_half}, {count} to t = {s.coupling.end:g} s", err=True)
    for note in s.notes:
        typer.echo(f"note: {note}", err=True)
    with ProgressLine(s.temperature_unit) as line:
        results = run(s, out, processes=processes, until=until, on_window=line)
    if judged and results.outcome == "completed":
        with TrialLine() as trials:
            # fault: the companions of a run are built twice -> found = errors_of_probes(s, results,
            #   mesh=confidence_mesh, on_trial=trials) | coupler/test_confidence
            found = errors_of_probes(s, results, mesh=confidence_mesh, companions=companions, on_trial=trials)
        write_confidence(out, found)
        results = Results(out)
    typer.echo(summary(results, printed={*s.notes, *line.printed}))
    for name, of in results.confidence.items():
        typer.echo(f"  {name}: {of.failed or f'error {100 * of.share:.2g} % of its range, {of.words}'}")
    if report:
        typer.echo(f"  {write_report(results, out.with_suffix('.html'))}")
    else:
        typer.echo(f"  report: slideline report {out}")
    if against and results.outcome == "completed":
        own, path = _scenario(scenario, sets, None), out.with_name(f"{out.stem}-own.h5")
        check_target(path)
        typer.echo(f"{own.title}: {own.thermal_half} + {own.mechanical_half}, to compare with", err=True)
        with ProgressLine(own.temperature_unit) as line:
            _compare(run(own, path, processes=processes, on_window=line), results, None, within)
    _leave(results)


@app.command("resume")
def resume_command(results: Annotated[Path, typer.Argument(help="The results file of a run that ended early.",
                                                           show_default=False)],
                   processes: ProcessesOption = False, until: UntilOption = None) -> None:
    """Resume a run that was interrupted, stopped or killed, or that failed, into the same results file."""
    continued = resumed(results, processes=processes)
    scenario = continued.scenario
    typer.echo(f"{scenario.title}: resuming at t = {continued.start:.9g} s of {scenario.coupling.end:g} s", err=True)
    with ProgressLine(scenario.temperature_unit) as line:
        done = resume(continued, until=until, on_window=line)
    typer.echo(summary(done))
    _leave(done)


def _leave(results: Results) -> None:
    """End with the exit code of a run that was not finished, or is not to be trusted."""
    if results.outcome == "interrupted":
        raise typer.Exit(INTERRUPTED)
    # fault: a run that does not trust itself ends with 0 -> if False: | coupler/test_trust
    if results.broken:
        raise typer.Exit(UNTRUSTED)


@app.command("report")
def report_command(results: Annotated[Path, typer.Argument(help="A results file, run.h5.", show_default=False)],
                   out: Annotated[Path | None, typer.Option("--out", "-o", help="The page.")] = None) -> None:
    """Write a self-contained HTML page about a run."""
    typer.echo(write_report(Results(results), out or results.with_suffix(".html")))


@app.command("study")
def study_command(scenario: ScenarioFile,
                  out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the study.")] = Path("study"),
                  grid: Annotated[list[str] | None, typer.Option(
                      "--grid", metavar="AXIS=VALUES", help="scheme=staggered,extrapolated. May be repeated.")] = None,
                  measure: Annotated[str, typer.Option(
                      "--measure", metavar="PROBES", help="Probes whose error counts, with commas.")] = "",
                  processes: Annotated[int, typer.Option(
                      "--jobs", "-j", min=0, help="Runs at a time; 0: one a core.")] = 0,
                  cluster: Annotated[str, typer.Option("--cluster", help="Address of a Dask scheduler instead.")] = "",
                  limit: Annotated[float | None, typer.Option("--limit", help="Seconds a run may take.")] = None,
                  pilot: Annotated[bool, typer.Option("--pilot", help="Predict limits of windows first.")] = False,
                  sets: SetOption = None, swaps: SwapOption = None) -> None:
    """Run a grid of settings, and draw error against cost.  After Ctrl-C the same command continues."""
    # Here and not above: a command that makes no study starts a second sooner without matplotlib.
    from coupler.experiments.grid import grid_of, parse_axis
    from coupler.experiments.pool import StudyLine
    from coupler.experiments.study import StudyOptions, conduct
    from coupler.experiments.study_files import write_study

    keys: dict[str, Any] = {}
    if grid:
        keys["grid"] = grid_of([parse_axis(text) for text in grid])
    if measure:
        keys["measure"] = [name.strip() for name in measure.split(",")]
    try:
        with StudyLine() as line:
            options = StudyOptions(processes, cluster, limit, pilot)
            study = conduct(scenario, out, _overrides(sets, swaps), keys, options, line)
    except KeyboardInterrupt as exc:
        typer.echo("\n".join(getattr(exc, "__notes__", ())), err=True)
        raise typer.Exit(INTERRUPTED) from None
    typer.echo(f"  {write_study(study, out)}")


@app.command("compare")
def compare_command(first: Annotated[Path, typer.Argument(help="The results file to refer to.", show_default=False)],
                    second: Annotated[Path, typer.Argument(help="The results file to compare.", show_default=False)],
                    out: Annotated[Path | None, typer.Option("--out", "-o", help="The page.")] = None,
                    within: WithinOption = "") -> None:
    """Compare two runs: the largest differences on a page, and a verdict.  Code 5: they differ, or are two scenes."""
    _compare(Results(first), Results(second), out, within)


def _compare(a: Results, b: Results, out: Path | None, within: str) -> None:
    """Tell the comparison and the verdict, and end with its exit code."""
    # Here and not above, as the report itself: other commands start without matplotlib.
    from coupler.report.comparison import short_names, write_comparison
    from coupler.report.verdict import bounds_of, verdict

    bounds = bounds_of(within)
    page, text = write_comparison(a, b, out or b.path.with_name(f"{b.path.stem}-against-{a.path.stem}.html"))
    judged = verdict(a, b, bounds)
    typer.echo(f"{text}\n  {page}\n{judged.text(short_names(a, b))}")
    # fault: runs that differ end with 0 -> if False: | coupler/test_verdict
    if judged.differs or judged.changed:
        raise typer.Exit(DIFFER)


@app.command("advise")
def advise_command(scenario: ScenarioFile,
                   goals: Annotated[list[str] | None, typer.Option(
                       "--for", metavar="PROBE=TOLERANCE", help="A probe and its tolerance: lower.top.centre=1K, "
                       "'upper.*=0.5%' (of its range).  May be repeated; default: every probe, 1 %.")] = None,
                   out: Annotated[Path, typer.Option(
                       "--out", "-o", help="Folder for trials, advice.txt and advised.yaml.")] = Path("advise"),
                   limit: Annotated[float, typer.Option("--limit", metavar="SECONDS", help="Wall time.")] = 600.0,
                   cells: Annotated[int, typer.Option("--cells", help="Most cells of a body in a trial.")] = CELLS,
                   sets: SetOption = None, swaps: SwapOption = None) -> None:
    """Find the cheapest model within your tolerance, and write it as a scenario."""
    with TrialLine() as line:
        advice = advise(scenario, out, AdviceOptions(goals or (), _overrides(sets, swaps), limit, cells), line)
    for text in advice.lines:
        typer.echo(text)
    if advice.interrupted:
        raise typer.Exit(INTERRUPTED)


@app.command("build")
def build_command(scenario: ScenarioFile,
                  out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the FMUs.")] = Path(),
                  sets: SetOption = None, swaps: SwapOption = None) -> None:
    """Build the FMUs of a scenario by hand, for use in any FMI 2.0 master."""
    for path in build_halves(_scenario(scenario, sets, swaps), out):
        typer.echo(path)


# Coarse and rigid: the probes stay within 3 K of the full scene's, in about a third of its time.
OVERRIDES = {"mechanical.half": "rigid", "bodies.lower.mesh.rectangle.cells": [12, 12],
             "bodies.upper.mesh.rectangle.cells": [12, 12]}


@dataclass(frozen=True)
class Demo:
    """The files of a demo.  scenario : the copy that was run."""

    scenario: Path
    results: Results
    page: Path


def run_demo(folder: Path, on_start: Callable[[Scenario], AbstractContextManager[Callable[[Progress], Any]]],
             ) -> Demo:
    """Copy the sliding blocks to a folder, run them coarse with the rigid half, write the report.

    on_start : called before the run; its context gives what is called after every window.
    Raises ScenarioError where the folder cannot be made, or holds another scenario of this name.
    """
    make_folder(folder)
    copy, text = folder / SCENARIO, (shipped_scenarios() / SCENARIO).read_bytes()
    if copy.exists() and copy.read_bytes() != text:
        raise ScenarioError("another scenario of this name is in this folder already; nothing was written",
                            file=str(copy), remedy="Give the demo another folder: slideline demo FOLDER")
    if not copy.exists():
        copy.write_bytes(text)
    scenario = load_scenario(copy, overrides=OVERRIDES)
    with on_start(scenario) as progress:
        results = run(scenario, folder / "run.h5", on_window=progress)
    return Demo(copy, results, write_report(results, folder / "run.html"))


@app.command("demo")
def demo_command(folder: Annotated[Path, typer.Argument(help="Where the demo goes.")] = Path("slideline-demo")) -> None:
    """A first look in seconds: the sliding blocks with the rigid half, and their report."""
    demo = run_demo(folder, on_start=lambda s: ProgressLine(s.temperature_unit))
    typer.echo(summary(demo.results))
    typer.echo(f"  the scenario: {demo.scenario}\n  the report:   {demo.page}")
    _leave(demo.results)


def main() -> None:
    """Run the command line: every expected error becomes one clear text and an exit code."""
    try:
        app()
    except (SlidelineError, LinkError) as exc:
        told = str(exc).splitlines() if isinstance(exc, ScenarioError) else [str(exc)]
        typer.echo("\n".join([*(f"error: {line}" for line in told), *getattr(exc, "__notes__", ())]), err=True)
        code = {ScenarioError: BAD_INPUT, ResultsError: BAD_RESULTS}.get(type(exc), FAILED)
        sys.exit(code)
    except KeyboardInterrupt as exc:
        typer.echo("\n".join(getattr(exc, "__notes__", ())), err=True)
        sys.exit(INTERRUPTED)
