"""What error a window may make: one tolerance a quantity, for windows that find their own size."""

from __future__ import annotations

from dataclasses import dataclass, field

from coupler.schemes.iteration import Tolerance


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
