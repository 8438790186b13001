"""One window solved by a scheme, with both halves' states at hand until it is known whether it stands."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import TracebackType

from coupler.control.auto import runs_away, squeezes
from coupler.errors import CouplingError
from coupler.scenario.options import Scheme
from coupler.schemes.adiabatic import check_adiabatic, with_mode
from coupler.schemes.along_heat import solve_along_heat
from coupler.schemes.iterate import solve_iterated
from coupler.schemes.scheme import ONCE, extrapolated
from coupler.schemes.settings import Settings
from coupler.schemes.sweep import DiscardError
from coupler.schemes.window import CoupledState, Halves, Solved, Span


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

    curve : how x and t_N are drawn on where the scheme is `extrapolated` (coupler.schemes.curve).
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
