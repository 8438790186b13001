"""Contact forces at the contact quadrature points: the reply to a Traction request.  Eqs. (17)-(20), Coulomb's law.

p_N = max(-lambda - eps_N g_N, 0) at each point, lambda interpolated from the slave's nodes; a point touches where
p_N > 0.  It pushes the slave with -N p_N n A and the master with +M p_N n A, along the ray n that joins the two
points, so forces and moments balance to round-off.  A touching point with friction drags along t (n turned to the
left) with tau = tau_before - eps_T slip, bounded by mu p_N; what it moves at that bound makes heat.  The history is
tau/p_N, the mobilised friction (contact.shear_history).
The two drags stand the gap apart, so their moments balance only to tau A g_N.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.arcs import feet
from contact.compiled import kernel
from contact.faced import ray
from contact.facing import Cut, cut_surfaces, shapes_of
from contact.leaning import FACE, Follows, by_face, ways_of
from contact.messages import ContactState, Floats, Ints, Traction, Tractions
from contact.nodal import at_slivers, nodal_means, on_masters, touching_means
from contact.penalty import in_a_row, penalties
from contact.piece import (
    EPS_N,
    EPS_T,
    FIXED,
    LAMBDA_1,
    LAMBDA_2,
    MU,
    N_CONSTANTS,
    NODES,
    OFFSET_1,
    OFFSET_2,
    OPEN,
    OPENS,
    RISE_M,
    RISE_S,
    SLIPS_BACK,
    SLIPS_FORWARD,
    STICKS,
    TRIAL,
    TRIAL_ETA,
    TRIAL_XI,
    piece_stiffness,
    ray_length,
)
from contact.quadrature import GAUSS
from contact.shear_history import ShearHistory, checked_history, noted, remembered
from contact.slip import slip_since
from contact.surfaces import Frame, RegisteredSurfaces, checked_reals, edge_frames, frame_of
from contact.tied import Bonds, bonds_at, ties_of

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
        for k in range(filled[s]):  # by numbers: numba takes 2 s to compile one assignment of slices
            packed[starts[s] + k] = columns[room[s] + k]
    for p in range(n_pieces):
        for i in range(m):
            for j in range(m):
                at = starts[nodes[p, i]]
                while packed[at] < nodes[p, j]:
                    at += 1
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
ZERO_GAP = 1e-3  # of the gaps at the points of a piece: smaller ones are where it opens


@dataclass(frozen=True)
class PointStates:
    """State of the contact quadrature points.

    c : (n_p, N_CONSTANTS) of contact.piece.  doing : (n_p,) open, sticks or slips.  p_N, tau : (n_p,) [Pa].
    heat : (n_p,) [J].  slip : (n_p,) [m], at Coulomb's bound.
    """

    c: Floats
    doing: Floats
    p_N: Floats
    tau: Floats
    heat: Floats
    slip: Floats


def traction(surfaces: RegisteredSurfaces, request: Traction) -> Tractions:
    """Compute contact forces at request.x.  Raises ValueError."""
    r = surfaces.register
    asked, cut, points = evaluated(surfaces, request)
    nodes, forces, blocks = pieces(asked.x, r.edges, surfaces.previous, surfaces.following, cut.met, cut.values,
                                   cut.normals, cut.follows, cut.shape, surfaces.passes.by_node[cut.number],
                                   r.axisymmetric, points.c, points.doing)
    of, bonds = surfaces.pair_nodes, None
    if of.tied.size:
        bonds = bonds_at(surfaces, asked.x, asked.multipliers, cut.values[surfaces.tied[cut.number] == 1, 3])
        nodes, forces = np.concatenate([nodes, bonds.nodes]), np.concatenate([forces, bonds.forces])
        blocks = np.concatenate([blocks, bonds.blocks])
    force = added_up(r.n_nodes, nodes, forces)
    starts, columns, stiffness = rows_of(r.n_nodes, nodes, blocks)
    mean, drag, E_friction, faced = nodal_means(of.size, cut.at, cut.values, points.p_N, points.tau, points.heat)
    t_N, t_T = at_slivers(mean, drag, faced, cut.node_covered, of.searched, of.sides, surfaces.start, of.place)
    t_N = on_masters(t_N, of.searched, cut.at, cut.values)
    pressed, dragged = (touching_means(of.size, cut.at, cut.values, points.doing, told)
                        for told in (points.p_N, points.tau))
    mobilised = np.divide(dragged, pressed, out=np.zeros(of.size), where=pressed > 0.0)
    mobilised_at = noted(cut.at, cut.values, points.c[:, MU], points.p_N, points.tau)
    # fault: what sticks is told as slipping -> slides = (points.doing >= STICKS).astype(np.float64) |
    #   contact/test_traction
    slides = (points.doing >= SLIPS_FORWARD).astype(np.float64)
    slipping = touching_means(of.size, cut.at, cut.values, points.doing, slides)
    slip = touching_means(of.size, cut.at, cut.values, points.doing, points.slip)
    told = Tractions(force, starts, columns, stiffness, t_N, cut.node_gap, cut.node_covered,
                     np.where(of.searched == 1, mean, 0.0), mobilised, mobilised_at, t_T, E_friction, slipping, slip,
                     int(np.count_nonzero(points.p_N)), int(np.count_nonzero(points.doing >= SLIPS_FORWARD)),
                     spring_energy(cut.values, points))
    return told if bonds is None else _with_ties(surfaces, told, bonds, asked.multipliers)


def _with_ties(surfaces: RegisteredSurfaces, told: Tractions, bonds: Bonds, multipliers: Floats) -> Tractions:
    """Add what ties carry to tractions; multipliers : (n_m,) [Pa], those asked for."""
    ties, n_q = ties_of(surfaces), surfaces.pair_nodes.size
    went = np.divide(ties.node_eps, ties.weight, out=np.zeros_like(ties.weight), where=ties.weight > 0.0)
    # fault: multipliers of ties stay what they were -> pulls = multipliers[n_q:].copy() | contact/test_tied
    pulls = multipliers[n_q:] - (went[:, None] * bonds.apart).ravel()
    return replace(told, t_N=told.t_N + bonds.t_N, shear=told.shear + bonds.t_T,
                   multipliers=np.concatenate([told.multipliers, pulls]), stored=told.stored + bonds.stored)


def spring_energy(values: Floats, points: PointStates) -> float:
    """Sum A (p_N depth + tau^2/eps_T)/2 [J]; values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].

    Where multipliers have taken the load the depth is nothing in the mean, and so is what is held.
    """
    gap, area = values[:, 2:4].T
    sticking = np.divide(points.tau**2, points.c[:, EPS_T], out=np.zeros_like(gap), where=points.tau != 0.0)
    # fault: contact holds twice what its springs do -> return float((area * (sticking - points.p_N * gap)).sum()) |
    #   mechanical_fmu/test_impact::test_a_bar_comes_back_as_the_wave_says_at_any_penalty
    return 0.5 * float((area * (sticking - points.p_N * gap)).sum())


@dataclass(frozen=True)
class Asked:
    """The arrays of a request, checked.

    x, before : (n_s, 2) [m] now and when the history was noted.  multipliers, multipliers_before : (n_m,) [Pa].
    history : shear over p_N then.  sticking : share of eps_T [1].
    """

    x: Floats
    multipliers: Floats
    before: Floats
    multipliers_before: Floats
    history: ShearHistory
    sticking: float


def checked_request(surfaces: RegisteredSurfaces, request: ContactState) -> Asked:
    """Check the arrays of a request.  Raises ValueError."""
    n, n_q, n_m = surfaces.register.n_nodes, surfaces.pair_nodes.size, surfaces.pair_nodes.n_multipliers
    multipliers = checked_reals("multipliers", request.multipliers, (n_m,))
    pressing = multipliers[:n_q]
    if pressing.size and pressing.max() > 0.0:
        raise ValueError(f"multipliers must be <= 0, got {pressing.max()!r} at pair node {pressing.argmax()}")
    before = checked_reals("x_before", request.x_before, (n, 2))
    then = checked_reals("multipliers_before", request.multipliers_before, (n_m,))
    history = checked_history(request.mobilised, request.mobilised_at, n_q)
    sticking = checked_reals("sticking", request.sticking, ()).item()
    if not sticking > 0.0:
        raise ValueError(f"sticking must be > 0, got {sticking!r}")
    return Asked(checked_reals("x", request.x, (n, 2)), multipliers, before, then, history, sticking)


def evaluated(surfaces: RegisteredSurfaces, request: ContactState) -> tuple[Asked, Cut, PointStates]:
    """Check a request, cut the surfaces and evaluate the points.  Raises ValueError.

    Equations of multipliers are asked for where forces were asked for just before: what was found for the last request
    is kept, and given again for the same numbers.
    """
    told = [np.asarray(a) for a in (request.x, request.multipliers, request.x_before, request.multipliers_before,
                                    request.mobilised, request.mobilised_at, request.sticking)]
    last = surfaces.found.get("evaluated")
    # fault: what was found for another request is given -> if last is not None: | contact/test_coupling
    if last is not None and all(map(np.array_equal, told, last[0])):
        return last[1]
    asked = checked_request(surfaces, request)
    cut = cut_surfaces(surfaces, asked.x)
    found = asked, cut, points_at(surfaces, cut, asked)
    surfaces.found["evaluated"] = [a.copy() for a in told], found
    return found


def points_at(surfaces: RegisteredSurfaces, cut: Cut, asked: Asked) -> PointStates:
    """Evaluate the points of a cut."""
    p, edges, n = surfaces.passes, surfaces.register.edges, len(cut.met)
    c = np.zeros((n, N_CONSTANTS))
    c[:, LAMBDA_1:LAMBDA_2 + 1] = asked.multipliers[cut.at[:, :2]]
    c[:, EPS_N], c[:, MU] = penalties(p.eps_N[cut.number], surfaces.stiffness, cut.met), p.mu[cut.number]
    # What is tied neither presses nor rubs: its forces are those of contact.tied.
    c[surfaces.tied[cut.number] == 1, :LAMBDA_2 + 1] = 0.0
    c[surfaces.tied[cut.number] == 1, EPS_N] = 0.0
    c[:, OFFSET_1:OFFSET_2 + 1] = surfaces.offsets[cut.number, cut.met[:, 0]]
    shapes = shapes_of(surfaces)
    c[:, RISE_S:RISE_M + 1] = shapes.rise[cut.shape[:, None], cut.met]
    by_penalty = surfaces.stick[cut.number] * c[:, EPS_N]
    c[:, EPS_T] = asked.sticking * np.where(p.eps_T[cut.number] > 0.0, p.eps_T[cut.number], by_penalty)
    points = PointStates(c, *(np.zeros(n) for _ in range(5)))
    press(cut.values, c, points.doing, points.p_N)
    if p.mu.any():
        # fault: slip is along the normals of now -> length, normal = edge_frames(asked.x, edges, surfaces.previous,
        #   surfaces.following) | contact/test_slip::test_a_turn_of_both_is_no_slip mechanical_fmu/test_between_plates
        length, normal = edge_frames(asked.before, edges, surfaces.previous, surfaces.following)
        if not length.min() > 0.0:
            raise ValueError(f"x_before: edge {int(np.argmin(length))} has no length")
        told, normals = asked.history, shapes.normals(surfaces, asked.before, length, normal)[0]
        rub(asked.before, asked.multipliers_before, told.nodes, told.points, told.start, edges, surfaces.previous,
            surfaces.following, normals, shapes.rise, cut.shape, cut.met, cut.at, cut.values,
            p.eps_N[cut.number], surfaces.stiffness, c, points.doing, points.p_N, points.tau, points.heat, points.slip)
    return points


@kernel
def press(values: Floats, c: Floats, doing: Floats, p_N: Floats) -> None:
    """Fill the pressure p_N [Pa] of every point, and whether it is open or sticks until it is rubbed, (n_p,) each.

    values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1] as in
    contact.piece.
    """
    for i in range(values.shape[0]):
        xi, area = values[i, 0], values[i, 3]
        p = -(c[i, LAMBDA_1] + xi * (c[i, LAMBDA_2] - c[i, LAMBDA_1])) - c[i, EPS_N] * values[i, 2]
        doing[i] = OPEN
        # fault: contact may pull -> if area > 0.0: | contact/test_traction
        if p > 0.0 and area > 0.0:
            p_N[i], doing[i] = p, STICKS


@kernel
def rub(before: Floats, multipliers_before: Floats, mobilised: Floats, mobilised_at: Floats, start: Ints, edges: Ints,
        previous: Ints, following: Ints, normals: Floats, rise: Floats, shape: Ints, met: Ints, at: Ints,
        values: Floats, stated: Floats, stiffness: Floats, c: Floats, doing: Floats, p_N: Floats, tau: Floats,
        heat: Floats, slips: Floats) -> None:
    """Fill shear tau [Pa], state [1], slip [m] and its heat [J] of touching points, (n_p,) each, and c's part of shear.

    before : (n_s, 2) [m].  multipliers_before : (n_q,) [Pa].  mobilised, mobilised_at, start : as of ShearHistory.
    edges : (n_edges, 2).  previous, following : (n_edges,).  normals : (k, n_edges, 3, 2) [1], those of `before`,
    rise : (k, n_edges) [m], and shape : (n_p,) which of them are a point's.  met : (n_p, 2) slave and master edge.
    at : (n_p, 4) pair nodes.  values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  stated : (n_p,) [Pa/m],
    0: eps_N is that of the two edges in a row, of stiffness : (n_edges,) [Pa/m].
    c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1] as in contact.piece.  p_N : (n_p,) [Pa].
    tau_before is the mobilised friction of the slave's material point times the pressure it had, by the gap it had.
    """
    for i in range(met.shape[0]):
        if doing[i] == OPEN or not c[i, MU] > 0.0:
            continue
        xi, area = values[i, 0], values[i, 3]
        a, b = at[i, 0], at[i, 1]
        slip, slip_xi, slip_eta, g, g_xi, faced = slip_since(before, edges, previous, following, normals[shape[i]],
                                                             rise[shape[i]], met[i, 0], xi, met[i, 1], values[i, 1])
        r, r_slope = remembered(mobilised, mobilised_at, start, a, b, xi)
        slope = multipliers_before[b] - multipliers_before[a]
        g_xi += c[i, OFFSET_2] - c[i, OFFSET_1]
        g += c[i, OFFSET_1] + xi * (c[i, OFFSET_2] - c[i, OFFSET_1])
        eps = stated[i] if stated[i] > 0.0 else in_a_row(stiffness[met[i, 0]], stiffness[faced])
        p, p_xi = -(multipliers_before[a] + xi * slope) - eps * g, -slope - eps * g_xi
        if not p > 0.0:
            p, p_xi = 0.0, 0.0
        trial = r * p - c[i, EPS_T] * slip
        c[i, TRIAL] = trial
        c[i, TRIAL_XI], c[i, TRIAL_ETA] = r_slope * p + r * p_xi - c[i, EPS_T] * slip_xi, -c[i, EPS_T] * slip_eta
        bound = c[i, MU] * p_N[i]
        tau[i] = trial
        # fault: friction without its bound -> if abs(trial) > 1e9 * bound: | mechanical_fmu/test_friction
        if abs(trial) > bound:
            # fault: what slips is told as sticking -> doing[i] = STICKS | scenarios/test_contact_robust
            doing[i] = SLIPS_FORWARD if trial > 0.0 else SLIPS_BACK
            tau[i] = bound if trial > 0.0 else -bound
            # fault: slip is told with the spring's part -> slips[i] = slip | contact/test_slip
            slips[i] = (tau[i] - trial) / c[i, EPS_T]
            # fault: friction heat halved -> heat[i] = 0.5 * tau[i] * (trial - tau[i]) / c[i, EPS_T] * area |
            #   mechanical_fmu/test_friction
            # fault: the spring of sticking makes heat, too -> heat[i] = abs(tau[i] * trial) / c[i, EPS_T] * area |
            #   mechanical_fmu/test_stick_slip
            heat[i] = tau[i] * (trial - tau[i]) / c[i, EPS_T] * area


@kernel
def pieces(x: Floats, edges: Ints, previous: Ints, following: Ints, met: Ints, values: Floats, normals: Floats,
           follows: Follows, shape: Ints, by_node: Ints, axisymmetric: bool, c: Floats,
           doing: Floats) -> tuple[Ints, Floats, Floats]:
    """Compute nodes (n_b, 6), forces (n_b, 6, 2) [N] and blocks (n_b, 12, 12) [N/m] of the touching pieces.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  previous, following : (n_edges,).  met : (n_p, 2) slave and master edge.
    values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].  normals : (k, n_edges, 3, 2) [1], what
    they turn with, follows : (k, n_edges, 2), and shape : (n_p,) which of them are a point's.  by_node : (n_p,).
    c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1] as in contact.piece.  doing : (n_p,) state [1].  More rows of nodes and blocks
    are what faces do that corners lean to.
    """
    n_blocks, n_more = 0, 0
    for i in range(0, met.shape[0], 2):
        if doing[i] > OPEN or doing[i + 1] > OPEN:
            n_blocks += 1
            for k in range(2):
                n_more += follows[shape[i], met[i, 0], k] >= FACE
    nodes = np.empty((n_blocks + n_more, NODES), dtype=np.int32)
    forces, blocks = np.zeros((n_blocks + n_more, NODES, 2)), np.empty((n_blocks + n_more, 2 * NODES, 2 * NODES))
    width, more = 2 * NODES + (2 if n_more > 0 else 0), n_blocks
    whole = np.empty((2 * NODES, width))
    here = np.empty((NODES, 2))
    ways, ends, moves, scratch = np.empty((2, 3)), np.empty(2), np.empty(2), np.empty((6, width))
    b = 0
    for i in range(0, met.shape[0], 2):
        if not (doing[i] > OPEN or doing[i + 1] > OPEN):
            continue
        e, m, normal = met[i, 0], met[i, 1], normals[shape[i]]
        piece_nodes(edges, previous, following, e, m, nodes[b])
        for k in range(NODES):
            for d in range(2):
                here[k, d] = x[nodes[b, k], d]
        ways_of(normal, follows[shape[i]], previous, following, e, ways)
        nodal = by_node[i] == 1
        piece_cuts(frame_of(x, edges, normal, e), x, edges, m, here, values, c, i, nodal, ends, moves)
        piece_stiffness(here, normal[e, 1:], ways, nodal, axisymmetric, moves, ends, values, c, doing, i,
                        scratch, forces[b], whole)
        blocks[b] = whole[:, :2 * NODES]
        for k in range(2):
            if ways[k, 2] != 0.0:
                by_face(x, edges, follows[shape[i], e, k], nodes[b], whole[:, 2 * NODES + k], nodes[more], blocks[more])
                more += 1
        b += 1
    return nodes, forces, blocks


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
def piece_cuts(frame: Frame, x: Floats, edges: Ints, m: int, here: Floats, values: Floats, c: Floats, i: int,
               nodal: bool, ends: Floats, moves: Floats) -> None:
    """Fill the cuts of the piece whose Gauss points are in rows i and i + 1, and what each of them follows.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  m : the master's edge.  here : (6, 2) coordinates of its nodes [m].
    values : (n_p, 5).  c : (n_p, N_CONSTANTS).  nodal : the points are the cuts, of a part of half an edge
    (contact.quadrature.place_node).  ends : (2,) cuts [1], out.  moves : (2,) nodes, FIXED or OPENS [1], out.
    """
    xi_1, xi_2 = values[i, 0], values[i + 1, 0]
    half = 0.5 * (xi_2 - xi_1) / (2.0 * GAUSS)
    ends[0], ends[1] = (xi_1, xi_2) if nodal else (0.5 * (xi_1 + xi_2) - half, 0.5 * (xi_1 + xi_2) + half)
    moves[:] = FIXED
    for k in range(2):
        # The nodes of the edge, and the middle, where halves meet.
        if min(ends[k], 1.0 - ends[k]) <= CUT_MATCH or (nodal and ends[k] == 0.5):
            continue
        for node in range(4, NODES):
            first, second = feet(frame, here[node, 0], here[node, 1])
            if abs(first - ends[k]) <= CUT_MATCH or abs(second - ends[k]) <= CUT_MATCH:
                # fault: cuts do not move with the other side's nodes -> moves[k] = FIXED | contact/test_traction
                moves[k] = node
        if not nodal and int(moves[k]) == FIXED:
            # With a gap of 0 the ray ends on the master's edge.
            eta, g, _ = ray(frame, ends[k], x, edges, m)
            if (abs(g - ray_length(c, i, 0.0, ends[k], eta))
                    <= ZERO_GAP * max(abs(values[i, 2]), abs(values[i + 1, 2]))):
                moves[k] = OPENS
