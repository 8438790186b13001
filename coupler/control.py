"""Control: windows in order, cut where one cannot be solved, until the end; every try is told with its verdict."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise

from coupler import cycle
from coupler.errors import CouplingError
from coupler.iterate import solve_iterated
from coupler.iteration import Iteration, OnMax
from coupler.level import Scheme
from coupler.schedule import Schedule
from coupler.scheme import ONCE
from coupler.sweep import DiscardError
from coupler.window import CoupledState, Halves, Solved, Span, Verdict

# A window is halved at most this often before the run gives up: 2^-10 of a window a user chose is a sign of a
# problem that smaller windows do not cure.
MAX_CUTS = 10


@dataclass(frozen=True)
class Tried:
    """One window tried: its number (of those taken), its times [s], what came of it, what it cost, what was noticed."""

    number: int
    t: float
    H: float
    solved: Solved
    seconds: float
    notes: tuple[str, ...] = ()

    @property
    def accepted(self) -> bool:
        """Whether the run goes on from its end."""
        return self.solved.taken


@dataclass(frozen=True)
class Plan:
    """How to run: where windows end, by which scheme, with how many substeps of each half, iterated how."""

    schedule: Schedule
    scheme: Scheme
    substeps: Mapping[str, int]
    iteration: Iteration = field(default_factory=Iteration)


def windows(halves: Halves, state: CoupledState, plan: Plan) -> Iterator[Tried]:
    """Solve window after window; both halves are put back before a window that failed is tried again in two.

    Raises CouplingError when a window cannot be solved however small, or a half keeps no states.
    """
    clock, number, watch = plan.schedule.clock, 0, cycle.Watch()
    for k0, k1 in pairwise(plan.schedule.bounds):
        if k0 in plan.schedule.kinks:
            state = replace(state, before=None, memory=(), events=state.events + (k0 in plan.schedule.events))
            watch = cycle.Watch()
        ends = [k1]
        start = k0
        while ends:
            tried = _try(halves, state, plan, number, Span(clock, start, ends[-1], plan.substeps))
            if tried.accepted:
                watch, tried = _watched(watch, state, tried)
                yield tried
                state, number, start = tried.solved.state, number + 1, ends.pop()
                continue
            yield tried
            ends.append(_middle(tried, plan, start, ends))


def _watched(watch: cycle.Watch, state: CoupledState, tried: Tried) -> tuple[cycle.Watch, Tried]:
    """The watch after a window that was taken, and the window with what the watch has to say."""
    now = tried.solved.state.now
    watch = watch.plus(state.now, now)
    if not watch.cycling:
        return watch, tried
    return watch.tell(), replace(tried, notes=(cycle.note(watch, tried.number + 1, now.t),))


def _middle(tried: Tried, plan: Plan, start: int, ends: list[int]) -> int:
    """Where a window that failed is cut.  Raises CouplingError where it may not be."""
    solved, t = tried.solved, plan.schedule.clock.seconds(start)
    course = solved.course
    if solved.verdict is Verdict.MAX_ITERATIONS and plan.iteration.on_max is OnMax.STOP:
        assert course is not None
        raise CouplingError(f"{solved.message}; coupling.iteration.on_max says to stop", t=t, window=tried.number + 1,
                            iteration=len(course.misfits), residuals=tuple(course.misfits[-1].values()),
                            remedy="Give smaller windows, another acceleration or more iterations")
    middle = (start + ends[-1]) // 2
    if len(ends) > MAX_CUTS or middle == start:
        raise CouplingError(
            f"{solved.message}; the window was halved {len(ends) - 1} times to {tried.H:.3g} s", t=t,
            window=tried.number + 1, iteration=len(course.misfits) if course else 0,
            residuals=tuple(course.misfits[-1].values()) if course else (),
            remedy="Everything up to here is in the results file. Give smaller windows (coupling.windows) "
                   "or more substeps around this time, or look at the data that change here")
    return middle


def _try(halves: Halves, state: CoupledState, plan: Plan, number: int, span: Span) -> Tried:
    """One window; if it is not taken both halves are as before it."""
    t0 = span.clock.seconds(span.k0)
    both = (halves.thermal, halves.mechanical)
    started = time.perf_counter()
    tokens = [half.save() if half.can_save else None for half in both]

    def put_back(why: str) -> None:
        for half, token in zip(both, tokens, strict=True):
            if token is None:
                raise CouplingError(f"{why}; half {half.name!r} keeps no states, so the window cannot be tried again",
                                    t=t0, window=number + 1,
                                    remedy="Give smaller windows (coupling.windows) around this time")
            half.restore(token)

    try:
        solved = _solve(halves, state, plan, span, lambda: put_back("a window is to be iterated"))
        if not solved.taken:
            put_back(solved.message)
    finally:
        for half, token in zip(both, tokens, strict=True):
            if token is not None:
                half.release(token)
    return Tried(number, t0, span.end - t0, solved, time.perf_counter() - started)


def _solve(halves: Halves, state: CoupledState, plan: Plan, span: Span, rollback: Callable[[], None]) -> Solved:
    """The window by the plan's scheme; after a discard the halves are where the discard left them."""
    try:
        if plan.scheme is Scheme.ITERATED:
            return solve_iterated(halves, state, span, plan.iteration, rollback)
        return ONCE[plan.scheme](halves, state, span).solved(state)
    except DiscardError as discard:
        return Solved(discard.verdict, str(discard), state, (), discard.work, {})
