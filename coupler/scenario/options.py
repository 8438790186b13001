"""Options of coupling: the scheme, how it iterates, what error a window may make, and how long windows are.

Defaults stand here with their reasons; the schemes and the control read them, the scenario file sets them by the same
classes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated, Any, ClassVar

from pydantic import ConfigDict, model_validator

from contact.problem.part import Entry, Part
from contact.problem.values import Count, NotNegative, Number, Positive, Whole, problem


class Scheme(Enum):
    """Names of how a window is solved; what each is: coupler.schemes.schemes."""

    STAGGERED = "staggered"
    MECHANICAL_FIRST = "mechanical_first"
    PARALLEL = "parallel"
    EXTRAPOLATED = "extrapolated"
    ADIABATIC = "adiabatic"
    AUTO = "auto"  # no scheme: one of them window by window (coupler.control.auto)
    ALONG_HEAT = "along_heat"
    ITERATED = "iterated"


class Acceleration(Enum):
    """How the next guess is made of the residuals so far (coupler.schemes.acceleration)."""

    NONE = "none"  # the outcome is the next guess
    CONSTANT = "constant"  # a fixed share of the step towards it
    AITKEN = "aitken"  # one factor, from the last two residuals
    IQN_ILS = "iqn_ils"  # interface quasi-Newton: least squares over all residuals so far


class OnMax(Enum):
    """What follows when a window has not converged in `max_iterations`."""

    RETRY_SMALLER = "retry_smaller"  # put both halves back and halve the window
    STOP = "stop"  # end the run with an error
    ACCEPT = "accept"  # go on with the last iterate; its row keeps the verdict


class Seen(Enum):
    """Of which time of its substep the thermal half is given x and t_N."""

    MIDDLE = "middle"  # second order; far beyond 1/b what is disturbed alternates from window to window
    END = "end"  # first order, and no window is too large for it: for methods that damp (backward Euler, sdirk2)


def _all_have_defaults(schema: dict[str, Any]) -> None:
    schema.pop("required")


class Tolerance(Part):
    """atol, in the unit of its quantity, is the floor where nothing changes; rtol is a share of the change.

    The default of atol here is for who has no scene; where a file states none, a run takes that of its own scene
    (coupler.scenario.scales).

    Measured against the change in the window, the errors of all windows add up to at most rtol of the way the
    quantity went, whatever the size of the windows.
    """

    # Those of a quantity have defaults of their own (_ByQuantity), so a file may leave either out.
    model_config = ConfigDict(json_schema_extra=_all_have_defaults)

    atol: Positive
    rtol: NotNegative


class _ByQuantity(Part):
    """A Tolerance for each of some quantities; of atol and rtol a file may state the one that is not the default."""

    @model_validator(mode="before")
    @classmethod
    def _rest_is_default(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        return {key: {**cls.model_fields[key].default.plain(), **given} if isinstance(given, Mapping) else given
                for key, given in data.items()}


class Tolerances(_ByQuantity):
    """A difference passes if it is at most atol + rtol times the largest change over the window."""

    # T [K], x [m], t_N [Pa], f_s [1].
    temperature: Annotated[Tolerance, Entry(
        "of the largest change over the window, so errors of all windows add up to at most 1e-4 of the way a "
        "quantity goes; `atol` > 0 is the floor at rest",
        unit="K",
        kind="`{atol, rtol}`",
        default="of the scene, 1e-4")] = Tolerance(atol=1e-4, rtol=1e-4)
    gap: Annotated[Tolerance, Entry(
        "of every coordinate",
        unit="m",
        kind="`{atol, rtol}`",
        default="of the scene, 1e-4")] = Tolerance(atol=1e-9, rtol=1e-4)
    pressure: Annotated[Tolerance, Entry(
        "of every node of a pair",
        unit="Pa",
        kind="`{atol, rtol}`",
        default="of the scene, 1e-4")] = Tolerance(atol=100.0, rtol=1e-4)
    solid_fraction: Annotated[Tolerance, Entry(
        "0.4 J/kg of aluminium's latent heat, as little as `temperature`'s",
        kind="`{atol, rtol}`",
        default="1e-6, 1e-4")] = Tolerance(atol=1e-6, rtol=1e-4)


class Iteration(Part):
    """How `iterated` goes to agreement; other schemes do not read it."""

    LEAST: ClassVar[int] = 1  # iterates before agreement is believed

    acceleration: Annotated[Acceleration, Entry(
        "how the next iterate is computed",
        why="`iqn_ils` converges where the others do, and also with several stiff modes; with one it costs "
            "the same.")] = (
            Acceleration.IQN_ILS)
    # 1: where T does not act back on the geometry the second iterate is then the last, and a whole step is never wild,
    # because the T it goes to is what the thermal half found between its own boundary data.
    relaxation: Annotated[Number, Entry(
        "first factor of `aitken` and `iqn_ils`, and that of `constant`, which needs one below 1",
        above=0.0,
        most=1.0,
        remedy="Above 1 it would leave the bounds that both iterates keep.",
        why="If the exchange acts in one direction only, 1 makes the second iterate the last.")] = 1.0
    max_iterations: Annotated[Whole, Entry(
        "most iterates of one window",
        default="30; 100 with `thermal.method: steady`",
        why="Accelerated windows take 2 to 16; a window that takes more is cheaper as two of half the size, but for "
            "steady temperatures, which no shorter window makes easier.")] = 30
    on_max: Annotated[OnMax, Entry(
        "what the run does when a window has not converged by then: `retry_smaller` halves the window, and where that"
        " does not help either an adaptive one of which the estimated error is within its tolerance is taken and marked"
        " `max iterations`; `stop` ends the run; `accept` goes on, and the window is marked",
        why="Half the window has half the contraction factor.")] = OnMax.RETRY_SMALLER
    # 0: what a melting front did in the last window costs more iterates than it saves.
    reuse: Annotated[Count, Entry(
        "number of earlier windows whose residuals `iqn_ils` uses, none from before a breakpoint",
        kind="count, 0 for none",
        why="1 or 2 save iterates where the response hardly changes, and cost some where a melting front moves.")] = 0
    tolerance: Annotated[Tolerances, Entry("when a window agrees")] = Tolerances()
    level: Annotated[Seen, Entry(
        "time within a substep for which the thermal half receives `x` and `t_N`",
        default="`middle`; `end` with `thermal.method: steady`",
        why="`middle` is of second order; `end` is of first order, and with `backward_euler` or `sdirk2` "
            "damps windows of any size. Steady temperatures are those of the end.")] = Seen.MIDDLE

    @model_validator(mode="after")
    def _one_relaxes(self) -> Iteration:
        if self.acceleration is Acceleration.CONSTANT and self.relaxation == 1.0:
            raise problem("constant needs a relaxation below 1", "With 1 it would be the acceleration `none`.",
                          at=("relaxation",))
        return self


class MeasuredIteration(Iteration):
    """One that tells a contraction, for which two iterates are always enough."""

    LEAST: ClassVar[int] = 2


# What error a window may make: one tolerance a quantity, for adaptive windows.


class ErrorTolerances(_ByQuantity):
    """The error of one window passes if it is at most atol + rtol * scale, quantity by quantity."""

    # temperature [K], scale the range of T over all nodes and the window: a thousandth of a kelvin says nothing about
    # a casting, and of two bodies in one scene the smaller must not be judged by its own small range.  A thousandth of
    # it: the worst node is asked, and beside a front that freezes node by node it is off by the step of T between two
    # nodes however short the window, while gap and heat are a hundred times nearer.
    # gap [m] and displacement [m], scale their largest change in the window, or half the scale of the window before: so
    # the errors of all windows add up to at most twice rtol of the way gone.
    # heat [J], what crosses contact in the window, scale the same: 1 % of heat is what the best law is known to.
    # elastic_strain [1], of a body that remembers, its root mean square; scale its size, body by body: of stress that
    # relaxes half a per cent is left off in all, and a body of a hundredth of the stress of another is as right.  The
    # floor is 20 kPa of steel.
    temperature: Annotated[Tolerance, Entry(
        "of the error of one window",
        unit="K",
        kind="`{atol, rtol}`",
        # fault: an adaptive casting by a tolerance far too tight -> default="")] = Tolerance(atol=1e-4, rtol=1e-6) |
        #   scenarios/test_casting_1d
        default="[coupling.md](coupling.md)")] = Tolerance(atol=0.01, rtol=1e-3)
    gap: Annotated[Tolerance, Entry(
        "of the error of one window",
        unit="m",
        kind="`{atol, rtol}`",
        default="[coupling.md](coupling.md)")] = Tolerance(atol=1e-7, rtol=1e-2)
    heat: Annotated[Tolerance, Entry(
        "of the error of one window",
        unit="J",
        kind="`{atol, rtol}`",
        default="[coupling.md](coupling.md)")] = Tolerance(atol=1e-3, rtol=1e-2)
    displacement: Annotated[Tolerance, Entry(
        "of the error of one window",
        unit="m",
        kind="`{atol, rtol}`",
        default="[coupling.md](coupling.md)")] = Tolerance(atol=1e-7, rtol=1e-2)
    elastic_strain: Annotated[Tolerance, Entry(
        "of the error of one window, of the elastic strain of a body",
        unit="1",
        kind="`{atol, rtol}`",
        default="[coupling.md](coupling.md)")] = Tolerance(atol=1e-7, rtol=1e-3)


# Windows, and what follows a cycle.


@dataclass(frozen=True)
class WindowRange:
    """Windows up to `until` [s], growing or shrinking geometrically from `first` to `last` [s]."""

    until: float
    first: float
    last: float


@dataclass(frozen=True)
class Adaptive:
    """Adaptive windows [s].  least : shorter ones only end at a breakpoint or an event."""

    first: float
    least: float
    most: float
    tolerance: ErrorTolerances = field(default_factory=ErrorTolerances)


class OnUnstable(Enum):
    """What follows where windows were measured to make more of a disturbance that turns round, or to ring."""

    AUTO = "auto"  # put the window back and cut or iterate, whichever takes fewer solves
    CUT = "cut"  # put the window back and make windows short enough
    ITERATE = "iterate"  # put the window back and iterate it and those that follow
    WARN = "warn"  # say so
    STOP = "stop"  # end the run with an error


class OnCycle(Enum):
    """What follows when a quantity goes up and down from window to window because of the exchange."""

    NOTE = "note"  # say so
    ITERATE = "iterate"  # say so, and iterate the windows that follow
    CUT = "cut"  # put the window back and halve it
