"""One window solved by a scheme, with both halves' states at hand until it is known whether it stands."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import TracebackType

from coupler.control.auto import runs_away, squeezes
from coupler.errors import CouplingError
from coupler.scenario.options import Scheme
from coupler.schemes.iterate import solve_iterated
from coupler.schemes.schemes import ONCE, check_adiabatic, extrapolated, solve_along_heat, with_mode
from coupler.schemes.state import CoupledState, Course, Halves, Settings, Solved, Span
from coupler.schemes.sweep import DiscardError


class Kept:
    """The states of both halves at the start of a window, while the block lasts.

    t [s], number (from 1) : of the window, for messages.
    """

    def __init__(self, halves: Halves, t: float, number: int) -> None:
        self._both = (halves.thermal, halves.mechanical)
        self._t, self.number = t, number

    def __enter__(self) -> Kept:
        self._tokens = [half.save() if half.can_save else None for half in self._both]
        return self

    def put_back(self, why: str) -> None:
        """Both halves to the start of the window.  Raises CouplingError where one keeps no states."""
        for half, token in zip(self._both, self._tokens, strict=True):
            if token is None:
                raise CouplingError(f"{why}; half {half.name!r} keeps no states, so the window cannot be tried again",
                                    t=self._t, window=self.number,
                                    remedy="Give smaller windows (coupling.windows) around this time")
            # fault: halves not put back after a discard -> pass | coupler/test_coupling
            half.restore(token)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        for half, token in zip(self._both, self._tokens, strict=True):
            if token is not None:
                half.release(token)


@dataclass(frozen=True)
class Way:
    """How a window is solved.  scheme : never `auto`, which has chosen one.

    curve : how x and t_N are drawn on where the scheme is `extrapolated` (coupler.schemes.schemes).
    may_run_away : a window whose iterates show that what changes drives itself on is solved by `staggered` instead.
    may_freeze : one whose iterates show that heat of squeezing is all that acts back, by `adiabatic`.
    """

    scheme: Scheme
    settings: Settings
    curve: float = 0.0
    may_run_away: bool = False
    may_freeze: bool = False


def solve_once(halves: Halves, state: CoupledState, span: Span, way: Way, kept: Kept) -> Solved:
    """The window by a scheme; after a discard the halves are where the discard left them."""
    if way.scheme is Scheme.ADIABATIC:
        check_adiabatic(halves.thermal, halves.mechanical, span.substeps)
    if inputs := with_mode(way.settings.inputs, halves.mechanical, way.scheme):
        halves = replace(halves, inputs=inputs)
    try:
        if way.scheme is Scheme.ITERATED:
            solved = solve_iterated(halves, state, span, way.settings.iteration,
                                    lambda: kept.put_back("a window is to be iterated"))
            if way.may_run_away and runs_away(solved.course):
                kept.put_back("a window is to be solved once")
                followed = ONCE[Scheme.STAGGERED](halves, state, span).solved(state, Scheme.STAGGERED, solved.course)
                return replace(followed, work=solved.work.plus(followed.work))
            if way.may_freeze and squeezes(solved, way.settings.iteration.level):
                kept.put_back("a window is to be solved once")
                split = solve_once(halves, state, span, replace(way, scheme=Scheme.ADIABATIC), kept)
                return replace(split, work=solved.work.plus(split.work), course=solved.course)
            return solved
        if way.scheme is Scheme.ALONG_HEAT:
            return solve_along_heat(halves, state, span, lambda: kept.put_back("a first window is solved again"))
        swept = ONCE[way.scheme](halves, state, span) if way.curve == 0.0 else extrapolated(halves, state, span,
                                                                                            way.curve)
        return swept.solved(state, way.scheme, curve=way.curve)
    except DiscardError as discard:
        return Solved(discard.verdict, str(discard), state, (), discard.work, {}, scheme=way.scheme)


# The same window in two halves: what a window's error is, measured where nothing else tells it.
#
# A window of H has a local error c H^3 if the scheme is of second order, its two halves together a quarter of that, so
# the difference of the two answers is 3/4 of the error; of first order, half of it.  It needs no knowledge of the
# halves, the scheme or the physics, and sees all there is to see: each half's own time error, the exchange, modes too
# stiff for the window, a front that jumps from cell to cell.  It costs two windows of half the size, and their answer
# is the better one: where a run is free to, it keeps that.

Solve = Callable[[CoupledState, Span], Solved]


def doubled(halves: Halves, state: CoupledState, span: Span, way: Way, window: tuple[Kept, Solved]) -> Solved:
    """The answer of a window's two halves, with that of the window itself in `whole`.

    window : the states of both halves at its start, and its outcome; the work is that of all three.
    """
    kept, whole = window
    number = kept.number

    def solve(at: CoupledState, piece: Span) -> Solved:
        with Kept(halves, at.now.t, number) as here:
            return solve_once(halves, at, piece, way, here)

    kept.put_back("a window is to be solved in two halves too")
    found = in_two(solve, state, span)
    # fault: the work of the window in one is forgotten -> return replace(found, whole=whole, work=found.work) |
    #   coupler/test_estimate
    return replace(found, whole=whole, work=whole.work.plus(found.work))


def halved(span: Span) -> tuple[Span, Span]:
    """Its two halves.  Raises ValueError where the window is a single tick of the clock."""
    middle = (span.k0 + span.k1) // 2
    if middle == span.k0:
        raise ValueError("a window of one tick has no halves")
    return replace(span, k1=middle), replace(span, k0=middle)


def in_two(solve: Solve, state: CoupledState, span: Span) -> Solved:
    """The window solved as two, told as one: it begins at `state`, and its `past` does not know the middle.

    Where one of the two is not taken, that one's outcome; the halves are then anywhere within the window.
    """
    first_span, second_span = halved(span)
    first = solve(state, first_span)
    if not first.taken:
        return replace(first, state=state)
    second = solve(first.state, second_span)
    if not second.taken:
        return replace(second, state=state, work=first.work.plus(second.work))
    # fault: the past of a window in two halves knows its middle -> end = replace(second.state, past=second.state.past)
    #   | coupler/test_estimate
    end = replace(second.state, past=(state.now, *state.past)[:3])
    return replace(second, state=end, terms=(*first.terms, *second.terms), work=first.work.plus(second.work),
                   course=_course(first.course, second.course))


def _course(first: Course | None, second: Course | None) -> Course | None:
    """Of both: all iterates, the larger contraction."""
    if first is None or second is None:
        return second
    known = [c.contraction for c in (first, second) if not math.isnan(c.contraction)]
    factors = (*first.factors, math.nan, *second.factors)  # no step led from the one to the other
    return Course((*first.misfits, *second.misfits), factors, max(known, default=math.nan))
