"""Halves of one wrong law each: ours, told another scene than the one they stand in, or deaf to one input."""

from __future__ import annotations

import copy
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from contact.half.interface import Interface
from coupler.fmu.half import Advance, Half

sys.path.insert(0, str(Path(__file__).parent))
from stacked_blocks import rectangle, stacked

# Two bodies across a gap, with every kind of load; one melts.
MELTING = """
slideline: 2
title: Two blocks with every load
units: {temperature: K}
geometry: plane
materials:
  steel:
    {rho: 8000, c: {T: [300, 900], value: [400, 900]}, k: {T: [300, 900], value: [90, 10]}, E: 2.0e11, nu: 0.3,
     alpha: 0, T_ref: 300}
  salt: {rho: 2000, c: 1000, k: 5, latent: {L: 2.0e5, T_s: 580, T_l: 620}, E: 2.0e11, nu: 0.3, alpha: 0, T_ref: 300}
bodies:
  lower: {mesh: {rectangle: {origin: [0.01, 0], size: [0.02, 0.01], cells: [3, 2]}}, material: salt, T0: 570}
  upper:
    mesh: {rectangle: {origin: [0.01, 0.011], size: [0.02, 0.02], cells: [2, 3]}}
    material: steel
    T0: 800
    Q_T: 2.0e6
contact:
  joint:
    slave: upper.bottom
    master: lower.top
    gap_max: 0.002
    friction: {mu: 0.1}
    conduction: {closed: {law: constant, h: 3000}, open: {law: gas, k_g: 0.06, g_m: 30.0e-6}}
    radiation: {emissivity_slave: 0.8, emissivity_master: 0.8, gap: {d_near: 2.0e-3, d_far: 3.0e-3}}
thermal:
  boundary:
    - {on: lower.bottom, temperature: {t: [0, 200], value: [570, 640]}}
    - {on: upper.top, convection: {h: 200, T: 350}}
    - {on: lower.left, convection: {h: 500, T: 900}}
    - {on: upper.left, flux: 2.0e4}
    - {on: upper.right, radiation: {emissivity: 0.9, T: 600}}
mechanical:
  half: elastic
  elastic:
    boundary: [{on: lower.bottom, u_x: 0, u_y: 0}, {on: upper.top, u_x: 0, u_y: 0}]
coupling: {scheme: staggered, end: 12, windows: [{until: 12, size: 1}]}
"""

# Properties that stay: a tenth of the time.
THERMAL = MELTING.replace("c: {T: [300, 900], value: [400, 900]}, k: {T: [300, 900], value: [90, 10]}",
                          "c: 500, k: 30").replace("latent: {L: 2.0e5, T_s: 580, T_l: 620}, ", "")

# The same blocks pressed: only then do they conduct by pressure.
CLOSED = THERMAL.replace("0.011], size", "0.01], size").replace(
    "{law: constant, h: 3000}", "{law: power, h0: 100, h1: 9000, p0: 1.0e7, exponent: 0.95, p_max: 1.0e8}")

# A block on another, with weight and friction; a third stands free beside.
MECHANICAL = stacked(
    rectangle("0.01, 0", "0.02, 0.01", "3, 2", 300), rectangle("0.012, 0.01", "0.01, 0.01", "2, 2", 320),
    more_bodies=f"  post: {rectangle('0.05, 0', '0.01, 0.02', '2, 4', 300)}\n", T_ref=300, mu=0.4, h=3000, end=12,
    elastic="""\
    gravity: {y: -1.0e4}
    boundary:
      - {on: lower.bottom, u_x: 0, u_y: 0}
      - {on: upper.top, pressure: 1.0e6}
      - {on: upper.left, pressure: 5.0e4}
      - {on: post.bottom, u_x: 0, u_y: 0}
      - {on: post.right, t_x: 2.0e5}
""")
ROUND = ("geometry: plane", "geometry: axisymmetric")
SCENES = {"apart": THERMAL, "melting": MELTING, "pressed": CLOSED, "round": THERMAL.replace(*ROUND),
          "blocks": MECHANICAL, "round blocks": MECHANICAL.replace(*ROUND).replace(
              "      - {on: post.right, t_x: 2.0e5}\n", "")}

Model = dict[str, Any]


@dataclass
class Deaf:
    """A half that is another one, but for what it takes an input for: hears(name, value, first value)."""

    half: Half
    hears: Callable[[str, Any, Any], Any]

    def __post_init__(self) -> None:
        self.first: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self.half, name)

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Any],
                   outputs: Sequence[str]) -> Any:
        self.first = dict(inputs)
        return self.half.initialise(t_start, t_end, parameters, inputs, outputs)

    def advance(self, t: float, h: float, inputs: Mapping[str, Any], outputs: Sequence[str]) -> Advance:
        return self.half.advance(t, h, {name: self.hears(name, value, self.first.get(name, value))
                                        for name, value in inputs.items()}, outputs)


def as_told(name: str, value: Any, first: Any) -> Any:
    return value


def without(name: str) -> Callable[[str, Any, Any], Any]:
    return lambda n, value, first: first if n == name else value


def the_scene(model: Model) -> None: ...


def materials(**change: Callable[[Any], Any]) -> Callable[[Model], None]:
    def changed(model: Model) -> None:
        for material in model["materials"].values():
            for key, new in change.items():
                if key in material:
                    material[key] = new(material[key])
    return changed


def boundary(on: str, **change: Any) -> Callable[[Model], None]:
    """Another condition on a surface; without any change none."""
    def changed(model: Model) -> None:
        rows = [row for row in model["boundary"] if row.get("on") == on]
        assert rows, f"no condition on {on}"
        model["boundary"] = [row for row in model["boundary"] if row.get("on") != on]
        if change:
            model["boundary"] += [{**rows[0], **change}]
    return changed


def pair(key: str, value: Any) -> Callable[[Model], None]:
    def changed(model: Model) -> None:
        model["pairs"]["joint"][key] = value
    return changed


def law(key: str, value: Any) -> Callable[[Model], None]:
    def changed(model: Model) -> None:
        model["pairs"]["joint"]["conduction"][key] = value
    return changed


def bodies(key: str, value: Any) -> Callable[[Model], None]:
    def changed(model: Model) -> None:
        for body in model["bodies"].values():
            body[key] = value
    return changed


def top(key: str, value: Any) -> Callable[[Model], None]:
    def changed(model: Model) -> None:
        model[key] = value
    return changed


def flat(interface: Interface) -> Interface:
    return replace(interface, geometry="plane")


def first_of(value: Any) -> Any:
    """A table at its first temperature alone."""
    return value["value"][0] if isinstance(value, dict) and "value" in value else value


def twice(value: Any) -> Any:
    return {**value, "value": [2.0 * v for v in value["value"]]} if isinstance(value, dict) else 2.0 * value


@dataclass(frozen=True)
class Wrong:
    """role : of the half.  scene : it stands in.  told : what is done to its model.json.  built : to its interface.

    hears : what it takes an input for.  says : of what the finding speaks.
    """

    role: str
    scene: str
    told: Callable[[Model], None] = the_scene
    says: str = ""
    hears: Callable[[str, Any, Any], Any] = as_told
    built: Callable[[Interface], Interface] = lambda interface: interface


THERMAL_FAULTS = {
    "conductivity twice too large": Wrong("thermal", "apart", materials(k=twice)),
    "conductivity at the first temperature alone": Wrong("thermal", "melting", materials(k=first_of)),
    "heat capacity at the first temperature alone": Wrong("thermal", "melting", materials(c=first_of)),
    "density left out": Wrong("thermal", "apart", materials(rho=lambda rho: 1.0)),
    "latent heat left out": Wrong("thermal", "melting", materials(latent=lambda was: None)),
    "radiation left out": Wrong("thermal", "apart", boundary("upper.right"), "heat.radiation"),
    "radiation by degrees Celsius": Wrong("thermal", "apart", boundary(
        "upper.right", radiation={"emissivity": 0.9, "T": 326.85})),
    "a film left out on one edge": Wrong("thermal", "apart", boundary("lower.left")),
    "a flux with the other sign": Wrong("thermal", "apart", boundary("upper.left", flux=-2.0e4), "heat.flux"),
    "a source left out": Wrong("thermal", "apart", bodies("Q_T", 0.0), "heat.source"),
    "a prescribed temperature that stays": Wrong("thermal", "apart", boundary("lower.bottom", temperature=570.0)),
    "radiation across the gap left out": Wrong("thermal", "apart", pair("radiation", None), "near_radiation"),
    "the gap taken as half as wide": Wrong("thermal", "apart", law("open", {
        "law": "gas", "k_g": 0.12, "g_m": 30.0e-6}), "heat.gap"),
    "pressure not heard": Wrong("thermal", "pressed", hears=without("contact.t_N")),
    "the matrices of the first x": Wrong("thermal", "apart", hears=without("x")),
    "friction heat not heard": Wrong("thermal", "apart", hears=without("contact.E_friction"), says="heat.friction"),
    "mechanical heat not heard": Wrong("thermal", "apart", hears=without("E_M"), says="heat.mechanical"),
    "no turn around the axis": Wrong("thermal", "round", built=flat),
}
MECHANICAL_FAULTS = {
    "stiffness a third too large": Wrong("mechanical", "blocks", materials(E=lambda E: 1.3 * E)),
    "Poisson's number halved": Wrong("mechanical", "blocks", materials(nu=lambda nu: 0.5 * nu)),
    "plane stress for plane strain": Wrong("mechanical", "blocks", top("state", "plane_stress")),
    "expansion a quarter too large": Wrong("mechanical", "blocks", materials(alpha=lambda alpha: 1.25 * alpha)),
    "expansion from another temperature": Wrong("mechanical", "blocks", materials(T_ref=lambda T: T - 20.0)),
    "weight with the other sign": Wrong("mechanical", "blocks", top("gravity", {"x": 0.0, "y": 1.0e4})),
    "weight left out": Wrong("mechanical", "blocks", top("gravity", None)),
    "a pressure along x in place of the normal": Wrong("mechanical", "blocks", boundary(
        "upper.top", pressure=None, t_x=2.0e5)),
    "a traction left out": Wrong("mechanical", "blocks", boundary("post.right")),
    "temperatures not heard": Wrong("mechanical", "blocks", hears=without("T")),
    "no turn around the axis": Wrong("mechanical", "round blocks", built=flat),
}
FAULTS = {**{f"thermal: {n}": w for n, w in THERMAL_FAULTS.items()},
          **{f"mechanical: {n}": w for n, w in MECHANICAL_FAULTS.items()}}


def model_of(wrong: Wrong, models: Mapping[str, Any]) -> Model:
    model = copy.deepcopy(dict(models[wrong.role]))
    wrong.told(model)
    for part in (*model["materials"].values(), *model["pairs"].values()):
        for key in [key for key, value in part.items() if value is None and key in ("latent", "radiation")]:
            del part[key]
    model["boundary"] = [{k: v for k, v in row.items() if v is not None} for row in model["boundary"]]
    return {key: value for key, value in model.items() if value is not None}
