"""The part of the schema that says what bodies are made of."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from pydantic import Discriminator, StrictBool, Tag, model_validator

from coupler.scenario.base import Part, Polynomial, PropertySpec, PropertyTable
from coupler.scenario.property_checks import At, numbers_in, positive
from coupler.scenario.quantity import Number, Positive, problem
from coupler.scenario.schema_flow import Creep, Liquid, Plastic


class Phases(Part):
    """A property of its own for each phase, blended by the solid fraction."""

    solid: PropertySpec
    liquid: PropertySpec


def _phased_form(value: Any) -> str:
    if isinstance(value, Phases) or (isinstance(value, Mapping) and {"solid", "liquid"} & value.keys()):
        return "<phases>"
    if isinstance(value, Polynomial) or (isinstance(value, Mapping) and "polynomial" in value):
        return "<polynomial>"
    return "<table>" if isinstance(value, Mapping | PropertyTable) else "<number>"


PhasedSpec = Annotated[
    Annotated[Number, Tag("<number>")] | Annotated[PropertyTable, Tag("<table>")]
    | Annotated[Polynomial, Tag("<polynomial>")] | Annotated[Phases, Tag("<phases>")],
    Discriminator(_phased_form),
]


class Axes(Part):
    """k_1, k_2 along two material axes; angle [degrees] of axis 1 to x in the reference; turns with the body."""

    k_1: PhasedSpec
    k_2: PhasedSpec
    angle: Number = 0.0
    turns: StrictBool = True


AXES_KEYS = frozenset(("k_1", "k_2", "angle", "turns", "k1", "k2"))  # the last two to be told the right ones


def _conductivity_form(value: Any) -> str:
    if isinstance(value, Axes) or (isinstance(value, Mapping) and AXES_KEYS & value.keys()):
        return "<axes>"
    return _phased_form(value)


ConductivitySpec = Annotated[
    Annotated[Number, Tag("<number>")] | Annotated[PropertyTable, Tag("<table>")]
    | Annotated[Polynomial, Tag("<polynomial>")] | Annotated[Phases, Tag("<phases>")]
    | Annotated[Axes, Tag("<axes>")],
    Discriminator(_conductivity_form),
]


class Latent(Part):
    """L [J/kg], taken up from T_s (solidus) to T_l (liquidus), or all at T_m."""

    L: Positive
    T_m: Number | None = None
    T_s: Number | None = None
    T_l: Number | None = None

    @model_validator(mode="after")
    def _one_form(self) -> Latent:
        if (self.T_m is None) == (self.T_s is None) or (self.T_s is None) != (self.T_l is None):
            raise problem("latent heat has either `T_m`, or both `T_s` and `T_l`")
        if self.T_s is not None and self.T_l is not None and self.T_l < self.T_s:
            raise problem("T_l (liquidus) must not be below T_s (solidus)", at=("T_l",))
        return self

    @property
    def limits(self) -> tuple[float, float]:
        """Solidus and liquidus, in the scenario's unit of temperature."""
        if self.T_m is not None:
            return self.T_m, self.T_m
        assert self.T_s is not None
        assert self.T_l is not None
        return self.T_s, self.T_l


class Material(Part):
    """Each half needs its own share: thermal rho, k, c, latent; elastic E, nu, alpha, T_ref, and how it flows."""

    rho: Positive | None = None
    k: ConductivitySpec | None = None
    c: PhasedSpec | None = None
    latent: Latent | None = None
    E: PropertySpec | None = None
    nu: PropertySpec | None = None
    alpha: PropertySpec | None = None
    T_ref: Number | None = None
    plastic: Plastic | None = None
    creep: Creep | None = None
    liquid: Liquid | None = None

    @model_validator(mode="after")
    def _physical(self) -> Material:
        for key in ("k", "c", "E"):
            for at, spec in properties_in(getattr(self, key), (key,)):
                positive(spec, at)
                if at[-1] in ("solid", "liquid") and self.latent is None:
                    raise problem("solid and liquid need to know when it melts",
                                  "Add latent: {L: ..., T_m: ...} to the material.", at=at[:-1])
        for at, nu in numbers_in(self.nu, ("nu",)):
            if not -1.0 < nu < 0.5:
                raise problem("Poisson's ratio lies between -1 and 0.5, both excluded",
                              "For a nearly incompressible material write 0.4999.", at=at)
        if self.creep is not None and self.plastic is not None and self.plastic.kinematic is not None:
            raise problem("creep does not go with a kinematic backstress, which would have to creep too",
                          "Give plastic.overstress instead of creep, or leave plastic.kinematic out.", at=("creep",))
        if self.liquid is not None and self.latent is not None:
            melts = (self.liquid.T_s, self.liquid.T_l)
            if melts != self.latent.limits:
                raise problem(f"it melts from {melts[0]:g} to {melts[1]:g} here, but latent heat is taken up from "
                              f"{self.latent.limits[0]:g} to {self.latent.limits[1]:g}",
                              "One material melts once: state the same temperatures.", at=("liquid",))
        return self


def properties_in(spec: Any, at: At) -> Iterator[tuple[At, float | PropertyTable | Polynomial]]:
    """Every property that makes up a material's datum, and its place; none for None."""
    if isinstance(spec, Phases | Axes):
        for name in ("solid", "liquid", "k_1", "k_2"):
            yield from properties_in(getattr(spec, name, None), (*at, name))
    elif spec is not None:
        yield at, spec
