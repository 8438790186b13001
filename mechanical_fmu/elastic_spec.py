"""model.json of the elastic half, checked: the model as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.checks import keys, known, made, nodes_on, number, signal
from contact.half.interface import Interface
from contact.half.property import positive_property, property_from
from contact.half.signal import Signal
from mechanical_fmu.material import Material

Ints = NDArray[np.int32]

DEFAULT_TOLERANCE = 1e-8
# The first of each is the default.  "plane_strain" is also what an axisymmetric scene has.
ELEMENTS = ("mean_dilatation", "enhanced")
STATES = ("plane_strain", "plane_stress")


@dataclass(frozen=True)
class Displacement:
    """Eq. (15): component of u is value(t) [m] at nodes.  on : the name they go by.  name : of the factor, or ""."""

    on: str
    nodes: Ints
    component: int
    value: Signal
    name: str


@dataclass(frozen=True)
class Pressure:
    """Eq. (16): a pressure value(t) [Pa] that pushes on the body and follows its edges : (n, 2)."""

    on: str
    edges: Ints
    value: Signal
    name: str


@dataclass(frozen=True)
class ElasticSpec:
    """All of model.json.  body_material : (n_bodies,) index into materials, in the order of interface.bodies.

    body_element : (n_bodies,) names of ELEMENTS.  plane_stress : no stress through the thickness (plane geometry).
    """

    tolerance: float
    materials: tuple[Material, ...]
    body_material: NDArray[np.intp]
    displacements: tuple[Displacement, ...]
    pressures: tuple[Pressure, ...]
    body_element: tuple[str, ...]
    plane_stress: bool

    @property
    def load_names(self) -> tuple[str, ...]:
        """Names of the factor inputs, each once, in the order of the file."""
        boundary: tuple[Displacement | Pressure, ...] = (*self.displacements, *self.pressures)
        return tuple(dict.fromkeys(b.name for b in boundary if b.name))


def parse_elastic(interface: Interface, spec: Mapping[str, Any]) -> ElasticSpec:
    """The model a model.json describes.  Raises ValueError naming the key, the value and what would do."""
    keys(spec, "", {"half", "format", "materials", "bodies"},
         {"tolerance", "boundary", "pairs", "element", "state"})
    if spec["half"] != "elastic" or spec["format"] != 1:
        raise ValueError(f"model.json: half {spec['half']!r}, format {spec['format']!r} is not elastic, 1")
    tolerance = number(spec.get("tolerance", DEFAULT_TOLERANCE), "tolerance", 0.0, 1.0)
    materials = {name: _material(name, m) for name, m in keys(spec["materials"], "materials", set(),
                                                              spec["materials"]).items()}
    bodies = keys(spec["bodies"], "bodies", set(interface.bodies))
    names = [known(keys(bodies[b], f"bodies.{b}", {"material"}, {"element"})["material"], f"bodies.{b}.material",
                   materials) for b in interface.bodies]
    element = known(spec.get("element", ELEMENTS[0]), "element", ELEMENTS)
    elements = tuple(known(bodies[b].get("element", element), f"bodies.{b}.element", ELEMENTS)
                     for b in interface.bodies)
    for name, pair in keys(spec.get("pairs", {}), "pairs", set(), [p.name for p in interface.pairs]).items():
        keys(pair, f"pairs.{name}", set())
    for contact in interface.pairs:
        if not contact.eps_N > 0.0:
            raise ValueError(f"interface: pair {contact.name} needs a penalty eps_N > 0 [Pa/m], "
                             f"not {contact.eps_N!r}")
    boundary = [_boundary(interface, b, f"boundary[{i}]") for i, b in enumerate(spec.get("boundary", []))]
    return ElasticSpec(tolerance, tuple(materials.values()),
                       np.array([list(materials).index(n) for n in names], dtype=np.intp),
                       tuple(b for b in boundary if isinstance(b, Displacement)),
                       tuple(b for b in boundary if isinstance(b, Pressure)), elements, _plane_stress(interface, spec))


def _plane_stress(interface: Interface, spec: Mapping[str, Any]) -> bool:
    state = known(spec.get("state", STATES[0]), "state", STATES)
    if state == "plane_stress" and interface.axisymmetric:
        raise ValueError("model.json: state plane_stress is of plane geometry, and this scene is axisymmetric")
    return state == "plane_stress"


def _material(name: str, spec: Any) -> Material:
    where = f"materials.{name}"
    keys(spec, where, {"E", "nu"}, {"alpha", "T_ref"})
    nu = number(spec["nu"], f"{where}.nu", -1.0, 0.5)
    T_ref = number(spec.get("T_ref", 0.0), f"{where}.T_ref")
    E = made(lambda E: positive_property(E, "Young's modulus"), spec["E"], f"{where}.E")
    return Material(name, E, nu, made(property_from, spec.get("alpha", 0.0), f"{where}.alpha"), T_ref)


def _boundary(interface: Interface, spec: Any, where: str) -> Displacement | Pressure:
    kind = known(keys(spec, where, {"kind"}, spec)["kind"], f"{where}.kind", ("displacement", "pressure"))
    if kind == "pressure":
        keys(spec, where, {"kind", "on", "value"}, {"name"})
        on = known(spec["on"], f"{where}.on", interface.surfaces)
        value = signal(spec["value"], f"{where}.value")
        return Pressure(on, interface.surfaces[on], value, str(spec.get("name") or ""))
    keys(spec, where, {"kind", "on", "component", "value"}, {"name"})
    nodes = nodes_on(interface, spec["on"], f"{where}.on")
    component = spec["component"]
    if isinstance(component, bool) or component not in (0, 1):
        raise ValueError(f"model.json: {where}.component must be 0 (x) or 1 (y), not {component!r}")
    return Displacement(spec["on"], nodes, int(component), signal(spec["value"], f"{where}.value"),
                        str(spec.get("name") or ""))
