"""The schemes that solve each half once: in which order, and on what the one sees of the other."""

from __future__ import annotations

from coupler.scenario.options import Scheme, Seen
from coupler.schemes.extrapolation import extrapolated_slope
from coupler.schemes.scheme import BOTH_ENDS, EXTRAPOLATED, HELD, CouplingScheme, Exchange, WindowTask
from coupler.schemes.state import Solved, exchanged
from coupler.schemes.sweep import at_once, mechanical_first, thermal_first


def solve_staggered(w: WindowTask) -> Solved:
    """Solve a window: thermal on x and t_N of the start, then mechanics with the new T.  Raises DiscardError."""
    return thermal_first(w.halves, w.state, w.span, None).solved(w.state, Scheme.STAGGERED)


def solve_mechanical_first(w: WindowTask) -> Solved:
    """Solve a window: mechanics on the T of the start, then thermal on the way x and t_N went.  Raises DiscardError."""
    swept = mechanical_first(w.halves, w.state, w.span, exchanged(w.state.now))
    return swept.solved(w.state, Scheme.MECHANICAL_FIRST)


def solve_parallel(w: WindowTask) -> Solved:
    """Solve a window: both on what the other was at the start.  Raises DiscardError."""
    return at_once(w.halves, w.state, w.span).solved(w.state, Scheme.PARALLEL)


def solve_extrapolated(w: WindowTask) -> Solved:
    """Solve a window: thermal on x and t_N extrapolated past the last levels, then mechanics.  Raises DiscardError."""
    slope = extrapolated_slope(w.state.now, w.state.past, w.span.end, w.extrapolation)
    swept = thermal_first(w.halves, w.state, w.span, slope)
    return swept.solved(w.state, Scheme.EXTRAPOLATED, extrapolation=w.extrapolation)


# fault: the stagger is told to be of second order -> STAGGERED = CouplingScheme(Scheme.STAGGERED, solve_staggered,
#   {Seen.MIDDLE: Exchange(EXTRAPOLATED, BOTH_ENDS, HELD)}, | coupler/test_scheme_table
STAGGERED = CouplingScheme(Scheme.STAGGERED, solve_staggered, {Seen.MIDDLE: Exchange(HELD, BOTH_ENDS, HELD)},
                           alternating_gain=1.0, simpler=())
MECHANICAL_FIRST = CouplingScheme(Scheme.MECHANICAL_FIRST, solve_mechanical_first,
                                  {Seen.MIDDLE: Exchange(BOTH_ENDS, HELD, BOTH_ENDS)})
PARALLEL = CouplingScheme(Scheme.PARALLEL, solve_parallel, {Seen.MIDDLE: Exchange(HELD, HELD, HELD)})
EXTRAPOLATING = CouplingScheme(Scheme.EXTRAPOLATED, solve_extrapolated,
                               {Seen.MIDDLE: Exchange(EXTRAPOLATED, BOTH_ENDS, HELD)}, alternating_gain=2.0)
