"""The part of the schema that says what the thermal half solves, and what conditions of both stand on."""

from __future__ import annotations

from enum import StrEnum
from typing import Any

from pydantic import Field, model_validator

from coupler.scenario.base import Part, SignalSpec, exactly_one
from coupler.scenario.quantity import Name, NotNegative, Positive, Text, problem


class Method(StrEnum):
    """How the thermal half steps in time."""

    MIDPOINT = "midpoint"
    SDIRK2 = "sdirk2"
    BACKWARD_EULER = "backward_euler"
    STEADY = "steady"


class FilmGap(Part):
    """kappa rises from 0 at a gap of d_cut to 1 at d_full [m]. Eq. (7)."""

    d_cut: NotNegative
    d_full: Positive

    @model_validator(mode="after")
    def _in_order(self) -> FilmGap:
        if self.d_full <= self.d_cut:
            raise problem("d_full must be greater than d_cut", at=("d_full",))
        return self


class Convection(Part):
    """h [W/m2K^(1+exponent)], T of the surroundings, exponent alpha; gap: fades near others. Eqs. (5-7)."""

    h: SignalSpec
    T: SignalSpec
    exponent: NotNegative = 0.0
    gap: FilmGap | None = None


class Supported(Part):
    """What a boundary condition stands on: a surface (on) or named points (at)."""

    on: Text | None = None
    at: Text | None = None
    name: Name | None = None

    @property
    def where(self) -> str:
        """The surface or node set."""
        return self.on if self.on is not None else str(self.at)

    def only_on(self, kind: str) -> None:
        """A flux through a point is not a number."""
        if self.on is None:
            raise problem(f"{kind} acts on a surface, not at points", "Use `on: body.surface`.", at=("at",))


class ThermalBoundary(Supported):
    """One of temperature (scenario's unit), flux [W/m2 into the body], convection."""

    temperature: SignalSpec | None = None
    flux: SignalSpec | None = None
    convection: Convection | None = None

    @model_validator(mode="after")
    def _one_condition(self) -> ThermalBoundary:
        exactly_one(self, ("on", "at"))
        if (kind := exactly_one(self, ("temperature", "flux", "convection"))) != "temperature":
            self.only_on(kind)
        return self


class Thermal(Part):
    """half: kind; options: for a half of another package, passed on unchanged in its model.json."""

    half: Text = "thermal"
    method: Method = Method.MIDPOINT
    tolerance: Positive = 1e-10
    boundary: tuple[ThermalBoundary, ...] = ()
    options: dict[str, Any] = Field(default_factory=dict)
