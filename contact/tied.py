"""Tied pairs: points that faced each other at the start stay together, whatever pulls or shears them.

A piece of slave edge and what it faced at Register.x keep their material points for good: two Gauss points xi on the
slave's edge, eta on the master's, with their weights A there [m2].  What a point stood apart as drawn it keeps, as an
arm g fixed to its slave's edge and turning with it:
    d = x_s(xi) + R g - x_m(eta),   t = lambda - eps d,
the way [m] the two have come apart and the traction [Pa] on the slave, per area at Register.x; lambda is linear between
the slave's nodes.  d knows no direction: pull, pressure and shear are one law, linear but for the arm.  Forces are the
derivative of sum A (eps d.d/2 - lambda.d), so they add up to nothing, and so do their moments where d is nothing in the
mean.  No superposed rigid motion changes d, but for its direction.  The multipliers that hold sum A N_j d = 0 at every
slave node pass on every traction that is linear along the edges, whatever the two meshes (mortar: Bernardi, Maday and
Patera 1994; Puso and Laursen, Comput. Methods Appl. Mech. Eng. 193, 2004).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.compiled import kernel
from contact.faced import ray
from contact.messages import Floats, Ints
from contact.penalty import penalties
from contact.piece import NODES
from contact.quadrature import GAUSS, master_weights, ring
from contact.search import pass_points
from contact.surfaces import RegisteredSurfaces, edge_frames, frame_of

# Of a multiplier's own weight: so firmly it stays where nothing feels it, as where both sides are prescribed.
STAYS = 1e-6


@dataclass(frozen=True)
class Ties:
    """Tied points, n of them, two a piece.

    number : (n,) of the pass.  met : (n, 2) slave and master edge.  at : (n, 4) pair nodes, the slave edge's two first.
    values : (n, 5) xi_s, xi_m [1], gap as drawn [m], area, area_m [m2], as of contact.search, at Register.x.
    cuts : (n, 2) ends [1] of the piece on the slave's edge, and on the master's, the same for both of its points: xi_1,
    xi_2 in row i, eta_1, eta_2 in row i + 1.  arm : (n, 2) [m] along the slave's edge, and out of it.
    eps : (n,) [Pa/m].  bond : (n, 2) numbers k of the slave's two nodes among the n_t.
    node_eps : (n_t,) [Pa/m] the mean of eps, and weight : (n_t,) [m2] sum A N.
    """

    number: Ints
    met: Ints
    at: Ints
    values: Floats
    cuts: Floats
    arm: Floats
    eps: Floats
    bond: Ints
    node_eps: Floats
    weight: Floats


def ties_of(surfaces: RegisteredSurfaces) -> Ties:
    """Find what is tied, once for registered surfaces.  Raises ValueError where Register.x is no possible geometry."""
    if "ties" not in surfaces.found:
        surfaces.found["ties"] = _ties(surfaces)
    found = surfaces.found["ties"]
    assert isinstance(found, Ties)
    return found


def _ties(surfaces: RegisteredSurfaces) -> Ties:
    r, p, of = surfaces.register, surfaces.passes, surfaces.pair_nodes
    x, numbers = r.x, np.flatnonzero(surfaces.tied).astype(np.int32)
    if x is None:
        x = np.empty((r.n_nodes, 2))
    length, normal = edge_frames(x, r.edges, surfaces.previous, surfaces.following)
    straight = np.zeros(len(r.edges))
    found = [pass_points(surfaces, x, length, normal, None, straight, int(i))[:2] for i in numbers]
    met = np.concatenate([np.empty((0, 2), np.int32), *(m for m, _ in found)])
    values = np.concatenate([np.empty((0, 5)), *(v for _, v in found)])
    number = np.repeat(numbers, [len(m) for m, _ in found]).astype(np.int32)
    at = np.empty((len(met), 4), np.int32)
    for side in range(2):
        at[:, 2 * side:2 * side + 2] = of.first[number, side][:, None] + of.place[met[:, side]]
    cuts, arm = drawn(x, r.edges, normal, met, values)
    eps = penalties(p.eps_N[number], surfaces.stiffness, met)
    bond = np.searchsorted(of.tied, at[:, :2]).astype(np.int32)
    node_eps, weight = np.zeros(of.tied.size), np.zeros(of.tied.size)
    for end in range(2):
        share = (values[:, 0] if end else 1.0 - values[:, 0]) * values[:, 3]
        np.add.at(weight, bond[:, end], share)
        np.add.at(node_eps, bond[:, end], share * eps)
    node_eps = np.divide(node_eps, weight, out=np.zeros_like(weight), where=weight > 0.0)
    return Ties(number, met, at, values, cuts, arm, eps, bond, node_eps, weight)


@kernel
def drawn(x: Floats, edges: Ints, normal: Floats, met: Ints, values: Floats) -> tuple[Floats, Floats]:
    """Return cuts (n, 2) [1] and arms (n, 2) [m] of points found at x : (n_s, 2) [m], as in Ties.

    edges : (n_edges, 2).  normal : (n_edges, 3, 2) [1].  met : (n, 2).  values : (n, 5).
    """
    cuts, arm = np.empty((met.shape[0], 2)), np.empty((met.shape[0], 2))
    for i in range(met.shape[0]):
        e, m = met[i, 0], met[i, 1]
        a, b, c, d = edges[e, 0], edges[e, 1], edges[m, 0], edges[m, 1]
        tx, ty = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1]
        size = np.sqrt(tx * tx + ty * ty)
        tx, ty = tx / size, ty / size
        xi, eta = values[i, 0], values[i, 1]
        gx = (1.0 - eta) * x[c, 0] + eta * x[d, 0] - (1.0 - xi) * x[a, 0] - xi * x[b, 0]
        gy = (1.0 - eta) * x[c, 1] + eta * x[d, 1] - (1.0 - xi) * x[a, 1] - xi * x[b, 1]
        arm[i, 0], arm[i, 1] = gx * tx + gy * ty, gx * ty - gy * tx
        if i % 2 == 0:
            half = 0.5 * (values[i + 1, 0] - xi) / (2.0 * GAUSS)
            middle, frame = 0.5 * (xi + values[i + 1, 0]), frame_of(x, edges, normal, e)
            for k in range(2):
                cuts[i, k] = middle + (2 * k - 1) * half
                cuts[i + 1, k] = min(max(ray(frame, cuts[i, k], x, edges, m)[0], 0.0), 1.0)
    return cuts, arm


@kernel
def areas_now(x: Floats, edges: Ints, length: Floats, met: Ints, cuts: Floats, axisymmetric: bool,
              values: Floats) -> None:
    """Put the areas that tied points have at x : (n_s, 2) [m] into values : (n, 5), and a gap of 0.

    edges : (n_edges, 2).  length : (n_edges,) [m].  met : (n, 2).  cuts : (n, 2) [1].
    """
    for i in range(0, met.shape[0], 2):
        e, m = met[i, 0], met[i, 1]
        low, high = cuts[i + 1, 0], cuts[i + 1, 1]
        r_1, r_2 = x[edges[m, 0], 0], x[edges[m, 1], 0]
        r_low, r_high = ring(r_1, r_2, low, axisymmetric), ring(r_1, r_2, high, axisymmetric)
        for q in range(i, i + 2):
            depth = ring(x[edges[e, 0], 0], x[edges[e, 1], 0], values[q, 0], axisymmetric)
            values[q, 2], values[q, 4] = 0.0, 0.0
            values[q, 3] = 0.5 * (cuts[i, 1] - cuts[i, 0]) * length[e] * depth
        if r_low + r_high > 0.0:
            values[i, 4], values[i + 1, 4] = master_weights(values[i, 1], values[i + 1, 1], low, high,
                                                            abs(high - low) * length[m], r_low, r_high)


def points_now(surfaces: RegisteredSurfaces, x: Floats, length: Floats, number: int) -> tuple[Ints, Floats]:
    """Return the edges (n, 2) and values (n, 5) of the points of a tied pass at x : (n_s, 2) [m].

    length : (n_edges,) [m].
    """
    ties = ties_of(surfaces)
    own = ties.number == number
    met, values = ties.met[own], ties.values[own].copy()
    areas_now(x, surfaces.register.edges, length, met, ties.cuts[own], surfaces.register.axisymmetric, values)
    return met, values


# Forces

@dataclass(frozen=True)
class Bonds:
    """What ties do at coordinates x, by pieces, in the form of contact.traction and contact.multipliers.

    nodes : (n_b, 6), forces : (n_b, 6, 2) [N], blocks : (n_b, 12, 12) [N/m].
    apart : (n_t, 2) [m3] sum A N d.  t_N, t_T : (n_q,) [Pa] of the areas now, on both sides and on the slave's.
    stored : [J].
    """

    nodes: Ints
    forces: Floats
    blocks: Floats
    apart: Floats
    t_N: Floats
    t_T: Floats
    stored: float


def bonds_at(surfaces: RegisteredSurfaces, x: Floats, multipliers: Floats, area: Floats) -> Bonds:
    """Compute what ties do at x : (n_s, 2) [m].  multipliers : (n_m,) [Pa].  area : (n,) [m2] of the tied points, at x.
    """
    ties, of = ties_of(surfaces), surfaces.pair_nodes
    pulls = multipliers[of.size:].reshape(-1, 2)
    nodes, forces, blocks, apart, stress, stored = tied_pieces(x, surfaces.register.edges, ties.met, ties.values,
                                                               ties.arm, ties.eps, ties.bond, pulls)
    t_N, t_T = tied_means(of.size, ties.at, ties.values, stress, area)
    return Bonds(nodes, forces, blocks, apart, t_N, t_T, stored)


@kernel
def tie(x: Floats, edges: Ints, e: int, m: int, xi: float, eta: float, arm: Floats, D: Floats,
        swing: Floats) -> tuple[float, float]:
    """Return d [m] of a tied point and fill D : (2, 8), its derivatives by the slave's two nodes and the master's two.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  e, m, xi, eta : its edges, and where on them.  arm : (2,) [m].
    swing : (2,) [m] the derivative of the arm by the turn of its edge, out.
    """
    a, b, c, f = edges[e, 0], edges[e, 1], edges[m, 0], edges[m, 1]
    tx, ty = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1]
    size = np.sqrt(tx * tx + ty * ty)
    tx, ty = tx / size, ty / size
    # Turned by phi, t goes to -n and n = (ty, -tx) to t.
    gx, gy = arm[0] * tx + arm[1] * ty, arm[0] * ty - arm[1] * tx
    # fault: what was drawn apart does not turn with its edge -> swing[0], swing[1] = 0.0 * gy, 0.0 * gx |
    #   contact/test_tied
    swing[0], swing[1] = -gy, gx
    phi = (ty / size, -tx / size)  # by node a; by node b the same, the other way round
    for k in range(2):
        for j in range(2):
            same = 1.0 if k == j else 0.0
            D[k, j] = (1.0 - xi) * same + swing[k] * phi[j]
            D[k, 2 + j] = xi * same - swing[k] * phi[j]
            D[k, 4 + j], D[k, 6 + j] = (eta - 1.0) * same, -eta * same
    dx = (1.0 - xi) * x[a, 0] + xi * x[b, 0] + gx - (1.0 - eta) * x[c, 0] - eta * x[f, 0]
    dy = (1.0 - xi) * x[a, 1] + xi * x[b, 1] + gy - (1.0 - eta) * x[c, 1] - eta * x[f, 1]
    return dx, dy


@kernel
def add_bending(x: Floats, a: int, b: int, area: float, arm: Floats, swing: Floats, tx: float, ty: float,
                block: Floats) -> None:
    """Add to block : (8, 8) [N/m] what comes of the arm's second derivative under the traction (tx, ty) [Pa].

    x : (n_s, 2) [m].  a, b : the slave edge's nodes.  area : [m2].  arm, swing : (2,) [m].
    """
    ex, ey = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1]
    size = ex * ex + ey * ey
    length = np.sqrt(size)
    ex, ey = ex / length, ey / length
    gx, gy = arm[0] * ex + arm[1] * ey, arm[0] * ey - arm[1] * ex
    phi = (ey / length, -ex / length, -ey / length, ex / length)
    # Second derivatives of the angle: (t n' + n t')/L2 between like ends, the other sign between unlike ones.
    twice = ((2.0 * ex * ey / size, (ey * ey - ex * ex) / size), ((ey * ey - ex * ex) / size, -2.0 * ex * ey / size))
    along, across = tx * gx + ty * gy, tx * swing[0] + ty * swing[1]
    for i in range(4):
        for j in range(4):
            sign = 1.0 if i // 2 == j // 2 else -1.0
            # fault: stiffness without the turn of what was drawn apart -> block[i, j] -= 0.0 * area * along |
            #   contact/test_tied
            block[i, j] -= area * (across * sign * twice[i % 2][j % 2] - along * phi[i] * phi[j])


@kernel
def tied_pieces(x: Floats, edges: Ints, met: Ints, values: Floats, arm: Floats, eps: Floats, bond: Ints,
                pulls: Floats) -> tuple[Ints, Floats, Floats, Floats, Floats, float]:
    """Compute nodes (n_b, 6), forces (n_b, 6, 2) [N], blocks (n_b, 12, 12) [N/m], apart (n_t, 2) [m3] and stored [J].

    And stress (n, 2) [Pa], the traction of each point out of the slave and along it.  x : (n_s, 2) [m].  edges :
    (n_edges, 2).  met, values, arm, eps, bond : as in Ties.  pulls : (n_t, 2) [Pa] multipliers.
    """
    n_b = met.shape[0] // 2
    nodes, forces = np.empty((n_b, NODES), dtype=np.int32), np.zeros((n_b, NODES, 2))
    blocks, apart = np.zeros((n_b, 2 * NODES, 2 * NODES)), np.zeros(pulls.shape)
    stress, D, swing, stored = np.empty((met.shape[0], 2)), np.empty((2, 8)), np.empty(2), 0.0
    place = np.array([0, 1, 2, 3, 8, 9, 10, 11])  # rows of nodes 0, 1, 4, 5 of contact.piece
    small = np.empty((8, 8))
    for i in range(met.shape[0]):
        e, m, p = met[i, 0], met[i, 1], i // 2
        a, b = edges[e, 0], edges[e, 1]
        nodes[p] = np.array([a, b, a, b, edges[m, 0], edges[m, 1]], dtype=np.int32)
        xi, area = values[i, 0], values[i, 3]
        dx, dy = tie(x, edges, e, m, xi, values[i, 1], arm[i], D, swing)
        j, k = bond[i, 0], bond[i, 1]
        # fault: a tie holds along one direction alone -> ty = 0.0 * dy | mechanical_fmu/test_tied
        ty = (1.0 - xi) * pulls[j, 1] + xi * pulls[k, 1] - eps[i] * dy
        tx = (1.0 - xi) * pulls[j, 0] + xi * pulls[k, 0] - eps[i] * dx
        for c in range(8):
            forces[p, place[c] // 2, c % 2] += area * (D[0, c] * tx + D[1, c] * ty)
            for g in range(8):
                small[c, g] = area * eps[i] * (D[0, c] * D[0, g] + D[1, c] * D[1, g])
        add_bending(x, a, b, area, arm[i], swing, tx, ty, small)
        for c in range(8):
            for g in range(8):
                blocks[p, place[c], place[g]] += small[c, g]
        for end in range(2):
            N = xi if end == 1 else 1.0 - xi
            apart[bond[i, end], 0] += area * N * dx
            apart[bond[i, end], 1] += area * N * dy
        ex, ey = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1]
        length = np.sqrt(ex * ex + ey * ey)
        stress[i, 0], stress[i, 1] = (tx * ey - ty * ex) / length, (tx * ex + ty * ey) / length
        stored -= 0.5 * area * (tx * dx + ty * dy)
    return nodes, forces, blocks, apart, stress, stored


@kernel
def tied_means(n_q: int, at: Ints, values: Floats, stress: Floats, now: Floats) -> tuple[Floats, Floats]:
    """Average the tractions of ties to pair nodes, of the areas now : (n,) [m2]: t_N of both sides, t_T of the slave's.

    Both (n_q,) [Pa].  at : (n, 4) pair nodes.  values : (n, 5) as in Ties.  stress : (n, 2) [Pa] of values' areas.
    A master's node has the mean of what the slave's nodes have where it faces them, as in contact.traction.
    """
    t, faced = np.zeros((n_q, 2)), np.zeros(n_q)
    for side in range(2):
        for i in range(at.shape[0]):
            xi = values[i, 0]
            for end in range(2):
                s = at[i, 2 * side + end]
                weight = now[i] * (values[i, side] if end == 1 else 1.0 - values[i, side])
                for k in range(2):
                    if side == 1:
                        t[s, k] += weight * ((1.0 - xi) * t[at[i, 0], k] + xi * t[at[i, 1], k])
                    else:
                        t[s, k] += weight / now[i] * values[i, 3] * stress[i, k]
                faced[s] += weight
        for i in range(at.shape[0]):
            for end in range(2):
                s = at[i, 2 * side + end]
                if faced[s] > 0.0:  # once: what is done is marked
                    t[s, 0], t[s, 1], faced[s] = t[s, 0] / faced[s], t[s, 1] / faced[s], -1.0
    t_T = t[:, 1].copy()
    for i in range(at.shape[0]):
        t_T[at[i, 2]] = 0.0
        t_T[at[i, 3]] = 0.0
    return t[:, 0].copy(), t_T


@kernel
def tied_couplings(x: Floats, edges: Ints, met: Ints, values: Floats, arm: Floats, bond: Ints, node_eps: Floats,
                   n_q: int) -> tuple[Ints, Ints, Floats]:
    """Compute nodes (n_b, 6), ends (n_b, 4) and values (n_b, 6, 4, 5) of tied pieces, as of Couplings.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  met, values, arm, bond, node_eps : as in Ties.  R_j = eps_j sum A N_j d
    has no derivative by lambda; STAYS W_j in its place leaves R alone and keeps multipliers that nothing feels.
    """
    n_b = met.shape[0] // 2
    nodes, ends = np.empty((n_b, NODES), dtype=np.int32), np.empty((n_b, 4), dtype=np.int32)
    out, D, swing = np.zeros((n_b, NODES, 4, 5)), np.empty((2, 8)), np.empty(2)
    own = np.array([0, 1, 4, 5])
    for i in range(met.shape[0]):
        e, m, p = met[i, 0], met[i, 1], i // 2
        a, b = edges[e, 0], edges[e, 1]
        nodes[p] = np.array([a, b, a, b, edges[m, 0], edges[m, 1]], dtype=np.int32)
        xi, area = values[i, 0], values[i, 3]
        tie(x, edges, e, m, xi, values[i, 1], arm[i], D, swing)
        for end in range(2):
            k, w = bond[i, end], area * (xi if end == 1 else 1.0 - xi)
            for c in range(2):
                j = 2 * end + c
                ends[p, j] = n_q + 2 * k + c
                for node in range(4):
                    for g in range(2):
                        out[p, own[node], j, g] += w * D[c, 2 * node + g]
                        # fault: multipliers of ties heed another penalty -> out[p, own[node], j, 2 + g] += 2.0 *
                        #   node_eps[k] * w * D[c, 2 * node + g] | contact/test_tied
                        out[p, own[node], j, 2 + g] += node_eps[k] * w * D[c, 2 * node + g]
                out[p, own[j], j, 4] -= (1.0 - STAYS) * w
    return nodes, ends, out
