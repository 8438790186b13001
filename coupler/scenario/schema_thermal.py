"""The part of the schema that says what the thermal half solves and what drives it."""

from __future__ import annotations

from enum import StrEnum
from typing import Any

from pydantic import Field, model_validator

from coupler.scenario.base import Part, PropertySpec, exactly_one
from coupler.scenario.property_checks import positive
from coupler.scenario.quantity import NotNegative, Number, Positive, Text, Whole, problem
from coupler.scenario.schema_field import FieldSpec
from coupler.scenario.schema_halves import Supported

MOST_INCREMENTS = 100_000  # a count beyond this is a slip of the pen
SIGMA_SB = 5.670374419e-8  # W/m2K4


class Method(StrEnum):
    """How the thermal half steps in time."""

    MIDPOINT = "midpoint"
    THETA = "theta"
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

    h: FieldSpec
    h_factor: PropertySpec | None = None
    T: FieldSpec
    exponent: NotNegative = 0.0
    gap: FilmGap | None = None

    @model_validator(mode="after")
    def _factor_positive(self) -> Convection:
        if self.h_factor is not None:
            positive(self.h_factor, ("h_factor",), zero_in_table=True)
        return self


class RadiationGap(Part):
    """Near radiation up to a gap of d_near, far radiation from d_far on [m], a blend between. After Eq. (12)."""

    d_near: NotNegative
    d_far: Positive

    @model_validator(mode="after")
    def _in_order(self) -> RadiationGap:
        if self.d_far <= self.d_near:
            raise problem("d_far must be greater than d_near", at=("d_far",))
        return self


class Radiation(Part):
    """Far radiation to surroundings at T; emissivity in (0, 1]; gap: fades near others. Eq. (12)."""

    emissivity: PropertySpec
    T: FieldSpec
    gap: RadiationGap | None = None

    @model_validator(mode="after")
    def _emissive(self) -> Radiation:
        positive(self.emissivity, ("emissivity",), most=1.0)
        return self


class NearRadiation(Part):
    """Radiation between the sides of a pair, close to parallel planes; gap: fades far apart. Eq. (11)."""

    emissivity_slave: PropertySpec
    emissivity_master: PropertySpec
    gap: RadiationGap | None = None

    @model_validator(mode="after")
    def _emissive(self) -> NearRadiation:
        for key in ("emissivity_slave", "emissivity_master"):
            positive(getattr(self, key), (key,), most=1.0)
        return self


CONDITIONS = ("temperature", "flux", "convection", "radiation")


class ThermalBoundary(Supported):
    """One of temperature (scenario's unit), flux [W/m2 into the body], convection, radiation."""

    temperature: FieldSpec | None = None
    flux: FieldSpec | None = None
    convection: Convection | None = None
    radiation: Radiation | None = None

    @model_validator(mode="after")
    def _one_condition(self) -> ThermalBoundary:
        exactly_one(self, ("on", "at"))
        if (kind := exactly_one(self, CONDITIONS)) != "temperature":
            self.only_on(kind)
        return self


class Adaptive(Part):
    """Inner steps of a substep: local error below tolerance [K], change below max_dT [K], none below least [s]."""

    tolerance: Positive | None = None
    max_dT: Positive | None = None
    least: Positive | None = None

    @model_validator(mode="after")
    def _has_a_measure(self) -> Adaptive:
        if self.tolerance is None and self.max_dT is None:
            raise problem("at least one of tolerance, max_dT is needed", "Both are in K.")
        return self


class Thermal(Part):
    """half: kind; options: for a half of another package, passed on unchanged in its model.json."""

    half: Text = "thermal"
    method: Method = Method.MIDPOINT
    theta: Number | None = None
    increments: Whole | None = None
    adaptive: Adaptive | None = None
    tolerance: Positive = 1e-10
    sigma_SB: Positive = SIGMA_SB
    boundary: tuple[ThermalBoundary, ...] = ()
    options: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _of_its_method(self) -> Thermal:
        for key, method in (("theta", Method.THETA), ("increments", Method.STEADY)):
            if getattr(self, key) is not None and self.method is not method:
                raise problem(f"{key} belongs to method {method.value}, but the method is {self.method.value}",
                              f"Write method: {method.value}, or leave {key} out.", at=(key,))
        if self.method is Method.THETA and self.theta is None:
            raise problem("method theta needs its theta", "Add theta: 0.5 (midpoint) to 1 (backward Euler).",
                          at=("method",))
        if self.theta is not None and not 0.5 <= self.theta <= 1.0:
            raise problem("theta lies between 0.5 and 1", "Below 0.5 no large step would be stable.", at=("theta",))
        if self.increments is not None and self.increments > MOST_INCREMENTS:
            raise problem(f"more than {MOST_INCREMENTS} increments", at=("increments",))
        if self.adaptive is not None and self.method is Method.STEADY:
            raise problem("a steady solution has no steps in time to adapt", "Use increments.", at=("adaptive",))
        return self
