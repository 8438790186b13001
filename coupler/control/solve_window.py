"""One window solved by a scheme, with both halves' states at hand until it is known whether it stands."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import TracebackType

from coupler.errors import CouplingError, HalfError
from coupler.scenario.options import Scheme
from coupler.schemes.scheme import WindowTask
from coupler.schemes.schemes import scheme_of, with_mode
from coupler.schemes.state import CoupledState, Halves, IterationHistory, Settings, Solved, Span
from coupler.schemes.sweep import DiscardError


class SavedStates:
    """The states of both halves at the start of a window, while the block lasts.

    t [s], number (from 1) : of the window, for messages.  roles : whose states, where it is not both.
    """

    def __init__(self, halves: Halves, t: float, number: int, roles: Sequence[str] = ("thermal", "mechanical")) -> None:
        self._roles = tuple(roles)
        self._both = tuple(halves.thermal if role == "thermal" else halves.mechanical for role in roles)
        self._t, self.number = t, number

    def __enter__(self) -> SavedStates:
        self._tokens = [half.save() if half.can_save else None for half in self._both]
        return self

    def roll_back(self, why: str, only: str = "") -> None:
        """Both halves, or the one of a role, to the start of the window.

        Raises CouplingError where one keeps no states.
        """
        for role, half, token in zip(self._roles, self._both, self._tokens, strict=True):
            if only not in ("", role):
                continue
            if token is None:
                raise CouplingError(f"{why}; half {half.name!r} keeps no states, so the window cannot be tried again",
                                    t=self._t, window=self.number,
                                    remedy="Give smaller windows (coupling.windows) around this time")
            # fault: halves not put back after a discard -> pass | coupler/test_coupling
            half.restore(token)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        kept = [(half, token) for half, token in zip(self._both, self._tokens, strict=True) if token is not None]
        if isinstance(error, HalfError):
            # After `error` FMI allows an older state to be set again; after `fatal` nothing, and no half that died
            # does as it is told.  Whatever they answer now, the cause is the error there is.
            # fault: after a failure halves stay where it left them -> error.went_back = bool(kept) |
            #   coupler/test_last_window
            error.went_back = len(kept) == len(self._both) and all([_done(half.restore, token) for half, token in kept])
            for half, token in kept:
                # fault: what a half says that is dead takes the place of why it died -> half.release(token) |
                #   coupler/test_last_window
                _done(half.release, token)
            return
        for half, token in kept:
            half.release(token)


def _done(call: Callable[[int], None], token: int) -> bool:
    """Whether a half that may be broken did as it was told."""
    try:
        call(token)
    except HalfError:
        return False
    return True


def keep(solved: Solved) -> Scheme | None:
    """Returns None: the window stays as it was solved."""
    return None


@dataclass(frozen=True)
class SolveOptions:
    """How a window is solved.  scheme : never `auto`, which has chosen one.

    extrapolation : of x and t_N, where the scheme extrapolates them (coupler.schemes.levels).
    instead : from the window as solved, the scheme by which it is to be solved once more; None: it stays.
    """

    scheme: Scheme
    settings: Settings
    extrapolation: float = 0.0
    instead: Callable[[Solved], Scheme | None] = keep


def solve_once(halves: Halves, state: CoupledState, span: Span, options: SolveOptions, saved: SavedStates) -> Solved:
    """Solves the window by a scheme; after a discard the halves are where that left them.  Raises HalfError."""
    scheme = scheme_of(options.scheme)
    if (lack := scheme.lacking(halves.thermal, halves.mechanical, span.substeps)) is not None:
        raise lack
    given = given_to(halves, options)
    try:
        solved = scheme.solve(WindowTask(given, state, span, options.settings.iteration, saved.roll_back,
                                         options.extrapolation))
    except DiscardError as discard:
        return Solved(discard.verdict, str(discard), state, (), discard.work, {}, scheme=options.scheme,
                      final=discard.final, share=discard.share)
    other = options.instead(solved)
    if other is None:
        return solved
    saved.roll_back("a window is to be solved once")
    again = solve_once(halves, state, span, replace(options, scheme=other, instead=keep), saved)
    return replace(again, work=solved.work.plus(again.work), history=solved.history)


def given_to(halves: Halves, options: SolveOptions) -> Halves:
    """Return the halves with what a window gives them besides what is exchanged."""
    inputs = with_mode(options.settings.inputs, halves.mechanical, scheme_of(options.scheme).frozen_entropy)
    return replace(halves, inputs=inputs) if inputs else halves


# The same window in two halves: what a window's error is, measured where nothing else tells it.
#
# A window of H has a local error c H^3 if the scheme is of second order, its two halves together a quarter of that, so
# the difference of the two answers is 3/4 of the error; of first order, half of it.  It needs no knowledge of the
# halves, the scheme or the physics, and sees all there is to see: each half's own time error, the exchange, modes too
# stiff for the window, a front that jumps from cell to cell.  It costs two windows of half the size, and their answer
# is the better one: where a run is free to, it keeps that.

Solve = Callable[[CoupledState, Span], Solved]


def doubled(halves: Halves, state: CoupledState, span: Span, options: SolveOptions, saved: SavedStates,
            whole: Solved) -> Solved:
    """The answer of a window's two halves, with that of the window in one in `whole`; the work is that of all three.

    saved : the states of both halves at the start of the window.  whole : its outcome in one.
    """
    number = saved.number

    def solve(at: CoupledState, piece: Span) -> Solved:
        with SavedStates(halves, at.now.t, number) as here:
            return solve_once(halves, at, piece, options, here)

    saved.roll_back("a window is to be solved in two halves too")
    found = in_two(solve, state, span)
    # fault: the work of the window in one is forgotten -> return replace(found, whole=whole, work=found.work) |
    #   coupler/test_estimate
    return replace(found, whole=whole, work=whole.work.plus(found.work))


def can_halve(span: Span) -> bool:
    """Whether it is longer than a single tick of the clock, which the search for an event may leave."""
    return span.k1 - span.k0 >= 2


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
                   history=_course(first.history, second.history))


def _course(first: IterationHistory | None, second: IterationHistory | None) -> IterationHistory | None:
    """Of both: all iterates, the larger contraction."""
    if first is None or second is None:
        return second
    known = [c.contraction for c in (first, second) if not math.isnan(c.contraction)]
    factors = (*first.factors, math.nan, *second.factors)  # no step led from the one to the other
    return IterationHistory((*first.misfits, *second.misfits), factors, max(known, default=math.nan))
