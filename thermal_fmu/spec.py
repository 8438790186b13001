"""model.json of the thermal half, checked: the model as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from contact.half.checks import keys, known, made, number
from contact.half.field import Field
from contact.half.interface import Interface
from contact.half.property import Property, property_from
from contact.half.signal import Signal
from thermal_fmu.material import Material, parse_material
from thermal_fmu.spec_boundary import (
    Film,
    Flux,
    PairLaws,
    Prescribed,
    Radiator,
    field,
    parse_boundary,
    parse_pair,
    values_of,
)
from thermal_fmu.stepping import Stepping, parse_stepping

SIGMA_SB = 5.670374419e-8  # W/m2K4


@dataclass(frozen=True)
class Body:
    """material of the body, T0 : initial temperature [K], Q_T : volumetric heat rate [W/m3 of current volume].

    Q_T_factor : of the cell's own temperature; None is 1.
    """

    name: str
    material: Material
    T0: float
    Q_T: Field
    Q_T_factor: Property | None = None


@dataclass(frozen=True)
class Model:
    """All of model.json.  pairs : in the order of interface.pairs, None where no heat is exchanged.

    sigma_SB : Stefan-Boltzmann constant [W/m2K4].
    """

    stepping: Stepping
    sigma_SB: float
    bodies: tuple[Body, ...]
    prescribed: tuple[Prescribed, ...]
    fluxes: tuple[Flux, ...]
    films: tuple[Film, ...]
    radiators: tuple[Radiator, ...]
    pairs: tuple[PairLaws | None, ...]

    @property
    def load_names(self) -> tuple[str, ...]:
        """Names of the factor inputs, each once, in the order of the file."""
        names = [b.name for kind in (self.prescribed, self.fluxes, self.films, self.radiators) for b in kind]
        return tuple(dict.fromkeys(name for name in names if name))

    @property
    def fields(self) -> tuple[Field, ...]:
        """Every field of it."""
        return (*(b.Q_T for b in self.bodies), *(b.value for b in self.prescribed), *(b.value for b in self.fluxes),
                *(s for f in self.films for s in (f.h, f.Te)), *(r.T_inf for r in self.radiators))

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Every signal the half follows by itself."""
        pairs = [p for p in self.pairs if p is not None]
        return (*(s for f in self.fields for s in f.signals),
                *(s for p in pairs for s in (p.closed_factor, p.open_factor)))

    @property
    def radiates(self) -> bool:
        """Whether temperatures must be kelvin."""
        return bool(self.radiators) or any(p is not None and p.radiation is not None for p in self.pairs)


def parse_model(interface: Interface, spec: Mapping[str, Any]) -> Model:
    """The model a model.json describes.  Raises ValueError naming the key, the value and what would do."""
    keys(spec, "", {"half", "format", "materials", "bodies"},
         {"method", "theta", "increments", "adaptive", "tolerance", "sigma_SB", "boundary", "pairs"})
    if spec["half"] != "thermal" or spec["format"] != 1:
        raise ValueError(f"model.json: half {spec['half']!r}, format {spec['format']!r} is not thermal, 1")
    materials = {name: parse_material(m, f"materials.{name}")
                 for name, m in keys(spec["materials"], "materials", set(), spec["materials"]).items()}
    bodies = keys(spec["bodies"], "bodies", set(interface.bodies))
    boundary = [parse_boundary(interface, b, f"boundary[{i}]") for i, b in enumerate(spec.get("boundary", []))]
    pairs = keys(spec.get("pairs", {}), "pairs", set(), [p.name for p in interface.pairs])
    model = Model(parse_stepping(spec), number(spec.get("sigma_SB", SIGMA_SB), "sigma_SB", 0.0),
                  tuple(_body(name, bodies[name], f"bodies.{name}", materials) for name in interface.bodies),
                  tuple(b for b in boundary if isinstance(b, Prescribed)),
                  tuple(b for b in boundary if isinstance(b, Flux)),
                  tuple(b for b in boundary if isinstance(b, Film)),
                  tuple(b for b in boundary if isinstance(b, Radiator)),
                  tuple(parse_pair(pairs[p.name], f"pairs.{p.name}") if p.name in pairs else None
                        for p in interface.pairs))
    if model.radiates:
        _demand_kelvin(model)
    return model


def _demand_kelvin(model: Model) -> None:
    named = [(f"bodies.{b.name}.T0", b.T0) for b in model.bodies]
    named += [(f"T of a {kind}", value.least) for kind, values in (
        ("prescribed temperature", [b.value for b in model.prescribed]), ("convection", [f.Te for f in model.films]),
        ("radiation", [r.T_inf for r in model.radiators])) for value in values if value.least is not None]
    for what, T in named:
        if T < 0:
            raise ValueError(f"model.json: {what} is {T:g}: radiation needs temperatures in kelvin, 0 or more")


def _body(name: str, spec: Any, where: str, materials: Mapping[str, Material]) -> Body:
    keys(spec, where, {"material", "T0"}, {"Q_T", "Q_T_factor"})
    material = materials[known(spec["material"], f"{where}.material", materials)]
    factor = None
    if spec.get("Q_T_factor") is not None:
        made(values_of, spec["Q_T_factor"], f"{where}.Q_T_factor")
        factor = made(property_from, spec["Q_T_factor"], f"{where}.Q_T_factor")
    return Body(name, material, number(spec["T0"], f"{where}.T0"), field(spec.get("Q_T", 0.0), f"{where}.Q_T"), factor)
