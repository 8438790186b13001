"""The messages of the contact service.  Their bytes are the business of contact.codec.

All coordinates are those of the n_s surface nodes of a scene (Interface.contact_nodes), 0-based index s.  What contact
tells of a node belongs to a pair: it is told of the n_q pair nodes, index q (contact.pair_nodes).  Multipliers are
n_m = n_q + 2 n_t numbers: one a pair node, then x and y of each of the n_t slave nodes of tied pairs (contact.tied).
All replies depend on the request and on surfaces registered by content hash, on nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

WIRE_VERSION = 10


@dataclass(frozen=True)
class Passes:
    """How the pairs are searched: once each, or in two passes of half the weight with the sides exchanged.

    Arrays of (n_passes,).  pair : number of the pair.  slave, master : surface numbers, the same one for a surface
    that may fold onto itself.  weight : part of the area that counts [1].  by_node : 0 for points on pieces of edges
    cut at the other side's nodes, 1 for one point a slave node (the paper's form).  gap_max : farther apart nothing is
    faced [m].  eps_N : penalty [Pa/m], 0: at each point that of the two edges there in a row.  eps_T : stiffness of
    sticking [Pa/m], 0: stick times eps_N.  mu : Coulomb's coefficient [1].  depth : how deep behind the other surface
    is looked [m], where that is more than an edge's length; None: nowhere.  tied : 1 where the sides are bonded as
    they face each other at Register.x, for good, else 0; None: nowhere.  smooth : 1 where forces see the sides as
    round as they are at Register.x (contact.rounding), else 0; None: nowhere.  parting : 1 where pieces end where the
    gap is 0, else 0: pairs by their penalty alone, whose pressure ends there; None: nowhere.  leaning : 1 where
    corners of the slave are pushed along the master's normals (contact.leaning), else 0: pairs whose master does not
    deform; None: nowhere.  stick : eps_T over eps_N where eps_T is 0 [1]; None: 1.
    """

    pair: Ints
    slave: Ints
    master: Ints
    weight: Floats
    by_node: Ints
    gap_max: Floats
    eps_N: Floats
    eps_T: Floats
    mu: Floats
    depth: Floats | None = None
    tied: Ints | None = None
    smooth: Ints | None = None
    parting: Ints | None = None
    leaning: Ints | None = None
    stick: Floats | None = None


@dataclass(frozen=True)
class Register:
    """Register the surfaces of a scene, once.

    n_nodes : n_s.  edges : (n_edges, 2) indices s; the body lies on the left going from first to second.
    edge_surface : (n_edges,) number of the surface each edge belongs to; the edges of one surface are consecutive.
    axisymmetric : areas are weighted by 2 pi r (r = x), else unit depth.
    passes : which surface is searched from which, and the penalties and friction of what faces.
    stiffness : (n_edges,) [Pa/m], of the layer of cells behind each edge; None: 0.
    offset : (n_q,) [m], what is added to gaps at pair nodes of sides that are searched from, linear between; None: 0.
    x : (n_s, 2) [m], as drawn: where tied sides faced each other, and by how much edges are chords of round surfaces;
    None: nothing is tied or smooth, and edges are as round to heat as they are when asked for.
    """

    n_nodes: int
    edges: Ints
    edge_surface: Ints
    axisymmetric: bool
    passes: Passes
    stiffness: Floats | None = None
    offset: Floats | None = None
    x: Floats | None = None


@dataclass(frozen=True)
class Registered:
    """The surfaces are registered.  surfaces : the hash by which later requests name them."""

    surfaces: str


@dataclass(frozen=True)
class Project:
    """Ask which points face each other at coordinates x : (n_s, 2) [m]."""

    surfaces: str
    x: Floats


@dataclass(frozen=True)
class Facing:
    """Contact quadrature points (n_p of them) and the gap of every pair node.

    pair : (n_p,) number of the pair.  slave_edge, master_edge : (n_p,) numbers as registered.  xi_s, xi_m : (n_p,) in
    [0, 1] along the edge, from its first node.  gap : (n_p,) g_N [m].  area : (n_p,) A [m2], the common area of the
    exchange, measured on the slave.  area_m : (n_p,) [m2], the same piece measured on the master (for the part of
    the master's film, and for what crosses a gap between sides of unlike area).  wide_s, wide_m : (n_p,) [1], by how
    much the round surface of either side is wider there than its edge.  The two points of a piece are neighbours.
    node_gap : (n_q,) [m], g_N of every pair node, both sides; beyond the other side's end that of the end, the
    pair's gap_max where nothing of the node's part faces anything.
    node_covered : (n_q,) part in [0, 1] of the node's share of its side that faces the other side.
    """

    pair: Ints
    slave_edge: Ints
    master_edge: Ints
    xi_s: Floats
    xi_m: Floats
    gap: Floats
    area: Floats
    area_m: Floats
    wide_s: Floats
    wide_m: Floats
    node_gap: Floats
    node_covered: Floats


@dataclass(frozen=True)
class ContactState:
    """The surfaces at x : (n_s, 2) [m], and the history: what forces and their derivatives depend on.

    multipliers : (n_m,) [Pa], the first n_q <= 0 (zeros: pure penalty).  The rest matters with friction only.
    x_before : (n_s, 2) [m], where the surfaces were then, and multipliers_before : (n_m,) [Pa], theirs then.
    mobilised : (n_q,) [1], the shear of slave nodes over p_N then, positive along the edges, the body on the left.
    mobilised_at : (n_h, 3), the same of the points that touched then: the pair node of the slave edge's first end, the
    place xi along the edge [1], and the shear over p_N [1], ascending; None: it is linear between nodes.
    sticking : share of eps_T [1], above 0, by which points stick; less than 1 on the way to a solution.
    """

    surfaces: str
    x: Floats
    multipliers: Floats
    x_before: Floats
    multipliers_before: Floats
    mobilised: Floats
    mobilised_at: Floats | None = None
    sticking: float = 1.0


@dataclass(frozen=True)
class Traction(ContactState):
    """Ask for contact forces."""


@dataclass(frozen=True)
class Tractions:
    """Contact forces.

    force : (n_s, 2) [N] on the nodes (per metre depth when plane); both sides, adding up to zero.
    starts : (n_s + 1,), columns : (n_b,), blocks : (n_b, 2, 2) [N/m] stiffness -d(force)/dx, exact, by rows of nodes:
    row s couples to columns[starts[s]:starts[s + 1]]; symmetric where nothing slips and nothing turns.
    t_N : (n_q,) nodal normal traction [Pa], <= 0: of slave nodes the mean of -p_N over what each faces (of next to
    nothing: as contact.nodal.at_slivers says), of a master's the mean of the slave's there, so that none has more
    than the slave; of a tied pair > 0 where it is pulled.
    node_gap, node_covered : (n_q,) as in Facing.
    multipliers : (n_m,) [Pa], of slave nodes the mean of -p_N over what each faces, 0 of others, and the tractions of
    ties, mobilised : (n_q,) [1] and mobilised_at : (n_h, 3), as in ContactState: the new history.
    shear : (n_q,) [Pa] of slave nodes, the mean of tau over what each faces (of next to nothing: as t_N).
    E_friction : (n_q,) [J] of slave nodes, what slipping made since x_before.
    slipping : (n_q,) of what a slave node touches, the part at Coulomb's bound, 0 to 1.
    slip : (n_q,) [m] of slave nodes, how far they went at that bound since x_before, the mean over what each touches,
    positive along the edges, the body on the left; what only strains the spring of sticking is none.
    n_touching, n_slipping : contact quadrature points with p_N > 0, and those of them at Coulomb's bound.
    stored : [J] that the springs of contact hold, sum A (p_N depth + tau^2/eps_T)/2, and those of ties.
    """

    force: Floats
    starts: Ints
    columns: Ints
    blocks: Floats
    t_N: Floats
    node_gap: Floats
    node_covered: Floats
    multipliers: Floats
    mobilised: Floats
    mobilised_at: Floats
    shear: Floats
    E_friction: Floats
    slipping: Floats
    slip: Floats
    n_touching: int
    n_slipping: int
    stored: float


@dataclass(frozen=True)
class Coupling(ContactState):
    """Ask for residual and derivatives of the multipliers."""


@dataclass(frozen=True)
class Couplings:
    """What a half needs to solve for displacements and multipliers lambda at once.

    residual : (n_m,) [N], R_j = sum A N_j (lambda_j + p_N) over what a node faces: 0 where lambda is the t_N a slave
    node makes; of a tie eps_j sum A N_j d, 0 where nothing of what its node faced went away from it.
    weight : (n_m,) [m2], W_j = sum A N_j.
    nodes : (n_b, 6) of the pieces that touch or have multipliers: the slave edge's two (0, 1), their two neighbours,
    the master edge's two (4, 5).  ends : (n_b, 4) the multipliers of (0, 1, 4, 5); of a tied piece those of node 0 and
    of node 1 along x and y.
    values : (n_b, 6, 4, 5), to be added up: for node i and multiplier j of ends
    df_i/dlambda_j [m2] along x and y, dR_j/dx_i [N/m] along x and y, dR_i/dlambda_j [m2] less W_i where i = j.
    """

    residual: Floats
    weight: Floats
    nodes: Ints
    ends: Ints
    values: Floats


@dataclass(frozen=True)
class Refused:
    """The service could not answer.  code : unknown_surfaces | bad_request | bug."""

    code: str
    message: str


Request = Register | Project | Traction | Coupling
Reply = Registered | Facing | Tractions | Couplings | Refused
