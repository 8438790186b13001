"""The master clock, and the schedule: where windows end, before anything has been solved.

Time is integer ticks of 2^-40 of the end time; marked ticks know their exact times.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field

from coupler.scenario.options import WindowRange

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


@dataclass(frozen=True)
class Schedule:
    """bounds : ticks at which windows end, ascending, from 0 on.  kinks : those of them that are kinks.

    events : the kinks at which halves restart damped.
    """

    clock: Clock
    bounds: tuple[int, ...]
    kinks: frozenset[int]
    events: frozenset[int]


def schedule(end: float, ranges: Sequence[WindowRange], kinks: Iterable[float],
             bends: Collection[float] = ()) -> Schedule:
    """Windows over [0, end] that end at every kink and at the end of every range.

    end [s].  kinks [s]: times at which boundary data jump or change slope; 0 and times past the end are left out.
    bends [s]: those of them where no half need restart damped.
    Raises ValueError if the ranges do not reach the end or do not advance.
    """
    if not ranges or ranges[-1].until < end:
        raise ValueError(f"the windows must reach the end of the run, {end} s")
    kink_times = sorted({t for t in kinks if 0 < t < end})
    clock = clock_with_marks(end, [*kink_times, *(r.until for r in ranges)])
    bounds, start = [0], 0.0
    for r in ranges:
        until = min(r.until, end)
        if until <= start:
            raise ValueError(f"a range of windows ends at {r.until} s, where the one before it ends at {start} s")
        range_start = start
        for piece_end in [t for t in kink_times if start < t < until] + [until]:
            first, last = _sizes_at(r, range_start, start, piece_end)
            base, sizes = start, geometric_sizes(piece_end - start, first, last)
            for i in range(len(sizes) - 1):
                bounds.append(clock.ticks(base + math.fsum(sizes[: i + 1])))
            bounds.append(clock.ticks(piece_end))
            start = piece_end
        if until == end:
            break
    unique = tuple(sorted(set(bounds)))
    events = frozenset(clock.ticks(t) for t in kink_times if t not in bends)
    return Schedule(clock, unique, frozenset(clock.ticks(t) for t in kink_times), events)


def _sizes_at(r: WindowRange, range_start: float, start: float, end: float) -> tuple[float, float]:
    """First and last window size of the piece [start, end] of a range: a geometric sequence is linear in time."""
    length = r.until - range_start

    def size(t: float) -> float:
        return r.first + (r.last - r.first) * (t - range_start) / length

    return size(start), size(end)


def geometric_sizes(length: float, first: float, last: float) -> list[float]:
    """Sizes of about first ... last that add up to length, each the same factor of the one before."""
    ratio = last / first
    # Sizes of a geometric sequence change linearly with the time covered, so their number is the integral of 1/size.
    n = length / first if abs(ratio - 1.0) < 1e-12 else length * math.log(ratio) / (last - first)
    count = max(1, math.ceil(n - 1e-9))
    factor = ratio ** (1.0 / (count - 1)) if count > 1 else 1.0
    sizes = [factor**i for i in range(count)]
    total = math.fsum(sizes)
    return [s / total * length for s in sizes]
