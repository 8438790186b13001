"""The finding of one check of a half, and how findings are shown."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from rich.markup import escape
from rich.table import Table


class CheckVerdict(Enum):
    """The verdict of one check."""

    PASS = "pass"
    FAIL = "FAIL"
    NOT_APPLICABLE = "n/a"


@dataclass(frozen=True)
class Finding:
    """The finding of a check.

    check : its name.  reason : what was measured.  remedy : of a failure what to change; of n/a what a run then lacks.
    """

    check: str
    verdict: CheckVerdict
    reason: str = ""
    remedy: str = ""


def passed(check: str, reason: str = "") -> Finding:
    return Finding(check, CheckVerdict.PASS, reason)


def failed(check: str, reason: str, remedy: str) -> Finding:
    return Finding(check, CheckVerdict.FAIL, reason, remedy)


def not_applicable(check: str, reason: str, cost: str = "") -> Finding:
    return Finding(check, CheckVerdict.NOT_APPLICABLE, reason, cost)


_COLOUR = {CheckVerdict.PASS: "green", CheckVerdict.FAIL: "bold red", CheckVerdict.NOT_APPLICABLE: "yellow"}


def table_of(half: str, findings: Iterable[Finding]) -> Table:
    """Return a table with one row a check."""
    table = Table(title=f"{half} against the interface specification", title_justify="left")
    for column in ("check", "", "result", "remedy"):
        table.add_column(column, overflow="fold")
    for f in findings:
        table.add_row(f.check, f"[{_COLOUR[f.verdict]}]{f.verdict.value}[/]", escape(f.reason), escape(f.remedy))
    return table


def conclusion(half: str, findings: Iterable[Finding]) -> str:
    """Return the result of all checks in a line."""
    verdicts = [f.verdict for f in findings]
    counts = ", ".join(f"{n} {text}" for verdict, text in (
        (CheckVerdict.PASS, "passed"), (CheckVerdict.FAIL, "failed"), (CheckVerdict.NOT_APPLICABLE, "not applicable"))
        if (n := verdicts.count(verdict)))
    result = "violates" if CheckVerdict.FAIL in verdicts else "meets"
    return f"{half} {result} the interface specification: {counts}"
