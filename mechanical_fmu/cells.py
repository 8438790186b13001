"""The loop over cells whose points live by response.py: any material, mean dilatation, enhanced strain, plane stress.

Mean dilatation: deviators are the points', the pressure part is of the cell's theta = v/V,
    W = sum_q w psi_dev(F_q) + V kappa/2 (ln theta - e_th)^2;
without it the pressure is each point's own.  Modes of enhanced strain come behind the nodes as if they were nodes.
A cell's numbers that evolve lie in one row of history: [modes | of each point: history, ln F33 in plane stress].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner, kernel
from contact.half.interface import Interface
from contact.half.quadrature import CellQuadrature, table_of
from mechanical_fmu.laws.kinds import history_size
from mechanical_fmu.strain import (
    MAX_MODE_ITERATIONS,
    MAX_MODE_STRAIN,
    MIN_MODE_DAMPING,
    MODE_ROUND_OFF,
    MODE_TOLERANCE,
    CellMaterials,
    Modes,
    PointScratch,
    add_dilatation_curvature,
    back,
    dilatation_gradient,
    eliminate,
    mode_count,
    mode_gradients,
    respond,
)

# The inner loops over cells: internal forces, tangent, stress.  numba, compiled once and cached.
#
# Energy of a cell, per reference volume V (Simo, Taylor & Pister 1985, mean dilatation; theta = v/V):
#     W = mu/2 (J^(-2/3) tr(F'F) - 3) + kappa/2 (ln theta - e)^2,   e = 3 ln(1 + alpha (T - T_ref)).
# The dilatation is one number a cell, so the pressure p = kappa (ln theta - e)/theta is too: nothing locks as nu ->
# 1/2. A plane triangle has one J anyway, and for it this is the plain compressible neo-Hookean energy. F = 1 + du/dX in
# the plane and F_33 = 1 (plane strain) or r/R (axisymmetric).

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Corners = tuple[int, ...]
"""As many numbers as a cell has nodes, and points: the length of a tuple is known when the loops are compiled, which
unrolls them and saves a fifth of their time."""


@inner
def gradient(B: Floats, N_over_R: Floats, u: Floats, F: Floats) -> float:
    """F = (F11, F12, F21, F22, F33) of one point from its cell's u : (nn, 2) [m]; returns J = det F."""
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
    """Fill F : (nq, 5) and J : (nq,) of one cell; returns its current volume v [m3], or -1 where a J or F_33 <= 0."""
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

    u : (n_nodes, 2) [m].  mu, kappa : (n_e,) [Pa], e_th : (n_e,) thermal part of ln theta.
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
    """Add one point's lower triangle: c dF:dF - 2c/3 (h k' + k h') + n h h' + m (F^-T dF' F^-T):dF."""
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
    """Add factor d d' and mirror the lower triangle."""
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
    """Fill stress : (n_e, nq, 4) Cauchy (11, 22, 12, 33) [Pa] and strain : (n_e, nq, 4) Green-Lagrange, same order."""
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


INVERTED, NO_MODES = -1, 101


class CellShapes(NamedTuple):
    """Where the cells are.  B : (n_e, nq, nn + n_x, 2), N_over_R : (n_e, nq, nn + n_x) [1/m], modes behind the nodes.

    n_modes : numbers the modes have (n_x of them are vectors, but the last about an axis has one component).
    """

    nodes: Ints
    B: Floats
    N_over_R: Floats
    weight: Floats
    volume: Floats
    n_modes: int


class Out(NamedTuple):
    """What the loop fills, empty arrays where it is not wanted.

    f : (n_nodes, 2) [N], added to.  K : (n_e, 2 nn, 2 nn) [N/m].  history : (n_e, n_row).  heat : (n_e,) [J].
    stress, strain : (n_e, nq, 4) Cauchy [Pa] and Green-Lagrange, (11, 22, 12, 33).
    """

    f: Floats
    K: Floats
    history: Floats
    heat: Floats
    stress: Floats
    strain: Floats


class CellScratch(NamedTuple):
    """Room for one cell.  u : nodes, then modes.  F, P : (nq, 5).  A : (nq, 5, 5).  K, r : all unknowns, then modes."""

    u: Floats
    F: Floats
    J: Floats
    P: Floats
    A: Floats
    K: Floats
    r: Floats
    H: Floats
    a: Floats
    d: Floats
    dJ: Floats


@kernel
def cell_points(shape: CellShapes, law: CellMaterials, u: Floats, history_n: Floats, out: Out) -> tuple[int, int]:
    """Fill out at u : (n_nodes, 2) [m].  Returns (cell, code) of the first cell that fails, or (-1, 0).

    code : INVERTED, NO_MODES where the modes are not found, NO_THICKNESS or one of points.CODES.
    """
    n_e, nq, n_all = shape.B.shape[0], shape.B.shape[1], shape.B.shape[2]
    nn, nm = shape.nodes.shape[1], shape.n_modes
    cell = CellScratch(np.empty((n_all, 2)), np.empty((nq, 5)), np.empty(nq), np.empty((nq, 5)), np.empty((nq, 5, 5)),
                       np.empty((2 * nn + nm, 2 * nn + nm)), np.empty(2 * nn + nm), np.empty((nm, nm)), np.empty(nm),
                       np.empty(2 * nn), np.empty(5))
    work = PointScratch(np.empty(4), np.empty(4), np.empty((4, 5)), np.empty((4, 4)),
                        out.K.shape[0] > 0 or nm > 0)
    for e in range(n_e):
        cell.u[:, :] = 0.0
        for a in range(nn):
            cell.u[a, 0] = u[shape.nodes[e, a], 0]
            cell.u[a, 1] = u[shape.nodes[e, a], 1]
        for m in range(nm):
            cell.u[nn + m // 2, m % 2] = history_n[e, m]
        code, heat = settle(shape, law, e, cell, work, history_n[e], out.history[e])
        if code != 0:
            return e, code
        out.heat[e] = heat
        for m in range(nm):
            out.history[e, m] = cell.u[nn + m // 2, m % 2]
        close_cell(shape, law, e, cell, out)
        if out.stress.shape[0] > 0:
            measure(cell, out.stress[e], out.strain[e])
    return -1, 0


@inner
def settle(shape: CellShapes, law: CellMaterials, e: int, cell: CellScratch, work: PointScratch, h_n: Floats,
           h: Floats) -> tuple[int, float]:
    """Points of cell e at its nodes' u, with modes in balance: fills F, J, P, A and h.  Returns (code, heat [J])."""
    nn, nm = shape.nodes.shape[1], shape.n_modes
    before, share = np.inf, 1.0
    for _ in range(MAX_MODE_ITERATIONS):
        code, heat = at_points(shape, law, e, cell, work, h_n, h)
        if code != 0 or nm == 0:
            return code, heat
        cell.a[:] = 0.0
        cell.H[:, :] = 0.0
        largest = 0.0
        for q in range(shape.weight.shape[1]):
            add_forces(shape.B[e, q, nn:], shape.N_over_R[e, q, nn:], shape.weight[e, q], cell.P[q], cell.a)
            add_stiffness(shape.B[e, q, nn:], shape.N_over_R[e, q, nn:], shape.weight[e, q], cell.A[q], cell.H)
            for m in range(nm):
                largest = max(largest, abs(shape.B[e, q, nn + m // 2, 0]), abs(shape.B[e, q, nn + m // 2, 1]))
        if not eliminate(cell.H, cell.a, 0, nm):
            return NO_MODES, heat
        back(cell.H, cell.a, 0, nm)
        longest = 0.0
        for m in range(nm):
            longest = max(longest, abs(cell.a[m]))
        strain = largest * longest
        if strain <= MODE_TOLERANCE or (before <= MODE_ROUND_OFF and strain >= 0.5 * before):
            return 0, heat
        # Yielding that changes hands can make whole steps go round in a circle.
        share = max(0.5 * share, MIN_MODE_DAMPING) if strain >= before else min(2.0 * share, 1.0)
        before = strain
        for m in range(nm):
            cell.u[nn + m // 2, m % 2] -= min(share, MAX_MODE_STRAIN / strain) * cell.a[m]
    return NO_MODES, 0.0


@inner
def at_points(shape: CellShapes, law: CellMaterials, e: int, cell: CellScratch, work: PointScratch, h_n: Floats,
              h: Floats) -> tuple[int, float]:
    """F, J, P, A and h of the points of cell e at cell.u.  Returns (code, heat [J])."""
    nq = shape.weight.shape[1]
    if dilatation(shape.B[e], shape.N_over_R[e], shape.weight[e], cell.u, cell.F, cell.J) <= 0.0:
        return INVERTED, 0.0
    total, start, size = 0.0, shape.n_modes, (h.shape[0] - shape.n_modes) // nq
    for q in range(nq):
        mine = slice(start + q * size, start + (q + 1) * size)
        code, heat = respond(law, e, cell.F[q], h_n[mine], h[mine], cell.P[q], cell.A[q], work)
        if code != 0:
            return code, 0.0
        total += shape.weight[e, q] * heat
    return 0, total


@inner
def close_cell(shape: CellShapes, law: CellMaterials, e: int, cell: CellScratch, out: Out) -> None:
    """Add the cell's forces to out.f and fill its out.K, the pressure of the cell and its modes settled."""
    nn, nm, nq = shape.nodes.shape[1], shape.n_modes, shape.weight.shape[1]
    tangent = out.K.shape[0] > 0
    dJ, d, factor = cell.dJ, cell.d, 0.0
    d[:] = 0.0
    if law.mean:
        v = 0.0
        for q in range(nq):
            v += shape.weight[e, q] * cell.J[q]
        log = np.log(v / shape.volume[e]) - law.e_th[e]
        p = law.kappa[e] * log * shape.volume[e] / v
        # fault: tangent of the mean pressure at no pressure -> factor = law.kappa[e] * shape.volume[e] / (v * v) |
        #   mechanical_fmu/test_elements_points
        factor = law.kappa[e] * (1.0 - log) * shape.volume[e] / (v * v)
        for q in range(nq):
            dilatation_gradient(cell.F[q], dJ)
            for i in range(5):
                cell.P[q, i] += p * dJ[i]
            if tangent:
                add_dilatation_curvature(p, cell.F[q], cell.A[q])
                add_forces(shape.B[e, q], shape.N_over_R[e, q], shape.weight[e, q], dJ, d)
    cell.r[:] = 0.0
    for q in range(nq):
        add_forces(shape.B[e, q, :nn], shape.N_over_R[e, q, :nn], shape.weight[e, q], cell.P[q], cell.r[: 2 * nn])
    for a in range(nn):
        out.f[shape.nodes[e, a], 0] += cell.r[2 * a]
        out.f[shape.nodes[e, a], 1] += cell.r[2 * a + 1]
    if not tangent:
        return
    cell.K[:, :] = 0.0
    for q in range(nq):
        add_stiffness(shape.B[e, q], shape.N_over_R[e, q], shape.weight[e, q], cell.A[q], cell.K)
    if nm > 0:
        eliminate(cell.K, cell.r, 2 * nn, nm)
    for i in range(2 * nn):
        for j in range(2 * nn):
            out.K[e, i, j] = cell.K[i, j] + factor * d[i] * d[j]


@inner
def add_forces(B: Floats, N_over_R: Floats, w: float, P: Floats, r: Floats) -> None:
    """r += w P : dF of the unit displacements; r : (n,), as many of them as it has room for."""
    for a in range((r.shape[0] + 1) // 2):
        r[2 * a] += w * (P[0] * B[a, 0] + P[1] * B[a, 1] + P[4] * N_over_R[a])
        if 2 * a + 1 < r.shape[0]:
            r[2 * a + 1] += w * (P[2] * B[a, 0] + P[3] * B[a, 1])


@inner
def add_stiffness(B: Floats, N_over_R: Floats, w: float, A: Floats, K: Floats) -> None:
    """K += w dF : A : dF of the unit displacements; K : (n, n), as many of them as it has room for."""
    n = K.shape[0]
    for b in range((n + 1) // 2):
        B0, B1, hoop = w * B[b, 0], w * B[b, 1], w * N_over_R[b]
        x0, x1 = A[0, 0] * B0 + A[0, 1] * B1 + A[0, 4] * hoop, A[1, 0] * B0 + A[1, 1] * B1 + A[1, 4] * hoop
        x2, x3 = A[2, 0] * B0 + A[2, 1] * B1 + A[2, 4] * hoop, A[3, 0] * B0 + A[3, 1] * B1 + A[3, 4] * hoop
        x4, y4 = A[4, 0] * B0 + A[4, 1] * B1 + A[4, 4] * hoop, A[4, 2] * B0 + A[4, 3] * B1
        y0, y1 = A[0, 2] * B0 + A[0, 3] * B1, A[1, 2] * B0 + A[1, 3] * B1
        y2, y3 = A[2, 2] * B0 + A[2, 3] * B1, A[3, 2] * B0 + A[3, 3] * B1
        two = 2 * b + 1 < n
        for a in range((n + 1) // 2):
            K[2 * a, 2 * b] += B[a, 0] * x0 + B[a, 1] * x1 + N_over_R[a] * x4
            if two:
                K[2 * a, 2 * b + 1] += B[a, 0] * y0 + B[a, 1] * y1 + N_over_R[a] * y4
            if 2 * a + 1 < n:
                K[2 * a + 1, 2 * b] += B[a, 0] * x2 + B[a, 1] * x3
                if two:
                    K[2 * a + 1, 2 * b + 1] += B[a, 0] * y2 + B[a, 1] * y3


@inner
def measure(cell: CellScratch, stress: Floats, strain: Floats) -> None:
    """Fill stress, strain : (nq, 4) of a closed cell."""
    for q in range(stress.shape[0]):
        F, P = cell.F[q], cell.P[q]
        J = (F[0] * F[3] - F[1] * F[2]) * F[4]
        stress[q, 0] = (P[0] * F[0] + P[1] * F[1]) / J
        stress[q, 1] = (P[2] * F[2] + P[3] * F[3]) / J
        stress[q, 2] = (P[0] * F[2] + P[1] * F[3]) / J
        stress[q, 3] = P[4] * F[4] / J
        strain[q, 0] = 0.5 * (F[0] * F[0] + F[2] * F[2] - 1.0)
        strain[q, 1] = 0.5 * (F[1] * F[1] + F[3] * F[3] - 1.0)
        strain[q, 2] = 0.5 * (F[0] * F[1] + F[2] * F[3])
        strain[q, 3] = 0.5 * (F[4] * F[4] - 1.0)


# Cells of one kind (shape and treatment): shape functions, reference gradients, quadrature weights.

@dataclass(frozen=True)
class Treatment:
    """How the cells of a body are computed.  kind : of their points (points.py), 0 : neo-Hookean.

    enhanced : with modes that let a quad bend; a triangle has none and keeps its mean dilatation.
    plane_stress : no stress through the thickness.
    """

    kind: int = 0
    enhanced: bool = False
    plane_stress: bool = False


ELASTIC = Treatment()


@dataclass(frozen=True)
class Cells:
    """All cells of one kind, at the reference coordinates X.

    nodes : (n_e, nn).  body : (n_e,) index of the body.  number : (n_e,) of the cell in interface order, 0-based.
    N : (nq, nn) shape functions.  B : (n_e, nq, nn, 2) gradients dN/dX [1/m].
    weight : (n_e, nq) reference volume of a point [m3], 2 pi R weighted when axisymmetric, else per metre depth.
    N_over_R : (n_e, nq, nn) [1/m], N_a/R when axisymmetric, else 0: what turns u_r into the hoop stretch.
    volume : (n_e,) [m3].  mean : (n_e, nn) takes nodal values to the volume mean of each cell.
    modes : of enhanced strain, of none where it has none.
    """

    nodes: Ints
    body: Ints
    number: Ints
    N: Floats
    B: Floats
    weight: Floats
    N_over_R: Floats
    volume: Floats
    mean: Floats
    treatment: Treatment
    modes: Modes

    @property
    def dofs(self) -> NDArray[np.int64]:
        """(n_e, 2 nn) degrees of freedom, 2 node + component."""
        dofs = 2 * self.nodes[:, :, None].astype(np.int64) + np.arange(2)
        return dofs.reshape(len(self.nodes), -1)

    @property
    def fast(self) -> bool:
        """Whether the loop of kernels.py does: elastic, of mean dilatation."""
        return self.treatment == ELASTIC

    @property
    def n_modes(self) -> int:
        n = self.modes.hoop.shape[2]
        return mode_count(n == 3) if n else 0

    @property
    def n_row(self) -> int:
        """Numbers that evolve in a cell: modes, then each point's history and, in plane stress, its ln F33."""
        point = history_size(self.treatment.kind) + self.treatment.plane_stress
        return 0 if self.fast else self.n_modes + point * self.weight.shape[1]

    @cached_property
    def shape(self) -> CellShapes:
        B, N_over_R = (np.concatenate(parts, axis=2) for parts in zip((self.B, self.N_over_R), self.modes, strict=True))
        return CellShapes(self.nodes, B, N_over_R, self.weight, self.volume, self.n_modes)


def cells_of(interface: Interface, treatments: tuple[Treatment, ...] | None = None) -> tuple[Cells, ...]:
    """The quads, then the triangles, of a mesh, each by treatment; a kind without cells is left out.

    treatments : one a body, None for elastic bodies only.
    Raises ValueError naming the cell (1-based) and its body where the mesh itself is inverted or left of the axis.
    """
    shapes = (("quad", interface.quads, interface.quad_body, 0),
              ("triangle", interface.triangles, interface.triangle_body, len(interface.quads)))
    chosen = treatments or (ELASTIC,) * len(interface.bodies)
    out = []
    for name, nodes, body, first in shapes:
        of_body = chosen if name == "quad" else tuple(replace(t, enhanced=False) for t in chosen)
        number = np.arange(first, first + len(nodes), dtype=np.int32)
        for treatment in dict.fromkeys(of_body):
            here = np.isin(body, [i for i, t in enumerate(of_body) if t == treatment])
            if here.any():
                out.append(_cells(interface, nodes[here], body[here], number[here], table_of(name), treatment))
    return tuple(out)


def _cells(interface: Interface, nodes: Ints, body: Ints, number: Ints, table: CellQuadrature,
           treatment: Treatment) -> Cells:
    N, dN = table.N, table.dN
    X = interface.nodes[nodes]
    jacobian = np.einsum("eai,qaj->eqij", X, dN)
    det = np.linalg.det(jacobian)
    R = np.einsum("qa,ea->eq", N, X[:, :, 0])
    _refuse(interface, body, number, det <= 0.0, "has no volume or its nodes run clockwise")
    if interface.axisymmetric:
        _refuse(interface, body, number, R <= 0.0, "lies on the wrong side of the axis (x = r must be positive)")
    B = np.einsum("qaj,eqji->eqai", dN, np.linalg.inv(jacobian))
    # fault: 2 pi R dropped from the cells -> weight = det * table.w * (R if interface.axisymmetric else 1.0) |
    #   mechanical_fmu/test_elastic_cylinder
    weight = det * table.w * (2.0 * np.pi * R if interface.axisymmetric else 1.0)
    N_over_R = N / R[:, :, None] if interface.axisymmetric else np.zeros((*R.shape, N.shape[1]))
    volume = weight.sum(axis=1)
    mean = np.einsum("eq,qa->ea", weight, N) / volume[:, None]
    modes = Modes(np.empty((*det.shape, 0, 2)), np.empty((*det.shape, 0)))
    # fault: quads without their modes -> if False: | mechanical_fmu/test_elements_bending
    if treatment.enhanced:
        modes = mode_gradients(X, N, det, interface.axisymmetric)
    return Cells(np.ascontiguousarray(nodes), body, number, N, np.ascontiguousarray(B),
                 np.ascontiguousarray(weight), np.ascontiguousarray(N_over_R), volume, mean, treatment, modes)


def _refuse(interface: Interface, body: Ints, number: Ints, bad: NDArray[np.bool_], why: str) -> None:
    if bad.any():
        e = int(np.argmax(bad.any(axis=1)))
        raise ValueError(f"mesh: cell {number[e] + 1} of body {interface.bodies[body[e]]} {why}")
