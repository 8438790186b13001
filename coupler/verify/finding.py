"""What one check found."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class Verdict(Enum):
    """Of one check."""

    PASS = "pass"
    FAIL = "FAIL"
    NOT_APPLICABLE = "n/a"


@dataclass(frozen=True)
class Finding:
    """check : its name.  reason : what was seen.  remedy : what to change, of a failure; of n/a what it costs."""

    check: str
    verdict: Verdict
    reason: str = ""
    remedy: str = ""


def passed(check: str, reason: str = "") -> Finding:
    return Finding(check, Verdict.PASS, reason)


def failed(check: str, reason: str, remedy: str) -> Finding:
    return Finding(check, Verdict.FAIL, reason, remedy)


def not_applicable(check: str, reason: str, cost: str = "") -> Finding:
    return Finding(check, Verdict.NOT_APPLICABLE, reason, cost)
