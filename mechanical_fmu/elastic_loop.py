"""The loop over elastic cells of mean dilatation: internal forces, tangent, stress.  numba, compiled once and cached.

Energy of a cell, per reference volume V (Simo, Taylor & Pister 1985, mean dilatation; theta = v/V):
    W = mu/2 (J^(-2/3) tr(F'F) - 3) + kappa/2 (ln theta - e)^2,   e = 3 ln(1 + alpha (T - T_ref)).
The dilatation is one number a cell, so the pressure p = kappa (ln theta - e)/theta is too: nothing locks as nu -> 1/2.
A plane triangle has one J anyway, and for it this is the plain compressible neo-Hookean energy.  F = 1 + du/dX in the
plane and F_33 = 1 (plane strain) or r/R (axisymmetric).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Corners = tuple[int, ...]
"""As many numbers as a cell has nodes, and points: the length of a tuple is known when the loops are compiled, which
unrolls them and saves a fifth of their time."""


@inner
def gradient(B: Floats, N_over_R: Floats, u: Floats, F: Floats) -> float:
    """Compute F = (F11, F12, F21, F22, F33) of one point from the displacements of its cell; returns J = det F.

    B : (nn, 2) [1/m] gradients dN/dX.  N_over_R : (nn,) [1/m].  u : (nn, 2) [m].  F : (5,) [1], out.
    nn counts modes of enhanced strain too, where there are some.
    """
    F[0] = 1.0
    F[1] = 0.0
    F[2] = 0.0
    F[3] = 1.0
    F[4] = 1.0
    for a in range(B.shape[0]):
        F[0] += u[a, 0] * B[a, 0]
        F[1] += u[a, 0] * B[a, 1]
        F[2] += u[a, 1] * B[a, 0]
        F[3] += u[a, 1] * B[a, 1]
        F[4] += u[a, 0] * N_over_R[a]
    return (F[0] * F[3] - F[1] * F[2]) * F[4]


@inner
def dilatation(B: Floats, N_over_R: Floats, weight: Floats, u: Floats, F: Floats, J: Floats) -> float:
    """Fill F and J of one cell; returns its current volume v [m3], or -1 where a J or F_33 <= 0.

    B : (nq, nn, 2) [1/m].  N_over_R : (nq, nn) [1/m].  weight : (nq,) [m3].  u : (nn, 2) [m].
    F : (nq, 5) [1] and J : (nq,) [1], out.
    """
    v = 0.0
    for q in range(weight.shape[0]):
        J[q] = gradient(B[q], N_over_R[q], u, F[q])
        if not (J[q] > 0.0 and F[q, 4] > 0.0):
            return -1.0
        v += weight[q] * J[q]
    return v


@kernel
def cell_forces(nodes: Ints, B: Floats, N_over_R: Floats, weight: Floats, volume: Floats, mu: Floats, kappa: Floats,
                e_th: Floats, u: Floats, tangent: bool, f: Floats, K: Floats, corners: Corners) -> int:
    """Add the internal forces to f : (n_nodes, 2) [N]; with tangent, fill K : (n_e, 2 nn, 2 nn) [N/m], symmetric.

    nodes : (n_e, nn) node numbers.  B : (n_e, nq, nn, 2) [1/m].  N_over_R : (n_e, nq, nn) [1/m].
    weight : (n_e, nq) [m3].  volume : (n_e,) [m3].  mu, kappa : (n_e,) [Pa].
    e_th : (n_e,) [1] thermal part of ln theta.  u : (n_nodes, 2) [m].
    Returns the number of the first cell turned inside out, or -1.
    """
    n_e, nq, nn = B.shape[0], len(corners), len(corners)
    ue, F, J = np.empty((nn, 2)), np.empty((nq, 5)), np.empty(nq)
    g, h, k, d, fe = np.empty((nn, 2)), np.empty((nn, 2)), np.empty((nn, 2)), np.empty((nn, 2)), np.empty((nn, 2))
    for e in range(n_e):
        for a in range(nn):
            for i in range(2):
                ue[a, i] = u[nodes[e, a], i]
                d[a, i] = 0.0
                fe[a, i] = 0.0
        v = dilatation(B[e], N_over_R[e], weight[e], ue, F, J)
        if v <= 0.0:
            return e
        theta = v / volume[e]
        log = np.log(theta) - e_th[e]
        # fault: one dilatation a point instead of one a cell -> p = kappa[e] * np.log(J[0]) / theta |
        #   mechanical_fmu/test_elements_locking
        p = kappa[e] * log / theta
        if tangent:
            K[e] = 0.0
        for q in range(nq):
            I1 = F[q, 0] ** 2 + F[q, 1] ** 2 + F[q, 2] ** 2 + F[q, 3] ** 2 + F[q, 4] ** 2
            det = F[q, 0] * F[q, 3] - F[q, 1] * F[q, 2]
            w = weight[e, q]
            # fault: isochoric exponent wrong -> c = w * mu[e] * J[q] ** (-1.0 / 3.0) |
            #   mechanical_fmu/test_elastic_patch
            c = w * mu[e] * J[q] ** (-2.0 / 3.0)
            wJ = w * J[q]
            s = wJ * p - c * I1 / 3.0
            # g : gradients by x; h = F^-T : dF and k = F : dF of every unit displacement, hoop term included.
            for a in range(nn):
                B0, B1, hoop = B[e, q, a, 0], B[e, q, a, 1], N_over_R[e, q, a]
                g[a, 0] = (F[q, 3] * B0 - F[q, 2] * B1) / det
                g[a, 1] = (F[q, 0] * B1 - F[q, 1] * B0) / det
                # fault: hoop stretch left out of the forces -> h[a, 0] = g[a, 0] | mechanical_fmu/test_elastic_patch
                h[a, 0] = g[a, 0] + hoop / F[q, 4]
                h[a, 1] = g[a, 1]
                k[a, 0] = F[q, 0] * B0 + F[q, 1] * B1 + F[q, 4] * hoop
                k[a, 1] = F[q, 2] * B0 + F[q, 3] * B1
                for i in range(2):
                    fe[a, i] += c * k[a, i] + s * h[a, i]
                    d[a, i] += wJ * h[a, i]
            if tangent:
                # fault: a term of the tangent with the wrong sign -> add_tangent(B[e, q], N_over_R[e, q], F[q, 4], c,
                #   s, 2.0 / 9.0 * c * I1 + wJ * p, g, h, k, K[e], | mechanical_fmu/test_elastic_patch
                add_tangent(B[e, q], N_over_R[e, q], F[q, 4], c, -s, 2.0 / 9.0 * c * I1 + wJ * p, g, h, k, K[e],
                            corners)
        if tangent:
            # The volumetric part beyond fixed p: d2U/dtheta2 (d theta/du)(d theta/du)' V.
            # fault: volumetric term of the tangent with the wrong sign -> close_tangent(kappa[e] * (1.0 + log) / (theta
            #   * theta * volume[e]), d, K[e], corners) | mechanical_fmu/test_elastic_patch
            close_tangent(kappa[e] * (1.0 - log) / (theta * theta * volume[e]), d, K[e], corners)
        for a in range(nn):
            for i in range(2):
                f[nodes[e, a], i] += fe[a, i]
    return -1


@inner
def add_tangent(B: Floats, N_over_R: Floats, F33: float, c: float, m: float, n: float, g: Floats, h: Floats,
                k: Floats, K: Floats, corners: Corners) -> None:
    """Add one point's lower triangle: c dF:dF - 2c/3 (h k' + k h') + n h h' + m (F^-T dF' F^-T):dF.

    B : (nn, 2) [1/m].  N_over_R : (nn,) [1/m].  c, m, n : [J].  K : (2 nn, 2 nn) [N/m] of the cell.
    g : (nn, 2) [1/m] gradients by x.  h, k : (nn, 2) [1/m], F^-T : dF and F : dF of every unit displacement.
    """
    c3 = 2.0 / 3.0 * c
    for b in range(len(corners)):
        B0, B1, hoop = c * B[b, 0], c * B[b, 1], c * N_over_R[b]
        over_r = m * N_over_R[b] / (F33 * F33)
        x0, x1 = n * h[b, 0] - c3 * k[b, 0], n * h[b, 1] - c3 * k[b, 1]
        y0, y1 = c3 * h[b, 0], c3 * h[b, 1]
        g0, g1 = m * g[b, 0], m * g[b, 1]
        for a in range(b, len(corners)):
            along = B[a, 0] * B0 + B[a, 1] * B1
            K[2 * a, 2 * b] += (along + N_over_R[a] * (hoop + over_r) + h[a, 0] * x0 - k[a, 0] * y0
                                + g[a, 0] * g0)
            K[2 * a + 1, 2 * b] += h[a, 1] * x0 - k[a, 1] * y0 + g[a, 0] * g1
            K[2 * a, 2 * b + 1] += h[a, 0] * x1 - k[a, 0] * y1 + g[a, 1] * g0
            K[2 * a + 1, 2 * b + 1] += along + h[a, 1] * x1 - k[a, 1] * y1 + g[a, 1] * g1


@inner
def close_tangent(factor: float, d: Floats, K: Floats, corners: Corners) -> None:
    """Add factor d d' and mirror the lower triangle.

    factor : [Pa/m3].  d : (nn, 2) [m2] change of the cell's volume by its displacements.  K : (2 nn, 2 nn) [N/m].
    """
    for a in range(len(corners)):
        for i in range(2):
            row = 2 * a + i
            for b in range(a + 1):
                for j in range(2):
                    column = 2 * b + j
                    if column <= row:
                        K[row, column] += factor * d[a, i] * d[b, j]
                        K[column, row] = K[row, column]


@kernel
def cell_stress(nodes: Ints, B: Floats, N_over_R: Floats, weight: Floats, volume: Floats, mu: Floats, kappa: Floats,
                e_th: Floats, u: Floats, stress: Floats, strain: Floats) -> None:
    """Fill the stress and strain of every point.

    nodes : (n_e, nn) node numbers.  B : (n_e, nq, nn, 2) [1/m].  N_over_R : (n_e, nq, nn) [1/m].
    weight : (n_e, nq) [m3].  volume : (n_e,) [m3].  mu, kappa : (n_e,) [Pa].
    e_th : (n_e,) [1] thermal part of ln theta.  u : (n_nodes, 2) [m].
    stress : (n_e, nq, 4) [Pa], out, Cauchy, components (11, 22, 12, 33).
    strain : (n_e, nq, 4) [1], out, Green-Lagrange, same order.
    """
    nn, nq = B.shape[2], B.shape[1]
    ue, F, J = np.empty((nn, 2)), np.empty((nq, 5)), np.empty(nq)
    for e in range(B.shape[0]):
        for a in range(nn):
            ue[a, 0] = u[nodes[e, a], 0]
            ue[a, 1] = u[nodes[e, a], 1]
        theta = dilatation(B[e], N_over_R[e], weight[e], ue, F, J) / volume[e]
        p = kappa[e] * (np.log(theta) - e_th[e]) / theta
        for q in range(nq):
            F11, F12, F21, F22, F33 = F[q, 0], F[q, 1], F[q, 2], F[q, 3], F[q, 4]
            b11, b22, b12, b33 = F11**2 + F12**2, F21**2 + F22**2, F11 * F21 + F12 * F22, F33**2
            c, third = mu[e] * J[q] ** (-5.0 / 3.0), (b11 + b22 + b33) / 3.0
            stress[e, q, 0] = c * (b11 - third) + p
            stress[e, q, 1] = c * (b22 - third) + p
            stress[e, q, 2] = c * b12
            stress[e, q, 3] = c * (b33 - third) + p
            strain[e, q, 0] = 0.5 * (F11**2 + F21**2 - 1.0)
            strain[e, q, 1] = 0.5 * (F12**2 + F22**2 - 1.0)
            strain[e, q, 2] = 0.5 * (F11 * F12 + F21 * F22)
            strain[e, q, 3] = 0.5 * (F33**2 - 1.0)


@kernel
def cell_stress_sizes(nodes: Ints, B: Floats, N_over_R: Floats, weight: Floats, volume: Floats, mu: Floats,
                      kappa: Floats, e_th: Floats, u: Floats, sigma_v: Floats, hoop: Floats) -> None:
    """Fill what a run asks of the stress in every window, without an array of all of it.

    As cell_stress.  sigma_v, hoop : (n_e,) [Pa], out, means over a cell's points of the von Mises stress and of the
    stress 33, to the bit those of cell_stress.
    """
    nn, nq = B.shape[2], B.shape[1]
    ue, F, J = np.empty((nn, 2)), np.empty((nq, 5)), np.empty(nq)
    for e in range(B.shape[0]):
        for a in range(nn):
            ue[a, 0] = u[nodes[e, a], 0]
            ue[a, 1] = u[nodes[e, a], 1]
        theta = dilatation(B[e], N_over_R[e], weight[e], ue, F, J) / volume[e]
        p = kappa[e] * (np.log(theta) - e_th[e]) / theta
        sigma_v[e], hoop[e] = 0.0, 0.0
        for q in range(nq):
            F11, F12, F21, F22, F33 = F[q, 0], F[q, 1], F[q, 2], F[q, 3], F[q, 4]
            b11, b22, b12, b33 = F11**2 + F12**2, F21**2 + F22**2, F11 * F21 + F12 * F22, F33**2
            c, third = mu[e] * J[q] ** (-5.0 / 3.0), (b11 + b22 + b33) / 3.0
            s11, s22, s12, s33 = c * (b11 - third) + p, c * (b22 - third) + p, c * b12, c * (b33 - third) + p
            squares = (s11 - s22) ** 2 + (s22 - s33) ** 2 + (s33 - s11) ** 2
            # fault: shear does not count in the stress of every window -> sigma_v[e] += np.sqrt(0.5 * squares) |
            #   mechanical_fmu/test_fields
            sigma_v[e] += np.sqrt(0.5 * squares + 3.0 * s12**2)
            hoop[e] += s33
        sigma_v[e] /= nq
        hoop[e] /= nq
