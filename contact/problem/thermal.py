"""What the thermal half solves and what drives it."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from contact.problem.boundary import RadiationGap, Supported
from contact.problem.curves import FieldSpec, PropertySpec
from contact.problem.material import Material
from contact.problem.pairs import ContactPair, PairData
from contact.problem.part import Entry, Part, exactly_one
from contact.problem.regions import regions_in
from contact.problem.start import FromFrames, GivenSpec, StartSpec
from contact.problem.values import Name, NotNegative, Number, Positive, Text, Whole, problem

MOST_INCREMENTS = 100_000  # a count beyond this is a slip of the pen
SIGMA_SB = 5.670374419e-8  # W/m2K4


class Method(StrEnum):
    """How the thermal half steps in time; `control.method` counts them from 1 in this order."""

    MIDPOINT = "midpoint"
    SDIRK2 = "sdirk2"
    BACKWARD_EULER = "backward_euler"
    THETA = "theta"
    STEADY = "steady"


class FilmGap(Part):
    """kappa rises from 0 at a gap of d_cut to 1 at d_full. Eq. (7)."""

    d_cut: Annotated[NotNegative, Entry("gap to the facing surface up to which kappa is 0", "m")]
    d_full: Annotated[Positive, Entry("gap from which it is 1", "m")]

    @model_validator(mode="after")
    def _in_order(self) -> FilmGap:
        if self.d_full <= self.d_cut:
            raise problem("d_full must be greater than d_cut", at=("d_full",))
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """The gaps at which it begins and ends to fade."""
        return self.d_cut, self.d_full


class Convection(Part):
    """q = kappa h |T - T_e|^exponent (T - T_e), out of the body. Eqs. (5-7)."""

    h: Annotated[FieldSpec, Entry("film coefficient, q = kappa h \\|T - T_e\\|^exponent (T - T_e), out of the body",
                                "W/m2K^(1 + exponent)", least=0.0)]
    h_factor: Annotated[PropertySpec | None, Entry(
        "multiplies h, at the temperature of the surface; a table may touch 0", above=0.0, zero_in_table=True,
        default="1")] = None
    T: Annotated[FieldSpec, Entry("T_e of the surroundings", "K", temperature=True)]
    exponent: Annotated[NotNegative, Entry("of the difference of temperature")] = 0.0
    gap: Annotated[FilmGap | None, Entry("kappa rises from 0 to 1 between these gaps to the facing surface",
                                       default="kappa = 1")] = None


class Radiation(Part):
    """q = sigma_SB emissivity (T^4 - T_inf^4), out of the body. Eq. (12)."""

    emissivity: Annotated[PropertySpec, Entry(
        "q = sigma_SB emissivity (T^4 - T_inf^4) in kelvin, out of the body", above=0.0, most=1.0)]
    T: Annotated[FieldSpec, Entry("T_inf of the surroundings", "K", temperature=True)]
    gap: Annotated[RadiationGap | None, Entry(
        "radiation grows from none to full between these gaps to the facing surface; places that face no surface "
        "radiate in full",
        default="full radiation everywhere")] = None


CONDITIONS = ("temperature", "flux", "convection", "radiation")


class ThermalBoundary(Supported):
    """One condition on a surface, or a temperature at a point or of a whole body."""

    body: Annotated[Name | None, Entry("the place, a whole body: its temperature is prescribed everywhere",
                                       kind="name")] = None
    temperature: Annotated[GivenSpec | None, Entry("prescribed; of a body also that of another run", "K",
                                                   temperature=True, kind="FIELD, or `{from: run.h5}`")] = None
    flux: Annotated[FieldSpec | None, Entry("into the body", "W/m2")] = None
    convection: Annotated[Convection | None, Entry("a film")] = None
    radiation: Annotated[Radiation | None, Entry("to far surroundings")] = None

    @model_validator(mode="after")
    def _one_condition(self) -> ThermalBoundary:
        place = exactly_one(self, ("on", "at", "body"))
        if (kind := exactly_one(self, CONDITIONS)) != "temperature" and place == "body":
            raise problem(f"{kind} acts on a surface, not in a body", "Use `on: body.surface`.", at=("body",))
        if kind != "temperature":
            self.only_on(kind)
        if isinstance(self.temperature, FromFrames) and place != "body":
            raise problem("the temperatures of another run are those of a body", "Write `body: NAME`.",
                          at=("temperature",))
        return self

    @property
    def where(self) -> str:
        """The surface, the node set or the body."""
        return self.body if self.body is not None else super().where


class InnerSteps(Part):
    """Inner steps of a substep, chosen by their error."""

    tolerance: Annotated[Positive | None, Entry("of the local error of an inner step", "K")] = None
    max_dT: Annotated[Positive | None, Entry("largest change of temperature in an inner step", "K")] = None
    least: Annotated[Positive | None, Entry("shortest inner step", "s")] = None

    @model_validator(mode="after")
    def _has_a_measure(self) -> InnerSteps:
        if self.tolerance is None and self.max_dT is None:
            raise problem("at least one of tolerance, max_dT is needed", "Both are in K.")
        return self


class ThermalSettings(Part):
    """How heat is solved for, and what acts on surfaces."""

    method: Annotated[Method, Entry("time stepping; `sdirk2` for large windows and jumps")] = Method.MIDPOINT
    theta: Annotated[Number | None, Entry("0.5 is the midpoint rule, 1 backward Euler", least=0.5, most=1.0,
                                        default="required with `theta`",
                                        remedy="Below 0.5 no large step would be stable.")] = None
    increments: Annotated[Whole | None, Entry(
        "with `steady` only: number of equal steps in which the load is applied",
                                            default="1", most=MOST_INCREMENTS)] = None
    adaptive: Annotated[InnerSteps | None, Entry(
        "inner time steps within a substep, sized by their error; needs `tolerance` or `max_dT`",
        default="none: one step a substep")] = None
    sigma_SB: Annotated[Positive, Entry("Stefan-Boltzmann constant", "W/m2K4")] = SIGMA_SB
    tolerance: Annotated[Positive, Entry("Newton residual over the sum of \\|terms\\|",
                                       why="Tight, so that the heat balance closes over a long run.")] = 1e-10
    boundary: Annotated[tuple[ThermalBoundary, ...],
                        Entry("entries below", default="none: insulated", kind="list")] = ()

    @model_validator(mode="after")
    def _of_its_method(self) -> ThermalSettings:
        for key, method in (("theta", Method.THETA), ("increments", Method.STEADY)):
            if getattr(self, key) is not None and self.method is not method:
                raise problem(f"{key} belongs to method {method.value}, but the method is {self.method.value}",
                              f"Write method: {method.value}, or leave {key} out.", at=(key,))
        if self.method is Method.THETA and self.theta is None:
            raise problem("method theta needs its theta", "Add theta: 0.5 (midpoint) to 1 (backward Euler).",
                          at=("method",))
        if self.adaptive is not None and self.method is Method.STEADY:
            raise problem("a steady solution has no steps in time to adapt", "Use increments.", at=("adaptive",))
        return self


class RegionHeat(Part):
    """What the thermal half knows of a region of a body, in full."""

    material: Annotated[Name, Entry("what it is made of", kind="name")]
    T0: Annotated[StartSpec, Entry("at time 0", "K", temperature=True)]
    Q_T: Annotated[FieldSpec, Entry("heat source per current volume", "W/m3")] = 0.0
    Q_T_factor: Annotated[PropertySpec | None, Entry("multiplies `Q_T`, at the local temperature")] = None


class BodyHeat(Part):
    """What the thermal half knows of a body beside its mesh."""

    material: Annotated[Name, Entry("what it is made of", kind="name")]
    T0: Annotated[StartSpec, Entry("at time 0", "K", temperature=True)]
    Q_T: Annotated[FieldSpec, Entry("heat source per current volume", "W/m3")] = 0.0
    Q_T_factor: Annotated[PropertySpec | None, Entry("multiplies `Q_T`, at the local temperature",
                                                   default="none: 1")] = None
    regions: Annotated[dict[Name, RegionHeat] | None, Entry("cells with a material, a start or a source of their own",
                                                            default="none")] = None

    @model_validator(mode="after")
    def _factor_has_a_source(self) -> BodyHeat:
        if self.Q_T_factor is not None and "Q_T" not in self.model_fields_set:
            raise problem("a factor without its source: Q_T is missing", at=("Q_T_factor",))
        return self


class ThermalProblem(ThermalSettings):
    """The model.json of a thermal half: SI, kelvin, signals written out."""

    half: Annotated[Text, Entry("kind of the half")]
    format: Annotated[Literal[2, 3], Entry("version of this form")]
    materials: Annotated[dict[Name, Material], Entry("by name")]
    bodies: Annotated[dict[Name, BodyHeat], Entry("by name")]
    pairs: Annotated[dict[Name, PairData], Entry("by name; what both halves must agree on is in interface.h5")] = Field(
        default_factory=dict)
    elsewhere: Annotated[tuple[Name, ...] | None, Entry(
        "bodies that another half of the role solves for: their temperature is the input `course.T_elsewhere`",
        default="none")] = None

    @model_validator(mode="after")
    def _elsewhere(self) -> ThermalProblem:
        for i, name in enumerate(self.elsewhere or ()):
            if name not in self.bodies:
                raise problem(f"there is no body {name!r}", at=("elsewhere", i))
        if self.elsewhere and self.adaptive is not None:
            raise problem("inner steps of its own do not fit to those of the half that solves for the others",
                          "Leave adaptive out.", at=("adaptive",))
        return self

    @property
    def parts(self) -> dict[str, BodyHeat | RegionHeat]:
        """What has a material, a start and a source: the bodies, then their regions as "body.region"."""
        return {**self.bodies, **regions_in(self.bodies)}


class ForeignThermal(ThermalProblem):
    """The model.json of a thermal half of another package: all that the scene states."""

    pairs: Annotated[dict[Name, ContactPair], Entry("by name, in full")] = Field(  # type: ignore[assignment]
        default_factory=dict)
    options: Annotated[dict[str, Any], Entry("as the scenario has them")] = Field(default_factory=dict)
