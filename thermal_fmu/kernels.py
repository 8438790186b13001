"""Compiled loops over cells: shape gradients, conduction, cell means and rotations.

They work for any table of nn nodes and nq quadrature points; sums run in the order of the cells.
Arrays of all of them: cells (ne, nn) node numbers; N (nq, nn) and dN (nq, nn, 2) shape functions and their derivatives
[1]; w (nq,) weights [1]; G (ne, nq, nn, 2) gradients of shape functions [1/m]; *_q (ne, nq) values at quadrature
points; slots (ne, nn, nn) places in the matrix data.  An empty `data` skips the matrix.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Slots = NDArray[np.int64]


@njit(cache=True)
def shape_gradients(x: Floats, cells: Ints, N: Floats, dN: Floats, w: Floats, axisymmetric: bool,
                    G: Floats, dV: Floats, dC: Floats) -> int:
    """Fill G [1/m], dV and dC (ne, nq) [m3] on coordinates x : (n, 2) [m]; return the first inverted cell or -1.

    cells : (ne, nn).  N : (nq, nn).  dN : (nq, nn, 2).  w : (nq,).  G : (ne, nq, nn, 2).
    dV, of the quadrature points, carries the weight 2 pi r when axisymmetric, else it is per metre of depth.  G and dC
    are those of conduction, whose points lie farther out in stretched quads (spread_of).
    """
    ne, nn = cells.shape
    nq = w.size
    at, mean = np.empty((nq, 5)), np.empty(4)
    for e in range(ne):
        mean[:] = 0.0
        least = np.inf
        for q in range(nq):
            xr = 0.0
            xs = 0.0
            yr = 0.0
            ys = 0.0
            r = 0.0
            for i in range(nn):
                node = cells[e, i]
                xr += dN[q, i, 0] * x[node, 0]
                xs += dN[q, i, 1] * x[node, 0]
                yr += dN[q, i, 0] * x[node, 1]
                ys += dN[q, i, 1] * x[node, 1]
                r += N[q, i] * x[node, 0]
            det = xr * ys - xs * yr
            # fault: 2 pi r dropped in cells -> depth = 1.0 | thermal_fmu/test_thermal_space
            depth = 2.0 * np.pi * r if axisymmetric else 1.0
            if not det * depth > 0.0:
                return e
            for i in range(nn):
                G[e, q, i, 0] = (ys * dN[q, i, 0] - yr * dN[q, i, 1]) / det
                G[e, q, i, 1] = (xr * dN[q, i, 1] - xs * dN[q, i, 0]) / det
            dV[e, q] = w[q] * det * depth
            dC[e, q] = dV[e, q]
            at[q, 0], at[q, 1], at[q, 2], at[q, 3], at[q, 4] = xr, xs, yr, ys, depth
            for j in range(4):
                mean[j] += at[q, j] / nq
            least = min(least, det)
        if nn != 4:
            continue
        f = spread_of(mean, least)
        if f > 1.0:
            along_r = mean[0] * mean[0] + mean[2] * mean[2] > mean[1] * mean[1] + mean[3] * mean[3]
            for q in range(nq):
                # Derivatives across the long axis change along it, linearly; r at 1/f there keeps int N_i r.
                xr, xs, yr, ys, depth = at[q]
                if along_r:
                    xs, ys = mean[1] + f * (xs - mean[1]), mean[3] + f * (ys - mean[3])
                    way = (N[q, 1] + N[q, 2] - 0.5) * xr
                else:
                    xr, yr = mean[0] + f * (xr - mean[0]), mean[2] + f * (yr - mean[2])
                    way = (N[q, 2] + N[q, 3] - 0.5) * xs
                det = xr * ys - xs * yr
                if axisymmetric:
                    depth -= 2.0 * np.pi * way * (1.0 - 1.0 / f)
                dC[e, q] = w[q] * det * depth
                for i in range(nn):
                    dr, ds = dN[q, i, 0], dN[q, i, 1]
                    if along_r:
                        centre = dN[:, i, 1].sum() / nq
                        ds = centre + f * (ds - centre)
                    else:
                        centre = dN[:, i, 0].sum() / nq
                        dr = centre + f * (dr - centre)
                    G[e, q, i, 0] = (ys * dr - yr * ds) / det
                    G[e, q, i, 1] = (xr * ds - xs * dr) / det
    return -1


LEAST_DET = 0.2  # of the cell's middle, at the points of conduction


@njit(cache=True)
def spread_of(mean: Floats, least: float) -> float:
    """Return how far out along its long axis the points of conduction of a quad lie: 1 at its Gauss points, or more.

    mean : dx/dr, dx/ds, dy/dr, dy/ds at the middle.  least : least determinant of Gauss points.
    On a rectangle of sides a > b the coupling along a is -(b/a)/3 + (a/b) (1 - z)/4, z the square of the points' place
    in [-1, 1] along a.  With Gauss points, z = 1/3, it has the wrong sign beyond a/b = sqrt 2, and a jump under- and
    overshoots along the surface (2 % at 2, 11 % at 10).  z = 1 - 4/3 (b/a)^2 makes it 0.  Any z is exact for linear
    fields and of second order.  In a distorted cell determinants stay positive there.
    """
    a = mean[0] * mean[0] + mean[2] * mean[2]
    b = mean[1] * mean[1] + mean[3] * mean[3]
    z = 1.0 - 4.0 / 3.0 * min(a, b) / max(a, b)
    if z <= 1.0 / 3.0:
        return 1.0
    # fault: conduction at Gauss points whatever the shape -> f = 1.0 | thermal_fmu/test_thermal_limits
    f = np.sqrt(3.0 * z)
    middle = mean[0] * mean[3] - mean[1] * mean[2]
    drop = middle - least
    if drop * f > (1.0 - LEAST_DET) * middle:
        f = max(1.0, (1.0 - LEAST_DET) * middle / drop)
    return float(f)


@njit(cache=True)
def at_points(T: Floats, cells: Ints, N: Floats) -> Floats:
    """Interpolate the nodal field T : (n,) to the quadrature points; return (ne, nq) in the unit of T.

    cells : (ne, nn).  N : (nq, nn).
    """
    ne, nn = cells.shape
    T_q = np.zeros((ne, N.shape[0]))
    for e in range(ne):
        for q in range(N.shape[0]):
            for i in range(nn):
                T_q[e, q] += N[q, i] * T[cells[e, i]]
    return T_q


@njit(cache=True)
def add_conduction(T: Floats, cells: Ints, N: Floats, G: Floats, k_q: Floats, dk_q: Floats, f: Floats,
                   slots: Slots, scale: float, data: Floats) -> None:
    """Add conduction: f -= sum_q k grad N_i . grad T [W] and data += scale * (its derivative by T) [W/K].

    T : (n,) [K].  cells : (ne, nn).  N : (nq, nn).  G : (ne, nq, nn, 2) [1/m].  k_q, dk_q : (ne, nq), k dV [W m/K] and
    (dk/dT) dV [W m/K2].  f : (n,) [W].  slots : (ne, nn, nn).  data : (nnz,) [W/K] or empty.
    Differences to the cell's first node are taken before the gradient, so a uniform temperature conducts exactly
    nothing.
    """
    ne, nn = cells.shape
    for e in range(ne):
        T0 = T[cells[e, 0]]
        for q in range(N.shape[0]):
            gx = 0.0
            gy = 0.0
            for i in range(1, nn):
                dT = T[cells[e, i]] - T0
                gx += G[e, q, i, 0] * dT
                gy += G[e, q, i, 1] * dT
            for i in range(nn):
                flow = gx * G[e, q, i, 0] + gy * G[e, q, i, 1]
                f[cells[e, i]] -= k_q[e, q] * flow
                if data.size > 0:
                    for j in range(nn):
                        dot = G[e, q, i, 0] * G[e, q, j, 0] + G[e, q, i, 1] * G[e, q, j, 1]
                        data[slots[e, i, j]] += scale * (k_q[e, q] * dot + dk_q[e, q] * flow * N[q, j])


@njit(cache=True)
def add_conduction_tensor(T: Floats, cells: Ints, N: Floats, G: Floats, K_q: Floats, dK_q: Floats, dK_f: Floats,
                          dT: Floats, df: Floats, f: Floats, slots: Slots, scale: float, data: Floats) -> None:
    """Add conduction by a symmetric tensor, for nodal unknowns s: T and f_s change with s by dT [1] and df [1/K].

    T, dT, df : (n,).  cells : (ne, nn).  N : (nq, nn).  G : (ne, nq, nn, 2) [1/m].  K_q, dK_q, dK_f : (ne, nq, 3), the
    components xx, xy, yy of K dV [W m/K] and of its derivatives by T and by f_s.  f : (n,) [W].  slots : (ne, nn, nn).
    data : (nnz,) [W/K] or empty, to which scale times the derivative of -f by s is added.
    """
    ne, nn = cells.shape
    for e in range(ne):
        T0 = T[cells[e, 0]]
        for q in range(N.shape[0]):
            gx = 0.0
            gy = 0.0
            for i in range(1, nn):
                d = T[cells[e, i]] - T0
                gx += G[e, q, i, 0] * d
                gy += G[e, q, i, 1] * d
            xx, xy, yy = K_q[e, q]
            for i in range(nn):
                kx = xx * G[e, q, i, 0] + xy * G[e, q, i, 1]
                ky = xy * G[e, q, i, 0] + yy * G[e, q, i, 1]
                f[cells[e, i]] -= kx * gx + ky * gy
                if data.size > 0:
                    by_T = _form(dK_q[e, q], G[e, q, i], gx, gy)
                    by_f = _form(dK_f[e, q], G[e, q, i], gx, gy)
                    for j in range(nn):
                        node = cells[e, j]
                        dot = kx * G[e, q, j, 0] + ky * G[e, q, j, 1]
                        # fault: no word of f_s in the matrix -> change = (dot + by_T * N[q, j]) * dT[node] + 0.0 * by_f
                        #   * N[q, j] * df[node] |
                        #   thermal_fmu/test_thermal_anisotropy::test_the_jacobian_is_the_derivative
                        change = (dot + by_T * N[q, j]) * dT[node] + by_f * N[q, j] * df[node]
                        data[slots[e, i, j]] += scale * change


@njit(cache=True)
def _form(K: Floats, a: Floats, bx: float, by: float) -> float:
    """a . K b for K = (xx, xy, yy)."""
    return float(a[0] * (K[0] * bx + K[1] * by) + a[1] * (K[1] * bx + K[2] * by))


@njit(cache=True)
def mean_flux(T: Floats, cells: Ints, G: Floats, K_q: Floats, dV: Floats) -> Floats:
    """Return (ne, 2) volume means of -K grad T [W/m2].

    T : (n,) [K].  cells : (ne, nn).  G : (ne, nq, nn, 2) [1/m].  K_q : (ne, nq, 3) as xx, xy, yy, or (ne, nq, 1) where
    isotropic [W/mK].  dV : (ne, nq) [m3].
    """
    ne, nn = cells.shape
    flux = np.zeros((ne, 2))
    for e in range(ne):
        T0 = T[cells[e, 0]]
        for q in range(dV.shape[1]):
            gx = 0.0
            gy = 0.0
            for i in range(1, nn):
                d = T[cells[e, i]] - T0
                gx += G[e, q, i, 0] * d
                gy += G[e, q, i, 1] * d
            xx, xy, yy = (K_q[e, q, 0], 0.0, K_q[e, q, 0])
            if K_q.shape[2] == 3:
                xy, yy = K_q[e, q, 1], K_q[e, q, 2]
            # fault: heat flux up the gradient -> flux[e, 0] += dV[e, q] * (xx * gx + xy * gy) |
            #   thermal_fmu/test_thermal_anisotropy::test_a13_patch_with_skewed_axes
            flux[e, 0] -= dV[e, q] * (xx * gx + xy * gy)
            flux[e, 1] -= dV[e, q] * (xy * gx + yy * gy)
        flux[e] /= dV[e].sum()
    return flux


@njit(cache=True)
def turn_of(x: Floats, cells: Ints, G: Floats) -> Floats:
    """Return (ne, nq) the angle [rad] of the rotation R in F = dx/dX = R U (polar decomposition).

    x : (n, 2) current coordinates [m].  cells : (ne, nn).  G : (ne, nq, nn, 2) gradients in the reference [1/m].
    """
    ne, nq, nn, _ = G.shape
    turn = np.zeros((ne, nq))
    for e in range(ne):
        for q in range(nq):
            across = 0.0
            along = 0.0
            for i in range(nn):
                node = cells[e, i]
                across += x[node, 1] * G[e, q, i, 0] - x[node, 0] * G[e, q, i, 1]
                along += x[node, 0] * G[e, q, i, 0] + x[node, 1] * G[e, q, i, 1]
            # fault: the turn from one edge of F instead of its rotation -> turn[e, q] = np.arctan2(across, along) + 0.1
            #   * (along - 2.0) | thermal_fmu/test_thermal_anisotropy::test_the_turn_is_that_of_the_polar_decomposition
            turn[e, q] = np.arctan2(across, along)
    return turn
