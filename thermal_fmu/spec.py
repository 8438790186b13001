"""model.json of the thermal half, checked: the model as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.checks import keys, known, made, nodes_on, number, signal
from contact.half.interface import Interface
from contact.half.property import positive_property
from contact.half.signal import Signal
from contact.laws import Law, parse_law
from thermal_fmu.material import Material
from thermal_fmu.methods import METHODS

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Body:
    """material of the body, T0 : initial temperature [K], Q_T : volumetric heat rate [W/m3 of current volume]."""

    name: str
    material: Material
    T0: float
    Q_T: Signal


@dataclass(frozen=True)
class Prescribed:
    """Eq. (2): T = value(t) [K] at nodes.  name : of the factor input, or ""."""

    nodes: Ints
    value: Signal
    name: str


@dataclass(frozen=True)
class Flux:
    """Eq. (3): value(t) [W/m2] into the body through the edges : (n, 2)."""

    edges: Ints
    value: Signal
    name: str


@dataclass(frozen=True)
class Film:
    """Eqs. (5-7): kappa(g) h(t) |T - Te|^exponent (T - Te) out of the body through a surface.

    d_cut, d_full : gaps [m] between which kappa grows from 0 to 1; None: kappa = 1, covered or not.
    """

    surface: str
    edges: Ints
    h: Signal
    Te: Signal
    exponent: float
    d_cut: float | None
    d_full: float | None
    name: str


@dataclass(frozen=True)
class PairLaws:
    """Eqs. (8-10) for one contact pair: laws of touching and of open points (None: none), and their factors."""

    closed: Law | None
    open: Law | None
    closed_factor: Signal
    open_factor: Signal


@dataclass(frozen=True)
class Model:
    """All of model.json.  pairs : in the order of interface.pairs, None where no heat is exchanged."""

    method: str
    tolerance: float
    bodies: tuple[Body, ...]
    prescribed: tuple[Prescribed, ...]
    fluxes: tuple[Flux, ...]
    films: tuple[Film, ...]
    pairs: tuple[PairLaws | None, ...]

    @property
    def load_names(self) -> tuple[str, ...]:
        """Names of the factor inputs, each once, in the order of the file."""
        names = [b.name for b in self.prescribed] + [b.name for b in self.fluxes] + [b.name for b in self.films]
        return tuple(dict.fromkeys(name for name in names if name))

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Every signal the half follows by itself."""
        pairs = [p for p in self.pairs if p is not None]
        return (*(b.Q_T for b in self.bodies), *(b.value for b in self.prescribed), *(b.value for b in self.fluxes),
                *(s for f in self.films for s in (f.h, f.Te)),
                *(s for p in pairs for s in (p.closed_factor, p.open_factor)))


def parse_model(interface: Interface, spec: Mapping[str, Any]) -> Model:
    """The model a model.json describes.  Raises ValueError naming the key, the value and what would do."""
    keys(spec, "", {"half", "format", "materials", "bodies"}, {"method", "tolerance", "boundary", "pairs"})
    if spec["half"] != "thermal" or spec["format"] != 1:
        raise ValueError(f"model.json: half {spec['half']!r}, format {spec['format']!r} is not thermal, 1")
    method = known(spec.get("method", "midpoint"), "method", METHODS)
    materials = {name: _material(m, f"materials.{name}")
                 for name, m in keys(spec["materials"], "materials", set(), spec["materials"]).items()}
    bodies = keys(spec["bodies"], "bodies", set(interface.bodies))
    boundary = [_boundary(interface, b, f"boundary[{i}]") for i, b in enumerate(spec.get("boundary", []))]
    pairs = keys(spec.get("pairs", {}), "pairs", set(), [p.name for p in interface.pairs])
    return Model(method, number(spec.get("tolerance", 1e-10), "tolerance", 0.0),
                 tuple(_body(name, bodies[name], f"bodies.{name}", materials) for name in interface.bodies),
                 tuple(b for b in boundary if isinstance(b, Prescribed)),
                 tuple(b for b in boundary if isinstance(b, Flux)),
                 tuple(b for b in boundary if isinstance(b, Film)),
                 tuple(_pair(pairs[p.name], f"pairs.{p.name}") if p.name in pairs else None
                       for p in interface.pairs))


def _material(spec: Any, where: str) -> Material:
    keys(spec, where, {"rho", "k", "c"})
    k = made(lambda k: positive_property(k, "conductivity"), spec["k"], f"{where}.k")
    c = made(lambda c: positive_property(c, "heat capacity"), spec["c"], f"{where}.c")
    return Material(number(spec["rho"], f"{where}.rho", 0.0), k, c)


def _body(name: str, spec: Any, where: str, materials: Mapping[str, Material]) -> Body:
    keys(spec, where, {"material", "T0"}, {"Q_T"})
    material = materials[known(spec["material"], f"{where}.material", materials)]
    Q_T = signal(spec.get("Q_T", 0.0), f"{where}.Q_T")
    return Body(name, material, number(spec["T0"], f"{where}.T0"), Q_T)


def _boundary(interface: Interface, spec: Any, where: str) -> Prescribed | Flux | Film:
    kind = known(keys(spec, where, {"kind"}, spec)["kind"], f"{where}.kind", ("temperature", "flux", "convection"))
    name = str(spec.get("name") or "")
    if kind == "temperature":
        keys(spec, where, {"kind", "on", "value"}, {"name"})
        nodes = nodes_on(interface, spec["on"], f"{where}.on")
        return Prescribed(nodes, signal(spec["value"], f"{where}.value"), name)
    on = known(spec.get("on"), f"{where}.on", interface.surfaces)
    edges = interface.surfaces[on]
    if kind == "flux":
        keys(spec, where, {"kind", "on", "value"}, {"name"})
        return Flux(edges, signal(spec["value"], f"{where}.value"), name)
    keys(spec, where, {"kind", "on", "h", "T"}, {"exponent", "d_cut", "d_full", "name"})
    d_cut, d_full = _gaps(spec, where)
    h = signal(spec["h"], f"{where}.h")
    if (h.value < 0).any():
        raise ValueError(f"model.json: {where}.h must not be negative")
    exponent = number(spec.get("exponent", 0.0), f"{where}.exponent", 0.0, low_itself=True)
    return Film(on, edges, h, signal(spec["T"], f"{where}.T"), exponent, d_cut, d_full, name)


def _gaps(spec: Mapping[str, Any], where: str) -> tuple[float | None, float | None]:
    if spec.get("d_cut") is None and spec.get("d_full") is None:
        return None, None
    d_cut, d_full = (number(spec.get(key), f"{where}.{key}") for key in ("d_cut", "d_full"))
    if not 0 <= d_cut < d_full:
        raise ValueError(f"model.json: {where}: 0 <= d_cut < d_full is needed, not {d_cut}, {d_full}")
    return d_cut, d_full


def _pair(spec: Any, where: str) -> PairLaws:
    keys(spec, where, set(), {"closed", "open", "closed_factor", "open_factor"})
    closed, open_ = (None if spec.get(k) is None else made(parse_law, spec[k], f"{where}.{k}")
                     for k in ("closed", "open"))
    return PairLaws(closed, open_, signal(spec.get("closed_factor", 1.0), f"{where}.closed_factor"),
                    signal(spec.get("open_factor", 1.0), f"{where}.open_factor"))
