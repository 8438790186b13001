"""What the rules of a run did: one row a rule, then its firings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from coupler.record.results import Firing, Results
from coupler.report.units import number

# A drive fires in every window: the first and the last of many tell enough.
LISTED_FIRST, LISTED_LAST = 8, 2


@dataclass(frozen=True)
class Acted:
    """One firing in words.  window : row of the windows table, from 1."""

    window: int
    t: str
    did: str
    saw: str


@dataclass(frozen=True)
class Ruled:
    """A rule, how often it fired, and its first and last firings; left_out : how many lie between."""

    name: str
    times: int
    first: tuple[Acted, ...]
    last: tuple[Acted, ...] = ()

    @property
    def left_out(self) -> int:
        return self.times - len(self.first) - len(self.last)


def rules_that_fired(results: Results) -> list[Ruled]:
    """By name, in the order in which they fired first."""
    found: dict[str, list[Firing]] = {}
    for firing in results.firings:
        found.setdefault(firing.rule, []).append(firing)
    return [_ruled(name, firings) for name, firings in found.items()]


def _ruled(name: str, firings: list[Firing]) -> Ruled:
    told = [Acted(f.row + 1, number(f.t, 8), f.text, _saw(f.values)) for f in firings]
    if len(told) <= LISTED_FIRST + LISTED_LAST:
        return Ruled(name, len(told), tuple(told))
    return Ruled(name, len(told), tuple(told[:LISTED_FIRST]), tuple(told[-LISTED_LAST:]))


def _saw(values: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {number(value, 5)}" for name, value in values.items())
