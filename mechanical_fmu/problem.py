"""The problem of the elastic half as it is solved: what model.json states, with nodes, edges and functions in it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half import checks
from contact.half.functions import Field, Property, Signal, field_from, property_from, signal_from
from contact.half.interface import Interface
from contact.half.prescribed import Turn, turn_from
from contact.problem import flow, material, mechanical
from contact.problem.boundary import FORCES, MOTIONS, TRACTIONS, WEIGHTS
from contact.problem.curves import Phases, PropertyTable
from contact.problem.errors import demand, made, read
from contact.problem.mechanical import ElasticProblem
from contact.problem.part import Part
from mechanical_fmu.laws.catalogue import hardening_law
from mechanical_fmu.laws.creep import NortonLaw, PowerLaw
from mechanical_fmu.laws.hardening import KinematicLaw, OverstressLaw
from mechanical_fmu.laws.law import NOTHING, ONE, CreepLaw
from mechanical_fmu.laws.liquid import LiquidLaw
from mechanical_fmu.material import ELASTIC, FlowLaws, PlasticFlow, SolidMaterial

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# control.method n > 0 is METHODS[n - 1]; 0 is that of model.json.
METHODS = tuple(method.value for method in mechanical.Solution)


@dataclass(frozen=True)
class Displacement:
    """Eq. (15): component of u is value(X, t) [m] at nodes; or of a rigid body's point, component 2 its angle [rad].

    on : the name they go by.  name : of its inputs, or "".  rigid : number among the rigid bodies, else -1.
    turn : what follows on the displacement of both components, one object for all components of an entry.
    until : [s] when it is released, or the name of the pair that releases it by closing; None: never.
    """

    on: str
    nodes: Ints
    component: int
    value: Field
    name: str
    rigid: int = -1
    turn: Turn | None = None
    until: float | str | None = None


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


@dataclass(frozen=True)
class DynamicsOptions:
    """Inertia by the generalised-alpha method (Chung & Hulbert 1993); alpha_m = alpha_f = 0 is Newmark's.

    M ((1 - alpha_m) a_{n+1} + alpha_m a_n) + (1 - alpha_f) f_{n+1} + alpha_f f_n = 0, f internal less external,
    u_{n+1} = u_n + dt v_n + dt2 ((1/2 - beta) a_n + beta a_{n+1}),
    v_{n+1} = v_n + dt ((1 - gamma) a_n + gamma a_{n+1}).
    lumped : whether the mass matrix is diagonal.  contact_mass_behind : whether nodes of contact surfaces have none
    (contact_mass.py).
    """

    beta: float = 0.25
    gamma: float = 0.5
    alpha_m: float = 0.0
    alpha_f: float = 0.0
    lumped: bool = False
    contact_mass_behind: bool = True


@dataclass(frozen=True)
class ElasticSpec:
    """A scene as it is solved: what model.json states, and what of it has nodes, edges or curves.

    bodies : as they are stated, in the order of interface.bodies.  part_material : (n_parts,) index into materials of
    interface.parts, drawn_at : where their mesh has its shape (ElasticBody).
    displacements, pressures, dead : the conditions, a component each.  dynamics : None where inertia is left out.
    rho : (n_materials,) [kg/m3], nan where not said.  c : heat capacities [J/kgK] where said.
    """

    stated: ElasticProblem
    bodies: tuple[mechanical.ElasticBody, ...]
    materials: tuple[SolidMaterial, ...]
    part_material: NDArray[np.intp]
    drawn_at: tuple[Any, ...]
    displacements: tuple[Displacement, ...]
    pressures: tuple[Pressure, ...]
    dead: tuple[DeadLoad, ...]
    dynamics: DynamicsOptions | None
    rho: NDArray[np.float64]
    c: tuple[Property | None, ...]

    @cached_property
    def augmented(self) -> dict[str, float]:
        """Find the pairs driven to no penetration: name -> to which share of the largest pressure they must settle."""
        return {name: p.augmented.tolerance for name, p in self.stated.pairs.items() if p.augmented is not None}

    @cached_property
    def enforcement(self) -> str:
        """Return a name of enforcement.ENFORCEMENTS: that of the augmented pairs, which is one."""
        ways = [pair.augmented.method.value for pair in self.stated.pairs.values() if pair.augmented is not None]
        # fault: rounds asked for, solved at once -> return "semi_smooth" if ways else "penalty" |
        #   coupler/test_scenario_contact mechanical_fmu/test_semi_smooth
        return next(iter(ways), "penalty")

    @property
    def load_names(self) -> tuple[str, ...]:
        """List the names of the inputs load.<name> and bc.<name>, each once, in the order of the file."""
        boundary: tuple[Displacement | Pressure | DeadLoad, ...] = (*self.displacements, *self.pressures, *self.dead)
        turns = [d.turn.name for d in self.displacements if d.turn is not None]
        return tuple(dict.fromkeys(name for name in (*(b.name for b in boundary), *turns) if name))

    @property
    def rigid(self) -> dict[int, tuple[float, float] | None]:
        """Return the rigid bodies: index -> reference point [m]."""
        return {i: b.reference for i, b in enumerate(self.bodies) if b.rigid}


def parse_elastic(interface: Interface, spec: Mapping[str, Any]) -> ElasticSpec:
    """Make the model that a model.json describes.  Raises ValueError naming every key that is wrong."""
    return _spec(interface, read(ElasticProblem, spec, "elastic"))


def parse_foreign(interface: Interface, spec: Mapping[str, Any]) -> ElasticSpec:
    """Make the model that a model.json of a half of another package describes, for a MechanicalVolume.

    Raises ValueError naming every key that is wrong, and what of the scene no MechanicalVolume can be asked for.
    """
    problem = read(mechanical.ForeignMechanical, spec, str(spec.get("half")))
    used = {part.material for part in problem.parts.values()}
    problem = problem.model_copy(update={"materials": {n: m for n, m in problem.materials.items() if n in used}})
    memory = [f"materials.{n}.{key}" for n, m in problem.materials.items() for key in ("plastic", "creep", "liquid")
              if getattr(m, key) is not None]
    rigid = [f"bodies.{n}.rigid" for n, body in problem.bodies.items() if body.rigid]
    heat = [key for key in ("thermoelastic_heat", "adiabatic") if getattr(problem, key)]
    explicit = ["method: explicit"] if problem.method is mechanical.Solution.EXPLICIT else []
    if never := [*memory, *rigid, *heat, *explicit]:
        raise ValueError(f"model.json: {', '.join(never)}: a MechanicalVolume has forces by displacements and "
                         "temperatures alone; choose the half elastic")
    return _spec(interface, problem)


def _spec(interface: Interface, problem: ElasticProblem) -> ElasticSpec:
    demand(checks.elastic_wrongs(problem, interface))
    bodies, names = tuple(problem.bodies[b] for b in interface.bodies), list(problem.materials)
    rigid = {name: k for k, name in enumerate(n for n in interface.bodies if problem.bodies[n].rigid)}
    conditions = [one for b in problem.boundary for one in _conditions(interface, b, rigid)]
    conditions += _gravity(interface, problem.gravity)
    materials = problem.materials.values()
    return ElasticSpec(
        stated=problem, bodies=bodies,
        materials=tuple(made_material(name, m) for name, m in problem.materials.items()),
        part_material=np.array([names.index(problem.parts[p].material) for p in interface.parts], dtype=np.intp),
        drawn_at=tuple(problem.parts[p].drawn_at for p in interface.parts),
        displacements=tuple(b for b in conditions if isinstance(b, Displacement)),
        pressures=tuple(b for b in conditions if isinstance(b, Pressure)),
        dead=tuple(b for b in conditions if isinstance(b, DeadLoad)),
        dynamics=None if problem.dynamics is None else _dynamics(problem.dynamics, problem.method),
        rho=np.array([float("nan") if m.rho is None else m.rho for m in materials]),
        c=tuple(_one_phase(m.c) for m in materials))


def _conditions(interface: Interface, b: mechanical.ElasticBoundary, rigid: Mapping[str, int]) -> Iterator[Condition]:
    """Every component of one entry of "boundary".  rigid : name of each rigid body -> its number."""
    on, name = str(b.on or b.at or b.body), b.name or ""
    if b.pressure is not None:
        yield Pressure(on, interface.surfaces[on], signal_from(b.pressure), name)
    yield from _displacements(interface, b, rigid.get(on, -1) if b.body is not None else -1)
    for kind, keys in (("traction", TRACTIONS), ("force", FORCES), ("body_force", WEIGHTS)):
        number = rigid.get(on, -1) if b.body is not None and kind == "force" else -1
        for i, key in enumerate(keys):
            if (value := getattr(b, key)) is not None:
                yield DeadLoad(kind, on, i, signal_from(value), name, number)


def _displacements(interface: Interface, b: mechanical.ElasticBoundary, number: int) -> Iterator[Displacement]:
    """The components that an entry prescribes: those it states; with a rotation all.  number : of its rigid body."""
    on, name = str(b.on or b.at or b.body), b.name or ""
    if number >= 0:
        nodes = np.empty(0, np.int32)
    elif b.body is not None:
        nodes = np.flatnonzero(interface.node_body == interface.bodies.index(on)).astype(np.int32)
    else:
        nodes = np.unique((interface.surfaces if b.on is not None else interface.node_sets)[on]).astype(np.int32)
    turn = turn_from(b.rotation, name)
    until = next(iter(b.until)) if isinstance(b.until, dict) else b.until
    for i, key in enumerate(MOTIONS):
        value = getattr(b, key)
        if b.rotation is not None and i < 2:
            yield Displacement(on, nodes, i, field_from(0.0 if value is None else value), "", number, turn,
                               until)
        elif b.rotation is not None and number >= 0:
            yield Displacement(on, nodes, i, field_from(b.rotation.angle), name, number, None, until)
        elif value is not None:
            yield Displacement(on, nodes, i, field_from(value), name, number, None, until)


def _gravity(interface: Interface, gravity: mechanical.Gravity | None) -> list[Condition]:
    """One dead load a body and component; a name stands for all of them."""
    if gravity is None:
        return []
    return [DeadLoad("gravity", body, i, signal_from(spec), gravity.name or "")
            for i, spec in enumerate((gravity.x, gravity.y)) if spec != 0.0 for body in interface.bodies]


def _dynamics(spec: mechanical.Dynamics, method: mechanical.Solution) -> DynamicsOptions:
    lumped = spec.mass is mechanical.Mass.LUMPED
    # An explicit step divides by the mass of every node.
    behind = (spec.contact_mass is mechanical.ContactMass.BEHIND) and method is not mechanical.Solution.EXPLICIT
    if spec.rho_inf is not None:
        # The spectral radius at infinite frequency is rho_inf; of order 2 whatever it is.
        alpha_m, alpha_f = ((2.0 * spec.rho_inf - 1.0) / (spec.rho_inf + 1.0), spec.rho_inf / (spec.rho_inf + 1.0))
        return DynamicsOptions(0.25 * (1.0 - alpha_m + alpha_f) ** 2, 0.5 - alpha_m + alpha_f, alpha_m, alpha_f, lumped,
                               behind)
    if spec.alpha is not None:
        # Hilber, Hughes & Taylor 1977.
        return DynamicsOptions(0.25 * (1.0 - spec.alpha) ** 2, 0.5 - spec.alpha, 0.0, -spec.alpha, lumped, behind)
    return DynamicsOptions(spec.beta or 0.25, spec.gamma or 0.5, 0.0, 0.0, lumped, behind)


# Materials


def parse_material(name: str, spec: Mapping[str, Any]) -> SolidMaterial:
    """Make the material that an entry of model.json describes.  Raises ValueError naming every key that is wrong."""
    return made_material(name, made(material.Material, spec, ("model.json:", "materials", name)))


def made_material(name: str, spec: material.Material) -> SolidMaterial:
    """Make a material.  Raises ValueError where it cannot flow as it should at the temperatures of its tables."""
    assert spec.E is not None, "asked for by fit"
    assert spec.nu is not None, "asked for by fit"
    T_ref = spec.T_ref or 0.0
    made = SolidMaterial(name, property_from(spec.E), property_from(spec.nu), _property(spec.alpha, NOTHING), T_ref,
                    _flow(spec))
    if made.kind and (why := made.flow.refusal(_temperatures(spec, T_ref))):
        raise ValueError(f"model.json: materials.{name}: {why}")
    return made


def _flow(spec: material.Material) -> FlowLaws:
    if spec.plastic is None and spec.creep is None and spec.liquid is None:
        return ELASTIC
    plastic = None if spec.plastic is None else _plastic(spec.plastic)
    creep = None if spec.creep is None else _creep(spec.creep)
    liquid = None if spec.liquid is None else _liquid(spec.liquid)
    return FlowLaws(plastic, creep, liquid)


def _plastic(spec: flow.Plastic) -> PlasticFlow:
    hardening, kinematic, overstress = hardening_law(spec), None, None
    if spec.kinematic is not None:
        kinematic = KinematicLaw(property_from(spec.kinematic.C), _property(spec.kinematic.gamma, NOTHING))
    if spec.overstress is not None:
        overstress = OverstressLaw(property_from(spec.overstress.K), spec.overstress.m)
    return PlasticFlow(hardening, _property(spec.factor, ONE), kinematic, overstress, spec.chi, spec.softening)


def _creep(spec: flow.Creep) -> CreepLaw:
    if spec.K is not None and spec.m is not None:
        return PowerLaw(property_from(spec.K), spec.m, spec.heat)
    assert spec.A is not None, "checked by the class"
    assert spec.n is not None, "checked by the class"
    return NortonLaw(property_from(spec.A), spec.n, spec.Q or 0.0, spec.heat)


def _liquid(spec: flow.Liquid) -> LiquidLaw:
    return LiquidLaw(property_from(spec.eta), property_from(spec.bulk), spec.T_s, spec.T_l, spec.shrinkage, spec.heat)


def _one_phase(c: Any) -> Property | None:
    """The heat capacity, where it is one for all phases."""
    return None if c is None or isinstance(c, Phases) else property_from(c)


def _property(spec: Any, default: Property) -> Property:
    return default if spec is None else property_from(spec)


def _temperatures(spec: Part, T_ref: float) -> Floats:
    """Temperatures at which the tables inside a material have knots; T_ref (or 1 K) where there are none."""
    found: set[float] = set()
    todo: list[Any] = [spec]
    while todo:
        part = todo.pop()
        if isinstance(part, PropertyTable | flow.TableHardening):
            found |= set(part.T or ())
        if isinstance(part, Part):
            todo += [getattr(part, name) for name in type(part).model_fields]
    return np.array(sorted(T for T in found if T > 0.0) or [max(T_ref, 1.0)])
