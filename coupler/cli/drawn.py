"""Verbs that draw: `show` a scenario, `report` or `watch` a run, `compare` two."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from coupler.cli.codes import DIFFER
from coupler.cli.options import JsonOption, ScenarioFile, SetOption, SwapOption, WithinOption, leave, scenario_of
from coupler.record.results import Results
from coupler.report import watch_report, write_report
from coupler.report.comparison import short_names, write_comparison
from coupler.report.verdict import bounds_of, verdict
from coupler.report.watch import wait_for


def show_command(scenario: ScenarioFile,
                 out: Annotated[Path | None, typer.Option(
                     "--out", "-o", help="The picture: .png, .svg or .pdf; without it SCENARIO.png, here.")] = None,
                 sets: SetOption = None, swaps: SwapOption = None) -> None:
    """Draw a scenario before it runs: bodies, meshes, pairs with their sides, conditions, probes."""
    # Here and not above: who draws results loads nothing that reads a scenario.
    from coupler.report.scene import write_scene

    typer.echo(write_scene(scenario_of(scenario, sets, swaps), out or Path(f"{scenario.stem}.png")))


def report_command(results: Annotated[Path, typer.Argument(help="A results file, run.h5.", show_default=False)],
                   out: Annotated[Path | None, typer.Option(
                       "--out", "-o", help="The page; default: beside the results, .html.")] = None) -> None:
    """Write a self-contained HTML page about a run."""
    typer.echo(write_report(Results(results), out or results.with_suffix(".html")))


def watch_command(results: Annotated[Path, typer.Argument(help="The results file that a run will write.",
                                                          show_default=False)],
                  out: Annotated[Path | None, typer.Option(
                       "--out", "-o", help="The page; default: beside the results, .html.")] = None,
                  every: Annotated[float, typer.Option("--every", metavar="SECONDS", min=1.0,
                                                       help="Time between two pages.")] = 5.0,
                  patience: Annotated[float, typer.Option("--patience", metavar="SECONDS", min=0.0,
                                                          help="How long to wait for a run to begin.")] = 180.0,
                  ) -> None:
    """Write the report of a run while it goes on; the page reloads itself until the run ends."""
    page = out or results.with_suffix(".html")

    def tell(so_far: Results) -> None:
        reached = so_far.t[-1] if len(so_far.t) else 0.0
        typer.echo(f"{page}: {so_far.outcome}, t = {reached:.6g} of {so_far.header['coupling']['end']:.6g} s")

    def tell_waiting() -> None:
        typer.echo(f"{results}: no run writes it yet (its halves are built first); waiting for {patience:g} s",
                   err=True)

    # fault: who watches before a run begins is sent away -> pass | coupler/test_watch
    wait_for(results, patience, tell_waiting)
    leave(watch_report(results, page, every, tell))


def compare_command(first: Annotated[Path, typer.Argument(help="Results file of the reference.", show_default=False)],
                    second: Annotated[Path, typer.Argument(help="The results file to compare.", show_default=False)],
                    out: Annotated[Path | None, typer.Option("--out", "-o",
                        help="The page; default: beside the second, SECOND-against-FIRST.html.")] = None,
                    within: WithinOption = "", as_json: JsonOption = False) -> None:
    """Compare two runs: the largest differences on a page, and a verdict.  Code 5: they differ, or are two scenes."""
    compare(Results(first), Results(second), out, within, as_json=as_json)


def compare(a: Results, b: Results, out: Path | None, within: str, *, as_json: bool = False) -> None:
    """Tell the comparison and the verdict, and end with its exit code."""
    found = compared(a, b, out, within)
    said = json.dumps(found.facts, indent=1) if as_json else f"{found.text}\n  {found.page}\n{found.verdict}"
    typer.echo(said)
    found.leave()


@dataclass(frozen=True)
class Compared:
    """Two runs against each other, in words, on a page, and judged.  same : whether they are of one scene and agree."""

    text: str
    page: Path
    verdict: str
    same: bool

    @property
    def facts(self) -> dict[str, str | bool]:
        """What a script reads of it."""
        return {"same": self.same, "verdict": self.verdict, "differences": self.text, "page": str(self.page)}

    def leave(self) -> None:
        """End with the exit code of runs that differ, where they do."""
        # fault: runs that differ end with 0 -> if False: | coupler/test_verdict
        if not self.same:
            raise typer.Exit(DIFFER)


def compared(a: Results, b: Results, out: Path | None, within: str) -> Compared:
    """Hold run b against run a.  Raises ScenarioError for bounds that are none, ResultsError as `verdict` does."""
    bounds = bounds_of(within)
    judged = verdict(a, b, bounds)
    page, text = write_comparison(a, b, out or b.path.with_name(f"{b.path.stem}-against-{a.path.stem}.html"))
    return Compared(text, page, judged.text(short_names(a, b)), not (judged.differs or judged.changed))
