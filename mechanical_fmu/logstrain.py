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

from contact.compiled import kernel

Floats = NDArray[np.float64]

# Below this y = q/m^2 the series of g is used; the closed form of g'' loses 2 digits to cancellation above it.
SERIES_BELOW = 0.05
# Below this fewer terms do: strains up to some percent, the usual case.
SHORT_BELOW = 1e-3


@kernel
def shape(y: float) -> tuple[float, float, float]:
    """g(y) = atanh(sqrt y)/sqrt y, g'(y), g''(y) for 0 <= y < 1: the sum of y^k/(2k + 1)."""
    if y >= SERIES_BELOW:
        root = np.sqrt(y)
        g = np.arctanh(root) / root
        over = 1.0 / (1.0 - y)
        g1 = (over - g) / (2.0 * y)
        return g, g1, (over * over - 3.0 * g1) / (2.0 * y)
    last = 6 if y < SHORT_BELOW else 15
    g, g1, g2 = 0.0, 0.0, 0.0
    for k in range(last, 1, -1):
        a = 1.0 / (2.0 * k + 1.0)
        g = g * y + a
        g1 = g1 * y + k * a
        g2 = g2 * y + k * (k - 1.0) * a
    return (g * y + 1.0 / 3.0) * y + 1.0, g1 * y + 1.0 / 3.0, g2


@kernel
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


@kernel
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


@kernel
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
    for i in range(4):
        side_i = 1.0 if i % 2 == 0 else -1.0
        di, ci = side_i * F[i], F[i ^ 1]
        ai = (F[3 - i] if i == 0 or i == 3 else -F[3 - i]) / J
        qi, wi = 2.0 * (d * di + c * ci), half * di + S[2] * ci
        bi = b_m * F[i] + b_q * qi
        for j in range(i + 1):
            side_j = 1.0 if j % 2 == 0 else -1.0
            dj, cj = side_j * F[j], F[j ^ 1]
            aj = (F[3 - j] if j == 0 or j == 3 else -F[3 - j]) / J
            qj, wj = 2.0 * (d * dj + c * cj), half * dj + S[2] * cj
            bj = b_m * F[j] + b_q * qj
            value = -mean * J * ai * aj + wi * bj + bi * wj
            q_ij = 2.0 * (di * dj + ci * cj)
            if i == j:
                value += b * half * side_i + w * b_m
                q_ij += 2.0 * d * side_i
            elif i == j ^ 1:
                value += b * S[2]
                q_ij += 2.0 * c
            elif i + j == 3:
                # d2J of F11 F22 and of -F12 F21.
                value += mean if i == 3 else -mean
            value += w * (b_q * q_ij + b_mm * F[i] * F[j] + b_mq * (F[i] * qj + qi * F[j]) + b_qq * qi * qj)
            H[i, j] = value
            H[j, i] = value
        H[i, 4] = 0.0
        H[4, i] = 0.0
    H[4, 4] = -S[3] / (F[4] * F[4])


@kernel
def piola(L: Floats, S: Floats, P: Floats) -> None:
    """Fill P : (5,) = S : dE/dF [Pa], conjugate to F."""
    for i in range(5):
        P[i] = S[0] * L[0, i] + S[1] * L[1, i] + 2.0 * S[2] * L[2, i] + S[3] * L[3, i]


@kernel
def piola_tangent(F: Floats, L: Floats, S: Floats, D: Floats, A: Floats) -> None:
    """Fill A : (5, 5) = dP/dF [Pa] of S : (4,) and D : (4, 4) = dS/dE (plain components on both sides)."""
    log_strain_curvature(F, S, A)
    for k in range(4):
        weight = 2.0 if k == 2 else 1.0
        for j in range(5):
            along = weight * (D[k, 0] * L[0, j] + D[k, 1] * L[1, j] + D[k, 2] * L[2, j] + D[k, 3] * L[3, j])
            for i in range(5):
                A[i, j] += L[k, i] * along
