"""The verb `slideline verify-half`: findings as a table, and a code."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from coupler.errors import ScenarioError
from coupler.verify.finding import Finding, Verdict
from coupler.verify.subject import fmu_of
from coupler.verify.verify import verify_fmu

NOT_KEPT = 1  # exit code where a check failed
_COLOUR = {Verdict.PASS: "green", Verdict.FAIL: "bold red", Verdict.NOT_APPLICABLE: "yellow"}

HalfArgument = Annotated[str, typer.Argument(
    help="An FMU, file.fmu, or the name of a half that is installed: thermal, elastic, ...", show_default=False)]
ScenarioOption = Annotated[Path | None, typer.Option(
    "--scenario", metavar="FILE", help="Of a half by name: a scenario that uses it; for our own halves there is one.",
    show_default=False)]
StepOption = Annotated[float, typer.Option("--step", metavar="SECONDS",
                                           help="Substep to begin with; halved while the half refuses it.")]


def verify_half_command(half: HalfArgument, scenario: ScenarioOption = None, step: StepOption = 1.0) -> None:
    """Hold a half against the border: names, units, state, discards, substeps.  Code 1 where it does not keep to it."""
    if not 0 < step < float("inf"):
        raise ScenarioError("a substep is longer than 0", key="--step", value=step, remedy="Give seconds")
    with tempfile.TemporaryDirectory(prefix="slideline-") as scratch:
        fmu = fmu_of(half, scenario, Path(scratch) / "half")
        findings = list(verify_fmu(fmu, Path(scratch), step))
    Console().print(table_of(half, findings))
    typer.echo(verdict_words(half, findings))
    if any(f.verdict is Verdict.FAIL for f in findings):
        raise typer.Exit(NOT_KEPT)


def table_of(half: str, findings: Iterable[Finding]) -> Table:
    """One row a check."""
    table = Table(title=f"{half} at the border", title_justify="left")
    for column in ("check", "", "seen", "what to do"):
        table.add_column(column, overflow="fold")
    for f in findings:
        table.add_row(f.check, f"[{_COLOUR[f.verdict]}]{f.verdict.value}[/]", escape(f.reason), escape(f.remedy))
    return table


def verdict_words(half: str, findings: Iterable[Finding]) -> str:
    """The outcome in a line."""
    verdicts = [f.verdict for f in findings]
    counts = ", ".join(f"{n} {words}" for verdict, words in (
        (Verdict.PASS, "passed"), (Verdict.FAIL, "failed"), (Verdict.NOT_APPLICABLE, "not applicable"))
        if (n := verdicts.count(verdict)))
    kept = "does not keep to the border" if Verdict.FAIL in verdicts else "keeps to the border"
    return f"{half} {kept}: {counts}"
