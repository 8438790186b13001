"""What faces what: the contact service's answer in the words of the thermal half."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.model import Link
from contact.half.register import register_message
from contact.wire import Facing, Project, Refused, Register, Registered
from thermal_fmu.edges import shape_functions

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class ContactRefusedError(ArithmeticError):
    """The contact service will not answer for these coordinates."""


@dataclass(frozen=True)
class Surfaces:
    """The surfaces of the pairs as the service numbers them.

    edges : (n_edges, 2) nodes of the mesh.  first : surface name -> number of its first edge.
    """

    interface: Interface

    @cached_property
    def message(self) -> Register:
        return register_message(self.interface)

    @cached_property
    def edges(self) -> Ints:
        return self.interface.contact_nodes[self.message.edges].reshape(-1, 2)

    @cached_property
    def first(self) -> dict[str, int]:
        names = dict.fromkeys(name for pair in self.interface.pairs for name in (pair.slave, pair.master))
        return {name: int(np.searchsorted(self.message.edge_surface, i)) for i, name in enumerate(names)}


@dataclass(frozen=True)
class Points:
    """Facing points with the pressure between them.

    nodes : (n_p, 4) nodes of the mesh, slave edge's two, master edge's two.  N_s, N_m : (n_p, 2) shape functions.
    gap : (n_p,) [m], 0 where touching.  p : (n_p,) [Pa], > 0 where touching.  area, area_m : (n_p,) [m2].
    pair, slave_edge, master_edge : (n_p,) as registered.
    """

    nodes: Ints
    N_s: Floats
    N_m: Floats
    gap: Floats
    p: Floats
    area: Floats
    area_m: Floats
    pair: Ints
    slave_edge: Ints
    master_edge: Ints


def register(surfaces: Surfaces, link: Link) -> str:
    """Tell the service of the surfaces; returns the name it knows them by.  Raises ContactRefusedError."""
    reply = link.ask(surfaces.message)
    if not isinstance(reply, Registered):
        raise ContactRefusedError(f"contact does not take the surfaces: {_reason(reply)}")
    return reply.surfaces


def ask_facing(surfaces: Surfaces, link: Link, known_as: str, x: Floats) -> Facing:
    """What faces what at coordinates x : (n_nodes, 2) [m].  Raises ContactRefusedError.

    A service started anew, or a half restored elsewhere, is told of the surfaces again.
    """
    request = Project(known_as, np.ascontiguousarray(x[surfaces.interface.contact_nodes]))
    reply = link.ask(request)
    if isinstance(reply, Refused) and reply.code == "unknown_surfaces":
        reply = link.ask(Project(register(surfaces, link), request.x))
    if not isinstance(reply, Facing):
        raise ContactRefusedError(f"contact does not answer: {_reason(reply)}")
    return reply


def points_of(surfaces: Surfaces, facing: Facing, t_N: Floats) -> Points:
    """Facing points with pressures from nodal tractions t_N : (n_s,) [Pa], <= 0, linear along the slave edge.

    A positive gap under pressure is read as no gap (physics: touching means p_N > 0).
    """
    N_s, N_m = shape_functions(facing.xi_s), shape_functions(facing.xi_m)
    slave = surfaces.message.edges[facing.slave_edge]
    p = np.maximum(-(N_s * t_N[slave]).sum(axis=1), 0.0)
    gap = np.where(p > 0, 0.0, np.maximum(facing.gap, 0.0))
    nodes = np.concatenate([surfaces.edges[facing.slave_edge], surfaces.edges[facing.master_edge]], axis=1)
    return Points(nodes, N_s, N_m, gap, p, facing.area, facing.area_m, facing.pair, facing.slave_edge,
                  facing.master_edge)


def _reason(reply: object) -> str:
    if isinstance(reply, Refused):
        return f"{reply.code}: {reply.message}"
    return f"it sent {type(reply).__name__}"
