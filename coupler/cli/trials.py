"""Verbs that run a scenario many times: `study` and `advise`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from coupler.cli.codes import INTERRUPTED
from coupler.cli.options import ScenarioFile, SetOption, SwapOption, overrides_of
from coupler.experiments.advise import AdviceOptions, advise
from coupler.experiments.grid import grid_of, parse_axis
from coupler.experiments.pool import StudyLine, TrialLine
from coupler.experiments.study import StudyOptions, conduct
from coupler.experiments.study_files import write_study
from coupler.experiments.variants import CELLS


def study_command(scenario: ScenarioFile,
                  out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the study.")] = Path("study"),
                  grid: Annotated[list[str] | None, typer.Option(
                      "--grid", metavar="AXIS=VALUES",
                      help="Values to run: scheme=staggered,extrapolated or windows=1,2,5. May be repeated.")] = None,
                  measure: Annotated[str, typer.Option(
                      "--measure", metavar="PROBES", help="Probes whose error counts, separated by commas.")] = "",
                  processes: Annotated[int, typer.Option(
                      "--jobs", "-j", min=0, help="Runs at the same time; 0: one for each core.")] = 0,
                  cluster: Annotated[str, typer.Option(
                      "--cluster", metavar="ADDRESS", help="Run on the Dask cluster of this scheduler.")] = "",
                  limit: Annotated[float | None, typer.Option(
                      "--limit", metavar="SECONDS", help="Wall time of a run at most.")] = None,
                  pilot: Annotated[bool, typer.Option(
                      "--pilot", help="Run a few long windows first, to show the longest stable ones.")] = False,
                  sets: SetOption = None, swaps: SwapOption = None) -> None:
    """Run a grid of settings, and draw error against cost.  After Ctrl-C the same command continues."""
    keys: dict[str, Any] = {}
    if grid:
        keys["grid"] = grid_of([parse_axis(text) for text in grid])
    if measure:
        keys["measure"] = [name.strip() for name in measure.split(",")]
    try:
        with StudyLine() as line:
            options = StudyOptions(processes, cluster, limit, pilot)
            study = conduct(scenario, out, overrides_of(sets, swaps), keys, options, line)
    except KeyboardInterrupt as exc:
        typer.echo("\n".join(getattr(exc, "__notes__", ())), err=True)
        raise typer.Exit(INTERRUPTED) from None
    typer.echo(f"  {write_study(study, out)}")


def advise_command(scenario: ScenarioFile,
                   goals: Annotated[list[str] | None, typer.Option(
                       "--for", metavar="PROBE=TOLERANCE", help="A probe and its tolerance: lower.top.centre=1K, "
                       "'upper.*=0.5%' (of its range).  May be repeated; default: every probe, 1 %.")] = None,
                   out: Annotated[Path, typer.Option(
                       "--out", "-o", help="Folder for trials, advice.txt and advised.yaml.")] = Path("advise"),
                   limit: Annotated[float, typer.Option(
                       "--limit", metavar="SECONDS", help="Wall time of all trials at most.")] = 600.0,
                   cells: Annotated[int, typer.Option("--cells", help="Most cells of a body in a trial.")] = CELLS,
                   sets: SetOption = None, swaps: SwapOption = None) -> None:
    """Find the cheapest model within your tolerance, and write it as a scenario."""
    with TrialLine() as line:
        advice = advise(scenario, out, AdviceOptions(goals or (), overrides_of(sets, swaps), limit, cells), line)
    for text in advice.lines:
        typer.echo(text)
    if advice.interrupted:
        raise typer.Exit(INTERRUPTED)
