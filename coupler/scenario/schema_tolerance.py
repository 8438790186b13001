"""The scenario file's `coupling.adaptive.tolerance`; defaults and reasons are those of coupler.scenario.options."""

from __future__ import annotations

from coupler.scenario.base import Part
from coupler.scenario.options import ErrorTolerances as ErrorOptions
from coupler.scenario.options import Tolerance
from coupler.scenario.quantity import NotNegative, Positive

DEFAULT = ErrorOptions()


class TemperatureError(Part):
    """atol [K]."""

    atol: Positive = DEFAULT.temperature.atol
    rtol: NotNegative = DEFAULT.temperature.rtol


class GapError(Part):
    """atol [m]."""

    atol: Positive = DEFAULT.gap.atol
    rtol: NotNegative = DEFAULT.gap.rtol


class HeatError(Part):
    """atol [J]."""

    atol: Positive = DEFAULT.heat.atol
    rtol: NotNegative = DEFAULT.heat.rtol


class DisplacementError(Part):
    """atol [m]."""

    atol: Positive = DEFAULT.displacement.atol
    rtol: NotNegative = DEFAULT.displacement.rtol


class ErrorTolerances(Part):
    """What error a window may make, a quantity each."""

    temperature: TemperatureError = TemperatureError()
    gap: GapError = GapError()
    heat: HeatError = HeatError()
    displacement: DisplacementError = DisplacementError()

    @property
    def method(self) -> ErrorOptions:
        """The checked values."""
        parts = (self.temperature, self.gap, self.heat, self.displacement)
        return ErrorOptions(*(Tolerance(q.atol, q.rtol) for q in parts))
