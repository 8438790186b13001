"""The command line.

Exit codes: 0 done; 1 the run failed (a window that cannot be solved, a half that died, a broken link);
2 the input is wrong (scenario, options); 3 a results file cannot be read or written; 130 interrupted.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import typer

from contact.link import LinkError
from coupler.console import ProgressLine, summary
from coupler.demo import run_demo
from coupler.errors import ResultsError, ScenarioError, SlidelineError
from coupler.launch import build_halves
from coupler.report import write_report
from coupler.results import Results
from coupler.runner import plan_of, run
from coupler.scenario import Scenario, load_scenario, parse_override
from coupler.target import check_target

FAILED, BAD_INPUT, BAD_RESULTS, INTERRUPTED = 1, 2, 3, 130

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False,
                  help="Heat and deformation of bodies in contact: two solvers, each an FMU, coupled.")

ScenarioFile = Annotated[Path, typer.Argument(help="The scenario, a YAML file.", show_default=False)]
SetOption = Annotated[list[str] | None, typer.Option(
    "--set", metavar="KEY=VALUE", help="Change a value: coupling.scheme=staggered. May be repeated.")]
SwapOption = Annotated[list[str] | None, typer.Option(
    "--swap", metavar="HALF=KIND", help="Use another half: mechanical=rigid. May be repeated.")]
OutOption = Annotated[Path, typer.Option("--out", "-o", help="Where the results go.")]


def _scenario(path: Path, sets: Sequence[str] | None, swaps: Sequence[str] | None) -> Scenario:
    overrides: dict[str, Any] = dict(parse_override(text) for text in sets or ())
    for text in swaps or ():
        half, sep, kind = text.partition("=")
        if not sep or half not in ("thermal", "mechanical") or not kind:
            raise ScenarioError("an exchange of halves reads thermal=KIND or mechanical=KIND", key="--swap", value=text,
                                remedy="For example --swap mechanical=rigid")
        overrides[f"{half}.half"] = kind
    return load_scenario(path, overrides=overrides)


@app.command("check")
def check_command(scenario: ScenarioFile, sets: SetOption = None, swaps: SwapOption = None) -> None:
    """Read a scenario and say what it would run, without running it."""
    s = _scenario(scenario, sets, swaps)
    plan = plan_of(s)
    i, clock = s.interface, plan.schedule.clock
    sizes = [clock.seconds(b) - clock.seconds(a)
             for a, b in pairwise(plan.schedule.bounds)]
    kinks = ", ".join(f"{clock.seconds(k):.6g}" for k in sorted(plan.schedule.kinks))
    pairs = "; ".join(f"{p.name} (slave {p.slave}, master {p.master})" for p in i.pairs) or "none"
    typer.echo(f"{s.title}: good.\n"
               f"  {s.geometry}, bodies {', '.join(i.bodies)}; {len(i.nodes)} nodes, "
               f"{len(i.quads)} quads, {len(i.triangles)} triangles\n"
               f"  contact pairs: {pairs}\n"
               f"  halves: thermal {s.thermal_half}, mechanical {s.mechanical_half}; scheme {plan.scheme.value}\n"
               f"  {_sizes(sizes)} to t = {s.coupling.end:g} s; {f'kinks at {kinks} s' if kinks else 'no kinks'}\n"
               f"  probes: {', '.join(s.probes) or 'none'}")
    for note in s.notes:
        typer.echo(f"  note: {note}")


def _sizes(sizes: Sequence[float]) -> str:
    least, most = f"{min(sizes):.3g}", f"{max(sizes):.3g}"
    return f"{len(sizes)} window{'s' if len(sizes) > 1 else ''} of {least if least == most else f'{least} to {most}'} s"


@app.command("run")
def run_command(scenario: ScenarioFile, out: OutOption = Path("run.h5"), sets: SetOption = None,
                swaps: SwapOption = None,
                processes: Annotated[bool, typer.Option(
                    "--processes", help="Each half and the contact service in a process of its own.")] = False,
                report: Annotated[bool, typer.Option("--report", help="Write the report page too.")] = False) -> None:
    """Run a scenario; results go to run.h5 and one .vtkhdf a half."""
    s = _scenario(scenario, sets, swaps)
    check_target(out, report=report)
    typer.echo(f"{s.title}: {s.thermal_half} + {s.mechanical_half}, {len(plan_of(s).schedule.bounds) - 1} windows "
               f"to t = {s.coupling.end:g} s", err=True)
    for note in s.notes:
        typer.echo(f"note: {note}", err=True)
    with ProgressLine(s.temperature_unit) as line:
        results = run(s, out, processes=processes, on_window=line)
    typer.echo(summary(results, told={*s.notes, *line.told}))
    if report:
        typer.echo(f"  {write_report(results, out.with_suffix('.html'))}")
    else:
        typer.echo(f"  see it: slideline report {out}")
    if results.outcome == "interrupted":
        raise typer.Exit(INTERRUPTED)


@app.command("report")
def report_command(results: Annotated[Path, typer.Argument(help="A results file, run.h5.", show_default=False)],
                   out: Annotated[Path | None, typer.Option("--out", "-o", help="The page.")] = None) -> None:
    """Write a self-contained HTML page about a run."""
    typer.echo(write_report(Results(results), out or results.with_suffix(".html")))


@app.command("compare")
def compare_command(first: Annotated[Path, typer.Argument(help="A results file to hold against.", show_default=False)],
                    second: Annotated[Path, typer.Argument(help="The one that is held.", show_default=False)],
                    out: Annotated[Path | None, typer.Option("--out", "-o", help="The page.")] = None) -> None:
    """Two runs side by side: the largest difference of each probe, when and where, in a sentence and on a page."""
    # Here and not above, as the report itself: other commands start without matplotlib.
    from coupler.report.comparison import write_comparison

    a, b = Results(first), Results(second)
    page, told = write_comparison(a, b, out or second.with_name(f"{second.stem}-against-{first.stem}.html"))
    typer.echo(f"{told}\n  {page}")


@app.command("build")
def build_command(scenario: ScenarioFile,
                  out: Annotated[Path, typer.Option("--out", "-o", help="Folder for the FMUs.")] = Path(),
                  sets: SetOption = None, swaps: SwapOption = None) -> None:
    """Build the FMUs of a scenario by hand, for use in any FMI 2.0 master."""
    for path in build_halves(_scenario(scenario, sets, swaps), out):
        typer.echo(path)


@app.command("demo")
def demo_command(folder: Annotated[Path, typer.Argument(help="Where the demo goes.")] = Path("slideline-demo")) -> None:
    """A first look in seconds: the sliding blocks with the rigid half, and their report."""
    scenario, results, page = run_demo(folder, on_start=lambda s: ProgressLine(s.temperature_unit))
    typer.echo(summary(results))
    typer.echo(f"  the scenario: {scenario}\n  the report:   {page}")


def main() -> None:
    """Entry point: every expected error is one clear text and an exit code."""
    try:
        app()
    except (SlidelineError, LinkError) as exc:
        typer.echo(f"error: {exc}", err=True)
        code = {ScenarioError: BAD_INPUT, ResultsError: BAD_RESULTS}.get(type(exc), FAILED)
        sys.exit(code)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)


if __name__ == "__main__":
    main()
