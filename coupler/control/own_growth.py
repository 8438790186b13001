"""Whether bodies would leave a steady state by themselves: what becomes of a small disturbance of it.

Heat changes gaps and pressures, and these change the heat: a gap that closes by the heat that crosses it may have three
steady states, of which time finds two.  Iterations find any of them, for acceleration holds them where plain ones would
run away.  A disturbance dT of a steady state is given to mechanics, and the steady temperatures of the shape that they
make of it come out as another, g times as large.  Bodies follow dT' = (g - 1) dT at the rate of their conduction, so
they stay where g < 1.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from coupler.control.solve_window import SavedStates
from coupler.control.window_size import answer
from coupler.errors import CouplingError
from coupler.schemes.levels import exchanged
from coupler.schemes.state import CoupledState, Halves, Solved, Span
from coupler.schemes.sweep import DiscardError, mechanical_first

Array = NDArray[np.float64]

# Of the span of temperatures: small beside what bends a law, large beside what solvers leave.
DISTURBANCE = 1e-3
TURNS = 4  # towards what it comes out as; what is left of other modes shrinks by their ratio each time
SOLVES = 4 * TURNS


def growth(halves: Halves, before: CoupledState, span: Span, saved: SavedStates, solved: Solved) -> float:
    """Return g of a window's end; nan where it cannot be known.  The halves are as before, afterwards.

    before, saved : at its start.  solved : its outcome, at which the halves are.
    """
    base = solved.state.now
    size = DISTURBANCE * float(np.ptp(base.T))
    if size == 0.0:
        return math.nan
    def outcome(T: Array) -> Array:
        saved.roll_back("a window is looked at")
        return mechanical_first(halves, before, span, exchanged(replace(base, T=T)), at_end=True).level.T

    with SavedStates(halves, base.t, saved.number) as end:
        try:
            found = answer(outcome, base.T, size, TURNS)
        except (DiscardError, CouplingError):
            found = math.nan
        end.roll_back("a window was only looked at")
    return found
