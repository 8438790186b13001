"""The mechanical rod: bodies along x that expand, shrink as they freeze, meet at their ends and press; quasi-static.

Without forces on its sides a rod carries one stress over its length, so its displacement is an integral:
u(x) = u_held + int (eps_th - p/E) dx, p > 0 in compression.  Where two ends meet, the pressure that just closes the
overlap of the free rods is p = overlap/(C_left + C_right), C = int dx/E: exact, with no penalty.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.columns import columns_of
from contact.half.interface import Interface
from contact.half.model import Discard, Done, Link, Value, Values, Variable
from contact.half.surfaces import ContactRefusedError, ContactSurfaces
from mechanical_fmu.contact_forces import contact_variables
from mechanical_fmu.rod_spec import RodBody, RodMaterial, parse_rod

Floats = NDArray[np.float64]


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
        """Positions at t, after a jump there.  Raises ContactRefusedError, BadModulusError."""
        strain = self._strain(inputs)
        poured = np.zeros(self.columns.count)
        for b, body in enumerate(self.spec.bodies):
            if body.material.melts:
                own = self.columns.of_body(b)
                poured[own] = strain[own]
        state = RodState(poured)
        return state, self._outputs(state, inputs, (t, 1), link)

    def step(self, state: RodState, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        """Positions at t + h, before a jump there."""
        try:
            return Done(state, self._outputs(state, inputs, (t + h, -1), link))
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

    def _outputs(self, state: RodState, inputs: Values, when: tuple[float, int], link: Link) -> dict[str, Value]:
        T = self.columns.mean(np.asarray(inputs["T"], dtype=np.float64))
        strain = self._strain(inputs) - state.poured
        X = self.columns.mean(self.interface.nodes[:, 0])
        rods = []
        for b, body in enumerate(self.spec.bodies):
            own = self.columns.of_body(b)
            rods.append(free_rod(body, X[own], strain[own], T[own], when))
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
        t_N, touching = np.zeros(self.interface.contact_nodes.size), 0
        for i, (pair, p) in enumerate(zip(self.interface.pairs, pressures, strict=True)):
            if p > 0.0:
                nodes = np.concatenate([self.interface.surfaces[n].ravel() for n in (pair.slave, pair.master)])
                t_N[np.searchsorted(self.interface.contact_nodes, nodes)] = -p
                touching += int((facing.pair == i).sum())
        return {"contact.t_N": t_N, "contact.gap": facing.node_gap, "contact.covered": facing.node_covered,
                "contact.touching": float(touching)}


def free_rod(body: RodBody, X: Floats, strain: Floats, T: Floats, when: tuple[float, int]) -> FreeRod:
    """A rod that meets nothing; X : (m,) reference places [m], strain, T [K] : (m,) at them.

    when : time [s], and the side of a jump there.  Integrals by the trapezoidal rule, as heat is stored.
    Raises BadModulusError.
    """
    length = np.diff(X)
    stretch = _sums(0.5 * (strain[:-1] + strain[1:]) * length)
    soft = _compliance(body.material, T)
    gives = -_sums(0.5 * (soft[:-1] + soft[1:]) * length)
    left, right = (None if end is None else end.at(*when) for end in (body.left, body.right))
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
    n, n_s = len(interface.nodes), interface.contact_nodes.size
    phase = (Variable("f_s", (n,), "input", "1", 1.0, description="solid fraction at the end"),) if melts else ()
    own = tuple(Variable(f"p.{body.name}", unit="Pa", description="pressure of a rod held at both ends, > 0 pressed")
                for body in half.spec.bodies if body.left is not None and body.right is not None)
    return (Variable("T", (n,), "input", "K", 293.15, description="temperature at the end"), *phase,
            Variable("x", (n, 2), unit="m", start=interface.nodes, description="current coordinates"),
            *own, *(contact_variables(n_s) if n_s else ()))


def load(interface: Interface, model: Mapping[str, Any]) -> MechanicalRod:
    """The half `mechanical_rod` of an interface and a model.json.  Raises ValueError naming what is wrong."""
    return MechanicalRod(interface, model)
