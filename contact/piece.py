"""The forces of one piece of contact and their exact derivative.  Eqs. (17)-(20), and Coulomb's law.

A piece's cuts, normals, gaps and areas all move with its six nodes: 0, 1 of the slave edge, 2 before it, 3 after it
(they turn the normals), 4, 5 of the master edge.  What is called d_a : (w,) is the derivative of a by their
coordinates, node by node, x before y; w = 12, or 14 with that by the turns of the normals at nodes 0 and 1 where these
follow a face (contact.leaning).

In the plane a unit vector can only turn: n' = phi' t with t = n turned to the left, and the normalised mean of two
unit vectors turns by the mean of their angles.  That is all the product rules need.
"""

from __future__ import annotations

import numpy as np

from contact.compiled import kernel
from contact.messages import Floats
from contact.quadrature import GAUSS

NODES = 6
# A cut that moves with the edge, and one where the gap is 0 (contact.search.openings); else the node whose foot it is.
FIXED, OPENS = -1, -2
# Columns of a point's constants: multipliers at the slave's nodes [Pa], penalties [Pa/m], friction [1], the
# shear if it sticks with its derivatives by xi and eta [Pa], what is added to the gap at the slave's nodes [m], and
# what slave and master rise above their edges (contact.rounding) where the pair is smooth [m].
LAMBDA_1, LAMBDA_2, EPS_N, EPS_T, MU, TRIAL, TRIAL_XI, TRIAL_ETA = 0, 1, 2, 3, 4, 5, 6, 7
OFFSET_1, OFFSET_2, RISE_S, RISE_M, N_CONSTANTS = 8, 9, 10, 11, 12
# State of a point, `doing`.
OPEN, STICKS, SLIPS_FORWARD, SLIPS_BACK = 0, 1, 2, 3


@kernel
def add_turn(x: Floats, a: int, b: int, weight: float, d_phi: Floats) -> None:
    """Add weight times the derivative of the direction of the edge from node a to node b.

    x : (6, 2) [m].  d_phi : (12,) [1/m].
    """
    tx, ty = x[b, 0] - x[a, 0], x[b, 1] - x[a, 1]
    scale = weight / (tx * tx + ty * ty)
    d_phi[2 * b] -= scale * ty
    d_phi[2 * b + 1] += scale * tx
    d_phi[2 * a] += scale * ty
    d_phi[2 * a + 1] -= scale * tx


@kernel
def turns(x: Floats, ways: Floats, d_phi: Floats) -> None:
    """Fill d_phi : (2, w) [1/m], how the normals at the slave's two nodes turn.

    x : (6, 2) [m].  ways : (2, 3) [1] the shares by which the edge, its neighbour and a face of the master turn them.
    """
    d_phi[:] = 0.0
    for k in range(2):
        if ways[k, 0] != 0.0:
            add_turn(x, 0, 1, ways[k, 0], d_phi[k])
        if ways[k, 1] != 0.0:
            # fault: normals do not turn with the neighbouring edge -> add_turn(x, 2 if k == 0 else 1, 0 if k == 0 else
            #   3, 0.0, d_phi[k]) | contact/test_traction
            add_turn(x, 2 if k == 0 else 1, 0 if k == 0 else 3, ways[k, 1], d_phi[k])
        if d_phi.shape[1] > 2 * NODES:
            # fault: the normal of a corner does not turn with the face -> d_phi[k, 2 * NODES + k] = 0.0 |
            #   contact/test_leaning
            d_phi[k, 2 * NODES + k] = ways[k, 2]


@kernel
def field_normal(n: Floats, xi: float) -> tuple[float, float, float, float, float]:
    """Return the unit normal at xi, and its turn by the turns of n : (2, 2) [1] and by xi."""
    ex, ey = n[1, 0] - n[0, 0], n[1, 1] - n[0, 1]
    mx, my = n[0, 0] + xi * ex, n[0, 1] + xi * ey
    size = mx * mx + my * my
    length = np.sqrt(size)
    return (mx / length, my / length, (1.0 - xi) * (mx * n[0, 0] + my * n[0, 1]) / size,
            xi * (mx * n[1, 0] + my * n[1, 1]) / size, (mx * ey - my * ex) / size)


@kernel
def cut_change(x: Floats, n: Floats, d_phi: Floats, node: int, xi: float, d_cut: Floats) -> None:
    """Fill d_cut : (w,) [1/m] of the slave coordinate xi whose ray passes through `node`.

    It solves (x_node - x(xi)) x n(xi) = 0.  x : (6, 2) [m].  n : (2, 2) [1].  d_phi : (2, w) [1/m].
    """
    nx, ny, by_0, by_1, by_xi = field_normal(n, xi)
    ex, ey = x[1, 0] - x[0, 0], x[1, 1] - x[0, 1]
    g = (x[node, 0] - x[0, 0] - xi * ex) * nx + (x[node, 1] - x[0, 1] - xi * ey) * ny
    scale = 1.0 / (ex * ny - ey * nx - g * by_xi)
    for j in range(d_cut.size):
        d_cut[j] = scale * g * (by_0 * d_phi[0, j] + by_1 * d_phi[1, j])
    for k in range(3):
        i, weight = (node, 1.0) if k == 2 else (k, -xi if k == 1 else xi - 1.0)
        d_cut[2 * i] += scale * weight * ny
        d_cut[2 * i + 1] -= scale * weight * nx


@kernel
def opening_change(x: Floats, n: Floats, d_phi: Floats, xi: float, c: Floats, q: int, d_cut: Floats) -> None:
    """Fill d_cut : (w,) [1/m] of the slave coordinate xi at which the gap is 0.

    x : (6, 2) [m].  n : (2, 2) [1].  d_phi : (2, w) [1/m].  c : (n_p, N_CONSTANTS), q : a point of the piece.
    """
    nx, ny, by_0, by_1, by_xi = field_normal(n, xi)
    sx, sy, ex, ey = x[1, 0] - x[0, 0], x[1, 1] - x[0, 1], x[5, 0] - x[4, 0], x[5, 1] - x[4, 1]
    cross = nx * ey - ny * ex
    eta = ((x[4, 0] - x[0, 0] - xi * sx) * ny - (x[4, 1] - x[0, 1] - xi * sy) * nx) / cross
    g = ray_length(c, q, 0.0, xi, eta)
    # P + g n = M(eta), as in add_point: first by xi, then by each coordinate with xi as it is.
    wx, wy = sx - g * by_xi * ny, sy + g * by_xi * nx
    by_edge = (wy * ex - wx * ey) / cross + c[q, OFFSET_2] - c[q, OFFSET_1]
    by_edge += rounding_change(c, q, xi, eta, 1.0, (wy * nx - wx * ny) / cross)
    for j in range(d_cut.size):
        i, along_x, along_y = j // 2, 1.0 - j % 2, float(j % 2)
        own = (1.0 - xi if i == 0 else xi) if i < 2 else 0.0
        other = (1.0 - eta if i == 4 else eta) if 4 <= i < NODES else 0.0
        turn = by_0 * d_phi[0, j] + by_1 * d_phi[1, j]
        wx, wy = (own - other) * along_x - g * turn * ny, (own - other) * along_y + g * turn * nx
        d_gap = (wy * ex - wx * ey) / cross + rounding_change(c, q, xi, eta, 0.0, (wy * nx - wx * ny) / cross)
        # fault: the place where surfaces part stays on its edge -> d_cut[j] = 0.0 * d_gap | contact/test_opening
        d_cut[j] = -d_gap / by_edge


@kernel
def frame_change(x: Floats, n: Floats, ways: Floats, moves: Floats, ends: Floats, c: Floats, q: int, d_phi: Floats,
                 d_cut: Floats) -> None:
    """Fill how the normals turn, d_phi, and the cuts of a piece move, d_cut, both (2, w) [1/m].

    x : (6, 2) [m].  n : (2, 2) [1].  ways : (2, 3) [1].  moves : (2,) the node each cut follows, FIXED or OPENS [1].
    ends : (2,) the cuts [1].  c : (n_p, N_CONSTANTS), q : a point of the piece.  d_phi, d_cut : (2, w) [1/m].
    """
    turns(x, ways, d_phi)
    for k in range(2):
        if int(moves[k]) == FIXED:
            d_cut[k] = 0.0
        elif int(moves[k]) == OPENS:
            opening_change(x, n, d_phi, ends[k], c, q, d_cut[k])
        else:
            cut_change(x, n, d_phi, int(moves[k]), ends[k], d_cut[k])


@kernel
def piece_stiffness(x: Floats, n: Floats, ways: Floats, by_node: bool, axisymmetric: bool, moves: Floats, ends: Floats,
                    points: Floats, c: Floats, doing: Floats, first: int, scratch: Floats, force: Floats,
                    block: Floats) -> None:
    """Fill force : (6, 2) [N] and block : (12, w) [N/m] = -d(force)/dx of a piece whose nodes are at x : (6, 2) [m].

    n : (2, 2) the normals at the slave's nodes [1], and ways : (2, 3) [1] what turns them, as of turns.
    ends : (2,) the cuts [1], and moves : (2,) the node each follows, FIXED or OPENS [1].
    points : (n_p, >= 4) xi, eta [1], gap [m], area [m2], c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1] and doing : (n_p,)
    state [1], the piece's two points in rows first, first + 1.
    by_node : the point is at the first of its ends.  scratch : (6, w) [1/m], its last row [m], overwritten.
    """
    force[:] = 0.0
    block[:] = 0.0
    d_phi, d_cut, d_xi, d_area = scratch[0:2], scratch[2:4], scratch[4], scratch[5]
    frame_change(x, n, ways, moves, ends, c, first, d_phi, d_cut)
    for q in range(first, first + 2):
        if int(doing[q]) == OPEN:
            continue
        # fault: the point of a node that slid off stays where it is -> along = 0.5 if by_node else (2.0 * (q - first) -
        #   1.0) * GAUSS | contact/test_nodes_at_ends
        along = -0.5 if by_node else (2.0 * (q - first) - 1.0) * GAUSS
        per_cut = points[q, 3] / (ends[1] - ends[0])
        for j in range(d_xi.size):
            spread = d_cut[1, j] - d_cut[0, j]
            d_xi[j] = 0.5 * (d_cut[0, j] + d_cut[1, j]) + along * spread
            d_area[j] = per_cut * spread
        rise = 0.0 if by_node else c[q, RISE_S]
        add_stretch(x, points[q, 0], points[q, 3], rise, axisymmetric, d_xi, d_area)
        add_point(x, n, points, c, doing, q, d_phi, d_xi, d_area, force, block)


@kernel
def add_stretch(x: Floats, xi: float, area: float, rise: float, axisymmetric: bool, d_xi: Floats,
                d_area: Floats) -> None:
    """Add to d_area : (w,) [m] what comes of the edge's length, and of the distance from the axis.

    x : (6, 2) [m].  rise : of the round surface whose area it is [m].  d_xi : (w,) [1/m].
    """
    tx, ty = x[1, 0] - x[0, 0], x[1, 1] - x[0, 1]
    size = tx * tx + ty * ty
    steep = rise * (1.0 - 2.0 * xi)
    wide = size + steep * steep  # the area is that of the edge times (wide/size)^(1/2)
    # fault: an edge that grows stays as round as it was -> scale = area / size | contact/test_smooth
    scale = area / wide
    d_area[0] -= scale * tx
    d_area[1] -= scale * ty
    d_area[2] += scale * tx
    d_area[3] += scale * ty
    r = x[0, 0] + xi * tx
    if axisymmetric and r > 0.0:
        d_area[0] += area / r * (1.0 - xi)
        d_area[2] += area / r * xi
        for j in range(d_area.size):
            d_area[j] += area / r * tx * d_xi[j]
    if rise != 0.0:
        for j in range(d_area.size):
            d_area[j] -= 2.0 * area * steep * rise / wide * d_xi[j]


@kernel
def ray_length(c: Floats, q: int, g: float, xi: float, eta: float) -> float:
    """Return the length [m] of the ray of point q from edge to edge, whose gap is g [m]; c : (n_p, N_CONSTANTS)."""
    g -= c[q, OFFSET_1] + xi * (c[q, OFFSET_2] - c[q, OFFSET_1])
    return g + c[q, RISE_S] * xi * (1.0 - xi) + c[q, RISE_M] * eta * (1.0 - eta)


@kernel
def rounding_change(c: Floats, q: int, xi: float, eta: float, d_xi: float, d_eta: float) -> float:
    """Return how the gap of point q changes [1] by what its surfaces rise, as xi and eta do, d_xi and d_eta [1/m].

    c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1].
    """
    # fault: round surfaces are as high all along -> return 0.0 * d_xi | contact/test_smooth
    return -c[q, RISE_S] * (1.0 - 2.0 * xi) * d_xi - c[q, RISE_M] * (1.0 - 2.0 * eta) * d_eta


@kernel
def add_point(x: Floats, n: Floats, points: Floats, c: Floats, doing: Floats, q: int, d_phi: Floats, d_xi: Floats,
              d_area: Floats, force: Floats, block: Floats) -> None:
    """Add the forces of point q to force : (6, 2) [N] and their derivative to block : (12, w) [N/m].

    x : (6, 2) [m].  n : (2, 2) [1].  points : (n_p, >= 4) xi, eta [1], gap [m], area [m2].
    c : (n_p, N_CONSTANTS) [Pa, Pa/m, 1].  doing : (n_p,) state [1].  d_phi : (2, w) [1/m].  d_xi : (w,) [1/m].
    d_area : (w,) [m].
    """
    xi, eta, g, area = points[q, 0], points[q, 1], points[q, 2], points[q, 3]
    nx, ny, by_0, by_1, by_xi = field_normal(n, xi)
    sx, sy, ex, ey = x[1, 0] - x[0, 0], x[1, 1] - x[0, 1], x[5, 0] - x[4, 0], x[5, 1] - x[4, 1]
    cross = nx * ey - ny * ex
    slope = c[q, LAMBDA_2] - c[q, LAMBDA_1]
    p = -(c[q, LAMBDA_1] + xi * slope) - c[q, EPS_N] * g
    # From here on the gap is the length of the ray.
    widens = c[q, OFFSET_2] - c[q, OFFSET_1]
    g = ray_length(c, q, g, xi, eta)
    # The shear is tau = drag p where it slips, else the trial's, which hangs on the two material points alone.
    drag, trial_xi, trial_eta, tau = 0.0, 0.0, 0.0, 0.0
    if int(doing[q]) >= SLIPS_FORWARD:
        drag = c[q, MU] if int(doing[q]) == SLIPS_FORWARD else -c[q, MU]
        tau = drag * p
    elif c[q, MU] > 0.0:
        tau, trial_xi, trial_eta = c[q, TRIAL], c[q, TRIAL_XI], c[q, TRIAL_ETA]
    fx, fy = -p * nx - tau * ny, -p * ny + tau * nx
    N, M = (1.0 - xi, xi), (1.0 - eta, eta)
    for j in range(d_xi.size):
        i, along_x, along_y = j // 2, 1.0 - j % 2, float(j % 2)
        own = N[i] if i < 2 else 0.0
        other = M[i - 4] if 4 <= i < NODES else 0.0
        # fault: normals of the field do not turn -> turn = 0.0 * d_phi[0, j] + by_1 * d_phi[1, j] + by_xi * d_xi[j] |
        #   mechanical_fmu/test_contact_newton
        turn = by_0 * d_phi[0, j] + by_1 * d_phi[1, j] + by_xi * d_xi[j]
        # P + g n = M(eta): what its two sides do for fixed eta and g, then eta and g follow.
        wx = own * along_x + d_xi[j] * sx - g * turn * ny - other * along_x
        wy = own * along_y + d_xi[j] * sy + g * turn * nx - other * along_y
        # fault: sliding along a tilted master edge forgotten -> dg, deta = (wy * ex - wx * ey) / cross, 0.0 * cross |
        #   contact/test_traction
        dg, deta = (wy * ex - wx * ey) / cross, (wy * nx - wx * ny) / cross
        # fault: what is added to a gap does not change along the edge -> dp = -d_xi[j] * slope - c[q, EPS_N] * (dg +
        #   rounding_change(c, q, xi, eta, d_xi[j], deta)) | contact/test_offset
        dp = -d_xi[j] * slope - c[q, EPS_N] * (dg + d_xi[j] * widens + rounding_change(c, q, xi, eta, d_xi[j], deta))
        # fault: slip does not follow the master point -> dtau = drag * dp + trial_xi * d_xi[j] + 0.0 * trial_eta |
        #   contact/test_slip
        # fault: slip follows the master point but for a millionth -> dtau = drag * dp + trial_xi * d_xi[j] + 0.999999 *
        #   trial_eta * deta | contact/test_slip contact/test_traction
        dtau = drag * dp + trial_xi * d_xi[j] + trial_eta * deta
        dfx = d_area[j] * fx + area * (-dp * nx - dtau * ny - turn * fy)
        dfy = d_area[j] * fy + area * (-dp * ny + dtau * nx + turn * fx)
        gx, gy = area * fx, area * fy
        block[0, j] -= N[0] * dfx - d_xi[j] * gx
        block[1, j] -= N[0] * dfy - d_xi[j] * gy
        block[2, j] -= N[1] * dfx + d_xi[j] * gx
        block[3, j] -= N[1] * dfy + d_xi[j] * gy
        block[8, j] += M[0] * dfx - deta * gx
        block[9, j] += M[0] * dfy - deta * gy
        block[10, j] += M[1] * dfx + deta * gx
        block[11, j] += M[1] * dfy + deta * gy
    for k in range(2):
        force[k, 0] += N[k] * area * fx
        force[k, 1] += N[k] * area * fy
        force[4 + k, 0] -= M[k] * area * fx
        # fault: master pushed less than the slave -> force[4 + k, 1] -= 0.9 * M[k] * area * fy | contact/test_traction
        force[4 + k, 1] -= M[k] * area * fy
