"""The halves whose displacements need no equilibrium of a mesh: bodies that are rigid, and rods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half import checks
from contact.half.columns import SAME, Columns, columns_of
from contact.half.contact_client import ContactRefusedError, ContactSurfaces
from contact.half.functions import Property, Signal, property_from, signal_from
from contact.half.interface import Interface
from contact.half.model import Discard, Done, Link, Value, Values, Variable
from contact.half.prescribed import Turn, turn_from
from contact.problem.errors import demand, read
from contact.problem.material import Material
from contact.problem.mechanical import Held, Motion, RigidProblem, RodProblem
from mechanical_fmu.contact import contact_variables

Floats = NDArray[np.float64]


# The rigid half: bodies that move as prescribed, x = X + u(t), and touch with a prescribed pressure.

# A pair touches where a facing gap is no more than this share of the scene: coordinates and motions in a file are
# rounded.
TOUCH = 1e-9


@dataclass(frozen=True)
class RigidState:
    """t [s]: where the bodies are follows from it."""

    t: float


@dataclass(frozen=True)
class RigidSpec:
    """motion : (u_x, u_y) of every body of the interface [m].  pressure : of every pair [Pa], >= 0, or None.

    turns : what follows on the displacement of every body, None without.
    """

    motion: tuple[tuple[Signal, Signal], ...]
    pressure: tuple[Signal | None, ...]
    turns: tuple[Turn | None, ...]


class RigidHalf:
    """HalfModel of bodies that follow signals.  It knows no temperature, and its contact no forces."""

    def __init__(self, interface: Interface, spec: RigidSpec) -> None:
        self.interface, self.spec, self.contact = interface, spec, ContactSurfaces(interface)
        # fault: what touches is a fixed length -> self._touch = TOUCH | mechanical_fmu/test_rigid
        self._touch = TOUCH * float(np.ptp(interface.nodes, axis=0).max())
        n_q = interface.pair_nodes.size
        x = Variable("x", (len(interface.nodes), 2), unit="m", start=interface.nodes, description="current coordinates",
                     on="nodes")
        self.variables = (x, *(contact_variables(n_q) if n_q else ()))

    def start(self, inputs: Values, t: float, link: Link) -> tuple[RigidState, Mapping[str, Value]]:
        """Compute the positions at t, after a jump there.  Raises ContactRefusedError."""
        return RigidState(t), self._outputs(t, 1, link)

    def step(self, state: RigidState, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        """Compute the positions at t + h, before a jump there."""
        try:
            return Done(RigidState(t + h), self._outputs(t + h, -1, link))
        except ContactRefusedError as exc:
            return Discard(str(exc), 0.5 * h)

    def _outputs(self, t: float, side: int, link: Link) -> dict[str, Value]:
        u = np.array([[s.at(t, side) for s in signals] for signals in self.spec.motion] + [[0.0, 0.0]])
        x = self.interface.nodes + u[self.interface.node_body]
        for body, turn in enumerate(self.spec.turns):
            if turn is not None:
                here = self.interface.node_body == body
                X = self.interface.nodes[here]
                x[here] = X + turn.displaced(X, u[body], turn.angle.at(t, side))
        if not self.interface.pairs:
            return {"x": x}
        facing = self.contact.facing(link, x)
        t_N, touching = np.zeros(self.interface.pair_nodes.size), 0
        for i, pressure in enumerate(self.spec.pressure):
            met = facing.gap[facing.pair == i]
            p = 0.0 if pressure is None else pressure.at(t, side)
            # fault: rigid pressure without touching -> if p > 0.0 and met.size: | mechanical_fmu/test_rigid
            if p > 0.0 and met.size and met.min() <= self._touch:
                # On the whole surfaces: a facing point takes it from its edge's nodes, some of which face nothing.
                # fault: rigid pressure on the slave only -> t_N[(self.contact.pair_nodes.pair == i) &
                #   (self.contact.pair_nodes.searched == 1)] = -p | mechanical_fmu/test_rigid
                t_N[self.contact.pair_nodes.pair == i] = -p
                touching += met.size
        return {"x": x, "contact.t_N": t_N, "contact.gap": facing.node_gap, "contact.covered": facing.node_covered,
                "contact.touching": float(touching)}


def load_rigid(interface: Interface, model: Mapping[str, Any]) -> RigidHalf:
    """Make the rigid half of an interface and a model.json.  Raises ValueError naming what is wrong."""
    return RigidHalf(interface, parse_rigid(interface, model))


def parse_rigid(interface: Interface, spec: Mapping[str, Any]) -> RigidSpec:
    """Make the model that a model.json describes.  Raises ValueError naming every key that is wrong."""
    problem = read(RigidProblem, spec, "rigid")
    demand(checks.rigid_wrongs(problem, interface))
    still = Motion()
    motions = [problem.motion.get(name, still) for name in interface.bodies]
    return RigidSpec(tuple((signal_from(m.u_x), signal_from(m.u_y)) for m in motions),
                     tuple(signal_from(problem.pressure[p.name]) if p.name in problem.pressure else None
                           for p in interface.pairs),
                     tuple(turn_from(m.rotation) for m in motions))


# The mechanical rod: bodies along x that expand, shrink as they freeze, meet at their ends and press; quasi-static.
#
# Without forces on its sides a rod carries one stress over its length, so its displacement is an integral: u(x) =
# u_held + int (eps_th - p/E) dx, p > 0 in compression.  Where two ends meet, the pressure that just closes the
# overlap of the free rods is p = overlap/(C_left + C_right), C = int dx/E: exact, with no penalty.

# model.json of the half `mechanical_rod`, checked.

@dataclass(frozen=True)
class RodMaterial:
    """alpha : mean expansion from T_ref [1/K].  E : [Pa], None: it does not give way.

    shrinkage : linear strain of solidification, 0 where it does not melt.  melts : whether it was poured, so that its
    mesh has the shape of the start, not of T_ref.
    """

    alpha: Property
    T_ref: float
    E: Property | None
    shrinkage: float
    melts: bool


@dataclass(frozen=True)
class RodBody:
    """left, right : displacement of a held end [m], None where it is free."""

    name: str
    material: RodMaterial
    left: Signal | None
    right: Signal | None


@dataclass(frozen=True)
class Meeting:
    """A contact pair: the right end of one body faces the left end of another."""

    left: int
    right: int


@dataclass(frozen=True)
class RodSpec:
    """bodies, pairs : in the order of the interface."""

    bodies: tuple[RodBody, ...]
    pairs: tuple[Meeting, ...]


def parse_rod(interface: Interface, columns: Columns, spec: Mapping[str, Any]) -> RodSpec:
    """Make the model that a model.json describes.  Raises ValueError naming every key that is wrong."""
    problem = read(RodProblem, spec, "mechanical_rod")
    demand(checks.rod_wrongs(problem, interface))
    materials = {name: _material(m) for name, m in problem.materials.items()}
    parsed = tuple(_body(name, materials[problem.bodies[name].material], problem.held[name])
                   for name in interface.bodies)
    return RodSpec(parsed, _meetings(interface, columns, parsed))


def _material(spec: Material) -> RodMaterial:
    assert spec.alpha is not None, "asked for by fit"
    return RodMaterial(property_from(spec.alpha), spec.T_ref or 0.0, None if spec.E is None else property_from(spec.E),
                       0.0 if spec.liquid is None else spec.liquid.shrinkage, spec.liquid is not None)


def _body(name: str, material: RodMaterial, held: Held) -> RodBody:
    left, right = (None if spec is None else signal_from(spec) for spec in (held.left, held.right))
    return RodBody(name, material, left, right)


def _meetings(interface: Interface, columns: Columns, bodies: tuple[RodBody, ...]) -> tuple[Meeting, ...]:
    """Who ends where whom begins.  Raises ValueError where a pair is not of two ends, or an end meets twice."""
    found: list[Meeting] = []
    for pair in interface.pairs:
        ends = dict(_end(interface, columns, surface, pair.name) for surface in (pair.slave, pair.master))
        if set(ends) != {"left", "right"}:
            raise ValueError(f"contact {pair.name!r}: the right end of one rod must face the left end of another")
        meeting = Meeting(ends["right"], ends["left"])
        if any(m.left == meeting.left or m.right == meeting.right for m in found):
            raise ValueError(f"contact {pair.name!r}: an end of a rod may meet one other only")
        a, b = bodies[meeting.left], bodies[meeting.right]
        low, high = (columns.heights(interface.nodes)[c] for c in
                     (columns.first[meeting.left + 1] - 1, columns.first[meeting.right]))
        if abs(low - high) > SAME * low:
            raise ValueError(f"contact {pair.name!r}: rods that press need equal heights, not {low:g} and {high:g} m")
        if (a.right is not None or a.material.E is None) and (b.left is not None or b.material.E is None):
            raise ValueError(f"contact {pair.name!r}: nothing could give way; give the material of {a.name!r} or "
                             f"{b.name!r} an E, and leave that end free")
        found.append(meeting)
    return tuple(found)


def _end(interface: Interface, columns: Columns, surface: str, pair: str) -> tuple[str, int]:
    at = np.unique(columns.of_node[interface.surfaces[surface]])
    body = int(interface.node_body[interface.surfaces[surface][0, 0]])
    for end, column in (("left", columns.first[body]), ("right", columns.first[body + 1] - 1)):
        if at.size == 1 and at[0] == column:
            return end, body
    raise ValueError(f"contact {pair!r}: {surface!r} is not the left or right end of a rod")


class BadModulusError(ArithmeticError):
    """A modulus is not positive at a temperature that was met."""


@dataclass(frozen=True)
class RodState:
    """poured : (n_columns,) free strain at the start where a body melts, else 0: its mesh is the mould's shape."""

    poured: Floats


@dataclass(frozen=True)
class FreeRod:
    """A rod without contact: u : (m,) displacement of its columns [m], gives : (m,) [m/Pa] how far p moves them.

    p : its own pressure [Pa], from being held at both ends; C of them is 0 at a held end.
    """

    u: Floats
    gives: Floats
    p: float


class MechanicalRod:
    """HalfModel of rods along x.  They make no heat."""

    def __init__(self, interface: Interface, spec: Mapping[str, Any]) -> None:
        """Raises ValueError for a model.json or a mesh that is not right."""
        self.interface, self.columns = interface, columns_of(interface)
        self.spec, self.contact = parse_rod(interface, self.columns, spec), ContactSurfaces(interface)
        self._melts = any(body.material.melts for body in self.spec.bodies)
        self.variables = _variables(self, self._melts)

    def start(self, inputs: Values, t: float, link: Link) -> tuple[RodState, Mapping[str, Value]]:
        """Compute the positions at t, after a jump there.  Raises ContactRefusedError, BadModulusError."""
        strain = self._strain(inputs)
        poured = np.zeros(self.columns.count)
        for b, body in enumerate(self.spec.bodies):
            if body.material.melts:
                own = self.columns.of_body(b)
                poured[own] = strain[own]
        state = RodState(poured)
        return state, self._outputs(state, inputs, t, 1, link)

    def step(self, state: RodState, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        """Compute the positions at t + h, before a jump there."""
        try:
            return Done(state, self._outputs(state, inputs, t + h, -1, link))
        except (ContactRefusedError, BadModulusError) as exc:
            return Discard(str(exc), 0.5 * h)

    def _strain(self, inputs: Values) -> Floats:
        """(n_columns,) free strain alpha(T) (T - T_ref) + shrinkage (1 - f_s)."""
        T = self.columns.mean(np.asarray(inputs["T"], dtype=np.float64))
        f_s = self.columns.mean(np.asarray(inputs["f_s"], dtype=np.float64)) if self._melts else np.ones(T.size)
        strain = np.empty(T.size)
        for b, body in enumerate(self.spec.bodies):
            own, material = self.columns.of_body(b), body.material
            # fault: rods shrink with the melt -> strain[own] = material.alpha(T[own]) * (T[own] - material.T_ref) +
            #   material.shrinkage * f_s[own] | mechanical_fmu/test_rod
            strain[own] = material.alpha(T[own]) * (T[own] - material.T_ref) + material.shrinkage * (1.0 - f_s[own])
        return strain

    def _outputs(self, state: RodState, inputs: Values, t: float, side: int, link: Link) -> dict[str, Value]:
        T = self.columns.mean(np.asarray(inputs["T"], dtype=np.float64))
        strain = self._strain(inputs) - state.poured
        X = self.columns.mean(self.interface.nodes[:, 0])
        rods = []
        for b, body in enumerate(self.spec.bodies):
            own = self.columns.of_body(b)
            rods.append(free_rod(body, X[own], strain[own], T[own], t, side))
        u, pressures = [rod.u for rod in rods], []
        for meeting in self.spec.pairs:
            a, b = meeting.left, meeting.right
            gap = X[self.columns.first[b]] + rods[b].u[0] - X[self.columns.first[a + 1] - 1] - rods[a].u[-1]
            # fault: rods press with the compliance of one side -> p = max(0.0, -gap) / (-rods[a].gives[-1]) |
            #   mechanical_fmu/test_rod
            # fault: rods pulled by their contact -> p = -gap / (-rods[a].gives[-1] + rods[b].gives[0]) |
            #   mechanical_fmu/test_rod
            p = max(0.0, -gap) / (-rods[a].gives[-1] + rods[b].gives[0])
            pressures.append(p)
            u[a], u[b] = u[a] + p * rods[a].gives, u[b] + p * rods[b].gives
        x = self.interface.nodes.copy()
        x[:, 0] += np.concatenate(u)[self.columns.of_node]
        own_p = {f"p.{body.name}": rod.p for body, rod in zip(self.spec.bodies, rods, strict=True)
                 if body.left is not None and body.right is not None}
        return {"x": x, **own_p, **self._contact(x, pressures, link)}

    def _contact(self, x: Floats, pressures: list[float], link: Link) -> dict[str, Value]:
        if not self.interface.pairs:
            return {}
        facing = self.contact.facing(link, x)
        t_N, touching = np.zeros(self.interface.pair_nodes.size), 0
        for i, p in enumerate(pressures):
            if p > 0.0:
                t_N[self.contact.pair_nodes.pair == i] = -p
                touching += int((facing.pair == i).sum())
        return {"contact.t_N": t_N, "contact.gap": facing.node_gap, "contact.covered": facing.node_covered,
                "contact.touching": float(touching)}


def free_rod(body: RodBody, X: Floats, strain: Floats, T: Floats, t: float, side: int) -> FreeRod:
    """Compute the displacement of a rod that meets nothing.

    X : (m,) [m] reference places.  strain : (m,) [1] free strain and T : (m,) [K] at them.
    t : [s], side : of a jump there, -1 before it, 1 after it.  Integrals by the trapezoidal rule, as heat is stored.
    Raises BadModulusError.
    """
    length = np.diff(X)
    stretch = _sums(0.5 * (strain[:-1] + strain[1:]) * length)
    soft = _compliance(body.material, T)
    gives = -_sums(0.5 * (soft[:-1] + soft[1:]) * length)
    left, right = (None if end is None else end.at(t, side) for end in (body.left, body.right))
    if left is None:
        assert right is not None
        return FreeRod(right + stretch - stretch[-1], gives - gives[-1], 0.0)
    if right is None:
        return FreeRod(left + stretch, gives, 0.0)
    if gives[-1] == 0.0:
        # Nothing can give way: a rigid body between two holds keeps its shape and tells no pressure.
        return FreeRod(left + (right - left) * (X - X[0]) / (X[-1] - X[0]), gives, 0.0)
    p = (left + stretch[-1] - right) / -gives[-1]
    return FreeRod(left + stretch + p * gives, np.zeros(X.size), float(p))


def _sums(parts: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(parts)])


def _compliance(material: RodMaterial, T: Floats) -> Floats:
    """(m,) 1/E at T : (m,) [1/Pa], 0 where nothing gives way."""
    if material.E is None:
        return np.zeros(T.size)
    E = material.E(T)
    if not (E > 0.0).all():
        raise BadModulusError(f"the modulus is {E.min():.6g} Pa at {T[np.argmin(E)]:.6g} K")
    return 1.0 / E


def _variables(half: MechanicalRod, melts: bool) -> tuple[Variable, ...]:
    interface = half.interface
    n, n_q = len(interface.nodes), interface.pair_nodes.size
    f_s = Variable("f_s", (n,), "input", "1", 1.0, description="solid fraction at the end", on="nodes")
    phase = (f_s,) if melts else ()
    own = tuple(Variable(f"p.{body.name}", unit="Pa", description="pressure of a rod held at both ends, > 0 pressed")
                for body in half.spec.bodies if body.left is not None and body.right is not None)
    return (Variable("T", (n,), "input", "K", 293.15, description="temperature at the end", on="nodes"), *phase,
            Variable("x", (n, 2), unit="m", start=interface.nodes, description="current coordinates", on="nodes"),
            *own, *(contact_variables(n_q) if n_q else ()))


def load_rod(interface: Interface, model: Mapping[str, Any]) -> MechanicalRod:
    """Make the half `mechanical_rod` of an interface and a model.json.  Raises ValueError naming what is wrong."""
    return MechanicalRod(interface, model)
