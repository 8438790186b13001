"""model.json of the elastic half, checked: the model as frozen values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from contact.half.checks import keys, known, made, nodes_on, number, signal
from contact.half.functions import Property, Signal, positive_property, property_from
from contact.half.interface import Interface
from mechanical_fmu.laws.catalogue import HARDENING
from mechanical_fmu.laws.creep_norton import NortonLaw
from mechanical_fmu.laws.creep_power import PowerLaw
from mechanical_fmu.laws.hardening_linear import LinearLaw
from mechanical_fmu.laws.hardening_table import CUBIC, SLOPED, TableLaw
from mechanical_fmu.laws.hardening_voce import VoceLaw
from mechanical_fmu.laws.kinematic import KinematicLaw
from mechanical_fmu.laws.law import NOTHING, ONE, CreepLaw, IsotropicHardening
from mechanical_fmu.laws.liquid import LiquidLaw
from mechanical_fmu.laws.overstress import OverstressLaw
from mechanical_fmu.material import ELASTIC, FlowLaws, PlasticFlow, SolidMaterial

# What holds and pushes the bodies, as model.json says it, checked.

Ints = NDArray[np.int32]

KINDS = ("displacement", "pressure", "traction", "force", "gravity", "body_force")


@dataclass(frozen=True)
class Displacement:
    """Eq. (15): component of u is value(t) [m] at nodes; or of a rigid body's point, component 2 its angle [rad].

    on : the name they go by.  name : of its inputs, or "".  rigid : number among the rigid bodies, else -1.
    """

    on: str
    nodes: Ints
    component: int
    value: Signal
    name: str
    rigid: int = -1


@dataclass(frozen=True)
class Pressure:
    """Eq. (16): a pressure value(t) [Pa] that pushes on the body and follows its edges : (n, 2)."""

    on: str
    edges: Ints
    value: Signal
    name: str


@dataclass(frozen=True)
class DeadLoad:
    """One component (0 x, 1 y; 2 a moment on a rigid body) of a force that keeps size and direction.

    kind : "traction" [Pa] of reference surface; "force" [N] at nodes, shared evenly (the whole turn when axisymmetric,
    per metre of depth when plane), or on a rigid body's reference point ([N], [N m]); "gravity" [m/s2] and
    "body_force" [N/m3] of reference volume on a body.  on : surface, node set or body.  name, rigid : as above.
    """

    kind: str
    on: str
    component: int
    value: Signal
    name: str
    rigid: int = -1


Condition = Displacement | Pressure | DeadLoad


def parse_boundary(interface: Interface, spec: Any, where: str, rigid: Mapping[str, int]) -> Condition:
    """One entry of "boundary".  rigid : name of each rigid body -> its number.  Raises ValueError."""
    kind = known(keys(spec, where, {"kind"}, spec)["kind"], f"{where}.kind", KINDS)
    if kind == "pressure":
        keys(spec, where, {"kind", "on", "value"}, {"name"})
        on = known(spec["on"], f"{where}.on", interface.surfaces)
        return Pressure(on, interface.surfaces[on], signal(spec["value"], f"{where}.value"), _name(spec))
    keys(spec, where, {"kind", "on", "component", "value"}, {"name"})
    value, name = signal(spec["value"], f"{where}.value"), _name(spec)
    number = rigid.get(spec["on"], -1) if kind in ("displacement", "force") and isinstance(spec["on"], str) else -1
    component = _component(spec["component"], where, number >= 0)
    if kind == "displacement":
        nodes = np.empty(0, np.int32) if number >= 0 else nodes_on(interface, spec["on"], f"{where}.on")
        return Displacement(spec["on"], nodes, component, value, name, number)
    return DeadLoad(kind, _place(interface, spec["on"], where, kind, number), component, value, name, number)


def _place(interface: Interface, on: Any, where: str, kind: str, number: int) -> str:
    places = {"traction": list(interface.surfaces), "force": list(interface.node_sets)}
    return str(on) if number >= 0 else known(on, f"{where}.on", places.get(kind, list(interface.bodies)))


def _component(component: Any, where: str, turns: bool) -> int:
    if isinstance(component, bool) or component not in ((0, 1, 2) if turns else (0, 1)):
        choice = "0 (x), 1 (y) or 2 (angle, moment)" if turns else "0 (x) or 1 (y)"
        raise ValueError(f"model.json: {where}.component must be {choice}, not {component!r}")
    return int(component)


def _name(spec: Mapping[str, Any]) -> str:
    return str(spec.get("name") or "")


# How the mechanical half solves, as model.json says it, checked: methods, inertia, skipping.

# control.method n > 0 is METHODS[n - 1]; 0 is that of model.json.
METHODS = ("newton", "modified_newton", "bfgs", "explicit")
MASSES = ("consistent", "lumped")
# A step that fails is halved inside the half this often before it is discarded.
DEFAULT_CUTS = 4


@dataclass(frozen=True)
class Dynamics:
    """Inertia by the generalised-alpha method (Chung & Hulbert 1993); alpha_m = alpha_f = 0 is Newmark's.

    M ((1 - alpha_m) a_{n+1} + alpha_m a_n) + (1 - alpha_f) f_{n+1} + alpha_f f_n = 0, f internal less external,
    u_{n+1} = u_n + dt v_n + dt2 ((1/2 - beta) a_n + beta a_{n+1}),
    v_{n+1} = v_n + dt ((1 - gamma) a_n + gamma a_{n+1}).
    lumped : whether the mass matrix is diagonal.
    """

    beta: float = 0.25
    gamma: float = 0.5
    alpha_m: float = 0.0
    alpha_f: float = 0.0
    lumped: bool = False


@dataclass(frozen=True)
class Skip:
    """A step is skipped while what it would change is estimated below u [m], at most `most` times in a row."""

    u: float
    most: int


def parse_dynamics(spec: Any, where: str) -> Dynamics:
    """Raises ValueError naming the key, the value and what would do."""
    keys(spec, where, set(), {"beta", "gamma", "rho_inf", "alpha", "mass"})
    lumped = known(spec.get("mass", MASSES[0]), f"{where}.mass", MASSES) == "lumped"
    given = [k for k in ("beta", "rho_inf", "alpha") if k in spec or (k == "beta" and "gamma" in spec)]
    if len(given) > 1:
        raise ValueError(f"model.json: {where}: one of beta and gamma, rho_inf, alpha, not several")
    if "rho_inf" in spec:
        return damped_by_radius(_closed(spec["rho_inf"], f"{where}.rho_inf", 0.0, 1.0), lumped)
    if "alpha" in spec:
        # Hilber, Hughes & Taylor 1977.
        alpha = _closed(spec["alpha"], f"{where}.alpha", -1.0 / 3.0, 0.0)
        return Dynamics(0.25 * (1.0 - alpha) ** 2, 0.5 - alpha, 0.0, -alpha, lumped)
    beta, gamma = (number(spec.get(k, d), f"{where}.{k}", 0.0) for k, d in (("beta", 0.25), ("gamma", 0.5)))
    if gamma < 0.5 or beta < 0.5 * gamma:
        raise ValueError(f"model.json: {where}: beta {beta:g}, gamma {gamma:g} is stable for small steps only; "
                         "take gamma >= 1/2 and beta >= gamma/2, or method explicit")
    return Dynamics(beta, gamma, 0.0, 0.0, lumped)


def damped_by_radius(rho_inf: float, lumped: bool) -> Dynamics:
    """The method whose spectral radius at infinite frequency is rho_inf; order 2 whatever it is."""
    alpha_m, alpha_f = (2.0 * rho_inf - 1.0) / (rho_inf + 1.0), rho_inf / (rho_inf + 1.0)
    return Dynamics(0.25 * (1.0 - alpha_m + alpha_f) ** 2, 0.5 - alpha_m + alpha_f, alpha_m, alpha_f, lumped)


def parse_skip(spec: Any, where: str) -> Skip:
    """Raises ValueError naming the key, the value and what would do."""
    keys(spec, where, {"u", "most"})
    most = spec["most"]
    if isinstance(most, bool) or not isinstance(most, int) or most < 1:
        raise ValueError(f"model.json: {where}.most must be a whole number, 1 or more, not {most!r}")
    return Skip(number(spec["u"], f"{where}.u", 0.0), most)


def _closed(value: Any, where: str, low: float, high: float) -> float:
    found = number(value, where)
    if not low <= found <= high:
        raise ValueError(f"model.json: {where} must lie between {low:g} and {high:g}, not {value!r}")
    return found


# A material of model.json, checked and made.

Floats = NDArray[np.float64]

DEFAULT_CHI = 0.9  # Taylor and Quinney's share for metals at large strain
LAWS = tuple(law.NAME for law in HARDENING)


def parse_material(name: str, spec: Any, others: Iterable[str] = ("rho", "c")) -> SolidMaterial:
    """The material a model.json describes.  others : keys that are read elsewhere.

    Raises ValueError naming the key, the value and what would do.
    """
    where = f"materials.{name}"
    keys(spec, where, {"E", "nu"}, {"alpha", "T_ref", "plastic", "creep", "liquid", *others})
    T_ref = number(spec.get("T_ref", 0.0), f"{where}.T_ref")
    material = SolidMaterial(name, _positive(spec, "E", where, "Young's modulus"), _poisson(spec["nu"], f"{where}.nu"),
                             _property(spec, "alpha", where, NOTHING), T_ref, _flow(spec, where))
    if material.kind and (why := material.flow.refusal(_temperatures(spec, T_ref))):
        raise ValueError(f"model.json: {where}: {why}")
    return material


def _flow(spec: Mapping[str, Any], where: str) -> FlowLaws:
    if not {"plastic", "creep", "liquid"} & set(spec):
        return ELASTIC
    plastic = _plastic(spec["plastic"], f"{where}.plastic") if "plastic" in spec else None
    creep = _creep(spec["creep"], f"{where}.creep") if "creep" in spec else None
    liquid = _liquid(spec["liquid"], f"{where}.liquid") if "liquid" in spec else None
    if plastic and plastic.kinematic and creep:
        raise ValueError(f"model.json: {where}: creep does not go with a kinematic backstress, which would have to "
                         "creep too; give plastic.overstress instead of creep, or leave plastic.kinematic out")
    return FlowLaws(plastic, creep, liquid)


def _plastic(spec: Any, where: str) -> PlasticFlow:
    keys(spec, where, set(), {"yield", "hardening", "factor", "kinematic", "overstress", "chi", "softening"})
    softening = spec.get("softening", False)
    if not isinstance(softening, bool):
        raise ValueError(f"model.json: {where}.softening must be true or false, not {softening!r}")
    kinematic, overstress = None, None
    if "kinematic" in spec:
        law = keys(spec["kinematic"], f"{where}.kinematic", {"C"}, {"gamma"})
        kinematic = KinematicLaw(_property(law, "C", f"{where}.kinematic", NOTHING),
                                 _property(law, "gamma", f"{where}.kinematic", NOTHING))
    if "overstress" in spec:
        law = keys(spec["overstress"], f"{where}.overstress", {"K", "m"})
        overstress = OverstressLaw(_property(law, "K", f"{where}.overstress", NOTHING),
                                   _exponent(law["m"], f"{where}.overstress.m"))
    return PlasticFlow(_hardening(spec, where), _property(spec, "factor", where, ONE), kinematic, overstress,
                       _share(spec, "chi", where, DEFAULT_CHI), softening)


def _hardening(spec: Mapping[str, Any], where: str) -> IsotropicHardening:
    at = f"{where}.hardening"
    law = spec.get("hardening", {"law": "linear", "H": 0.0})
    kind = known(keys(law, at, {"law"}, law)["law"], f"{at}.law", LAWS)
    if kind == "table":
        if "yield" in spec:
            raise ValueError(f"model.json: {where}.yield: a table begins with the yield stress; leave it out "
                             "(factor scales the table by temperature)")
        return _curves(law, at)
    keys(spec, where, {"yield"}, spec)
    yield_stress = _positive(spec, "yield", where, "the yield stress")
    if kind == "linear":
        return LinearLaw(yield_stress, _property(keys(law, at, {"law", "H"}), "H", at, NOTHING))
    keys(law, at, {"law", "Q", "b"}, {"H"})
    b = number(law["b"], f"{at}.b", 0.0)
    return VoceLaw(yield_stress, _property(law, "Q", at, NOTHING), b, _property(law, "H", at, NOTHING))


def _curves(law: Mapping[str, Any], where: str) -> TableLaw:
    keys(law, where, {"law", "strain", "stress"}, {"T", "form", "beyond"})
    strain, T = _numbers(law["strain"], f"{where}.strain"), _numbers(law.get("T", [0.0]), f"{where}.T")
    rows = law["stress"] if "T" in law else [law["stress"]]
    if not isinstance(rows, list | tuple) or len(rows) != len(T):
        raise ValueError(f"model.json: {where}.stress needs one list for each of the {len(T)} temperatures in T")
    stress = [_numbers(row, f"{where}.stress") for row in rows]
    if strain.size < 2 or strain[0] != 0.0 or (np.diff(strain) <= 0.0).any():
        raise ValueError(f"model.json: {where}.strain must begin at 0, increase, and have at least two values")
    if (np.diff(T) <= 0.0).any():
        raise ValueError(f"model.json: {where}.T must increase")
    for row in stress:
        if row.size != strain.size or (row <= 0.0).any():
            raise ValueError(f"model.json: {where}.stress needs {strain.size} positive values, one for each strain")
    cubic = known(law.get("form", "linear"), f"{where}.form", ("linear", "cubic")) == "cubic"
    sloped = known(law.get("beyond", "flat"), f"{where}.beyond", ("flat", "slope")) == "slope"
    slope = [PchipInterpolator(strain, row).derivative()(strain) if cubic
             else np.append(d := np.diff(row) / np.diff(strain), d[-1]) for row in stress]
    return TableLaw(strain, T, np.array(stress), np.array(slope), CUBIC * cubic + SLOPED * sloped)


def _creep(spec: Any, where: str) -> CreepLaw:
    if isinstance(spec, Mapping) and "K" in spec:
        keys(spec, where, {"K", "m"}, {"heat"})
        return PowerLaw(_positive(spec, "K", where, "K"), _exponent(spec["m"], f"{where}.m"),
                        _share(spec, "heat", where, 1.0))
    keys(spec, where, {"A", "n"}, {"Q", "heat"})
    return NortonLaw(_property(spec, "A", where, NOTHING), number(spec["n"], f"{where}.n", 0.0),
                  number(spec.get("Q", 0.0), f"{where}.Q", 0.0, low_itself=True), _share(spec, "heat", where, 1.0))


def _liquid(spec: Any, where: str) -> LiquidLaw:
    keys(spec, where, {"eta", "bulk", "T_s", "T_l"}, {"shrinkage", "heat"})
    T_s, T_l = number(spec["T_s"], f"{where}.T_s", 0.0), number(spec["T_l"], f"{where}.T_l", 0.0)
    if T_s > T_l:
        raise ValueError(f"model.json: {where}: T_s = {T_s:g} K, where melting begins, must not be above "
                         f"T_l = {T_l:g} K, where it ends")
    return LiquidLaw(_positive(spec, "eta", where, "the viscosity"), _positive(spec, "bulk", where, "the bulk modulus"),
                  T_s, T_l, number(spec.get("shrinkage", 0.0), f"{where}.shrinkage", -0.5, 0.5),
                  _share(spec, "heat", where, 1.0))


def _poisson(spec: Any, where: str) -> Property:
    if not isinstance(spec, Mapping):
        return Property(number(spec, where, -1.0, 0.5))
    for value in spec.get("value", ()):
        number(value, where, -1.0, 0.5)
    return made(property_from, spec, where)


def _positive(spec: Mapping[str, Any], key: str, where: str, what: str) -> Property:
    return made(lambda s: positive_property(s, what), spec[key], f"{where}.{key}")


def _property(spec: Mapping[str, Any], key: str, where: str, default: Property) -> Property:
    return made(property_from, spec[key], f"{where}.{key}") if key in spec else default


def _share(spec: Mapping[str, Any], key: str, where: str, default: float) -> float:
    share = number(spec.get(key, default), f"{where}.{key}", 0.0, low_itself=True)
    if share > 1.0:
        raise ValueError(f"model.json: {where}.{key} is a share, from 0 to 1, not {share!r}")
    return share


def _exponent(value: Any, where: str) -> float:
    m = number(value, where, 0.0)
    if m > 1.0:
        raise ValueError(f"model.json: {where} must lie above 0 and be at most 1, not {value!r}")
    return m


def _numbers(values: Any, where: str) -> Floats:
    if not isinstance(values, list | tuple) or not values:
        raise ValueError(f"model.json: {where} must be a list of numbers, not {values!r}")
    return np.array([number(v, f"{where}[{i}]") for i, v in enumerate(values)])


def _temperatures(spec: Any, T_ref: float) -> Floats:
    """Temperatures at which the tables inside a spec have knots; T_ref (or 1 K) where there are none.  Ascending."""
    found: set[float] = set()
    todo = [spec]
    while todo:
        part = todo.pop()
        if isinstance(part, Mapping):
            if isinstance(part.get("T"), list | tuple):
                found |= {float(T) for T in part["T"]}
            todo += part.values()
    return np.array(sorted(T for T in found if T > 0.0) or [max(T_ref, 1.0)])


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
    enforcement : a name of enforcement.ENFORCEMENTS.
    """

    tolerance: float
    materials: tuple[SolidMaterial, ...]
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
    enforcement: str

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
    augmented, enforcement = _augmented(interface, spec)
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
        augmented=augmented, enforcement=enforcement))


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


def _augmented(interface: Interface, spec: Mapping[str, Any]) -> tuple[dict[str, float], str]:
    """The share of each augmented pair, and the enforcement of all."""
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
    return augmented, next(iter(methods.values()), "penalty")


def _body(spec: Mapping[str, Any], where: str) -> BodySpec:
    rigid = _flag(spec, "rigid", f"{where}.")
    reference = None
    if "reference" in spec:
        if not rigid:
            raise ValueError(f"model.json: {where}.reference: only a rigid body has one")
        x, y = _few_numbers(spec["reference"], f"{where}.reference", (2,))
        reference = (x, y)
    v0 = (*_few_numbers(spec.get("v0", (0.0, 0.0)), f"{where}.v0", (2, 3)), 0.0)
    drawn_at = number(spec["drawn_at"], f"{where}.drawn_at", 0.0) if "drawn_at" in spec else None
    return BodySpec(rigid, reference, (v0[0], v0[1], v0[2]), drawn_at)


def _few_numbers(spec: Any, where: str, lengths: tuple[int, ...]) -> tuple[float, ...]:
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
