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
from coupler.errors import CouplingError
from coupler.schemes.levels import Level, exchanged
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
    with SavedStates(halves, base.t, saved.number) as end:
        try:
            found = _growth(halves, before, span, saved, (base, size))
        except (DiscardError, CouplingError):
            found = math.nan
        end.roll_back("a window was only looked at")
    return found


def _growth(halves: Halves, before: CoupledState, span: Span, saved: SavedStates, at: tuple[Level, float]) -> float:
    base, size = at
    direction, found = np.ones_like(base.T), 0.0
    for _ in range(TURNS):
        outcomes: list[Array] = []
        for side in (size, -size):
            saved.roll_back("a window is looked at")
            guess = exchanged(replace(base, T=base.T + side * direction))
            outcomes.append(mechanical_first(halves, before, span, guess, at_end=True).level.T)
        out = (outcomes[0] - outcomes[1]) / (2.0 * size)
        # fault: what comes out turned round is taken for what goes on -> found = abs(float(direction @ out)) /
        #   float(direction @ direction) | coupler/test_own_growth
        found = float(direction @ out) / float(direction @ direction)
        largest = float(np.abs(out).max())
        if largest == 0.0:
            return 0.0
        direction = out / largest
    return found
