"""Verbs that run a scenario: `run`, `resume`, `demo`, and `build`, which makes its halves alone."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from coupler.cli.codes import DIFFER
from coupler.cli.console import ProgressLine, facts, summary
from coupler.cli.options import (
    ChangeOption,
    HostsOption,
    JsonOption,
    LogOption,
    ProcessesOption,
    ScenarioFile,
    SetOption,
    SwapOption,
    UntilOption,
    WithinOption,
    leave,
    overrides_of,
    own_scenario_of,
    scenario_of,
)
from coupler.errors import ScenarioError, SlidelineError
from coupler.experiments.confidence import check_companions
from coupler.experiments.confidence import confidence as errors_of_probes
from coupler.experiments.pool import TrialLine
from coupler.fmu.launch import build_halves, make_folder
from coupler.fmu.ssp import check_one_system, write_ssp
from coupler.init.shipped import SCENARIO, shipped_scenarios
from coupler.record.confidence import write_confidence
from coupler.record.paths import check_target
from coupler.record.results import Results
from coupler.report import write_report
from coupler.running.progress import Progress
from coupler.running.resume import changes_of, resume, resumed
from coupler.running.run import run
from coupler.running.runlog import RunLog
from coupler.running.setup import plan_of
from coupler.scenario import Scenario, load_scenario
from coupler.scenario.kinds import words_of
from coupler.verify.verdicts import Verify

OutOption = Annotated[Path, typer.Option("--out", "-o", help="Where the results go.")]


def run_command(scenario: ScenarioFile, out: OutOption = Path("run.h5"), sets: SetOption = None,
                swaps: SwapOption = None,
                processes: ProcessesOption = False, hosts: HostsOption = None, until: UntilOption = None,
                log: LogOption = None,
                confidence: Annotated[bool, typer.Option(
                    "--confidence", help="Run it in windows of 2 and 4 times the size too, for the error of each probe."
                )] = False,
                confidence_mesh: Annotated[bool, typer.Option(
                    "--confidence-mesh", help="The same, and on a mesh with half as many cells along each edge."
                )] = False,
                report: Annotated[bool, typer.Option("--report", help="Also write the report page.")] = False,
                quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print no progress.")] = False,
                verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print a line for each window.")] = False,
                as_json: JsonOption = False,
                against: Annotated[bool, typer.Option(
                    "--compare", help="With --swap: run the scenario's own halves too (OUT-own.h5), and compare."
                )] = False, within: WithinOption = "",
                verify: Annotated[bool | None, typer.Option(
                    "--verify/--no-verify", help="Check halves of other packages first, as verify-half does, even if "
                    "they were checked before; or not at all. Default: once.", show_default=False
                )] = None) -> None:
    """Run a scenario; write run.h5 and a .vtkhdf file for each half."""
    if against and not swaps:
        raise ScenarioError("there is nothing to compare: no half is swapped", key="--compare",
                            remedy="Add --swap thermal=KIND or --swap mechanical=KIND")
    if within and not against:
        raise ScenarioError("there is nothing to compare", key="--within", value=within,
                            remedy="Add --compare, or compare two runs with `slideline compare`")
    s = scenario_of(scenario, sets, swaps)
    check_target(out, report=report)
    # Before anything runs: what cannot be compared is told at once.
    own = own_scenario_of(scenario, sets, swaps) if against else None
    if own is not None:
        # Here and not above: a run that compares nothing starts without matplotlib.
        from coupler.report.verdict import bounds_of, demand_names

        demand_names(bounds_of(within), {name: probe.quantity for name, probe in own.probes.items()})
    own_out = out.with_name(f"{out.stem}-own.h5")
    if own is not None:
        check_target(own_out)
    judged = confidence or confidence_mesh
    # Before anything runs: they may not be possible.
    companions = check_companions(s, mesh=confidence_mesh) if judged else []
    plan = plan_of(s)
    count = f"{len(plan.schedule.bounds) - 1} windows" if plan.adaptive is None else "adaptive windows"
    if not quiet:
        typer.echo(f"{s.title}: {_words(s)}, {count} to t = {s.coupling.end:g} s", err=True)
        for note in s.notes:
            typer.echo(f"note: {note}", err=True)
    with ProgressLine(s.temperature_unit, quiet=quiet, verbose=verbose) as line, RunLog(log, out) as written:
        how = Verify.ONCE if verify is None else Verify.ANEW if verify else Verify.NEVER
        with _reported(out, report), _noted(s, line, quiet=quiet):
            results = run(s, out, processes=processes, hosts=hosts, until=until, on_window=_each(line, written),
                          verify=how, on_verify=partial(line.say, asked=how is Verify.ANEW))
        written.done(results.outcome)
    if judged and results.outcome == "completed":
        with TrialLine(quiet=quiet) as trials:
            # fault: the companions of a run are built twice -> found = errors_of_probes(s, results,
            #   mesh=confidence_mesh, on_trial=trials) | coupler/test_confidence
            found = errors_of_probes(s, results, mesh=confidence_mesh, companions=companions, on_trial=trials)
        write_confidence(out, found)
        results = Results(out)
    page = write_report(results, out.with_suffix(".html")) if report else None
    told = facts(results) | {"page": str(page) if page else None}
    if not as_json:
        typer.echo(summary(results, printed=() if quiet else {*s.notes, *line.printed}))
        for name, of in results.confidence.items():
            typer.echo(f"  {name}: {of.failed or f'error {100 * of.share:.2g} % of its range, {of.words}'}")
        typer.echo(f"  {page}" if page else f"  report: slideline report {out}")
    if own is not None and results.outcome == "completed":
        # Here and not above: a run that compares nothing starts without matplotlib.
        from coupler.cli.drawn import compare, compared

        if not quiet:
            typer.echo(f"{own.title}: {_words(own)}, to compare with", err=True)
        # fault: --quiet: the run that is compared with tells its progress -> with ProgressLine(own.temperature_unit) as
        #   line: | coupler/test_verdict
        with ProgressLine(own.temperature_unit, quiet=quiet, verbose=verbose) as line:
            reference = run(own, own_out, processes=processes, hosts=hosts, on_window=line, verify=how,
                            on_verify=partial(line.say, asked=how is Verify.ANEW))
        if not as_json:
            compare(reference, results, None, within)
        else:
            against_own = compared(reference, results, None, within)
            code = told["exit_code"] if against_own.same else DIFFER
            _print_json(told | {"exit_code": code, "comparison": against_own.facts})
            against_own.leave()
    elif as_json:
        _print_json(told)
    leave(results)


@contextmanager
def _reported(out: Path, wanted: bool) -> Iterator[None]:
    """Write the page of a run that fails too, where one is wanted and the run has left results."""
    before = _changed_at(out)
    try:
        yield
    except SlidelineError as exc:
        # fault: a run that fails has no page -> if False: | coupler/test_cli::test_a_run_that_fails_has_its_page_too
        if wanted and _changed_at(out) != before:
            exc.add_note(f"report: {write_report(Results(out), out.with_suffix('.html'))}")
        raise


@contextmanager
def _noted(s: Scenario, line: ProgressLine, *, quiet: bool) -> Iterator[None]:
    """Tell with the error of a quiet run what its notes are: they may name the cause."""
    try:
        yield
    except SlidelineError as exc:
        # fault: a quiet run that fails keeps its notes to itself -> notes: list[str] = [] |
        #   coupler/test_last_words
        notes = list(dict.fromkeys((*s.notes, *line.printed))) if quiet else []
        for note in notes:
            exc.add_note(f"note: {note}")
        raise


def _words(s: Scenario) -> str:
    return " + ".join(words_of(s.thermal_half, s.mechanical_half).values())


def _changed_at(path: Path) -> int | None:
    return path.stat().st_mtime_ns if path.exists() else None


def _print_json(told: dict[str, Any]) -> None:
    typer.echo(json.dumps(told, indent=1, allow_nan=False))


def resume_command(results: Annotated[Path, typer.Argument(help="The results file of a run that ended early.",
                                                           show_default=False)],
                   processes: ProcessesOption = False, hosts: HostsOption = None, until: UntilOption = None,
                   log: LogOption = None,
                   quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print no progress.")] = False,
                   as_json: JsonOption = False, sets: ChangeOption = None) -> None:
    """Resume a run that was interrupted, stopped or killed, or that failed, into the same results file."""
    changes = changes_of(results, overrides_of(sets, None)) if sets else None
    continued = resumed(results, processes=processes, hosts=hosts)
    scenario = continued.scenario
    if not quiet:
        typer.echo(f"{scenario.title}: resuming at t = {continued.start:.9g} s of {scenario.coupling.end:g} s",
                   err=True)
    # fault: a scenario that was changed since is resumed as it was, in silence -> if False: | coupler/test_resume
    if scenario.file.is_file() and scenario.file.read_bytes().splitlines() != scenario.text.encode().splitlines():
        typer.echo(f"note: {scenario.file} was changed since; the run goes on as it began. To run what the file says "
                   f"now: slideline run {scenario.file}", err=True)
    with ProgressLine(scenario.temperature_unit, quiet=quiet) as line, RunLog(log, results) as written:
        done = resume(continued, until=until, on_window=_each(line, written), changes=changes)
        written.done(done.outcome)
    if as_json:
        typer.echo(json.dumps(facts(done), indent=1, allow_nan=False))
    else:
        typer.echo(summary(done, printed=() if quiet else line.printed))
    leave(done)


def _each(*told: Callable[[Progress], None]) -> Callable[[Progress], None]:
    """Return what tells each of these of a window."""
    def tell(progress: Progress) -> None:
        for one in told:
            one(progress)

    return tell


def build_command(scenario: ScenarioFile,
                  out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the FMUs.")] = Path(),
                  fmi: Annotated[int, typer.Option("--fmi", min=2, max=3, help="Version of FMI; in FMI 3 an array "
                                                   "is one variable (needs pythonfmu3).")] = 2,
                  ssp: Annotated[bool, typer.Option("--ssp", help="Also write scene.ssp, which holds both FMUs and "
                                                    "their connections.")] = False,
                  sets: SetOption = None, swaps: SwapOption = None) -> None:
    """Build the FMUs of a scenario, for use in any FMI 2.0 or 3.0 master."""
    found = scenario_of(scenario, sets, swaps)
    if ssp:
        check_one_system(found, fmi)
    built = build_halves(found, out, fmi)
    if ssp:
        built.append(write_ssp(found, dict(zip(found.halves, built, strict=True)), out / "scene.ssp"))
    for path in built:
        typer.echo(path)


# Coarse and rigid.  Windows adapt: those of the file are the elastic half's, and across the time at which rigid blocks
# part, to which the pressure jumps down, they told a first user not to trust what he saw.
OVERRIDES = {"mechanical.half": "rigid", "bodies.lower.mesh.rectangle.cells": [12, 12],
             "bodies.upper.mesh.rectangle.cells": [12, 12],
             # fault: the demo says not to trust it -> "coupling.scheme": "extrapolated"} |
             #   coupler/test_demo::test_the_demo_is_to_be_trusted
             "coupling.scheme": "auto", "coupling.adaptive": {}}


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


def demo_command(folder: Annotated[Path, typer.Argument(help="Where the demo goes.")] = Path("slideline-demo")) -> None:
    """Show a first result in seconds: the sliding blocks with the rigid half, and their report."""
    demo = run_demo(folder, on_start=lambda s: ProgressLine(s.temperature_unit))
    typer.echo(summary(demo.results))
    typer.echo(f"  the scenario: {demo.scenario}\n  the report:   {demo.page}")
    leave(demo.results)
