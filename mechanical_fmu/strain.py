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

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner

Floats = NDArray[np.float64]

# Below this y = q/m^2 the series of g is used; the closed form of g'' loses 2 digits to cancellation above it.
SERIES_BELOW = 0.05
# Below this fewer terms do: strains up to some percent, the usual case.
SHORT_BELOW = 1e-3


@inner
def shape(y: float) -> tuple[float, float, float]:
    """g(y) = atanh(sqrt y)/sqrt y, g'(y), g''(y) for 0 <= y < 1: the sum of y^k/(2k + 1)."""
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
def log_strain(F: Floats, E: Floats) -> None:
    """Fill E : (4,) = (11, 22, 12, 33) of F : (5,) with J > 0 in the plane and F33 > 0."""
    J = F[0] * F[3] - F[1] * F[2]
    C11, C22, c = F[0] * F[0] + F[2] * F[2], F[1] * F[1] + F[3] * F[3], F[0] * F[1] + F[2] * F[3]
    m, d = 0.5 * (C11 + C22), 0.5 * (C11 - C22)
    b = shape((d * d + c * c) / (m * m))[0] / m
    a = np.log(J)
    E[0] = 0.5 * (a + b * d)
    E[1] = 0.5 * (a - b * d)
    E[2] = 0.5 * b * c
    E[3] = np.log(F[4])


@inner
def log_strain_gradient(F: Floats, E: Floats, L: Floats) -> None:
    """Fill E : (4,) and L : (4, 5) = dE/dF."""
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
    """Fill H : (5, 5) = S : d2E/dFdF of S : (4,), symmetric [Pa]."""
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
    """Fill P : (5,) = S : dE/dF [Pa], conjugate to F."""
    for i in range(5):
        P[i] = S[0] * L[0, i] + S[1] * L[1, i] + 2.0 * S[2] * L[2, i] + S[3] * L[3, i]


@inner
def piola_tangent(F: Floats, L: Floats, S: Floats, D: Floats, A: Floats) -> None:
    """Fill A : (5, 5) = dP/dF [Pa] of S : (4,) and D : (4, 4) = dS/dE (plain components on both sides)."""
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
