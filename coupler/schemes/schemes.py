"""The schemes that solve each half once or a few times over, and the table of all coupling schemes.

A new scheme is a `solve` and a `CouplingScheme` here (or, like `iterate.py`, a file of its own), a row of SCHEMES, and
its name in `Scheme`.  `auto` is no scheme but a choice among them, window by window: coupler.control.auto.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupler.errors import HalfError
from coupler.fmu.half import Half
from coupler.scenario.options import Scheme, Seen
from coupler.schemes.iterate import ITERATED
from coupler.schemes.levels import Level, exchanged, extrapolated_slope
from coupler.schemes.paths import Bodies, carried_along
from coupler.schemes.scheme import BOTH_ENDS, EXTRAPOLATED, HELD, CouplingScheme, Exchange, Exchanged, Sees, WindowTask
from coupler.schemes.state import Solved
from coupler.schemes.sweep import Swept, at_once, mechanical_first, thermal_first

Array = NDArray[np.float64]


# The schemes that solve each half once: in which order, and on what the one sees of the other.

def solve_staggered(w: WindowTask) -> Solved:
    """Solves a window: thermal on x and t_N of the start, then mechanics with the new T.  Raises DiscardError."""
    return thermal_first(w.halves, w.state, w.span, None).solved(w.state, Scheme.STAGGERED)


def solve_mechanical_first(w: WindowTask) -> Solved:
    """Solves a window: mechanics on the T of the start, then thermal from start to end of x and t_N.

    Raises DiscardError.
    """
    swept = mechanical_first(w.halves, w.state, w.span, exchanged(w.state.now))
    return swept.solved(w.state, Scheme.MECHANICAL_FIRST)


def solve_parallel(w: WindowTask) -> Solved:
    """Solves a window: both on what the other was at the start.  Raises DiscardError."""
    return at_once(w.halves, w.state, w.span).solved(w.state, Scheme.PARALLEL)


def solve_extrapolated(w: WindowTask) -> Solved:
    """Solves a window: thermal on x, t_N and the power of friction extrapolated, then mechanics.  Raises DiscardError.
    """
    slope = extrapolated_slope(w.state.now, w.state.past, w.span.end, w.extrapolation, w.halves.bodies)
    # fault: power of friction is held where it could be extrapolated -> trend = 0.0 | coupler/test_friction_trend
    trend = max(w.extrapolation, 0.0)
    swept = thermal_first(w.halves, w.state, w.span, slope, trend if w.state.past else None)
    return swept.solved(w.state, Scheme.EXTRAPOLATED, extrapolation=w.extrapolation)


# fault: the stagger is told to be of second order -> STAGGERED = CouplingScheme(Scheme.STAGGERED, solve_staggered,
#   {Seen.MIDDLE: Exchange(EXTRAPOLATED, BOTH_ENDS, HELD)}, | coupler/test_scheme_table
STAGGERED = CouplingScheme(Scheme.STAGGERED, solve_staggered, {Seen.MIDDLE: Exchange(HELD, BOTH_ENDS, HELD)},
                           alternating_gain=1.0, simpler=())
MECHANICAL_FIRST = CouplingScheme(Scheme.MECHANICAL_FIRST, solve_mechanical_first,
                                  {Seen.MIDDLE: Exchange(BOTH_ENDS, HELD, BOTH_ENDS)})
PARALLEL = CouplingScheme(Scheme.PARALLEL, solve_parallel, {Seen.MIDDLE: Exchange(HELD, HELD, HELD)})
EXTRAPOLATING = CouplingScheme(Scheme.EXTRAPOLATED, solve_extrapolated,
                               {Seen.MIDDLE: Exchange(EXTRAPOLATED, BOTH_ENDS, HELD, EXTRAPOLATED)},
                               alternating_gain=2.0)


# The scheme `along_heat`: x and t_N are extrapolated along the heat the bodies store, not along time.
#
# Where bodies move because they heat, cool or freeze, x is nearly a straight line over the heat stored while it bends
# in time, the more so just after an event.  So the thermal half is given, substep by substep, the x that belongs to
# the heat it has stored by then:
#
#     x = x_n + w (x_n - x_b),  w = (dH . dH_b)/(dH_b . dH_b)
#
# dH : heat stored by each body since the start of the window, carried on to the middle of the substep at the rate of
# the substep before.  b : the level before, dH_b : what was stored from there to the start.  In the first window
# after an event no level is before: the window is solved with x as it is, then again with b and the start in the
# place of each other (x from the start to where the last pass ended), FIRST_PASSES passes in all.  With one thermal
# substep in a window it is `extrapolated` with the rate of the last window.

# Each pass after an event takes an error of the gap down five to ten times; four of them gain nothing on F2-1D.
# fault: first window after an event passed once -> FIRST_PASSES = 1 | stability/test_freezing
FIRST_PASSES = 3


@dataclass(frozen=True)
class Lead:
    """Where x and t_N go with heat.  start : of the window.  earlier, later : levels that tell how far for how much.

    rate : heat stored by each body a second (n_bodies,) [W], before the window tells its own.
    bodies : (n_nodes,) of each node.
    """

    start: Level
    earlier: Level
    later: Level
    rate: Array
    bodies: Bodies | None

    def seen(self, t0: float, t1: float, stored: Array, rate: Array | None) -> tuple[Array, Array]:
        """Return x (n_nodes, 2) [m] and t_N (n_q,) [Pa] for the substep from t0 to t1 [s].

        stored : (n_bodies,) [J] since the start of the window, at t0; one 0 in the first substep.
        rate : (n_bodies,) [W] of the substep before; None in the first one.
        """
        there = stored + 0.5 * (t1 - t0) * (self.rate if rate is None else rate)
        along = _heat_stored(self.later) - _heat_stored(self.earlier)
        size = float(along @ along)
        # fault: geometry held where it should go along with the heat -> w = 0.0 | stability/test_freezing
        w = float(there @ along) / size if size > 0.0 else 0.0
        x = carried_along(self.start.x, self.earlier.x, self.later.x, w, self.bodies)
        return x, np.minimum(self.start.t_N + w * (self.later.t_N - self.earlier.t_N), 0.0)


def solve_along_heat(w: WindowTask) -> Solved:
    """Solves a window.  Raises DiscardError."""
    halves, state, span, now = w.halves, w.state, w.span, w.state.now
    if state.before is not None and now.heat is not None:
        before = replace(state.before, heat=_heat_stored(state.before, len(now.heat)))
        rate = (now.heat - _heat_stored(before)) / (now.t - before.t)
        lead = Lead(now, before, now, rate, halves.bodies)
        return thermal_first(halves, state, span, lead, trend=0.0).solved(state, Scheme.ALONG_HEAT)
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
    swept = thermal_first(w.halves, w.state, w.span, Lead(start, start, last.level, rate, w.halves.bodies))
    return replace(swept, work=last.work.plus(swept.work))


def _heat_stored(level: Level, n: int = 0) -> Array:
    return np.zeros(n) if level.heat is None else level.heat


ALONG_HEAT = CouplingScheme(Scheme.ALONG_HEAT, solve_along_heat,
                            {Seen.MIDDLE: Exchange(EXTRAPOLATED, BOTH_ENDS, HELD, EXTRAPOLATED)},
                            needs_states=True)


# The scheme `adiabatic`: mechanics at frozen entropy, then thermal from the temperatures that leaves.
#
# Mechanics go first, on the T of the start, with control.mode 1: a body that is squeezed warms within the step and is
# stiffer for it, by 1 + delta.  The heat so moved, E_S, is handed over once, as a jump of T at the start of the
# thermal half's first substep, and conduction goes on from there.  Each of the two parts is stable at every size of
# window, and so is their product; the isothermal split holds T while the body moves, and grows beyond c^2 dt/D = 2/(1
# + delta).

MODE = "control.mode"
ISOTHERMAL, FROZEN = 0.0, 1.0
Inputs = Mapping[str, Mapping[str, float]]
# E_S comes within its own window, but all of it at the start.
JUMP = Exchanged(Sees.BOTH_ENDS, 1)


def solve_adiabatic(w: WindowTask) -> Solved:
    """Solves a window.  Raises DiscardError."""
    swept = mechanical_first(w.halves, w.state, w.span, exchanged(w.state.now))
    return swept.solved(w.state, Scheme.ADIABATIC)


def lacking(thermal: Half, mechanical: Half, substeps: Mapping[str, int]) -> HalfError | None:
    """What the halves lack to be run so.

    In a second mechanical substep the T it is given would not know what the first one moved.
    """
    if MODE not in mechanical.blocks or "E_S" not in mechanical.blocks:
        return HalfError("cannot step at frozen entropy (it has no control.mode or tells no E_S), which the scheme "
                         "adiabatic needs; the half elastic can, with mechanical.elastic.adiabatic: true, or give "
                         "another coupling.scheme", half=mechanical.name)
    if "E_S" not in thermal.blocks:
        return HalfError("takes no E_S, so what the scheme adiabatic moves as heat would be lost; give another "
                         "coupling.scheme", half=thermal.name)
    if substeps["mechanical"] != 1:
        return HalfError(f"has {substeps['mechanical']} substeps a window, and the scheme adiabatic freezes the "
                         "entropy of its start once; leave coupling.substeps.mechanical at 1", half=mechanical.name)
    return None


def with_mode(inputs: Inputs, mechanical: Half, frozen: bool) -> Inputs:
    """The inputs of a window with the mode of its scheme.  A half that has no mode is told none.

    It is told at every window, for a half keeps what it was last given.
    """
    if MODE not in mechanical.blocks:
        return inputs
    given = inputs.get("mechanical", {})
    # fault: adiabatic windows at isothermal moduli -> mode = ISOTHERMAL if frozen else given.get(MODE, ISOTHERMAL) |
    #   coupler/test_adiabatic
    mode = FROZEN if frozen else given.get(MODE, ISOTHERMAL)
    return {**inputs, "mechanical": {**given, MODE: mode}}


# fault: the adiabatic split is told to be of second order -> ADIABATIC = CouplingScheme(Scheme.ADIABATIC,
#   solve_adiabatic, {Seen.MIDDLE: Exchange(BOTH_ENDS, BOTH_ENDS, BOTH_ENDS)}, | coupler/test_scheme_table
ADIABATIC = CouplingScheme(Scheme.ADIABATIC, solve_adiabatic, {Seen.MIDDLE: Exchange(BOTH_ENDS, HELD, JUMP)},
                           frozen_entropy=True, lacking=lacking,
                           simpler=(Scheme.STAGGERED, Scheme.EXTRAPOLATED))


# The table.

SCHEMES: tuple[CouplingScheme, ...] = (
    STAGGERED,
    MECHANICAL_FIRST,
    PARALLEL,
    EXTRAPOLATING,
    ALONG_HEAT,
    ITERATED,
    ADIABATIC,
)
_BY_NAME = {scheme.name: scheme for scheme in SCHEMES}


def scheme_of(name: Scheme) -> CouplingScheme:
    """Returns the scheme of a name.  Raises KeyError for `auto`, which is none."""
    return _BY_NAME[name]


def read_at(name: Scheme, level: Seen, steps: int, windows: int) -> tuple[float, ...]:
    """Returns the parts (0 to 1) of a time at which the thermal half is given x, t_N and gaps in it, each as often.

    level : `coupling.iteration.level`.  steps : of the thermal half in a window.  windows : equal ones, in that time.
    """
    sees = scheme_of(name).exchange_at(level).geometry.sees
    if sees is Sees.START:
        return tuple(k / windows for k in range(windows))
    # fault: what is read at the ends of steps counts as read in their middles -> later = 0.5 |
    #   coupler/test_trust_skipped
    later = 1.0 if sees is Sees.END else 0.5
    return tuple((k + later) / (steps * windows) for k in range(steps * windows))
