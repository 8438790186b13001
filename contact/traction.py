"""Contact forces at the contact quadrature points: the reply to a Traction request.  Eqs. (17)-(20), Coulomb's law.

p_N = max(-lambda - eps_N g_N, 0) at each point, lambda interpolated from the slave's nodes; a point touches where
p_N > 0.  It pushes the slave with -N p_N n A and the master with +M p_N n A, along the ray n that joins the two
points, so forces and moments balance to round-off.  A touching point with friction drags along t (n turned to the
left) with tau = tau_before - eps_T slip, bounded by mu p_N; what it moves at that bound makes heat.
The two drags stand the gap apart, so their moments balance only to tau A g_N.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel
from contact.messages import Coupling, Floats, Ints, Traction, Tractions
from contact.piece import (
    EPS_N,
    EPS_T,
    FIXED,
    LAMBDA_1,
    LAMBDA_2,
    MU,
    N_CONSTANTS,
    NODES,
    OPEN,
    SHEAR_1,
    SHEAR_2,
    SLIPS_BACK,
    SLIPS_FORWARD,
    STICKS,
    piece_stiffness,
)
from contact.search import GAUSS, Cut, cut_surfaces, feet
from contact.surfaces import Frame, RegisteredSurfaces, checked_reals, frame_of

# Assembly of pieces

@kernel
def rows_of(n: int, nodes: Ints, blocks: Floats) -> tuple[Ints, Ints, Floats]:
    """Sum blocks of pieces into rows of nodes.

    nodes : (n_pieces, m), the same node perhaps twice.  blocks : (n_pieces, 2 m, 2 m) [N/m].  Returns starts (n + 1,),
    columns (n_b,), ascending in each row, and sums (n_b, 2, 2) [N/m]: a third of the bytes of blocks, and ready to be
    put into a matrix.
    """
    n_pieces, m = nodes.shape
    room = np.zeros(n + 1, dtype=np.int64)
    for p in range(n_pieces):
        for i in range(m):
            room[nodes[p, i] + 1] += m
    for s in range(n):
        room[s + 1] += room[s]
    columns, filled = np.empty(room[n], dtype=np.int32), np.zeros(n, dtype=np.int64)
    for p in range(n_pieces):
        for i in range(m):
            s = nodes[p, i]
            for j in range(m):
                _insert(columns[room[s]:room[s + 1]], filled, s, nodes[p, j])
    starts = np.zeros(n + 1, dtype=np.int32)
    for s in range(n):
        starts[s + 1] = starts[s] + filled[s]
    packed, values = np.empty(starts[n], dtype=np.int32), np.zeros((starts[n], 2, 2))
    for s in range(n):
        packed[starts[s]:starts[s + 1]] = columns[room[s]:room[s] + filled[s]]
    for p in range(n_pieces):
        for i in range(m):
            row = packed[starts[nodes[p, i]]:starts[nodes[p, i] + 1]]
            for j in range(m):
                at = starts[nodes[p, i]] + np.searchsorted(row, nodes[p, j])
                for d in range(2):
                    for e in range(2):
                        values[at, d, e] += blocks[p, 2 * i + d, 2 * j + e]
    return starts, packed, values


@kernel
def added_up(n: int, nodes: Ints, values: Floats) -> Floats:
    """Sum what pieces give to nodes; return (n, 2) in the unit of the values.

    nodes : (n_pieces, m) numbers from 0 to n - 1.  values : (n_pieces, m, 2), for example forces [N].
    """
    total = np.zeros((n, 2))
    for p in range(nodes.shape[0]):
        for i in range(nodes.shape[1]):
            for d in range(2):
                total[nodes[p, i], d] += values[p, i, d]
    return total


@kernel
def _insert(row: Ints, filled: NDArray[np.int64], s: int, column: int) -> None:
    """Put a column into its place in a sorted row, unless it is there; rows have a dozen columns."""
    k = filled[s]
    while k > 0 and row[k - 1] > column:
        k -= 1
    if k > 0 and row[k - 1] == column:
        return
    for i in range(filled[s], k, -1):
        row[i] = row[i - 1]
    row[k] = column
    filled[s] += 1


# Contact forces

CUT_MATCH = 1e-9  # of an edge: a cut this near to a node's foot was made by that node


@dataclass(frozen=True)
class PointStates:
    """State of the contact quadrature points.

    c : (n_p, N_CONSTANTS) of contact.piece.  doing : (n_p,) open, sticks or slips.  p_N, tau : (n_p,) [Pa].
    heat : (n_p,) [J].
    """

    c: Floats
    doing: Floats
    p_N: Floats
    tau: Floats
    heat: Floats


def traction(surfaces: RegisteredSurfaces, request: Traction) -> Tractions:
    """Compute contact forces at request.x.  Raises ValueError."""
    r = surfaces.register
    x, multipliers, before, shear = checked_request(surfaces, request)
    cut = cut_surfaces(surfaces, x)
    points = points_at(surfaces, cut, x, before, multipliers, shear)
    nodes, forces, blocks = pieces(x, before, r.edges, surfaces.previous, surfaces.following, cut.met, cut.values,
                                   cut.normal, surfaces.passes.by_node[cut.number], r.axisymmetric, points.c,
                                   points.doing)
    force = added_up(r.n_nodes, nodes, forces)
    starts, columns, stiffness = rows_of(r.n_nodes, nodes, blocks)
    t_N, t_T, E_friction = nodal_means(r.edges, cut.met, cut.values, points.c, points.p_N, points.tau, points.heat,
                                       shear)
    slipping = slipping_fractions(r.n_nodes, r.edges, cut.met, cut.values, points.doing)
    return Tractions(force, starts, columns, stiffness, t_N, cut.node_gap, cut.node_covered,
                     np.where(surfaces.on_slave, t_N, 0.0), t_T, E_friction, slipping,
                     int(np.count_nonzero(points.p_N)), int(np.count_nonzero(points.doing >= SLIPS_FORWARD)))


def checked_request(surfaces: RegisteredSurfaces, request: Traction | Coupling) -> tuple[Floats, Floats, Floats,
                                                                                         Floats]:
    """Check the arrays of a request; return x, multipliers, x_before and shear.

    They are (n_s, 2) [m], (n_s,) [Pa], (n_s, 2) [m] and (n_s,) [Pa].  Raises ValueError.
    """
    n = surfaces.register.n_nodes
    multipliers = checked_reals("multipliers", request.multipliers, (n,))
    if multipliers.size and multipliers.max() > 0.0:
        raise ValueError(f"multipliers must be <= 0, got {multipliers.max()!r} at node {multipliers.argmax()}")
    before = checked_reals("x_before", request.x_before, (n, 2))
    shear = checked_reals("shear", request.shear, (n,))
    return checked_reals("x", request.x, (n, 2)), multipliers, before, shear


def points_at(surfaces: RegisteredSurfaces, cut: Cut, x: Floats, before: Floats, multipliers: Floats,
              shear: Floats) -> PointStates:
    """Evaluate the points of a cut.

    x, before : (n_s, 2) [m] now and when the shear was `shear`.  multipliers, shear : (n_s,) [Pa].
    """
    p, edges = surfaces.passes, surfaces.register.edges
    ends = edges[cut.met[:, 0]]
    c = np.zeros((len(cut.met), N_CONSTANTS))
    c[:, LAMBDA_1:LAMBDA_2 + 1] = multipliers[ends]
    c[:, SHEAR_1:SHEAR_2 + 1] = shear[ends]
    c[:, EPS_N], c[:, EPS_T], c[:, MU] = p.eps_N[cut.number], p.eps_T[cut.number], p.mu[cut.number]
    n = len(cut.met)
    points = PointStates(c, np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n))
    evaluate_points(x, before, edges, cut.met, cut.values, cut.normal, c, points.doing, points.p_N, points.tau,
                    points.heat)
    return points


@kernel
def evaluate_points(x: Floats, before: Floats, edges: Ints, met: Ints, values: Floats, normal: Floats, c: Floats,
                    doing: Floats,
                    p_N: Floats, tau: Floats, heat: Floats) -> None:
    """Fill the state of every point: doing [1], p_N [Pa], tau [Pa], and the heat of its slip [J], each (n_p,).

    x, before : (n_s, 2) [m].  edges : (n_edges, 2).  met : (n_p, 2) slave and master edge.
    values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  normal : (n_edges, 3, 2) [1].
    c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1] as in contact.piece.  doing : (n_p,) state [1].  p_N, tau : (n_p,) [Pa].
    heat : (n_p,) [J].
    Slip is how far the slave's point has moved along t past the point it faces, since `before`: the two material points
    are those that face each other now, so a motion of both together is none.
    """
    for i in range(met.shape[0]):
        xi, eta, area = values[i, 0], values[i, 1], values[i, 3]
        p = -(c[i, LAMBDA_1] + xi * (c[i, LAMBDA_2] - c[i, LAMBDA_1])) - c[i, EPS_N] * values[i, 2]
        doing[i] = OPEN
        # fault: contact may pull -> if not area > 0.0: | contact/test_traction
        if not (p > 0.0 and area > 0.0):
            continue
        p_N[i], doing[i] = p, STICKS
        if not c[i, MU] > 0.0:
            continue
        a, b, d, e = edges[met[i, 0], 0], edges[met[i, 0], 1], edges[met[i, 1], 0], edges[met[i, 1], 1]
        slips = np.empty(2)
        for k in range(2):
            slips[k] = ((1.0 - xi) * (x[a, k] - before[a, k]) + xi * (x[b, k] - before[b, k])
                        - (1.0 - eta) * (x[d, k] - before[d, k]) - eta * (x[e, k] - before[e, k]))
        # Plus how the two present points, d and M, differ: nothing but the gap, which has no tangential part.
        nx = (1.0 - xi) * normal[met[i, 0], 1, 0] + xi * normal[met[i, 0], 2, 0]
        ny = (1.0 - xi) * normal[met[i, 0], 1, 1] + xi * normal[met[i, 0], 2, 1]
        slip = (-ny * slips[0] + nx * slips[1]) / np.sqrt(nx * nx + ny * ny)
        trial = c[i, SHEAR_1] + xi * (c[i, SHEAR_2] - c[i, SHEAR_1]) - c[i, EPS_T] * slip
        bound = c[i, MU] * p
        tau[i] = trial
        # fault: friction without its bound -> if abs(trial) > 1e9 * bound: | mechanical_fmu/test_friction
        if abs(trial) > bound:
            # fault: what slips is told as sticking -> doing[i] = STICKS | scenarios/test_contact_robust
            doing[i] = SLIPS_FORWARD if trial > 0.0 else SLIPS_BACK
            tau[i] = bound if trial > 0.0 else -bound
            # fault: friction heat halved -> heat[i] = 0.5 * tau[i] * (trial - tau[i]) / c[i, EPS_T] * area |
            #   mechanical_fmu/test_friction
            heat[i] = tau[i] * (trial - tau[i]) / c[i, EPS_T] * area


@kernel
def nodal_means(edges: Ints, met: Ints, values: Floats, c: Floats, p_N: Floats, tau: Floats, heat: Floats,
                before: Floats) -> tuple[Floats, Floats, Floats]:
    """Average pressure and shear to the nodes: t_N (n_s,) [Pa], shear (n_s,) [Pa] and E_friction (n_s,) [J].

    edges : (n_edges, 2).  met : (n_p, 2) slave and master edge.
    values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1] as in
    contact.piece.  p_N, tau : (n_p,) [Pa].  heat : (n_p,) [J].  before : (n_s,) [Pa].
    t_N = -sum(A N p_N)/sum(A N) over what each node faces, both sides; the others are of slave nodes: shear as before
    plus the mean of its change over what it touches.  Of the change, not of tau itself: a mean of what was interpolated
    is smoother than what it came from, and a surface at rest would lose its shear, and make heat, with every step.
    """
    n_nodes = before.size
    pushed, faced, dragged = np.zeros(n_nodes), np.zeros(n_nodes), np.zeros(n_nodes)
    touched, made = np.zeros(n_nodes), np.zeros(n_nodes)
    for i in range(met.shape[0]):
        for side in range(2):
            for end in range(2):
                s = edges[met[i, side], end]
                N = values[i, side] if end == 1 else 1.0 - values[i, side]
                weight = N * values[i, 3]
                pushed[s] += weight * p_N[i]
                faced[s] += weight
                if side == 0 and p_N[i] > 0.0:
                    dragged[s] += weight * (tau[i] - (c[i, SHEAR_1] + values[i, 0] * (c[i, SHEAR_2] - c[i, SHEAR_1])))
                    touched[s] += weight
                    made[s] += N * heat[i]
    for s in range(n_nodes):
        pushed[s] = -pushed[s] / faced[s] if pushed[s] > 0.0 else 0.0
        # fault: shear that is held smears out -> dragged[s] = 0.9 * before[s] + dragged[s] / touched[s] if touched[s] >
        #   0.0 else 0.0 | contact/test_shear_history
        dragged[s] = before[s] + dragged[s] / touched[s] if touched[s] > 0.0 else 0.0
    return pushed, dragged, made


@kernel
def slipping_fractions(n_nodes: int, edges: Ints, met: Ints, values: Floats, doing: Floats) -> Floats:
    """Return sum(A N of what slips)/sum(A N of what touches) (n_nodes,) [1] of slave nodes; 0 where nothing touches.

    edges : (n_edges, 2) nodes.  met : (n_p, 2) slave and master edge.
    values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  doing : (n_p,) state: open, sticks or slips [1].
    """
    slips, touches = np.zeros(n_nodes), np.zeros(n_nodes)
    for i in range(met.shape[0]):
        if doing[i] == OPEN:
            continue
        for end in range(2):
            s = edges[met[i, 0], end]
            weight = (values[i, 0] if end == 1 else 1.0 - values[i, 0]) * values[i, 3]
            touches[s] += weight
            # fault: what sticks is told as slipping -> if doing[i] >= STICKS: | contact/test_traction
            if doing[i] >= SLIPS_FORWARD:
                slips[s] += weight
    for s in range(n_nodes):
        slips[s] = slips[s] / touches[s] if touches[s] > 0.0 else 0.0
    return slips


@kernel
def pieces(x: Floats, before: Floats, edges: Ints, previous: Ints, following: Ints, met: Ints, values: Floats,
           normal: Floats, by_node: Ints, axisymmetric: bool, c: Floats,
           doing: Floats) -> tuple[Ints, Floats, Floats]:
    """Compute nodes (n_b, 6), forces (n_b, 6, 2) [N] and blocks (n_b, 12, 12) [N/m] of the touching pieces.

    x, before : (n_s, 2) [m].  edges : (n_edges, 2).  previous, following : (n_edges,).  met : (n_p, 2) slave and master
    edge.  values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  normal : (n_edges, 3, 2) [1].
    by_node : (n_p,).  c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1] as in contact.piece.  doing : (n_p,) state [1].
    """
    n_blocks = 0
    for i in range(0, met.shape[0], 2):
        n_blocks += doing[i] > OPEN or doing[i + 1] > OPEN
    nodes = np.empty((n_blocks, NODES), dtype=np.int32)
    forces, blocks = np.empty((n_blocks, NODES, 2)), np.empty((n_blocks, 2 * NODES, 2 * NODES))
    here, there = np.empty((NODES, 2)), np.empty((NODES, 2))
    smooth, ends, moves, scratch = np.empty(2, dtype=np.bool_), np.empty(2), np.empty(2), np.empty((6, 2 * NODES))
    b = 0
    for i in range(0, met.shape[0], 2):
        if not (doing[i] > OPEN or doing[i + 1] > OPEN):
            continue
        e, m = met[i, 0], met[i, 1]
        piece_nodes(edges, previous, following, e, m, nodes[b])
        for k in range(NODES):
            for d in range(2):
                here[k, d], there[k, d] = x[nodes[b, k], d], before[nodes[b, k], d]
        for k in range(2):
            smooth[k] = normal[e, 1 + k, 0] != normal[e, 0, 0] or normal[e, 1 + k, 1] != normal[e, 0, 1]
            other = previous[e] if k == 0 else following[e]
            smooth[k] = other >= 0 and (smooth[k] or parallel(normal, e, other))
        uncut = by_node[i] == 1
        piece_cuts(frame_of(x, edges, normal, e), here, values[i, 0], values[i + 1, 0], uncut, ends, moves)
        piece_stiffness(here, normal[e, 1:], there, smooth, uncut, axisymmetric, moves, ends, values, c, doing, i,
                        scratch, forces[b], blocks[b])
        b += 1
    return nodes, forces, blocks


@kernel
def parallel(normal: Floats, e: int, other: int) -> bool:
    """Return whether the normals of two neighbours are the same, so that their mean is too.

    normal : (n_edges, 3, 2) [1].
    """
    return normal[e, 0, 0] == normal[other, 0, 0] and normal[e, 0, 1] == normal[other, 0, 1]


@kernel
def piece_nodes(edges: Ints, previous: Ints, following: Ints, e: int, m: int, nodes: Ints) -> None:
    """Fill nodes : (6,), as contact.piece numbers them; where there is no neighbour, the edge's own node.

    edges : (n_edges, 2).  previous, following : (n_edges,).
    """
    nodes[0], nodes[1] = edges[e, 0], edges[e, 1]
    nodes[2] = edges[previous[e], 0] if previous[e] >= 0 else edges[e, 0]
    nodes[3] = edges[following[e], 1] if following[e] >= 0 else edges[e, 1]
    nodes[4], nodes[5] = edges[m, 0], edges[m, 1]


@kernel
def piece_cuts(frame: Frame, here: Floats, xi_1: float, xi_2: float, uncut: bool, ends: Floats, moves: Floats) -> None:
    """Fill the cuts of the piece whose Gauss points are xi_1, xi_2, and the node each of them follows.

    here : (6, 2) coordinates of its nodes [m].  ends : (2,) cuts [1], out.  moves : (2,) nodes or FIXED [1], out.
    """
    half = 0.5 * (xi_2 - xi_1) / (2.0 * GAUSS)
    ends[0], ends[1] = (0.0, 1.0) if uncut else (0.5 * (xi_1 + xi_2) - half, 0.5 * (xi_1 + xi_2) + half)
    moves[:] = FIXED
    if uncut:
        return
    for k in range(2):
        if abs(ends[k] - k) <= CUT_MATCH:
            continue
        for node in range(4, NODES):
            first, second = feet(frame, here[node, 0], here[node, 1])
            if abs(first - ends[k]) <= CUT_MATCH or abs(second - ends[k]) <= CUT_MATCH:
                # fault: cuts do not move with the other side's nodes -> moves[k] = FIXED | contact/test_traction
                moves[k] = node
