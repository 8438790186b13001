"""All checks of one half: its face first, then, where the face is one a run can use, how it behaves."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from coupler.errors import HalfError, ScenarioError
from coupler.fmu.description import read_description, unpack
from coupler.fmu.fmi import load_half
from coupler.fmu.half import Half
from coupler.verify.checks import (
    Finding,
    Verdict,
    behaviour_findings,
    face_findings,
    failed,
    fmu_of,
    passed,
    reference_finding,
    settled,
    state_findings,
)

RUNS = "takes substeps"


def verify_fmu(fmu: Path, scratch: Path, h: float) -> Iterator[Finding]:
    """Findings of an FMU one by one; h : substep to begin with [s].

    scratch : an empty folder.  Raises HalfError where the file is no FMU of FMI 2.0 for co-simulation.
    """
    extracted = unpack(fmu, scratch / "fmu")
    yield reference_finding(read_description(extracted))
    yield from verify_half(lambda: load_half(fmu, extracted, fmu.stem), h)


def verify_half(make: Callable[[], Half], h: float) -> Iterator[Finding]:
    """Findings of a half one by one.  make : a new instance, loaded and not initialised."""
    half = make()
    try:
        findings = [*face_findings(half.blocks), *state_findings(half.can_save, half.can_serialise)]
    finally:
        half.close()
    yield from findings
    if findings[0].verdict is Verdict.FAIL:
        return
    try:
        bench = settled(make, h)
    except HalfError as exc:
        yield failed(RUNS, str(exc).splitlines()[0], "Give a substep it can take, with --step")
        return
    yield passed(RUNS, f"of {bench.h:.3g} s")
    yield from behaviour_findings(bench)


# The verb `slideline verify-half`: findings as a table, and a code.

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
