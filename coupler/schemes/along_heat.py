"""The scheme `along_heat`: x and t_N are extrapolated along the heat the bodies store, not along time.

Where bodies move because they heat, cool or freeze, x is nearly a straight line over the heat stored while it bends
in time, the more so just after an event.  So the thermal half is given, substep by substep, the x that belongs to the
heat it has stored by then:

    x = x_n + w (x_n - x_b),  w = (dH . dH_b)/(dH_b . dH_b)

dH : heat stored by each body since the start of the window, carried on to the middle of the substep at the rate of the
substep before.  b : the level before, dH_b : what was stored from there to the start.  In the first window after an
event no level is before: the window is solved with x as it is, then again with b and the start in the place of each
other (x from the start to where the last pass ended), FIRST_PASSES passes in all.  With one thermal substep in a window
it is `extrapolated` with the rate of the last window.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupler.scenario.options import Scheme, Seen
from coupler.schemes.scheme import BOTH_ENDS, EXTRAPOLATED, HELD, CouplingScheme, Exchange, WindowTask
from coupler.schemes.state import Level, Solved
from coupler.schemes.sweep import Swept, thermal_first

Array = NDArray[np.float64]

# Each pass after an event takes an error of the gap down five to ten times; four of them gain nothing on F2-1D.
# fault: first window after an event passed once -> FIRST_PASSES = 1 | stability/test_freezing
FIRST_PASSES = 3


@dataclass(frozen=True)
class Lead:
    """Where x and t_N go with heat.  start : of the window.  earlier, later : levels that tell how far for how much.

    rate : heat stored by each body a second (n_bodies,) [W], before the window tells its own.
    """

    start: Level
    earlier: Level
    later: Level
    rate: Array

    def seen(self, t0: float, t1: float, stored: Array, rate: Array | None) -> tuple[Array, Array]:
        """Return x (n_nodes, 2) [m] and t_N (n_s,) [Pa] for the substep from t0 to t1 [s].

        stored : (n_bodies,) [J] since the start of the window, at t0; one 0 in the first substep.
        rate : (n_bodies,) [W] of the substep before; None in the first one.
        """
        there = stored + 0.5 * (t1 - t0) * (self.rate if rate is None else rate)
        along = _heat_stored(self.later) - _heat_stored(self.earlier)
        size = float(along @ along)
        # fault: geometry held where it should go along with the heat -> w = 0.0 | stability/test_freezing
        w = float(there @ along) / size if size > 0.0 else 0.0
        x = self.start.x + w * (self.later.x - self.earlier.x)
        return x, np.minimum(self.start.t_N + w * (self.later.t_N - self.earlier.t_N), 0.0)


def solve_along_heat(w: WindowTask) -> Solved:
    """Solves a window.  Raises DiscardError."""
    halves, state, span, now = w.halves, w.state, w.span, w.state.now
    if state.before is not None and now.heat is not None:
        before = replace(state.before, heat=_heat_stored(state.before, len(now.heat)))
        rate = (now.heat - _heat_stored(before)) / (now.t - before.t)
        return thermal_first(halves, state, span, Lead(now, before, now, rate)).solved(state, Scheme.ALONG_HEAT)
    swept = thermal_first(halves, state, span, None)
    for _ in range(1, FIRST_PASSES):
        w.roll_back("a first window is solved again")
        swept = _again(w, swept)
    return swept.solved(state, Scheme.ALONG_HEAT)


def _again(w: WindowTask, last: Swept) -> Swept:
    """One more pass over a first window, x from its start to where the last pass ended."""
    if last.level.heat is None:
        return last
    now = w.state.now
    rate = (_heat_stored(last.level) - _heat_stored(now, len(last.level.heat))) / (w.span.end - now.t)
    start = replace(now, heat=_heat_stored(now, len(last.level.heat)))
    swept = thermal_first(w.halves, w.state, w.span, Lead(start, start, last.level, rate))
    return replace(swept, work=last.work.plus(swept.work))


def _heat_stored(level: Level, n: int = 0) -> Array:
    return np.zeros(n) if level.heat is None else level.heat


ALONG_HEAT = CouplingScheme(Scheme.ALONG_HEAT, solve_along_heat,
                            {Seen.MIDDLE: Exchange(EXTRAPOLATED, BOTH_ENDS, HELD)}, needs_states=True)
