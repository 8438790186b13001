"""The forces of one piece of contact and their exact derivative.  Eqs. (17)-(20), and Coulomb's law.

A piece's cuts, normals, gaps and areas all move with its six nodes: 0, 1 of the slave edge, 2 before it, 3 after it
(they turn the normals), 4, 5 of the master edge.  Every quantity a is computed once, and its change da for each of the
twelve unit motions in the line below it; so no product rule is left out, and none is written twice.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from contact.wire import Floats

Flags = NDArray[np.bool_]

GAUSS = 0.28867513459481287  # half the distance of the two Gauss points of a unit interval
NODES = 6
FIXED = -1  # a cut that moves with the edge; else the number of the node whose foot it is
# Columns of a point's constants: multipliers and shear tractions at the slave's nodes [Pa], penalties [Pa/m], friction.
LAMBDA_1, LAMBDA_2, SHEAR_1, SHEAR_2, EPS_N, EPS_T, MU, WEIGHT, N_CONSTANTS = 0, 1, 2, 3, 4, 5, 6, 7, 8
# What a point does.
OPEN, STICKS, SLIPS_FORWARD, SLIPS_BACK = 0, 1, 2, 3

Vector = tuple[float, float]


@njit(cache=True, error_model="numpy")
def unit(tx: float, ty: float, dtx: float, dty: float) -> tuple[float, float, float, float]:
    """The unit normal (ty, -tx)/|t| of a direction t, and its change."""
    size = np.sqrt(tx * tx + ty * ty)
    nx, ny = ty / size, -tx / size
    along = (nx * dty - ny * dtx) / size  # the part of the change that only stretches
    return nx, ny, dty / size - along * nx, -dtx / size - along * ny


@njit(cache=True, error_model="numpy")
def end_normal(x: Floats, dx: Floats, end: int, smooth: bool) -> tuple[float, float, float, float]:
    """The field of normals at the slave's node `end`, and its change."""
    nx, ny, dnx, dny = unit(x[1, 0] - x[0, 0], x[1, 1] - x[0, 1], dx[1, 0] - dx[0, 0], dx[1, 1] - dx[0, 1])
    if not smooth:
        return nx, ny, dnx, dny
    a, b = (2, 0) if end == 0 else (1, 3)
    mx, my, dmx, dmy = unit(x[b, 0] - x[a, 0], x[b, 1] - x[a, 1], dx[b, 0] - dx[a, 0], dx[b, 1] - dx[a, 1])
    # (nx, ny) is the normal of the direction (-ny, nx): the mean's direction is turned back for `unit`.
    return unit(-(ny + my), nx + mx, -(dny + dmy), dnx + dmx)


@njit(cache=True, error_model="numpy")
def foot_change(x: Floats, dx: Floats, n: Floats, dn: Floats, node: int, xi: float) -> float:
    """How the slave coordinate xi changes whose ray passes through `node`: (x_node - x(xi)) x n(xi) = 0."""
    nx, ny = n[0, 0] + xi * (n[1, 0] - n[0, 0]), n[0, 1] + xi * (n[1, 1] - n[0, 1])
    dnx, dny = dn[0, 0] + xi * (dn[1, 0] - dn[0, 0]), dn[0, 1] + xi * (dn[1, 1] - dn[0, 1])
    rx, ry = x[node, 0] - x[0, 0] - xi * (x[1, 0] - x[0, 0]), x[node, 1] - x[0, 1] - xi * (x[1, 1] - x[0, 1])
    drx = dx[node, 0] - dx[0, 0] - xi * (dx[1, 0] - dx[0, 0])
    dry = dx[node, 1] - dx[0, 1] - xi * (dx[1, 1] - dx[0, 1])
    by_xi = (rx * (n[1, 1] - n[0, 1]) - ry * (n[1, 0] - n[0, 0])
             - (x[1, 0] - x[0, 0]) * ny + (x[1, 1] - x[0, 1]) * nx)
    return -(drx * ny - dry * nx + rx * dny - ry * dnx) / by_xi


@njit(cache=True, error_model="numpy")
def point_change(x: Floats, dx: Floats, n: Floats, dn: Floats, before: Floats, at: tuple[float, float, float, float],
                 change: tuple[float, float], c: Floats, doing: int, f: Floats, df: Floats) -> None:
    """Add a point's nodal forces to f : (6, 2) [N] and their change to df.

    at : xi, eta, gap [m], area [m2].  change : dxi, darea.  n, dn : (2, 2) the normals at the slave's nodes.
    """
    xi, eta, g, area = at
    dxi, darea = change
    mx, my = n[0, 0] + xi * (n[1, 0] - n[0, 0]), n[0, 1] + xi * (n[1, 1] - n[0, 1])
    dmx = dn[0, 0] + xi * (dn[1, 0] - dn[0, 0]) + dxi * (n[1, 0] - n[0, 0])
    dmy = dn[0, 1] + xi * (dn[1, 1] - dn[0, 1]) + dxi * (n[1, 1] - n[0, 1])
    nx, ny, dnx, dny = unit(-my, mx, -dmy, dmx)
    ex, ey = x[5, 0] - x[4, 0], x[5, 1] - x[4, 1]
    # P + g n = M(eta): what its two sides do for fixed eta and g, then eta and g follow.
    dpx = dx[0, 0] + xi * (dx[1, 0] - dx[0, 0]) + dxi * (x[1, 0] - x[0, 0])
    dpy = dx[0, 1] + xi * (dx[1, 1] - dx[0, 1]) + dxi * (x[1, 1] - x[0, 1])
    dqx, dqy = dx[4, 0] + eta * (dx[5, 0] - dx[4, 0]), dx[4, 1] + eta * (dx[5, 1] - dx[4, 1])
    wx, wy = dpx + g * dnx - dqx, dpy + g * dny - dqy
    cross = nx * ey - ny * ex
    dg = -(wx * ey - wy * ex) / cross
    deta = (wy * nx - wx * ny) / cross
    p = -(c[LAMBDA_1] + xi * (c[LAMBDA_2] - c[LAMBDA_1])) - c[EPS_N] * g
    dp = -dxi * (c[LAMBDA_2] - c[LAMBDA_1]) - c[EPS_N] * dg
    tau, dtau = 0.0, 0.0
    if doing >= SLIPS_FORWARD:
        mu = c[MU] if doing == SLIPS_FORWARD else -c[MU]
        tau, dtau = mu * p, mu * dp
    elif c[MU] > 0.0:
        sx, sy, dsx, dsy = 0.0, 0.0, dpx - dqx, dpy - dqy
        for k in range(2):
            N, dN = (1.0 - xi, -dxi) if k == 0 else (xi, dxi)
            M, dM = (1.0 - eta, -deta) if k == 0 else (eta, deta)
            sx += N * (x[k, 0] - before[k, 0]) - M * (x[4 + k, 0] - before[4 + k, 0])
            sy += N * (x[k, 1] - before[k, 1]) - M * (x[4 + k, 1] - before[4 + k, 1])
            # dp and dq hold the motion of the present points; what is left is that of the points before.
            dsx += dM * before[4 + k, 0] - dN * before[k, 0]
            dsy += dM * before[4 + k, 1] - dN * before[k, 1]
        dsx, dsy = dsx - deta * ex, dsy - deta * ey
        slip, dslip = -ny * sx + nx * sy, -ny * dsx + nx * dsy - dny * sx + dnx * sy
        tau = c[SHEAR_1] + xi * (c[SHEAR_2] - c[SHEAR_1]) - c[EPS_T] * slip
        dtau = dxi * (c[SHEAR_2] - c[SHEAR_1]) - c[EPS_T] * dslip
    fx, fy = area * (-p * nx - tau * ny), area * (-p * ny + tau * nx)
    dfx = darea * (-p * nx - tau * ny) + area * (-dp * nx - p * dnx - dtau * ny - tau * dny)
    dfy = darea * (-p * ny + tau * nx) + area * (-dp * ny - p * dny + dtau * nx + tau * dnx)
    for k in range(2):
        N, dN = (1.0 - xi, -dxi) if k == 0 else (xi, dxi)
        M, dM = (1.0 - eta, -deta) if k == 0 else (eta, deta)
        f[k, 0] += N * fx
        f[k, 1] += N * fy
        df[k, 0] += dN * fx + N * dfx
        df[k, 1] += dN * fy + N * dfy
        f[4 + k, 0] -= M * fx
        f[4 + k, 1] -= M * fy
        df[4 + k, 0] -= dM * fx + M * dfx
        df[4 + k, 1] -= dM * fy + M * dfy


@njit(cache=True, error_model="numpy")
def piece_stiffness(x: Floats, before: Floats, smooth: Flags, by_node: bool, axisymmetric: bool, moves: Floats,
                    ends: Floats, points: Floats, c: Floats, doing: Floats, force: Floats, block: Floats) -> None:
    """Fill force : (6, 2) [N] and block : (12, 12) [N/m] = -d(force)/dx of a piece whose nodes are at x : (6, 2) [m].

    before : (6, 2) [m], where they were when the shear tractions were those of c.  smooth : (2,) whether the
    neighbouring edge turns the normal.  ends : (2,) the cuts, and moves : (2,) the node each follows.  points : (2, 4)
    xi, eta, gap, area.  c : (2, N_CONSTANTS).  doing : (2,).  by_node : the points are the edge's ends, uncut.
    """
    dx, n, dn, f = np.zeros((NODES, 2)), np.empty((2, 2)), np.empty((2, 2)), np.empty((NODES, 2))
    df, dcut = np.empty((NODES, 2)), np.empty(2)
    tx, ty = x[1, 0] - x[0, 0], x[1, 1] - x[0, 1]
    for i in range(NODES):
        for d in range(2):
            dx[i, d] = 1.0
            f[:] = 0.0
            df[:] = 0.0
            for k in range(2):
                n[k, 0], n[k, 1], dn[k, 0], dn[k, 1] = end_normal(x, dx, k, smooth[k])
            for k in range(2):
                node = int(moves[k])
                dcut[k] = 0.0 if node == FIXED else foot_change(x, dx, n, dn, node, ends[k])
            stretch = (tx * (dx[1, 0] - dx[0, 0]) + ty * (dx[1, 1] - dx[0, 1])) / (tx * tx + ty * ty)
            for q in range(2):
                if int(doing[q]) == OPEN:
                    continue
                xi, area = points[q, 0], points[q, 3]
                dxi, darea = 0.0, area * stretch
                if not by_node:
                    dxi = 0.5 * (dcut[0] + dcut[1]) + (2 * q - 1) * GAUSS * (dcut[1] - dcut[0])
                    darea += area * (dcut[1] - dcut[0]) / (ends[1] - ends[0])
                if axisymmetric:
                    r = x[0, 0] + xi * tx
                    dr = dx[0, 0] + xi * (dx[1, 0] - dx[0, 0]) + dxi * tx
                    darea += area * dr / r if r > 0.0 else 0.0
                point_change(x, dx, n, dn, before, (xi, points[q, 1], points[q, 2], area), (dxi, darea), c[q],
                             int(doing[q]), f, df)
            dx[i, d] = 0.0
            for j in range(NODES):
                for e in range(2):
                    block[2 * j + e, 2 * i + d] = -df[j, e]
    force[:] = f
