"""What a coupling scheme is: one frozen object that says all there is to know of it.  coupler.schemes.schemes has them.

A scheme says what each half is given of the other in a window, and with it of which order the error of that is:

    geometry     x and t_N, which the thermal half is given
    temperature  T and f_s, which the mechanical half is given
    heat         E_M, E_S and contact.E_friction, which the mechanical half makes and the thermal half is given
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from coupler.errors import HalfError
from coupler.fmu.half import Half
from coupler.scenario.options import Iteration, Scheme, Seen
from coupler.schemes.state import CoupledState, Halves, Solved, Span


class Sees(Enum):
    """Of which levels a half is given a quantity in a window; of heat, when it was made."""

    START = "of the start"  # held through the window; heat of the window before
    PAST = "extrapolated from the windows before"
    BOTH_ENDS = "from start to end"  # on the line, whether the end is known or iterated; heat of the window itself
    END = "of the end"  # held through each substep


@dataclass(frozen=True)
class Exchanged:
    """How one quantity crosses.  order : the error that this makes over a run goes with H^order."""

    sees: Sees
    order: int


HELD = Exchanged(Sees.START, 1)
EXTRAPOLATED = Exchanged(Sees.PAST, 2)
BOTH_ENDS = Exchanged(Sees.BOTH_ENDS, 2)


@dataclass(frozen=True)
class OfLevels:
    """Of which temperatures something was made, as shares of them.

    past : of T at the start of the window, at the start of the one before, ...  end : of T at its end.
    """

    past: tuple[float, ...]
    end: float = 0.0


@dataclass(frozen=True)
class Exchange:
    """How each quantity crosses (see above)."""

    geometry: Exchanged
    temperature: Exchanged
    heat: Exchanged
    friction: Exchanged | None = None  # that of friction, where it crosses in another way than other heat

    def order(self, heat: bool, friction: bool = False) -> int:
        """The order of a run: the least of what crosses.  heat, friction : whether the mechanical half makes any.

        heat : other than by friction.
        """
        if friction and not heat and self.friction is not None:
            return min(self.geometry.order, self.temperature.order, self.friction.order)
        heat = heat or friction
        orders = (self.geometry.order, self.temperature.order, self.heat.order)
        # fault: heat that is delivered a window late keeps the order of the geometry -> return min(orders[:2]) |
        #   coupler/test_scheme_table
        return min(orders if heat else orders[:2])

    def geometry_of(self, extrapolated: tuple[float, ...]) -> OfLevels:
        """Return the temperatures that x and t_N of the middle of a window belong to.

        extrapolated : shares of the levels behind, the newest first, where the geometry is extrapolated past them.
        """
        late = (0.0,) if self.temperature.sees is Sees.START else ()
        match self.geometry.sees:
            case Sees.START:
                return OfLevels((*late, 1.0))
            case Sees.PAST:
                # fault: an alternation is seen once whatever the scheme extrapolates -> return OfLevels((*late, 1.0)) |
                #   coupler/test_gain
                return OfLevels((*late, *extrapolated))
            case Sees.BOTH_ENDS:
                return OfLevels((0.5, 0.5)) if late else OfLevels((0.5,), 0.5)
            case Sees.END:
                return OfLevels((1.0,)) if late else OfLevels((0.0,), 1.0)

    @property
    def heat_of(self) -> OfLevels:
        """The temperatures between which the heat was made that is delivered in a window."""
        late = (self.temperature.sees is Sees.START) + (self.heat.sees is Sees.START)
        # fault: heat that comes a window late is taken to come at once -> late = 0 | coupler/test_instability
        return OfLevels((-1.0,), 1.0) if late == 0 else OfLevels((*[0.0] * (late - 1), 1.0, -1.0))


@dataclass(frozen=True)
class WindowTask:
    """A window to solve.  halves, state : as they are at its start.

    iteration : of schemes that iterate.  extrapolation : of schemes that extrapolate (coupler.schemes.levels).
    roll_back : puts both halves back to the start of the window; it is told why.
    """

    halves: Halves
    state: CoupledState
    span: Span
    iteration: Iteration
    roll_back: Callable[[str], None]
    extrapolation: float = 0.0


Lacking = Callable[[Half, Half, Mapping[str, int]], HalfError | None]


def nothing_lacks(thermal: Half, mechanical: Half, substeps: Mapping[str, int]) -> HalfError | None:
    """Returns None: any two halves will do."""
    return None


@dataclass(frozen=True)
class CouplingScheme:
    """A scheme.

    name : as in the scenario file.
    solve : the window by it.  Raises DiscardError where a half gives up.
    exchange : `coupling.iteration.level` -> how each quantity crosses; one entry where the scheme does not read it.
    needs_states : it solves a window more than once, so both halves must keep states.
    ends_behind_event : a window that contact ends is to end just behind the event, else just before
        (coupler.control.events).
    frozen_entropy : mechanics step at frozen entropy (`control.mode` 1).
    lacking : thermal half, mechanical half, substeps -> what they lack for this scheme; None: nothing.
    alternating_gain : how often the thermal half sees what alternates from window to window, where that gives the
        longest stable window (coupler.control.window_size); None: not known.
    simpler : schemes that an advice tries in its place.
    """

    name: Scheme
    solve: Callable[[WindowTask], Solved]
    exchange: Mapping[Seen, Exchange]
    needs_states: bool = False
    ends_behind_event: bool = True
    frozen_entropy: bool = False
    lacking: Lacking = nothing_lacks
    alternating_gain: float | None = None
    simpler: tuple[Scheme, ...] = (Scheme.STAGGERED,)

    def exchange_at(self, level: Seen) -> Exchange:
        """How each quantity crosses.  level : `coupling.iteration.level`; a scheme that does not read it has one."""
        # fault: level end has the order of level middle -> return self.exchange[Seen.MIDDLE] |
        #   coupler/test_scheme_table
        return self.exchange.get(level, self.exchange[Seen.MIDDLE])

    @property
    def sees_start_T(self) -> bool:
        """Whether mechanics are given the T of the start, so that x and t_N at the end are those of a window before."""
        return self.exchange[Seen.MIDDLE].temperature.sees is Sees.START
