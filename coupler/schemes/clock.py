"""The master clock: integer ticks of 2^-40 of the end time, and the exact times of marked ticks."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

TICKS = 2**40


@dataclass(frozen=True)
class Clock:
    """Ticks 0 .. 2^40 cover [0, end] seconds.

    A marked time (a kink) keeps its own floating-point value, so that a signal which jumps there is
    evaluated at the jump and not 1e-8 s beside it.
    """

    end: float
    marks: dict[int, float] = field(default_factory=dict)

    def ticks(self, t: float) -> int:
        """The tick nearest to t [s]."""
        return round(t / self.end * TICKS)

    def seconds(self, tick: int) -> float:
        """The time of a tick [s]."""
        return self.marks.get(tick, tick / TICKS * self.end)


def clock_with_marks(end: float, times: Iterable[float]) -> Clock:
    """A clock to `end` [s] that knows the exact times of the given marks (those after the end are left out)."""
    bare = Clock(end)
    return Clock(end, {bare.ticks(t): t for t in (*times, end) if 0 < t <= end})
