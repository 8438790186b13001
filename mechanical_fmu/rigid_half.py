"""The rigid half: bodies that move as prescribed, x = X + u(t), and touch with a prescribed pressure."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half import checks
from contact.half.contact_client import ContactRefusedError, ContactSurfaces
from contact.half.functions import Signal, signal_from
from contact.half.interface import Interface
from contact.half.model import Discard, Done, Link, Value, Values, Variable
from contact.problem.errors import demand, read
from contact.problem.mechanical import Motion, RigidProblem
from mechanical_fmu.contact import contact_variables

Floats = NDArray[np.float64]

# A pair touches where a facing gap is no more than this [m]: motions are sums of tables, good to round-off only.
TOUCH = 1e-9


@dataclass(frozen=True)
class RigidState:
    """t [s]: where the bodies are follows from it."""

    t: float


@dataclass(frozen=True)
class RigidSpec:
    """motion : (u_x, u_y) of every body of the interface [m].  pressure : of every pair [Pa], >= 0, or None."""

    motion: tuple[tuple[Signal, Signal], ...]
    pressure: tuple[Signal | None, ...]


class RigidHalf:
    """HalfModel of bodies that follow signals.  It knows no temperature, and its contact no forces."""

    def __init__(self, interface: Interface, spec: RigidSpec) -> None:
        self.interface, self.spec, self.contact = interface, spec, ContactSurfaces(interface)
        n_s = interface.contact_nodes.size
        x = Variable("x", (len(interface.nodes), 2), unit="m", start=interface.nodes, description="current coordinates",
                     on="nodes")
        self.variables = (x, *(contact_variables(n_s) if n_s else ()))

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
        if not self.interface.pairs:
            return {"x": x}
        facing = self.contact.facing(link, x)
        t_N, touching = np.zeros(self.interface.contact_nodes.size), 0
        for i, (pair, pressure) in enumerate(zip(self.interface.pairs, self.spec.pressure, strict=True)):
            met = facing.gap[facing.pair == i]
            p = 0.0 if pressure is None else pressure.at(t, side)
            # fault: rigid pressure without touching -> if p > 0.0 and met.size: | mechanical_fmu/test_rigid
            if p > 0.0 and met.size and met.min() <= TOUCH:
                # On the whole surfaces: a facing point takes it from its edge's nodes, some of which face nothing.
                # fault: rigid pressure on the slave only -> nodes = np.concatenate([self.interface.surfaces[n].ravel()
                #   for n in (pair.slave,)]) | mechanical_fmu/test_rigid
                nodes = np.concatenate([self.interface.surfaces[n].ravel() for n in (pair.slave, pair.master)])
                s = np.searchsorted(self.interface.contact_nodes, nodes)
                t_N[s] = np.minimum(t_N[s], -p)
                touching += met.size
        return {"x": x, "contact.t_N": t_N, "contact.gap": facing.node_gap, "contact.covered": facing.node_covered,
                "contact.touching": float(touching)}


def load(interface: Interface, model: Mapping[str, Any]) -> RigidHalf:
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
                           for p in interface.pairs))
