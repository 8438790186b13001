"""The boundary and the pairs of model.json, checked: what acts on the surfaces, as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.checks import keys, known, made, nodes_on, number, signal
from contact.half.field import Field, field_from
from contact.half.interface import Interface
from contact.half.property import Property, property_from
from contact.half.signal import Signal
from contact.laws import Law, parse_law

Ints = NDArray[np.int32]


@dataclass(frozen=True)
class Prescribed:
    """Eq. (2): T = value(x, t) [K] at nodes.  name : of the factor input, or ""."""

    nodes: Ints
    value: Field
    name: str


@dataclass(frozen=True)
class Flux:
    """Eq. (3): value(x, t) [W/m2] into the body through the edges : (n, 2)."""

    edges: Ints
    value: Field
    name: str


@dataclass(frozen=True)
class Exposed:
    """A surface open to its surroundings.

    edges : (n, 2).  near, far : gaps [m] between which facing pieces of it are uncovered from 0 to 1, Eq. (7); None:
    it is open as a whole, facing something or not.
    """

    surface: str
    edges: Ints
    near: float | None
    far: float | None


@dataclass(frozen=True)
class Film:
    """Eqs. (5-7): kappa(g) h(x, t) h_factor(T) |T - Te|^exponent (T - Te) out of the body through a surface.

    where : kappa from d_cut to d_full.  h_factor : None is 1.
    """

    where: Exposed
    h: Field
    h_factor: Property | None
    Te: Field
    exponent: float
    name: str


@dataclass(frozen=True)
class Radiator:
    """Eq. (12): w(g) sigma_SB eps(T) (T^4 - T_inf^4) out of the body through a surface; w from d_near to d_far."""

    where: Exposed
    emissivity: Property
    T_inf: Field
    name: str


@dataclass(frozen=True)
class NearRadiation:
    """Eq. (11): (1 - w(g)) sigma_SB (T_s^4 - T_m^4)/(1/eps_s + 1/eps_m - 1) between the sides of a pair.

    near, far : gaps [m] between which w grows from 0 to 1; None: w = 0.
    """

    emissivity_slave: Property
    emissivity_master: Property
    near: float | None
    far: float | None


@dataclass(frozen=True)
class PairLaws:
    """One contact pair: Eqs. (8-10), laws of touching and of open points (None: none), and their factors.

    friction_share : share of friction heat that the slave takes; None: by effusivities.  radiation : Eq. (11).
    """

    closed: Law | None
    open: Law | None
    closed_factor: Signal
    open_factor: Signal
    friction_share: float | None = None
    radiation: NearRadiation | None = None


Boundary = Prescribed | Flux | Film | Radiator

KINDS = ("temperature", "flux", "convection", "radiation")


def parse_boundary(interface: Interface, spec: Any, where: str) -> Boundary:
    """One entry of `boundary`.  Raises ValueError naming key, value and what would do."""
    kind = known(keys(spec, where, {"kind"}, spec)["kind"], f"{where}.kind", KINDS)
    name = str(spec.get("name") or "")
    if kind == "temperature":
        keys(spec, where, {"kind", "on", "value"}, {"name"})
        return Prescribed(nodes_on(interface, spec["on"], f"{where}.on"), field(spec["value"], f"{where}.value"), name)
    on = _surface(interface, spec, kind, where)
    if kind == "flux":
        keys(spec, where, {"kind", "on", "value"}, {"name"})
        return Flux(interface.surfaces[on], field(spec["value"], f"{where}.value"), name)
    if kind == "convection":
        return _film(interface, spec, where, on)
    keys(spec, where, {"kind", "on", "emissivity", "T"}, {"d_near", "d_far", "name"})
    exposed = Exposed(on, interface.surfaces[on], *_gaps(spec, where, "d_near", "d_far"))
    eps = emissivity(spec["emissivity"], f"{where}.emissivity")
    return Radiator(exposed, eps, field(spec["T"], f"{where}.T"), name)


def _surface(interface: Interface, spec: Mapping[str, Any], kind: str, where: str) -> str:
    on = spec.get("on")
    if on in interface.node_sets and on not in interface.surfaces:
        raise ValueError(f"model.json: {where}.on: {on!r} is a set of nodes, and a {kind} needs an area: one of the "
                         f"surfaces {', '.join(interface.surfaces) or '(none)'}")
    return known(on, f"{where}.on", interface.surfaces)


def _film(interface: Interface, spec: Mapping[str, Any], where: str, on: str) -> Film:
    keys(spec, where, {"kind", "on", "h", "T"}, {"h_factor", "exponent", "d_cut", "d_full", "name"})
    exposed = Exposed(on, interface.surfaces[on], *_gaps(spec, where, "d_cut", "d_full"))
    h = field(spec["h"], f"{where}.h")
    if h.least is not None and h.least < 0:
        raise ValueError(f"model.json: {where}.h must not be negative, not {h.least:g}")
    factor = None
    if spec.get("h_factor") is not None:
        factor = made(_factor, spec["h_factor"], f"{where}.h_factor")
    exponent = number(spec.get("exponent", 0.0), f"{where}.exponent", 0.0, low_itself=True)
    return Film(exposed, h, factor, field(spec["T"], f"{where}.T"), exponent, str(spec.get("name") or ""))


def _factor(spec: Any) -> Property:
    """A factor of h: not negative, and not 0 at all temperatures (a polynomial is checked where it is met)."""
    values = values_of(spec)
    if values is not None and not ((values >= 0.0).all() and values.any()):
        raise ValueError(f"a factor of h must be positive (0 only in parts of a table), not {values.min():g}")
    return property_from(spec)


def values_of(spec: Any) -> NDArray[np.float64] | None:
    """The values a PROPERTY takes, all of them finite; None for a polynomial.  Raises ValueError."""
    polynomial = isinstance(spec, Mapping) and "polynomial" in spec
    values = spec if not isinstance(spec, Mapping) else spec["polynomial" if polynomial else "value"]
    values = np.atleast_1d(np.asarray(values, dtype=float))
    if values.size == 0 or not np.isfinite(values).all():
        raise ValueError(f"finite numbers are needed, not {values.tolist()}")
    return None if polynomial else values


def emissivity(spec: Any, where: str) -> Property:
    """An emissivity in (0, 1]; a polynomial is checked where it is met.  Raises ValueError."""
    def make(spec: Any) -> Property:
        values = values_of(spec)
        if values is not None and not ((values > 0.0) & (values <= 1.0)).all():
            wrong = values[~((values > 0.0) & (values <= 1.0))]
            raise ValueError(f"an emissivity must be greater than 0 and at most 1, not {wrong[0]:g}")
        return property_from(spec)

    return made(make, spec, where)


def field(spec: Any, where: str) -> Field:
    """A Field.  Raises ValueError."""
    return made(field_from, spec, where)


def _gaps(spec: Mapping[str, Any], where: str, low: str, high: str) -> tuple[float | None, float | None]:
    if spec.get(low) is None and spec.get(high) is None:
        return None, None
    near, far = (number(spec.get(key), f"{where}.{key}") for key in (low, high))
    if not 0 <= near < far:
        raise ValueError(f"model.json: {where}: 0 <= {low} < {high} is needed, not {near}, {far}")
    return near, far


def parse_pair(spec: Any, where: str) -> PairLaws:
    """One entry of `pairs`.  Raises ValueError naming key, value and what would do."""
    keys(spec, where, set(), {"closed", "open", "closed_factor", "open_factor", "friction_share", "radiation"})
    closed, open_ = (None if spec.get(k) is None else made(parse_law, spec[k], f"{where}.{k}")
                     for k in ("closed", "open"))
    share = spec.get("friction_share")
    if share is not None and not 0.0 <= number(share, f"{where}.friction_share") <= 1.0:
        raise ValueError(f"model.json: {where}.friction_share must lie from 0 to 1 (null: by effusivities), "
                         f"not {share!r}")
    radiation = None if spec.get("radiation") is None else _near_radiation(spec["radiation"], f"{where}.radiation")
    return PairLaws(closed, open_, signal(spec.get("closed_factor", 1.0), f"{where}.closed_factor"),
                    signal(spec.get("open_factor", 1.0), f"{where}.open_factor"),
                    None if share is None else float(share), radiation)


def _near_radiation(spec: Any, where: str) -> NearRadiation:
    keys(spec, where, {"emissivity_slave", "emissivity_master"}, {"d_near", "d_far"})
    slave, master = (emissivity(spec[key], f"{where}.{key}") for key in ("emissivity_slave", "emissivity_master"))
    return NearRadiation(slave, master, *_gaps(spec, where, "d_near", "d_far"))
