"""model.json of the thermal half, checked: the model as frozen values."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.signal import Signal, signal_from
from contact.laws import Law, parse_law
from thermal_fmu.material import Material, positive_curve
from thermal_fmu.methods import METHODS

Ints = NDArray[np.int32]
R = TypeVar("R")


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
    _keys(spec, "", {"half", "format", "materials", "bodies"}, {"method", "tolerance", "boundary", "pairs"})
    if spec["half"] != "thermal" or spec["format"] != 1:
        raise ValueError(f"model.json: half {spec['half']!r}, format {spec['format']!r} is not thermal, 1")
    method = _known(spec.get("method", "midpoint"), "method", METHODS)
    materials = {name: _material(m, f"materials.{name}") for name, m in spec["materials"].items()}
    for name in spec["bodies"]:
        _known(name, "bodies", interface.bodies)
    bodies = tuple(_body(name, spec["bodies"], materials) for name in interface.bodies)
    boundary = [_boundary(interface, b, f"boundary[{i}]") for i, b in enumerate(spec.get("boundary", []))]
    pairs = spec.get("pairs", {})
    for name in pairs:
        _known(name, "pairs", [p.name for p in interface.pairs])
    return Model(method, _number(spec.get("tolerance", 1e-10), "tolerance", low=0.0), bodies,
                 tuple(b for b in boundary if isinstance(b, Prescribed)),
                 tuple(b for b in boundary if isinstance(b, Flux)),
                 tuple(b for b in boundary if isinstance(b, Film)),
                 tuple(_pair(pairs[p.name], f"pairs.{p.name}") if p.name in pairs else None
                       for p in interface.pairs))


def _material(spec: Mapping[str, Any], where: str) -> Material:
    _keys(spec, where, {"rho", "k", "c"})
    k, c = (_made(positive_curve, spec[name], f"{where}.{name}") for name in ("k", "c"))
    return Material(_number(spec["rho"], f"{where}.rho", low=0.0), k, c)


def _body(name: str, bodies: Mapping[str, Any], materials: Mapping[str, Material]) -> Body:
    where = f"bodies.{name}"
    if name not in bodies:
        raise ValueError(f"model.json: {where} is missing")
    spec = bodies[name]
    _keys(spec, where, {"material", "T0"}, {"Q_T"})
    material = materials[_known(spec["material"], f"{where}.material", materials)]
    Q_T = _signal(spec.get("Q_T", 0.0), f"{where}.Q_T")
    return Body(name, material, _number(spec["T0"], f"{where}.T0"), Q_T)


def _boundary(interface: Interface, spec: Mapping[str, Any], where: str) -> Prescribed | Flux | Film:
    kind = _known(spec.get("kind"), f"{where}.kind", ("temperature", "flux", "convection"))
    name = str(spec.get("name") or "")
    if kind == "temperature":
        _keys(spec, where, {"kind", "on", "value"}, {"name"})
        nodes = _nodes(interface, spec["on"], f"{where}.on")
        return Prescribed(nodes, _signal(spec["value"], f"{where}.value"), name)
    on = _known(spec.get("on"), f"{where}.on", interface.surfaces)
    edges = interface.surfaces[on]
    if kind == "flux":
        _keys(spec, where, {"kind", "on", "value"}, {"name"})
        return Flux(edges, _signal(spec["value"], f"{where}.value"), name)
    _keys(spec, where, {"kind", "on", "h", "T"}, {"exponent", "d_cut", "d_full", "name"})
    d_cut, d_full = _gaps(spec, where)
    h = _signal(spec["h"], f"{where}.h")
    if (h.value < 0).any():
        raise ValueError(f"model.json: {where}.h must not be negative")
    exponent = _number(spec.get("exponent", 0.0), f"{where}.exponent", low=0.0, equal=True)
    return Film(on, edges, h, _signal(spec["T"], f"{where}.T"), exponent, d_cut, d_full, name)


def _gaps(spec: Mapping[str, Any], where: str) -> tuple[float | None, float | None]:
    if spec.get("d_cut") is None and spec.get("d_full") is None:
        return None, None
    d_cut, d_full = (_number(spec.get(key), f"{where}.{key}") for key in ("d_cut", "d_full"))
    if not 0 <= d_cut < d_full:
        raise ValueError(f"model.json: {where}: 0 <= d_cut < d_full is needed, not {d_cut}, {d_full}")
    return d_cut, d_full


def _pair(spec: Mapping[str, Any], where: str) -> PairLaws:
    _keys(spec, where, set(), {"closed", "open", "closed_factor", "open_factor"})
    closed, open_ = (None if spec.get(k) is None else _made(parse_law, spec[k], f"{where}.{k}")
                     for k in ("closed", "open"))
    return PairLaws(closed, open_, _signal(spec.get("closed_factor", 1.0), f"{where}.closed_factor"),
                    _signal(spec.get("open_factor", 1.0), f"{where}.open_factor"))


def _nodes(interface: Interface, on: Any, where: str) -> Ints:
    if on in interface.node_sets:
        return interface.node_sets[on]
    name = _known(on, where, [*interface.surfaces, *interface.node_sets])
    return np.unique(interface.surfaces[name]).astype(np.int32)


def _keys(spec: Mapping[str, Any], where: str, needed: set[str], optional: Iterable[str] = ()) -> None:
    if not isinstance(spec, Mapping):
        raise ValueError(f"model.json: {where} must be an object, not {spec!r}")
    unknown = sorted(set(spec) - needed - set(optional))
    missing = sorted(needed - set(spec))
    if unknown or missing:
        what = f"unknown key {unknown[0]!r}" if unknown else f"key {missing[0]!r} is missing"
        known = ", ".join(sorted(needed | set(optional)))
        raise ValueError(f"model.json: {where or 'top level'}: {what}; known: {known}")


def _known(value: Any, where: str, known: Iterable[str]) -> str:
    if not isinstance(value, str) or value not in (names := list(known)):
        raise ValueError(f"model.json: {where}: {value!r} is none of: {', '.join(known)}")
    return names[names.index(value)]


def _number(value: Any, where: str, low: float = -inf, equal: bool = False) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"model.json: {where} must be a finite number, not {value!r}")
    if value < low or (value == low and not equal):
        bound = "at least" if equal else "greater than"
        raise ValueError(f"model.json: {where} must be {bound} {low}, not {value}")
    return float(value)


def _signal(spec: Any, where: str) -> Signal:
    return _made(signal_from, spec, where)


def _made(make: Callable[[Any], R], spec: Any, where: str) -> R:
    try:
        return make(spec)
    except (ValueError, TypeError, KeyError) as exc:
        raise ValueError(f"model.json: {where}: {exc}") from exc
