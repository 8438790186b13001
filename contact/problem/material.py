"""What bodies are made of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Discriminator, Tag, model_validator

from contact.problem.curves import ANumber, APhases, APolynomial, APropertyTable, PhasedSpec, PropertySpec, phased_form
from contact.problem.flow import Creep, Liquid, Plastic
from contact.problem.part import Entry, Part, properties_in
from contact.problem.values import Flag, Number, Positive, problem


class Axes(Part):
    """Conductivity along two material axes."""

    k_1: Annotated[PhasedSpec, Entry("along axis 1", "W/mK", above=0.0)]
    k_2: Annotated[PhasedSpec, Entry("across axis 1", "W/mK", above=0.0)]
    angle: Annotated[Number, Entry("of axis 1, from x towards y in the reference", "degrees", degrees=True)] = 0.0
    turns: Annotated[Flag, Entry("whether the axes turn with the body; else they keep their direction in space")] = True


AXES_KEYS = frozenset(("k_1", "k_2", "angle", "turns", "k1", "k2"))  # the last two to be told the right ones


def _conductivity_form(value: Any) -> str:
    if isinstance(value, Axes) or (isinstance(value, Mapping) and AXES_KEYS & value.keys()):
        return "<axes>"
    return phased_form(value)


ConductivitySpec = Annotated[ANumber | APropertyTable | APolynomial | APhases | Annotated[Axes, Tag("<axes>")],
                             Discriminator(_conductivity_form)]


class Latent(Part):
    """Latent heat, taken up at one temperature or over a range."""

    L: Annotated[Positive, Entry("latent heat", "J/kg")]
    T_m: Annotated[Number | None, Entry(
        "melting temperature at which all of the latent heat is taken up; or", "K", temperature=True)] = None
    T_s: Annotated[Number | None, Entry("solidus: melting begins", "K", temperature=True)] = None
    T_l: Annotated[Number | None, Entry("liquidus: melting ends", "K", temperature=True)] = None

    @model_validator(mode="after")
    def _one_form(self) -> Latent:
        if (self.T_m is None) == (self.T_s is None) or (self.T_s is None) != (self.T_l is None):
            raise problem("latent heat has either `T_m`, or both `T_s` and `T_l`")
        if self.T_s is not None and self.T_l is not None and self.T_l < self.T_s:
            raise problem("T_l (liquidus) must not be below T_s (solidus)", at=("T_l",))
        return self

    @property
    def limits(self) -> tuple[float, float]:
        """Solidus and liquidus, in the unit of the file or of the model.json."""
        if self.T_m is not None:
            return self.T_m, self.T_m
        assert self.T_s is not None
        assert self.T_l is not None
        return self.T_s, self.T_l


class Material(Part):
    """What the halves know of a material; what none of the chosen halves needs may be left out."""

    rho: Annotated[Positive | None, Entry("density of the reference configuration", "kg/m3",
                                        default="thermal; elastic with gravity, inertia or `adiabatic`")] = None
    k: Annotated[ConductivitySpec | None, Entry("conductivity", "W/mK", above=0.0, kind="PHASED, or axes",
                                              default="thermal")] = None
    c: Annotated[PhasedSpec | None, Entry("heat capacity", "J/kgK", above=0.0,
                                        default="thermal; elastic with `adiabatic`")] = None
    latent: Annotated[Latent | None, Entry("latent heat", default="thermal, if it melts")] = None
    E: Annotated[PropertySpec | None, Entry("Young's modulus", "Pa", above=0.0,
                                          default="elastic; rod where it presses")] = None
    nu: Annotated[PropertySpec | None, Entry("Poisson's ratio", "", above=-1.0, below=0.5, default="elastic",
                                             remedy="Poisson's ratio of a nearly incompressible material: 0.4999.")] = (
        None)
    alpha: Annotated[PropertySpec | None, Entry("linear thermal expansion; 0 if there is none", "1/K",
                                              default="elastic, rod")] = None
    T_ref: Annotated[Number | None, Entry("the temperature at which the body is free of stress", "K", temperature=True,
                                        default="elastic, rod, unless `alpha` is 0")] = None
    plastic: Annotated[Plastic | None, Entry("plastic flow", default="")] = None
    creep: Annotated[Creep | None, Entry("creep", default="")] = None
    liquid: Annotated[Liquid | None, Entry("the melt", default="")] = None

    @model_validator(mode="after")
    def _physical(self) -> Material:
        for key in ("k", "c"):
            for at, _ in properties_in(getattr(self, key), (key,)):
                if at[-1] in ("solid", "liquid") and self.latent is None:
                    raise problem("solid and liquid need to know when it melts",
                                  "Add latent: {L: ..., T_m: ...} to the material.", at=at[:-1])
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

    def lacks(self, keys: tuple[str, ...]) -> list[str]:
        """List those of the keys that are not given."""
        return [key for key in keys if getattr(self, key) is None]
