"""The messages of the contact service.  Their bytes are the business of contact.messages and contact.codec.

All coordinates are those of the n_s surface nodes of a scene (Interface.contact_nodes), 0-based index s.
All replies depend on the request and on surfaces registered by content hash, on nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

WIRE_VERSION = 1


@dataclass(frozen=True)
class Register:
    """The surfaces of a scene, once.

    n_nodes : n_s.  edges : (n_edges, 2) indices s; the body lies on the left going from first to second.
    edge_surface : (n_edges,) number of the surface each edge belongs to; the edges of one surface are consecutive.
    pair_slave, pair_master : (n_pairs,) surface numbers.
    gap_max : (n_pairs,) [m].  eps_N : (n_pairs,) penalty [Pa/m].
    axisymmetric : areas are weighted by 2 pi r (r = x), else unit depth.
    """

    n_nodes: int
    edges: Ints
    edge_surface: Ints
    pair_slave: Ints
    pair_master: Ints
    gap_max: Floats
    eps_N: Floats
    axisymmetric: bool


@dataclass(frozen=True)
class Registered:
    """surfaces : the hash by which later requests name what was registered."""

    surfaces: str


@dataclass(frozen=True)
class Project:
    """Which points face each other at coordinates x : (n_s, 2) [m]?"""

    surfaces: str
    x: Floats


@dataclass(frozen=True)
class Facing:
    """Facing points (n_p of them) and the gap of every surface node.

    pair, slave_edge, master_edge : (n_p,) numbers as registered.  xi_s, xi_m : (n_p,) in [0, 1] along the edge, from
    its first node.  gap : (n_p,) g_N [m].  area : (n_p,) A [m2], the common area of the exchange, measured on the
    slave.  area_m : (n_p,) [m2], the same piece measured on the master (for the share of the master's film).
    node_gap : (n_s,) [m], g_N of every surface node, both sides; gap_max where nothing is faced (the least over the
    pairs the node takes part in).  node_covered : (n_s,) share in [0, 1] of the node's surface that faces something.
    """

    pair: Ints
    slave_edge: Ints
    master_edge: Ints
    xi_s: Floats
    xi_m: Floats
    gap: Floats
    area: Floats
    area_m: Floats
    node_gap: Floats
    node_covered: Floats


@dataclass(frozen=True)
class Traction:
    """Contact forces at x : (n_s, 2) [m], given the multipliers : (n_s,) [Pa], <= 0 (zeros: pure penalty)."""

    surfaces: str
    x: Floats
    multipliers: Floats


@dataclass(frozen=True)
class Tractions:
    """Frictionless contact forces.

    force : (n_s, 2) [N] on the nodes (per metre depth when plane); both sides, adding up to zero.
    block_nodes : (n_b, 4) indices s: slave edge's two, master edge's two.  blocks : (n_b, 8, 8) [N/m] stiffness
    -d(force)/dx on (node, component) row-major, consistent to the order said in docs/theory.md.
    t_N : (n_s,) nodal normal traction [Pa], <= 0, both sides.  node_gap, node_covered : as in Facing.
    multipliers : (n_s,) [Pa], the new history (t_N after augmentation).  n_touching : facing points with p_N > 0.
    """

    force: Floats
    block_nodes: Ints
    blocks: Floats
    t_N: Floats
    node_gap: Floats
    node_covered: Floats
    multipliers: Floats
    n_touching: int


@dataclass(frozen=True)
class Refused:
    """The service could not answer.  code : unknown_surfaces | bad_request | bug."""

    code: str
    message: str


Request = Register | Project | Traction
Reply = Registered | Facing | Tractions | Refused
