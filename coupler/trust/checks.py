"""A check of a run: what was measured, what it may be, and what to do where it is more."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from enum import StrEnum
from typing import Any


class TrustVerdict(StrEnum):
    """What a check found."""

    HOLDS = "holds"
    NOTED = "noted"  # smaller than what spoils an answer, and told
    BROKEN = "broken"
    UNCHECKED = "not checked"  # it says nothing of this run


PREFIXED = ("Pa", "J", "N", "W/m2")  # units of which engineers write thousands with a prefix


def amount(value: float, unit: str) -> str:
    """A value with its unit, to three digits: 1.28 kPa and not 1.28e+03 Pa.

    >>> amount(1283.0, "Pa"), amount(2.4e-5, "m"), amount(73.7, "K"), amount(3441.2, "K")
    ('1.28 kPa', '0.024 mm', '73.7 K', '3440 K')
    """
    # fault: a pressure is told with a power of ten -> if False: | coupler/test_trust_errors
    if unit in PREFIXED and abs(value) >= 1e3:
        factor, prefix = next(pair for pair in ((1e9, "G"), (1e6, "M"), (1e3, "k")) if abs(value) >= pair[0])
        return f"{value / factor:.3g} {prefix}{unit}"
    value, unit = (1e3 * value, "mm") if unit == "m" and abs(value) < 1.0 else (value, unit)
    digits = f"{float(f'{value:.3g}'):.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"
    return f"{digits} {unit}"


@dataclass(frozen=True)
class Check:
    """One line of the trust table.

    name : what was looked at.  number : what was measured, in `unit`.  limit : beyond it the answer is not to be
    trusted.  t [s]: where it was worst.  what : a sentence on it, or why it was not checked.  remedy : what to do.
    """

    name: str
    verdict: TrustVerdict
    number: float = 0.0
    limit: float = 0.0
    unit: str = "1"
    t: float = 0.0
    what: str = ""
    remedy: str = ""

    @property
    def sentence(self) -> str:
        """The finding in words."""
        if self.verdict in (TrustVerdict.HOLDS, TrustVerdict.UNCHECKED):
            return f"{self.name}: {self.verdict.value}" + (f" ({self.what})" if self.what else "")
        return f"{self.name}: {self.what}" + (f". {self.remedy}" if self.remedy else "")

    def as_dict(self) -> dict[str, Any]:
        """Return the plain values, for a results file."""
        return asdict(self) | {"verdict": self.verdict.value}

    @staticmethod
    def of(row: Mapping[str, Any]) -> Check:
        """Return the check of plain values; those it does not know are left out."""
        known = {f.name for f in fields(Check)}
        return Check(**{n: v for n, v in row.items() if n in known and n != "verdict"},
                     verdict=TrustVerdict(row["verdict"]))


def measured(name: str, number: float, limits: tuple[float, float], *, what: str, remedy: str, t: float = 0.0,
             unit: str = "1") -> Check:
    """Return the check of a number.  limits : up to the first it holds, beyond the second it is broken."""
    note_at, limit = limits
    verdict = TrustVerdict.BROKEN if number > limit else TrustVerdict.NOTED
    verdict = verdict if number > note_at else TrustVerdict.HOLDS
    return Check(name, verdict, number, limit, unit, t, "" if verdict is TrustVerdict.HOLDS else what,
                 "" if verdict is TrustVerdict.HOLDS else remedy)


def broken(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Return what makes a run one not to trust."""
    return tuple(c for c in checks if c.verdict is TrustVerdict.BROKEN)
