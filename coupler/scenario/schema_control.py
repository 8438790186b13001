"""The scenario file's `coupling.adaptive`, `coupling.events` and `coupling.stop`."""

from __future__ import annotations

from pydantic import StrictBool, model_validator

from coupler.scenario.base import Part
from coupler.scenario.options import Adaptive as Sizes
from coupler.scenario.quantity import NotNegative, Positive, problem
from coupler.scenario.schema_tolerance import ErrorTolerances

# Windows shorter than this share of the first are a sign that something else is wrong.
LEAST = 1e-6


class Adaptive(Part):
    """Windows that find their own size [s] from the error they make."""

    first: Positive
    least: Positive | None = None
    most: Positive | None = None
    tolerance: ErrorTolerances = ErrorTolerances()

    @model_validator(mode="after")
    def _in_order(self) -> Adaptive:
        if self.least is not None and self.least > self.first:
            raise problem("the first window is shorter than the least", at=("least",))
        if self.most is not None and self.most < self.first:
            raise problem("the first window is longer than the most", at=("most",))
        return self

    def sizes(self, end: float) -> Sizes:
        """The checked values for a run of `end` seconds."""
        first = min(self.first, end)
        least = self.least if self.least is not None else LEAST * first
        most = self.most if self.most is not None else end
        return Sizes(first, min(least, first), min(most, end), self.tolerance.method)


class Events(Part):
    """locate : end windows where contact opens, closes, sticks or slips.  tolerance [s]: how nearly.

    branches : and where a gap or a pressure passes a bend of a law.
    """

    locate: bool | None = None
    tolerance: Positive | None = None
    branches: StrictBool = False

    @model_validator(mode="after")
    def _are_located(self) -> Events:
        if self.branches and self.locate is False:
            raise problem("branches are events, and events are not located", "Leave locate out.", at=("branches",))
        return self


class Stop(Part):
    """steady [K/s]: stop once the temperature of no node changes faster for two windows."""

    steady: NotNegative | None = None
