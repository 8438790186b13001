"""Options of coupling: the scheme, how it iterates, what error a window may make, and how long windows are.

Defaults stand here with their reasons; the schemes and the control read them, the scenario file sets them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


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


@dataclass(frozen=True)
class Tolerance:
    """A difference passes if it is at most atol + rtol * (largest change of the quantity over the window).

    Measured against the change in the window, the errors of all windows add up to at most rtol of the way the
    quantity went, whatever the size of the windows; atol is the floor where nothing changes.
    """

    atol: float
    rtol: float


@dataclass(frozen=True)
class Tolerances:
    """One for each quantity: T [K], x [m], t_N [Pa], f_s [1].

    Conductance h sees a gap of 1 nm as 1e-4 of a gas layer of 10 um, and 100 Pa as 1e-4 of 1 MPa: no floor is
    tighter than the others, and all are far above what the halves leave over.
    """

    temperature: Tolerance = Tolerance(1e-4, 1e-4)
    gap: Tolerance = Tolerance(1e-9, 1e-4)
    pressure: Tolerance = Tolerance(100.0, 1e-4)
    solid_fraction: Tolerance = Tolerance(1e-6, 1e-4)


@dataclass(frozen=True)
class Iteration:
    """relaxation : the factor of `constant`, and of the first step of `aitken` and `iqn_ils`, in (0, 1].

    1 as a default: where T does not act back on the geometry the second iterate is then the last, and a whole step is
    never wild, because the T it goes to is what the thermal half found between its own boundary data.
    reuse : windows whose residuals `iqn_ils` remembers.  0 as a default: what a melting front did in the last window
    costs more iterates than it saves.
    least : iterates before agreement is believed; two always tell a contraction.
    level : `middle` as a default: it keeps the order of the midpoint rule.
    """

    acceleration: Acceleration = Acceleration.IQN_ILS
    relaxation: float = 1.0
    max_iterations: int = 30
    on_max: OnMax = OnMax.RETRY_SMALLER
    reuse: int = 0
    tolerance: Tolerances = field(default_factory=Tolerances)
    level: Seen = Seen.MIDDLE
    least: int = 1


# What error a window may make: one tolerance a quantity, for adaptive windows.


@dataclass(frozen=True)
class ErrorTolerances:
    """The error of one window passes if it is at most atol + rtol * scale, quantity by quantity.

    temperature [K], scale the range of T over all nodes and the window: a thousandth of a kelvin says nothing about a
    casting, and of two bodies in one scene the smaller must not be judged by its own small range.  A thousandth of it:
    the worst node is asked, and beside a front that freezes node by node it is off by the step of T between two nodes
    however short the window, while gap and heat are a hundred times nearer.
    gap [m] and displacement [m], scale their largest change in the window: so the errors of all windows add up to at
    most rtol of the way gone.  The floor of the gap is a hundredth of a gas layer of 10 um, below which no law of
    conductance changes by more than 1 %.
    heat [J], what crosses contact in the window, scale the same: 1 % of heat is what the best law is known to.
    """

    # fault: an adaptive casting by a tolerance far too tight -> temperature: Tolerance = field(default=Tolerance(1e-4,
    #   1e-6)) | scenarios/test_casting_1d
    temperature: Tolerance = field(default=Tolerance(0.01, 1e-3))
    gap: Tolerance = field(default=Tolerance(1e-7, 1e-2))
    heat: Tolerance = field(default=Tolerance(1e-3, 1e-2))
    displacement: Tolerance = field(default=Tolerance(1e-7, 1e-2))


# Windows, and what follows a cycle.


@dataclass(frozen=True)
class WindowRange:
    """Windows up to `until` [s], growing or shrinking geometrically from `first` to `last` [s]."""

    until: float
    first: float
    last: float


@dataclass(frozen=True)
class Adaptive:
    """Windows that find their own size [s].  least : shorter ones only end at a kink or an event."""

    first: float
    least: float
    most: float
    tolerance: ErrorTolerances = field(default_factory=ErrorTolerances)


class OnCycle(Enum):
    """What follows when a quantity goes up and down from window to window because of the exchange."""

    NOTE = "note"  # say so
    ITERATE = "iterate"  # say so, and iterate the windows that follow
    CUT = "cut"  # put the window back and halve it
