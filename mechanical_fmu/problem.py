"""model.json of the elastic half, checked: the model as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.checks import keys, known, made, number
from contact.half.interface import Interface
from contact.half.property import Property, positive_property
from mechanical_fmu.boundary_spec import DeadLoad, Displacement, Pressure, parse_boundary
from mechanical_fmu.material import Material
from mechanical_fmu.material_spec import parse_material
from mechanical_fmu.method_spec import DEFAULT_CUTS, METHODS, Dynamics, Skip, parse_dynamics, parse_skip

DEFAULT_TOLERANCE = 1e-8
# How the pressures of augmented pairs are found; the first is that of a plain number.
AUGMENTED = ("uzawa", "semi_smooth")
# The first of each is the default.  "plane_strain" is also what an axisymmetric scene has.
ELEMENTS = ("mean_dilatation", "enhanced")
STATES = ("plane_strain", "plane_stress")
MOST_CUTS = 12  # 2^-12 of a step is no step any more


@dataclass(frozen=True)
class BodySpec:
    """What a body is beside its material.

    rigid : it keeps its shape.  reference : the point its motion is told of [m], None for the centre of its volume.
    v0 : velocity at the start along x and y [m/s] and turning [rad/s] about the reference.  Eq. (21).
    drawn_at : the temperature [K] at which the body has the shape of the mesh, None where that is the material's T_ref.
    """

    rigid: bool = False
    reference: tuple[float, float] | None = None
    v0: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drawn_at: float | None = None


@dataclass(frozen=True)
class ElasticSpec:
    """All of model.json.  body_material : (n_bodies,) index into materials, in the order of interface.bodies.

    body_element : (n_bodies,) names of ELEMENTS.  plane_stress : no stress through the thickness (plane geometry).
    bodies : of each body.  dead : the dead loads.  method : name of METHODS.  cuts : how often a step is halved inside.
    dynamics : None where inertia is left out.  skip : None where every step is solved.
    rho : (n_materials,) [kg/m3], nan where not said.  c : heat capacities [J/kgK] where said.
    thermoelastic_heat : whether E_M has it.  adiabatic : whether steps at frozen entropy can be asked for.
    augmented : pairs whose pressures are driven to no penetration -> to which share of the largest they must settle.
    at_once : whether Newton's method solves for them too (semi_smooth), not Uzawa's rounds around it.
    """

    tolerance: float
    materials: tuple[Material, ...]
    body_material: NDArray[np.intp]
    displacements: tuple[Displacement, ...]
    pressures: tuple[Pressure, ...]
    body_element: tuple[str, ...]
    plane_stress: bool
    bodies: tuple[BodySpec, ...]
    dead: tuple[DeadLoad, ...]
    method: str
    cuts: int
    dynamics: Dynamics | None
    skip: Skip | None
    rho: NDArray[np.float64]
    c: tuple[Property | None, ...]
    thermoelastic_heat: bool
    adiabatic: bool
    augmented: Mapping[str, float]
    at_once: bool

    @property
    def load_names(self) -> tuple[str, ...]:
        """Names of the inputs load.<name> and bc.<name>, each once, in the order of the file."""
        boundary: tuple[Displacement | Pressure | DeadLoad, ...] = (*self.displacements, *self.pressures, *self.dead)
        return tuple(dict.fromkeys(b.name for b in boundary if b.name))

    @property
    def rigid(self) -> dict[int, tuple[float, float] | None]:
        """Rigid bodies: index -> reference point."""
        return {i: b.reference for i, b in enumerate(self.bodies) if b.rigid}

    @property
    def inert(self) -> bool:
        """Whether mass matters."""
        return self.dynamics is not None or self.method == "explicit"


def parse_elastic(interface: Interface, spec: Mapping[str, Any]) -> ElasticSpec:
    """The model a model.json describes.  Raises ValueError naming the key, the value and what would do."""
    keys(spec, "", {"half", "format", "materials", "bodies"},
         {"tolerance", "boundary", "pairs", "element", "state", "method", "cuts", "dynamics", "skip",
          "thermoelastic_heat", "adiabatic"})
    if spec["half"] != "elastic" or spec["format"] != 1:
        raise ValueError(f"model.json: half {spec['half']!r}, format {spec['format']!r} is not elastic, 1")
    materials = keys(spec["materials"], "materials", set(), spec["materials"])
    bodies = keys(spec["bodies"], "bodies", set(interface.bodies))
    for b in interface.bodies:
        keys(bodies[b], f"bodies.{b}", {"material"}, {"element", "rigid", "reference", "v0", "drawn_at"})
    names = [known(bodies[b]["material"], f"bodies.{b}.material", materials) for b in interface.bodies]
    augmented, at_once = _augmented(interface, spec)
    of_bodies = tuple(_body(bodies[b], f"bodies.{b}") for b in interface.bodies)
    rigid = [b for b, body in zip(interface.bodies, of_bodies, strict=True) if body.rigid]
    boundary = [parse_boundary(interface, b, f"boundary[{i}]", {name: k for k, name in enumerate(rigid)})
                for i, b in enumerate(spec.get("boundary", []))]
    element = known(spec.get("element", ELEMENTS[0]), "element", ELEMENTS)
    return _checked(interface, ElasticSpec(
        tolerance=number(spec.get("tolerance", DEFAULT_TOLERANCE), "tolerance", 0.0, 1.0),
        materials=tuple(parse_material(name, m) for name, m in materials.items()),
        body_material=np.array([list(materials).index(n) for n in names], dtype=np.intp),
        displacements=tuple(b for b in boundary if isinstance(b, Displacement)),
        pressures=tuple(b for b in boundary if isinstance(b, Pressure)),
        body_element=tuple(known(bodies[b].get("element", element), f"bodies.{b}.element", ELEMENTS)
                           for b in interface.bodies),
        plane_stress=_plane_stress(interface, spec), bodies=of_bodies,
        dead=tuple(b for b in boundary if isinstance(b, DeadLoad)),
        method=known(spec.get("method", METHODS[0]), "method", METHODS),
        cuts=_cuts(spec.get("cuts", DEFAULT_CUTS)),
        dynamics=parse_dynamics(spec["dynamics"], "dynamics") if "dynamics" in spec else None,
        skip=parse_skip(spec["skip"], "skip") if "skip" in spec else None,
        rho=np.array([_rho(name, m) for name, m in materials.items()]),
        c=tuple(_heat_capacity(name, m) for name, m in materials.items()),
        thermoelastic_heat=_flag(spec, "thermoelastic_heat", ""), adiabatic=_flag(spec, "adiabatic", ""),
        augmented=augmented, at_once=at_once))


def _checked(interface: Interface, spec: ElasticSpec) -> ElasticSpec:
    """The spec, if everything that needs a density or a heat capacity has one.  Raises ValueError."""
    everybody = range(len(interface.bodies))
    weighed = {interface.bodies.index(d.on): "gravity" for d in spec.dead if d.kind == "gravity"}
    weighed |= dict.fromkeys(everybody, "inertia") if spec.inert else {}
    weighed |= dict.fromkeys(everybody, "adiabatic") if spec.adiabatic else {}
    for body, why in weighed.items():
        i = int(spec.body_material[body])
        for key, missing in (("rho", np.isnan(spec.rho[i])), ("c", spec.adiabatic and spec.c[i] is None)):
            if missing:
                raise ValueError(f"model.json: materials.{spec.materials[i].name}: key {key!r} is missing, "
                                 f"which {why} needs")
    for name, body_spec in zip(interface.bodies, spec.bodies, strict=True):
        if any(body_spec.v0) and not spec.inert:
            raise ValueError(f"model.json: bodies.{name}.v0: without dynamics a body has no velocity")
    if spec.skip is not None and spec.inert:
        raise ValueError("model.json: skip: with inertia every step must be solved")
    return spec


def _augmented(interface: Interface, spec: Mapping[str, Any]) -> tuple[dict[str, float], bool]:
    """The share of each augmented pair, and whether their pressures are solved for at once."""
    augmented: dict[str, float] = {}
    methods: dict[str, str] = {}
    for name, pair in keys(spec.get("pairs", {}), "pairs", set(), [p.name for p in interface.pairs]).items():
        keys(pair, f"pairs.{name}", set(), {"augmented"})
        value, at = pair.get("augmented"), f"pairs.{name}.augmented"
        if isinstance(value, Mapping):
            keys(value, at, {"share"}, {"method"})
            methods[name] = known(value.get("method", AUGMENTED[0]), f"{at}.method", AUGMENTED)
            augmented[name] = number(value["share"], f"{at}.share", 0.0, 1.0)
        elif value is not None:
            methods[name], augmented[name] = AUGMENTED[0], number(value, at, 0.0, 1.0)
    # fault: different ways to settle taken as one -> if False: | mechanical_fmu/test_semi_smooth
    if len(set(methods.values())) > 1:
        raise ValueError("model.json: pairs: all augmented pairs are solved together and need one method, not "
                         + ", ".join(f"{method} ({name})" for name, method in methods.items()))
    for contact in interface.pairs:
        if not contact.eps_N > 0.0:
            raise ValueError(f"interface: pair {contact.name} needs a penalty eps_N > 0 [Pa/m], "
                             f"not {contact.eps_N!r}")
    return augmented, "semi_smooth" in methods.values()


def _body(spec: Mapping[str, Any], where: str) -> BodySpec:
    rigid = _flag(spec, "rigid", f"{where}.")
    reference = None
    if "reference" in spec:
        if not rigid:
            raise ValueError(f"model.json: {where}.reference: only a rigid body has one")
        x, y = _numbers(spec["reference"], f"{where}.reference", (2,))
        reference = (x, y)
    v0 = (*_numbers(spec.get("v0", (0.0, 0.0)), f"{where}.v0", (2, 3)), 0.0)
    drawn_at = number(spec["drawn_at"], f"{where}.drawn_at", 0.0) if "drawn_at" in spec else None
    return BodySpec(rigid, reference, (v0[0], v0[1], v0[2]), drawn_at)


def _numbers(spec: Any, where: str, lengths: tuple[int, ...]) -> tuple[float, ...]:
    if not isinstance(spec, list | tuple) or len(spec) not in lengths:
        raise ValueError(f"model.json: {where} must be a list of {' or '.join(map(str, lengths))} numbers, "
                         f"not {spec!r}")
    return tuple(number(v, f"{where}[{i}]") for i, v in enumerate(spec))


def _flag(spec: Mapping[str, Any], key: str, where: str) -> bool:
    value = spec.get(key, False)
    if not isinstance(value, bool):
        raise ValueError(f"model.json: {where}{key} must be true or false, not {value!r}")
    return value


def _cuts(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= MOST_CUTS:
        raise ValueError(f"model.json: cuts must be a whole number from 0 to {MOST_CUTS}, not {value!r}")
    return value


def _plane_stress(interface: Interface, spec: Mapping[str, Any]) -> bool:
    state = known(spec.get("state", STATES[0]), "state", STATES)
    if state == "plane_stress" and interface.axisymmetric:
        raise ValueError("model.json: state plane_stress is of plane geometry, and this scene is axisymmetric")
    return state == "plane_stress"


def _rho(name: str, spec: Mapping[str, Any]) -> float:
    return number(spec["rho"], f"materials.{name}.rho", 0.0) if "rho" in spec else float("nan")


def _heat_capacity(name: str, spec: Mapping[str, Any]) -> Property | None:
    if "c" not in spec:
        return None
    return made(lambda c: positive_property(c, "the heat capacity"), spec["c"], f"materials.{name}.c")
