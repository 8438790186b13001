"""Logarithmic strain E = 1/2 ln(F'F) of a point, and its derivatives (Miehe, Apel & Lambrecht 2002).  numba.

A small-strain law between E and its conjugate stress S becomes one of large strains through
    P = S : dE/dF,   A = dP/dF = dE/dF : D : dE/dF + S : d2E/dFdF.
F = (F11, F12, F21, F22, F33).  E and S are tensor components (11, 22, 12, 33), so the power is
S11 dE11 + S22 dE22 + 2 S12 dE12 + S33 dE33 per reference volume.

In the plane C = F'F has mean m, half difference d = (C11 - C22)/2 and shear c = C12; its eigenvalues are m -+ sqrt(q),
q = d^2 + c^2, and with J = F11 F22 - F12 F21
    ln C = ln J 1 + b [[d, c], [c, -d]],   b = atanh(sqrt(q)/m)/sqrt(q) = g(q/m^2)/m.
g is analytic, so equal eigenvalues are no special case: nothing is divided by their difference.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner
from mechanical_fmu.laws.law import Points
from mechanical_fmu.point import update

Floats = NDArray[np.float64]

# Below this y = q/m^2 the series of g is used; the closed form of g'' loses 2 digits to cancellation above it.
SERIES_BELOW = 0.05
# Below this fewer terms do: strains up to some percent, the usual case.
SHORT_BELOW = 1e-3


@inner
def shape(y: float) -> tuple[float, float, float]:
    """Compute g(y) = atanh(sqrt y)/sqrt y, g'(y), g''(y) for 0 <= y < 1: the sum of y^k/(2k + 1)."""
    if y >= SERIES_BELOW:
        root = np.sqrt(y)
        g = np.arctanh(root) / root
        over = 1.0 / (1.0 - y)
        g1 = (over - g) / (2.0 * y)
        return g, g1, (over * over - 3.0 * g1) / (2.0 * y)
    if y < SHORT_BELOW:
        return ((((((y / 13.0 + 1.0 / 11.0) * y + 1.0 / 9.0) * y + 1.0 / 7.0) * y + 0.2) * y + 1.0 / 3.0) * y + 1.0,
                ((((6.0 / 13.0 * y + 5.0 / 11.0) * y + 4.0 / 9.0) * y + 3.0 / 7.0) * y + 0.4) * y + 1.0 / 3.0,
                (((30.0 / 13.0 * y + 20.0 / 11.0) * y + 4.0 / 3.0) * y + 6.0 / 7.0) * y + 0.4)
    g, g1, g2 = 0.0, 0.0, 0.0
    # fault: series of the logarithm cut short -> for k in range(6, 1, -1): | mechanical_fmu/test_points_logstrain
    for k in range(15, 1, -1):
        a = 1.0 / (2.0 * k + 1.0)
        g = g * y + a
        g1 = g1 * y + k * a
        g2 = g2 * y + k * (k - 1.0) * a
    return (g * y + 1.0 / 3.0) * y + 1.0, g1 * y + 1.0 / 3.0, g2


@inner
def log_strain_gradient(F: Floats, E: Floats, L: Floats) -> None:
    """Fill E : (4,) and L : (4, 5) = dE/dF of F : (5,), all [1]."""
    J = F[0] * F[3] - F[1] * F[2]
    C11, C22, c = F[0] * F[0] + F[2] * F[2], F[1] * F[1] + F[3] * F[3], F[0] * F[1] + F[2] * F[3]
    m, d = 0.5 * (C11 + C22), 0.5 * (C11 - C22)
    g, g1, _ = shape((d * d + c * c) / (m * m))
    b, b_m, b_q = g / m, -1.0 / (J * J), g1 / (m * m * m)
    a = np.log(J)
    E[0] = 0.5 * (a + b * d)
    E[1] = 0.5 * (a - b * d)
    E[2] = 0.5 * b * c
    E[3] = np.log(F[4])
    for i in range(4):
        mi, di, ci = F[i], (F[i] if i % 2 == 0 else -F[i]), F[i ^ 1]
        ai = (F[3 - i] if i == 0 or i == 3 else -F[3 - i]) / J
        bi = b_m * mi + 2.0 * b_q * (d * di + c * ci)
        L[0, i] = 0.5 * (ai + b * di + d * bi)
        L[1, i] = 0.5 * (ai - b * di - d * bi)
        L[2, i] = 0.5 * (b * ci + c * bi)
        L[3, i] = 0.0
    L[0, 4] = 0.0
    L[1, 4] = 0.0
    L[2, 4] = 0.0
    L[3, 4] = 1.0 / F[4]


@inner
def log_strain_curvature(F: Floats, S: Floats, H: Floats) -> None:
    """Fill H : (5, 5) [Pa] = S : d2E/dFdF, symmetric, of F : (5,) [1] and S : (4,) [Pa]."""
    J = F[0] * F[3] - F[1] * F[2]
    C11, C22, c = F[0] * F[0] + F[2] * F[2], F[1] * F[1] + F[3] * F[3], F[0] * F[1] + F[2] * F[3]
    m, d = 0.5 * (C11 + C22), 0.5 * (C11 - C22)
    g, g1, g2 = shape((d * d + c * c) / (m * m))
    over = 1.0 / (J * J)
    b, b_m, b_q = g / m, -over, g1 / (m * m * m)
    b_mm, b_mq, b_qq = 2.0 * m * over * over, -over * over, g2 / m**5
    mean, half, w = 0.5 * (S[0] + S[1]) / J, 0.5 * (S[0] - S[1]), 0.5 * (S[0] - S[1]) * d + S[2] * c
    # S : E = mean ln J + b w + S33 ln F33 with w = half d + S12 c; i ^ 1 swaps the columns, 3 - i the corners.
    # dm, dd, dc of F are F, its columns with signs, and swapped; a : of ln J, b and q/2 : of b and q, w : of w.
    F0, F1, F2, F3 = F[0], F[1], F[2], F[3]
    ds, cs, a = (F0, -F1, F2, -F3), (F1, F0, F3, F2), (F3 / J, -F2 / J, -F1 / J, F0 / J)
    w_mm, w_mq, w_qq, w_q = w * b_mm, 2.0 * w * b_mq, 4.0 * w * b_qq, 2.0 * w * b_q
    for i in range(4):
        q_i, w_i = d * ds[i] + c * cs[i], half * ds[i] + S[2] * cs[i]
        b_i, lean = b_m * F[i] + 2.0 * b_q * q_i, -mean * J * a[i]
        # fault: curvature of the logarithmic strain without its last term -> along, across = w_mm * F[i] + w_mq * q_i,
        #   w_mq * F[i] | mechanical_fmu/test_points_logstrain
        along, across = w_mm * F[i] + w_mq * q_i, w_mq * F[i] + w_qq * q_i
        for j in range(i + 1):
            q_j, w_j = d * ds[j] + c * cs[j], half * ds[j] + S[2] * cs[j]
            H[i, j] = (lean * a[j] + w_i * (b_m * F[j] + 2.0 * b_q * q_j) + b_i * w_j + along * F[j] + across * q_j
                       + w_q * (ds[i] * ds[j] + cs[i] * cs[j]))
    even, odd, swap = b * half + w_q * d, b * S[2] + w_q * c, w * b_m
    H[0, 0] += even + swap
    H[1, 1] += swap - even
    H[2, 2] += even + swap
    H[3, 3] += swap - even
    H[1, 0] += odd
    H[3, 2] += odd
    # d2J of F11 F22 and of -F12 F21.
    H[3, 0] += mean
    H[2, 1] -= mean
    for i in range(4):
        for j in range(i):
            H[j, i] = H[i, j]
        H[i, 4] = 0.0
        H[4, i] = 0.0
    H[4, 4] = -S[3] / (F[4] * F[4])


@inner
def piola(L: Floats, S: Floats, P: Floats) -> None:
    """Fill P : (5,) [Pa] = S : dE/dF, conjugate to F, of L : (4, 5) [1] = dE/dF and S : (4,) [Pa]."""
    for i in range(5):
        P[i] = S[0] * L[0, i] + S[1] * L[1, i] + 2.0 * S[2] * L[2, i] + S[3] * L[3, i]


@inner
def piola_tangent(F: Floats, L: Floats, S: Floats, D: Floats, A: Floats) -> None:
    """Fill A : (5, 5) [Pa] = dP/dF.

    F : (5,) [1].  L : (4, 5) [1] = dE/dF.  S : (4,) [Pa].  D : (4, 4) [Pa] = dS/dE (plain components on both sides).
    """
    log_strain_curvature(F, S, A)
    # L is 3 x 4 in the plane and one number along 33: nothing else is multiplied.
    out = L[3, 4]
    for j in range(4):
        E0, E1, E2 = L[0, j], L[1, j], L[2, j]
        x0 = D[0, 0] * E0 + D[0, 1] * E1 + D[0, 2] * E2
        x1 = D[1, 0] * E0 + D[1, 1] * E1 + D[1, 2] * E2
        x2 = 2.0 * (D[2, 0] * E0 + D[2, 1] * E1 + D[2, 2] * E2)
        for i in range(4):
            A[i, j] += L[0, i] * x0 + L[1, i] * x1 + L[2, i] * x2
        A[4, j] = out * (D[3, 0] * E0 + D[3, 1] * E1 + D[3, 2] * E2)
        A[j, 4] = out * (E0 * D[0, 3] + E1 * D[1, 3] + 2.0 * E2 * D[2, 3])
    A[4, 4] += out * out * D[3, 3]


# P and A = dP/dF of one material point from its F, whatever the material; plane stress included.  numba.
#
# F, P : (5,), components (11, 12, 21, 22, 33).  kind 0 is neo-Hookean (its energy is in elastic_loop.py), every other
# kind lives in logarithmic strain space (point.py).  The pressure is kappa (ln J - e_th); a cell of mean dilatation
# gives kappa = 0 here and adds its own.
#
# Plane stress: the thickness stretch F33 follows from P33 = 0, point by point, and A is condensed,
#     A_ij - A_i5 A_5j / A_55  for the four components in the plane.
# The iteration is on ln F33 with the Kirchhoff stress P33 F33, which is linear where the law is linear in E; by
# logarithmic strain the stress is S33 and its slope D_3333.

# The thickness is found when ln F33 moves by less than this; its iteration is quadratic, so few steps do.
THICKNESS_TOLERANCE = 1e-14
MAX_THICKNESS_ITERATIONS = 40
# ln F33 moves by no more than this at a time: a stretch by 2.7 is far from any Newton's model.
MAX_THICKNESS_STEP = 1.0
NO_THICKNESS = 100


class CellMaterials(NamedTuple):
    """The materials of a kind of cell.  mu, kappa : (n_e,) [Pa].  e_th : (n_e, nq).

    p : (n_e,) records of POINT (laws/catalogue.py).  tables : (n_t,) of hardening curves.
    """

    kind: int
    plane_stress: bool
    mean: bool
    mu: Floats
    kappa: Floats
    e_th: Floats
    p: Points
    tables: Floats
    dt: float


class PointScratch(NamedTuple):
    """Room for one point's logarithmic strain: E, S : (4,), L : (4, 5), D : (4, 4).  tangent : whether A is wanted."""

    E: Floats
    S: Floats
    L: Floats
    D: Floats
    tangent: bool


@inner
def dilatation_gradient(F: Floats, dJ: Floats) -> float:
    """Fill dJ : (5,) [1] = dJ/dF of F : (5,) [1]; returns J."""
    plane = F[0] * F[3] - F[1] * F[2]
    dJ[0] = F[3] * F[4]
    dJ[1] = -F[2] * F[4]
    dJ[2] = -F[1] * F[4]
    dJ[3] = F[0] * F[4]
    dJ[4] = plane
    return plane * F[4]


@inner
def add_dilatation_curvature(p: float, F: Floats, A: Floats) -> None:
    """Add p d2J/dFdF to A : (5, 5) [Pa]; p : [Pa], F : (5,) [1]."""
    A[0, 3] += p * F[4]
    A[3, 0] += p * F[4]
    A[1, 2] -= p * F[4]
    A[2, 1] -= p * F[4]
    for i in range(4):
        along = p * (F[3 - i] if i == 0 or i == 3 else -F[3 - i])
        A[i, 4] += along
        A[4, i] += along


@inner
def neo_hooke(mu: float, kappa: float, e_th: float, F: Floats, P: Floats, A: Floats) -> None:
    """Fill P and A of the energy mu/2 (J^(-2/3) F:F - 3) + kappa/2 (ln J - e_th)^2.

    F : (5,) [1].  P : (5,) [Pa] and A : (5, 5) [Pa] = dP/dF, out.
    """
    # P holds h = F^-T until it is filled.
    h = P
    J = dilatation_gradient(F, h)
    c = mu * J ** (-2.0 / 3.0)
    squares = 0.0
    for i in range(5):
        h[i] /= J
        squares += F[i] * F[i]
    # fault: pressure forgets what heat takes from it -> s = kappa * np.log(J) - c * squares / 3.0 |
    #   mechanical_fmu/test_elements_patch
    s = kappa * (np.log(J) - e_th) - c * squares / 3.0
    n = 2.0 / 9.0 * c * squares + kappa - s
    for i in range(5):
        for j in range(5):
            A[i, j] = n * h[i] * h[j] - 2.0 / 3.0 * c * (F[i] * h[j] + h[i] * F[j])
        A[i, i] += c
    for i in range(5):
        P[i] = c * F[i] + s * h[i]
    add_dilatation_curvature(s / J, F, A)


@inner
def respond(law: CellMaterials, e: int, q: int, F: Floats, h_n: Floats, h: Floats, P: Floats, A: Floats,
            work: PointScratch) -> tuple[int, float]:
    """Fill P, A and the history of point q of cell e at F; returns (code, heat) of points.update.

    F : (5,) [1].  h_n, h : (n_h,) history at the start and at the end.  P : (5,) [Pa].  A : (5, 5) [Pa].
    In plane stress F33 is found first, from the ln F33 that ends h_n, and ends h and F.
    """
    if law.kind == 0:
        return hyperelastic(law, e, q, F, h_n, h, P, A), 0.0
    E, S, L, D, thin = work.E, work.S, work.L, work.D, law.plane_stress
    kappa, last = 0.0 if law.mean else law.kappa[e], h.shape[0] - (1 if thin else 0)
    thickness = h_n[last] if thin else 0.0
    if thin:
        F[4] = np.exp(thickness)
    log_strain_gradient(F, E, L)
    found, heat = False, 0.0
    for _ in range(MAX_THICKNESS_ITERATIONS):
        code, heat = update(law.kind, law.p[e], law.tables, E, law.dt, h_n[:last], h[:last], S, D)
        if code != 0:
            return code, heat
        pressure = kappa * (E[0] + E[1] + E[3] - law.e_th[e, q])
        for i in (0, 1, 3):
            S[i] += pressure
            for j in (0, 1, 3):
                D[i, j] += kappa
        if not thin:
            found = True
            break
        if not D[3, 3] > 0.0:
            return NO_THICKNESS, heat
        step = S[3] / D[3, 3]
        if abs(step) <= THICKNESS_TOLERANCE:
            h[last], L[3, 4], found = thickness, 1.0 / F[4], True
            break
        thickness -= min(max(step, -MAX_THICKNESS_STEP), MAX_THICKNESS_STEP)
        F[4] = np.exp(thickness)
        E[3] = np.log(F[4])
    if not found:
        return NO_THICKNESS, heat
    piola(L, S, P)
    if work.tangent:
        piola_tangent(F, L, S, D, A)
        if thin:
            condense(A)
    return 0, heat


@inner
def hyperelastic(law: CellMaterials, e: int, q: int, F: Floats, h_n: Floats, h: Floats, P: Floats, A: Floats) -> int:
    """Fill P, A and h as `respond` does, of kind 0; returns the code.

    F : (5,) [1].  h_n, h : (1,) ln F33 in plane stress, else (0,).  P : (5,) [Pa].  A : (5, 5) [Pa].
    """
    kappa = 0.0 if law.mean else law.kappa[e]
    if not law.plane_stress:
        neo_hooke(law.mu[e], kappa, law.e_th[e, q], F, P, A)
        return 0
    thickness = h_n[0]
    for _ in range(MAX_THICKNESS_ITERATIONS):
        F[4] = np.exp(thickness)
        neo_hooke(law.mu[e], kappa, law.e_th[e, q], F, P, A)
        slope = F[4] * (P[4] + F[4] * A[4, 4])
        if not slope > 0.0:
            return NO_THICKNESS
        step = P[4] * F[4] / slope
        if abs(step) <= THICKNESS_TOLERANCE:
            h[0] = thickness
            condense(A)
            return 0
        thickness -= min(max(step, -MAX_THICKNESS_STEP), MAX_THICKNESS_STEP)
    return NO_THICKNESS


@inner
def condense(A: Floats) -> None:
    """Condense A : (5, 5) [Pa] in place to that of P33 = 0 in the plane."""
    for i in range(4):
        for j in range(4):
            # fault: thickness not condensed from the tangent -> A[i, j] -= 0.0 * A[4, 4] |
            #   mechanical_fmu/test_elements_points
            A[i, j] -= A[i, 4] * A[4, j] / A[4, 4]


# Enhanced strain (Simo & Armero 1992): modes inside a quad that let it bend, and their elimination.
#
#     F = 1 + du/dX + sum_m a_m (x) e_m,   e_m = (R_0 j_0)/(R j) J_0^-T dM_m/dxi,   M_1 = xi^2 / 2, M_2 = eta^2 / 2,
# Wilson's modes with the map of the cell's middle (index 0; R = 1 in the plane), so that the integral of e_m over the
# cell vanishes and constant stress does no work on them: the patch test.  A mode is a vector a_m [m] in space, like a
# node with gradients e_m; it turns with the body.  About an axis a fifth number enters the hoop stretch alone,
# F_33 += a_5 (R_0 j_0)/(R j) xi eta / R_0.  The modes are found from zero out-of-balance inside each cell.
# Limit: under strong compression the element shows hourglasses (Wriggers & Reese 1996).  A square block of 4 x 4 cells,
# pressed and free to widen, has a tangent with a negative eigenvalue from a stretch of .64 on (nu = .3; .68 at
# nu = .4999), by mean dilatation not before .44.

# xi, eta of the four points of contact.half.functions' quad table are +-1/sqrt(3); signs follow from its N.
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
# Newton's method inside a cell: found when the modes strain it by less than this, or by no less than before.
MODE_TOLERANCE, MODE_ROUND_OFF = 1e-14, 1e-7
MAX_MODE_ITERATIONS = 60
# Its steps strain the cell by no more than MAX_MODE_STRAIN, and are shortened to no less than MIN_MODE_DAMPING of
# themselves.
MAX_MODE_STRAIN, MIN_MODE_DAMPING = 0.3, 0.1


def mode_count(axisymmetric: bool) -> int:
    """Count the numbers a cell of enhanced strain carries."""
    return 5 if axisymmetric else 4


class Modes(NamedTuple):
    """Modes of enhanced strain, as if they were nodes: gradients (n_e, nq, n_m, 2), hoop (n_e, nq, n_m) [1/m]."""

    gradients: Floats
    hoop: Floats


def mode_gradients(X: Floats, N: Floats, det: Floats, axisymmetric: bool) -> Modes:
    """Find the gradients and hoop parts of the modes.

    X : (n_e, 4, 2) [m].  N : (4, 4) shape functions at the points.  det : (n_e, 4) Jacobians there, of the unit square.
    n_m is 2, or 3 about an axis; of the third only its first component counts.
    """
    xi = N @ CORNERS
    middle = 0.25 * np.einsum("eai,aj->eij", X, CORNERS)
    # fault: modes do work on constant stress -> scale = np.ones_like(det) | mechanical_fmu/test_elements_patch
    scale = 4.0 * np.linalg.det(middle)[:, None] / det
    R = np.einsum("qa,ea->eq", N, X[:, :, 0])
    R_0 = X[:, :, 0].mean(axis=1)[:, None]
    if axisymmetric:
        scale = scale * R_0 / R
    inverse = np.linalg.inv(middle)
    gradients = np.einsum("eq,qm,emj->eqmj", scale, xi, inverse)
    hoop = np.zeros((*det.shape, 2))
    if axisymmetric:
        gradients = np.concatenate([gradients, np.zeros((*det.shape, 1, 2))], axis=2)
        hoop = np.concatenate([hoop, (scale * xi[:, 0] * xi[:, 1] / R_0)[:, :, None]], axis=2)
    return Modes(gradients, hoop)


@inner
def eliminate(K: Floats, r: Floats, n: int, m: int) -> bool:
    """Eliminate rows n to n + m of K and r in place, pivoting; False where they are singular.

    K : (n + m, n + m) [N/m].  r : (n + m,) [N].
    Then rows r[:n], K[:n, :n] are condensed, and `back` finds the eliminated unknowns.
    """
    total = n + m
    for k in range(total - 1, n - 1, -1):
        best = k
        for i in range(n, k):
            if abs(K[i, k]) > abs(K[best, k]):
                best = i
        if K[best, k] == 0.0:
            return False
        if best != k:
            for j in range(total):
                K[k, j], K[best, j] = K[best, j], K[k, j]
            r[k], r[best] = r[best], r[k]
        for i in range(k):
            factor = K[i, k] / K[k, k]
            if factor != 0.0:
                for j in range(k):
                    K[i, j] -= factor * K[k, j]
                r[i] -= factor * r[k]
    return True


@inner
def back(K: Floats, r: Floats, n: int, m: int) -> None:
    """Substitute back after `eliminate` with n = 0: r becomes the solution [m] of K x = r, m unknowns.

    K : (m, m) [N/m] and r : (m,) [N] as `eliminate` left them.
    """
    for k in range(n, n + m):
        for j in range(n, k):
            r[k] -= K[k, j] * r[j]
        r[k] /= K[k, k]
