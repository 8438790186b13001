"""The same window in two halves: what a window's error is, measured where nothing else tells it.

A window of H has a local error c H^3 if the scheme is of second order, its two halves together a quarter of that, so
the difference of the two answers is 3/4 of the error; of first order, half of it.  It needs no knowledge of the halves,
the scheme or the physics, and sees all there is to see: each half's own time error, the exchange, modes too stiff for
the window, a front that jumps from cell to cell.  It costs two windows of half the size, and their answer is the better
one: where a run is free to, it keeps that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from coupler.control.attempt import Kept, Way, solve_once
from coupler.schemes.window import CoupledState, Course, Halves, Solved, Span

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
