"""Control: windows in order, cut where a half discards, until the end; every try is told with its verdict."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

from coupler.errors import CouplingError
from coupler.level import Scheme
from coupler.schedule import Schedule
from coupler.window import CoupledState, Halves, Solved, Verdict, solve_window

# A window is halved at most this often before the run gives up: 2^-10 of a window a user chose is a sign of a
# problem that smaller windows do not cure.
MAX_CUTS = 10


@dataclass(frozen=True)
class Tried:
    """One window tried: its number (of the accepted ones), its times [s], what came of it, what it cost."""

    number: int
    t: float
    H: float
    solved: Solved
    seconds: float

    @property
    def accepted(self) -> bool:
        return self.solved.verdict is Verdict.ACCEPTED


@dataclass(frozen=True)
class Plan:
    """How to run: where windows end, by which scheme, with how many substeps of each half."""

    schedule: Schedule
    scheme: Scheme
    substeps: Mapping[str, int]


def windows(halves: Halves, state: CoupledState, plan: Plan) -> Iterator[Tried]:
    """Solve window after window; both halves are put back before a discarded window is tried again in two.

    Raises CouplingError when a window cannot be solved however small, or a half keeps no states.
    """
    clock, number = plan.schedule.clock, 0
    for k0, k1 in pairwise(plan.schedule.bounds):
        if k0 in plan.schedule.kinks:
            state = replace(state, before=None, events=state.events + (k0 in plan.schedule.events))
        ends = [k1]
        start = k0
        while ends:
            tried = _try(halves, state, plan, number, start, ends[-1])
            yield tried
            if tried.accepted:
                state, number, start = tried.solved.state, number + 1, ends.pop()
                continue
            middle = (start + ends[-1]) // 2
            if len(ends) > MAX_CUTS or middle == start:
                raise CouplingError(
                    f"{tried.solved.message}; the window was halved {len(ends) - 1} times to {tried.H:.3g} s",
                    t=clock.seconds(start), window=number + 1,
                    remedy="Everything up to here is in the results file. Give smaller windows (coupling.windows) "
                           "or more substeps around this time, or look at the data that change here")
            ends.append(middle)


def _try(halves: Halves, state: CoupledState, plan: Plan, number: int, k0: int, k1: int) -> Tried:
    """One window; after a discard both halves are as before it."""
    both = (halves.thermal, halves.mechanical)
    clock = plan.schedule.clock
    started = time.perf_counter()
    tokens = [half.save() if half.can_save else None for half in both]
    try:
        solved = solve_window(halves, state, clock, k0, k1, plan.scheme, plan.substeps)
        if solved.verdict is not Verdict.ACCEPTED:
            for half, token in zip(both, tokens, strict=True):
                if token is None:
                    raise CouplingError(f"{solved.message}; half {half.name!r} keeps no states, so the window "
                                        "cannot be tried again", t=clock.seconds(k0), window=number + 1,
                                        remedy="Give smaller windows (coupling.windows) around this time")
                half.restore(token)
    finally:
        for half, token in zip(both, tokens, strict=True):
            if token is not None:
                half.release(token)
    t0 = clock.seconds(k0)
    return Tried(number, t0, clock.seconds(k1) - t0, solved, time.perf_counter() - started)
