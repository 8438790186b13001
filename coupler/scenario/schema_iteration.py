"""The scenario file's `coupling.iteration`; defaults and their reasons are those of coupler.scenario.options."""

from __future__ import annotations

from pydantic import model_validator

from coupler.scenario.base import Part
from coupler.scenario.options import Acceleration, OnMax, Seen, Tolerance, Tolerances
from coupler.scenario.options import Iteration as IterationOptions
from coupler.scenario.quantity import NotNegative, Positive, Whole, problem

METHOD = IterationOptions()
DEFAULT = METHOD.tolerance


class TemperatureTolerance(Part):
    """atol [K]."""

    atol: Positive = DEFAULT.temperature.atol
    rtol: NotNegative = DEFAULT.temperature.rtol


class GapTolerance(Part):
    """atol [m]."""

    atol: Positive = DEFAULT.gap.atol
    rtol: NotNegative = DEFAULT.gap.rtol


class PressureTolerance(Part):
    """atol [Pa]."""

    atol: Positive = DEFAULT.pressure.atol
    rtol: NotNegative = DEFAULT.pressure.rtol


class SolidFractionTolerance(Part):
    """atol [1]."""

    atol: Positive = DEFAULT.solid_fraction.atol
    rtol: NotNegative = DEFAULT.solid_fraction.rtol


class IterationTolerances(Part):
    """A difference passes if it is at most atol + rtol times the largest change over the window."""

    temperature: TemperatureTolerance = TemperatureTolerance()
    gap: GapTolerance = GapTolerance()
    pressure: PressureTolerance = PressureTolerance()
    solid_fraction: SolidFractionTolerance = SolidFractionTolerance()


class Iteration(Part):
    """How `iterated` goes to agreement; other schemes do not read it."""

    acceleration: Acceleration = METHOD.acceleration
    relaxation: Positive = METHOD.relaxation
    max_iterations: Whole = METHOD.max_iterations
    on_max: OnMax = METHOD.on_max
    reuse: NotNegative = float(METHOD.reuse)
    tolerance: IterationTolerances = IterationTolerances()
    level: Seen = METHOD.level

    @model_validator(mode="after")
    def _in_bounds(self) -> Iteration:
        if self.relaxation > 1.0:
            raise problem("a relaxation above 1 leaves the bounds that both iterates keep",
                          "It is a share, above 0 and at most 1.", at=("relaxation",))
        if self.acceleration is Acceleration.CONSTANT and self.relaxation == 1.0:
            raise problem("constant needs a relaxation below 1", "With 1 it would be the acceleration `none`.",
                          at=("relaxation",))
        if self.reuse != int(self.reuse):
            raise problem("windows are counted in whole numbers", at=("reuse",))
        return self

    @property
    def method(self) -> IterationOptions:
        """The checked values."""
        t = self.tolerance
        tolerances = Tolerances(
            *(Tolerance(q.atol, q.rtol) for q in (t.temperature, t.gap, t.pressure, t.solid_fraction)))
        return IterationOptions(self.acceleration, self.relaxation, self.max_iterations, self.on_max, int(self.reuse),
                                tolerances, self.level)
