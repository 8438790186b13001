"""The scheme `along_heat`: x and t_N are drawn on along the heat the bodies take up, not along time.

Where bodies move because they heat, cool or freeze, x is nearly a straight line over the heat stored while it bends in
time, the more so just after an event.  So the thermal half is given, substep by substep, the x that belongs to the heat
it has stored by then:

    x = x_n + w (x_n - x_b),  w = (dH . dH_b)/(dH_b . dH_b)

dH : heat stored by each body since the start of the window, carried on to the middle of the substep at the pace of the
substep before.  b : the level before, dH_b : what was stored from there to the start.  In the first window after an
event no level is before: the window is solved with x as it is, then again with b and the start in the place of each
other (x from the start to where the last pass ended), FIRST_PASSES passes in all.  With one thermal substep in a window
it is `extrapolated` with the pace of the last window.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupler.scenario.options import Scheme
from coupler.schemes.level import Level
from coupler.schemes.scheme import Swept, thermal_first
from coupler.schemes.window import CoupledState, Halves, Solved, Span

Array = NDArray[np.float64]

# Each pass after an event takes an error of the gap down five to ten times; four of them gain nothing on F2-1D.
# fault: first window after an event passed once -> FIRST_PASSES = 1 | stability/test_freezing
FIRST_PASSES = 3


@dataclass(frozen=True)
class Lead:
    """Where x and t_N go with heat.  start : of the window.  earlier, later : levels that tell how far for how much.

    pace : heat stored by each body a second (n_bodies,) [W], before the window tells its own.
    """

    start: Level
    earlier: Level
    later: Level
    pace: Array

    def seen(self, t0: float, t1: float, stored: Array, pace: Array | None) -> tuple[Array, Array]:
        """x and t_N for the substep from t0 to t1 [s].  stored : (n_bodies,) [J] since the start, at t0.

        pace : of the substep before [W]; None in the first one.
        """
        there = stored + 0.5 * (t1 - t0) * (self.pace if pace is None else pace)
        along = _heat(self.later) - _heat(self.earlier)
        size = float(along @ along)
        # fault: geometry held where it should go along with the heat -> w = 0.0 | stability/test_freezing
        w = float(there @ along) / size if size > 0.0 else 0.0
        x = self.start.x + w * (self.later.x - self.earlier.x)
        return x, np.minimum(self.start.t_N + w * (self.later.t_N - self.earlier.t_N), 0.0)


def solve_along_heat(halves: Halves, state: CoupledState, span: Span, rollback: Callable[[], None]) -> Solved:
    """Solve a window.  rollback : puts both halves back to its start.  Raises DiscardError."""
    now = state.now
    if state.before is not None and now.heat is not None:
        before = replace(state.before, heat=_heat(state.before, len(now.heat)))
        pace = (now.heat - _heat(before)) / (now.t - before.t)
        return thermal_first(halves, state, span, Lead(now, before, now, pace)).solved(state, Scheme.ALONG_HEAT)
    swept = thermal_first(halves, state, span, None)
    for _ in range(1, FIRST_PASSES):
        rollback()
        swept = _again(halves, state, span, swept)
    return swept.solved(state, Scheme.ALONG_HEAT)


def _again(halves: Halves, state: CoupledState, span: Span, last: Swept) -> Swept:
    """One more pass over a first window, x from its start to where the last pass ended."""
    if last.level.heat is None:
        return last
    pace = (_heat(last.level) - _heat(state.now, len(last.level.heat))) / (span.end - state.now.t)
    start = replace(state.now, heat=_heat(state.now, len(last.level.heat)))
    swept = thermal_first(halves, state, span, Lead(start, start, last.level, pace))
    return replace(swept, work=last.work.plus(swept.work))


def _heat(level: Level, n: int = 0) -> Array:
    return np.zeros(n) if level.heat is None else level.heat
