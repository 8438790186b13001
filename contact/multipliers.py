"""Residual and derivatives of the contact multipliers: the reply to a Coupling request.

The multipliers lambda of the augmented Lagrangian are those of no penetration where, for every node j of a slave,
    R_j = sum A N_j (lambda_j + p_N) = W_j (lambda_j - t_N_j) = 0,   W_j = sum A N_j
over what the node faces: where lambda is the t_N it makes.  A half that solves for u and lambda at once needs the
derivatives of the forces f by lambda and of R by x and lambda; they are exact, from the same pieces as the stiffness.
Those of ties are of contact.tied.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel
from contact.leaning import Follows, ways_of
from contact.messages import Coupling, Couplings, Floats, Ints
from contact.piece import (
    EPS_N,
    LAMBDA_1,
    LAMBDA_2,
    MU,
    NODES,
    OFFSET_1,
    OFFSET_2,
    OPEN,
    RISE_S,
    SLIPS_BACK,
    SLIPS_FORWARD,
    add_stretch,
    field_normal,
    frame_change,
    ray_length,
    rounding_change,
)
from contact.quadrature import GAUSS
from contact.surfaces import RegisteredSurfaces, frame_of
from contact.tied import bonds_at, tied_couplings, ties_of
from contact.traction import evaluated, piece_cuts, piece_nodes

# The nodes of a piece that have a multiplier or an equation R: those of its two edges.
ENDS = (0, 1, 4, 5)


def coupling(surfaces: RegisteredSurfaces, request: Coupling) -> Couplings:
    """Compute residual and derivatives at request.x.  Raises ValueError."""
    r = surfaces.register
    asked, cut, points = evaluated(surfaces, request)
    multipliers = asked.multipliers
    residual, weight = balances(cut.at, cut.values, points.p_N, multipliers[:surfaces.pair_nodes.size])
    nodes, at, values = coupled_pieces(asked.x, r.edges, surfaces.previous, surfaces.following, cut.met, cut.at,
                                       cut.values, cut.normals, cut.follows, cut.shape,
                                       surfaces.passes.by_node[cut.number], r.axisymmetric, points.c,
                                       points.doing, points.p_N, multipliers)
    if surfaces.pair_nodes.tied.size:
        ties, n_q = ties_of(surfaces), surfaces.pair_nodes.size
        bonds = bonds_at(surfaces, asked.x, multipliers, cut.values[surfaces.tied[cut.number] == 1, 3])
        more = tied_couplings(asked.x, r.edges, ties.met, ties.values, ties.arm, ties.bond, ties.node_eps, n_q)
        nodes, at = np.concatenate([nodes, more[0]]), np.concatenate([at, more[1]])
        values = np.concatenate([values, more[2]])
        residual = np.concatenate([residual, (ties.node_eps[:, None] * bonds.apart).ravel()])
        weight = np.concatenate([weight, np.repeat(ties.weight, 2)])
    return Couplings(residual, weight, nodes, at, values)


@kernel
def balances(at: Ints, values: Floats, p_N: Floats, multipliers: Floats) -> tuple[Floats, Floats]:
    """Compute R [N] and W [m2] of the pair nodes of both sides, (n_q,) each.

    at : (n_p, 4) pair nodes, the slave edge's two, then the master edge's two.
    values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  p_N : (n_p,) [Pa].  multipliers : (n_q,) [Pa].
    """
    residual, weight = np.zeros(multipliers.size), np.zeros(multipliers.size)
    for i in range(at.shape[0]):
        for side in range(2):
            for end in range(2):
                s = at[i, 2 * side + end]
                w = (values[i, side] if end == 1 else 1.0 - values[i, side]) * values[i, 3]
                residual[s] += w * (multipliers[s] + p_N[i])
                weight[s] += w
    return residual, weight


@kernel
def coupled_pieces(x: Floats, edges: Ints, previous: Ints, following: Ints, met: Ints, at: Ints, values: Floats,
                   normals: Floats, follows: Follows, shape: Ints, by_node: Ints, axisymmetric: bool, c: Floats,
                   doing: Floats, p_N: Floats, multipliers: Floats) -> tuple[Ints, Ints, Floats]:
    """Compute nodes (n_b, 6), ends (n_b, 4), values (n_b, 6, 4, 5) of pieces that touch or have a multiplier.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  previous, following : (n_edges,).  met : (n_p, 2) slave and master edge.
    at : (n_p, 4) pair nodes.  values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  normals, follows, shape,
    by_node : as of contact.traction.pieces.  c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1] as in contact.piece.  doing : (n_p,)
    state [1].  p_N : (n_p,) [Pa].  multipliers : (n_q,) [Pa].  Normals that follow a face have no multipliers: what a
    turn of the face does is left out.
    """
    n_blocks = 0
    chosen = np.zeros(met.shape[0], dtype=np.bool_)
    for i in range(0, met.shape[0], 2):
        chosen[i] = doing[i] > OPEN or doing[i + 1] > OPEN
        for k in range(4):
            # fault: pieces with multipliers but open left out -> chosen[i] |= False | contact/test_coupling
            chosen[i] |= multipliers[at[i, k]] < 0.0
        n_blocks += chosen[i]
    nodes, out = np.empty((n_blocks, NODES), dtype=np.int32), np.zeros((n_blocks, NODES, len(ENDS), 5))
    of_pair = np.empty((n_blocks, len(ENDS)), dtype=np.int32)
    here, ways = np.empty((NODES, 2)), np.empty((2, 3))
    ends, moves, scratch = np.empty(2), np.empty(2), np.empty((6, 2 * NODES))
    b = 0
    for i in range(0, met.shape[0], 2):
        if not chosen[i]:
            continue
        e, m, normal = met[i, 0], met[i, 1], normals[shape[i]]
        piece_nodes(edges, previous, following, e, m, nodes[b])
        for k in range(NODES):
            for d in range(2):
                here[k, d] = x[nodes[b, k], d]
        ways_of(normal, follows[shape[i]], previous, following, e, ways)
        nodal = by_node[i] == 1
        piece_cuts(frame_of(x, edges, normal, e), x, edges, m, here, values, c, i, nodal, ends, moves)
        of_pair[b] = at[i]
        couple_piece(here, normal[e, 1:], ways, nodal, axisymmetric, moves, ends, values, c, doing, p_N, i,
                     multipliers, at[i], scratch, out[b])
        b += 1
    return nodes, of_pair, out


@kernel
def couple_piece(x: Floats, n: Floats, ways: Floats, by_node: bool, axisymmetric: bool, moves: Floats, ends: Floats,
                 points: Floats, c: Floats, doing: Floats, p_N: Floats, first: int, multipliers: Floats, at: Ints,
                 scratch: Floats, out: Floats) -> None:
    """Add both points of a piece to out : (6, 4, 5) [m2, N/m, m2], the values of Couplings.

    x : (6, 2) [m].  n : (2, 2) [1].  ways : (2, 3) [1].  moves : (2,) nodes or FIXED [1].  ends : (2,) cuts [1].
    points : (n_p, >= 4) xi, eta [1], gap [m], area [m2].  c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1].
    doing : (n_p,) state [1].  p_N : (n_p,) [Pa].  multipliers : (n_q,) [Pa].  at : (4,) pair nodes of the edges' ends.
    scratch : (6, 12) [1/m], its last row [m].  Their meaning is that of contact.piece.piece_stiffness.
    """
    d_phi, d_cut, d_xi, d_area = scratch[0:2], scratch[2:4], scratch[4], scratch[5]
    frame_change(x, n, ways, moves, ends, c, first, d_phi, d_cut)
    for q in range(first, first + 2):
        # fault: multipliers of a node that slid off stay where it was -> along = 0.5 if by_node else (2.0 * (q - first)
        #   - 1.0) * GAUSS | contact/test_nodes_at_ends
        along = -0.5 if by_node else (2.0 * (q - first) - 1.0) * GAUSS
        per_cut = points[q, 3] / (ends[1] - ends[0])
        for j in range(2 * NODES):
            spread = d_cut[1, j] - d_cut[0, j]
            d_xi[j] = 0.5 * (d_cut[0, j] + d_cut[1, j]) + along * spread
            d_area[j] = per_cut * spread
        rise = 0.0 if by_node else c[q, RISE_S]
        add_stretch(x, points[q, 0], points[q, 3], rise, axisymmetric, d_xi, d_area)
        by_place(x, n, points, c, doing, p_N[q], q, multipliers, at, d_phi, d_xi, d_area, out)
        if int(doing[q]) > OPEN:
            by_multiplier(n, points, c, doing, q, out)


@kernel
def by_place(x: Floats, n: Floats, points: Floats, c: Floats, doing: Floats, p: float, q: int, multipliers: Floats,
             at: Ints, d_phi: Floats, d_xi: Floats, d_area: Floats, out: Floats) -> None:
    """Add the derivative of A N_j (lambda_j + p_N) by coordinate k of node i to out[i, j, 2 + k] [N/m].

    x : (6, 2) [m].  n : (2, 2) [1].  points : (n_p, >= 4) xi, eta [1], gap [m], area [m2].
    c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1].  doing : (n_p,) state [1].  multipliers : (n_q,) [Pa].  at : (4,) pair nodes.
    d_phi : (2, 12) [1/m].  d_xi : (12,) [1/m].  d_area : (12,) [m].  out : (6, 4, 5) [m2, N/m, m2].
    """
    xi, eta, g, area = points[q, 0], points[q, 1], points[q, 2], points[q, 3]
    nx, ny, by_0, by_1, by_xi = field_normal(n, xi)
    sx, sy, ex, ey = x[1, 0] - x[0, 0], x[1, 1] - x[0, 1], x[5, 0] - x[4, 0], x[5, 1] - x[4, 1]
    cross = nx * ey - ny * ex
    slope, widens = c[q, LAMBDA_2] - c[q, LAMBDA_1], c[q, OFFSET_2] - c[q, OFFSET_1]
    g = ray_length(c, q, g, xi, eta)
    shape = (1.0 - xi, xi, 1.0 - eta, eta)
    for j in range(2 * NODES):
        i, along_x, along_y = j // 2, 1.0 - j % 2, float(j % 2)
        own = shape[i] if i < 2 else 0.0
        other = shape[i - 2] if i >= 4 else 0.0
        turn = by_0 * d_phi[0, j] + by_1 * d_phi[1, j] + by_xi * d_xi[j]
        wx = own * along_x + d_xi[j] * sx - g * turn * ny - other * along_x
        wy = own * along_y + d_xi[j] * sy + g * turn * nx - other * along_y
        dg, deta = (wy * ex - wx * ey) / cross, (wy * nx - wx * ny) / cross
        dp = 0.0
        if int(doing[q]) > OPEN:
            rounds = rounding_change(c, q, xi, eta, d_xi[j], deta)
            dp = -d_xi[j] * slope - c[q, EPS_N] * (dg + d_xi[j] * widens + rounds)
        d_shape = (-d_xi[j], d_xi[j], -deta, deta)
        for k in range(4):
            whole = multipliers[at[k]] + p
            # fault: multipliers moved by a place, but not with their area -> out[i, k, 2 + j % 2] += (0.0 * shape[k] +
            #   area * d_shape[k]) * whole + area * shape[k] * dp | contact/test_coupling
            out[i, k, 2 + j % 2] += (d_area[j] * shape[k] + area * d_shape[k]) * whole + area * shape[k] * dp


@kernel
def by_multiplier(n: Floats, points: Floats, c: Floats, doing: Floats, q: int, out: Floats) -> None:
    """Add what the multipliers of the slave's two nodes do at a touching point: to forces out[..., :2] [m2], and to R.

    n : (2, 2) [1].  points : (n_p, >= 4) xi, eta [1], gap [m], area [m2].  c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1].
    doing : (n_p,) state [1].  out : (6, 4, 5) [m2, N/m, m2], the values of Couplings.
    """
    xi, eta, area = points[q, 0], points[q, 1], points[q, 3]
    nx, ny = field_normal(n, xi)[:2]
    drag = 0.0
    if int(doing[q]) >= SLIPS_FORWARD:
        # fault: a slipping point drags nothing for its multiplier -> drag = 0.0 | contact/test_coupling
        drag = -c[q, MU] if int(doing[q]) == SLIPS_BACK else c[q, MU]
    shape = (1.0 - xi, xi, 1.0 - eta, eta)
    for j in range(2):
        for k in range(4):
            w = area * shape[j] * shape[k]
            sign = 1.0 if k < 2 else -1.0
            out[ENDS[k], j, 0] += sign * w * (nx + drag * ny)
            out[ENDS[k], j, 1] += sign * w * (ny - drag * nx)
            out[ENDS[k], j, 4] -= w


@kernel
def assembled(nodes: Ints, ends: Ints, values: Floats, place: NDArray[np.int64], size: Floats, eps: float, n: int,
              k: int) -> tuple[Floats, Floats, Floats]:
    """Sum the pieces of Couplings: B : (n, k) [N/m], eps times what multipliers do to forces, C : (k, n) [1] and
    D : (k, k) [1], the derivatives of R over W eps by places and by multipliers over eps, those of W_i lambda_i too.

    nodes : (n_b, 6).  ends : (n_b, 4).  values : (n_b, 6, 4, 5).  place : (n_m,) number of a multiplier among the k, -1
    of others.  size : (n_m,) [N/m], W eps.  n : 2 n_s.
    """
    B, C, D = np.zeros((n, k)), np.zeros((k, n)), np.eye(k)
    for b in range(nodes.shape[0]):
        for j in range(4):
            column = place[ends[b, j]]
            if column < 0:
                continue
            per = 1.0 / size[ends[b, j]]
            for i in range(6):
                row = 2 * nodes[b, i]
                for d in range(2):
                    B[row + d, column] += eps * values[b, i, j, d]
                    C[column, row + d] += per * values[b, i, j, 2 + d]
            for i in range(4):
                equation = place[ends[b, i]]
                if equation >= 0:
                    D[equation, column] += eps / size[ends[b, i]] * values[b, ENDS[i], j, 4]
    return B, C, D
