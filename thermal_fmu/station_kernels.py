"""The loops along rods, compiled.

Shapes: own (m + 1,) the stations of a rod from left to right; *_q (m, 2) values at the Gauss points between two of
them; N (2, 2) shape functions at these points; band (3 w + 1, n) with entry (i, j) of the matrix at [2 w + i - j, j].
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@njit(cache=True)
def rod_points(values: Floats, own: Ints, N: Floats) -> Floats:
    """(m, 2) values at Gauss points of values : (n,) at stations."""
    m = own.size - 1
    out = np.empty((m, 2))
    for e in range(m):
        a, b = values[own[e]], values[own[e + 1]]
        for q in range(2):
            out[e, q] = N[q, 0] * a + N[q, 1] * b
    return out


@njit(cache=True)
def add_rod_conduction(T: Floats, own: Ints, N: Floats, kA: Floats, dkA: Floats, f: Floats) -> Floats:
    """f -= the heat that leaves each station [W]; returns (m, 2) derivatives by T of the heat of each piece [W/K].

    kA, dkA : (m, 2) conductance and its derivative by temperature at Gauss points [W/K, W/K2].
    """
    m = own.size - 1
    slope = np.empty((m, 2))
    for e in range(m):
        drop = T[own[e]] - T[own[e + 1]]
        G = kA[e, 0] + kA[e, 1]
        f[own[e]] -= G * drop
        f[own[e + 1]] += G * drop
        for i in range(2):
            slope[e, i] = (dkA[e, 0] * N[0, i] + dkA[e, 1] * N[1, i]) * drop
        slope[e, 0] += G
        slope[e, 1] -= G
    return slope


@njit(cache=True)
def add_rod_slopes(own: Ints, slope: Floats, by_s: Floats, scale: float, band: Floats) -> None:
    """band += scale * slope * by_s, slope : (m, 2) derivatives of the heat from left to right in each piece.

    by_s : (n,) derivative by the unknown of what slope is a derivative by.
    """
    w = (band.shape[0] - 1) // 3
    for e in range(own.size - 1):
        i, j = own[e], own[e + 1]
        a, b = scale * slope[e, 0] * by_s[i], scale * slope[e, 1] * by_s[j]
        band[2 * w, i] += a
        band[2 * w + i - j, j] += b
        band[2 * w + j - i, i] -= a
        band[2 * w, j] -= b


@njit(cache=True)
def add_rod_storage(own: Ints, N: Floats, dE_q: Floats, C_q: Floats, S: Floats, band: Floats) -> None:
    """S += N'dE_q [J] and band += N'C_q N [J/K], both by stations."""
    w = (band.shape[0] - 1) // 3
    for e in range(own.size - 1):
        for q in range(2):
            for a in range(2):
                i = own[e + a]
                S[i] += N[q, a] * dE_q[e, q]
                for b in range(2):
                    j = own[e + b]
                    band[2 * w + i - j, j] += C_q[e, q] * N[q, a] * N[q, b]


@njit(cache=True)
def add_melting_fields(s: Floats, own: Ints, mush: tuple[float, float, float], T: Floats, f_s: Floats, dT: Floats,
                       df: Floats) -> None:
    """Fill T [K], f_s and their derivatives by s : (n,) [K] at the stations of a body (thermal_fmu/phase.py).

    mush : T_s, T_l and the width W [K].
    """
    T_s, T_l, W = mush
    for i in own:
        if s[i] <= T_s:
            T[i], f_s[i], dT[i], df[i] = s[i], 1.0, 1.0, 0.0
        elif s[i] < T_s + W:
            phi = (s[i] - T_s) / W
            T[i], f_s[i], dT[i], df[i] = T_s + phi * (T_l - T_s), 1.0 - phi, (T_l - T_s) / W, -1.0 / W
        else:
            T[i], f_s[i], dT[i], df[i] = s[i] - (W - (T_l - T_s)), 0.0, 1.0, 0.0


@njit(cache=True)
def melting_heat(s0: Floats, s1: Floats, mush: tuple[float, float, float], c: tuple[float, float],
                 C: Floats) -> Floats:
    """(m,) increase of enthalpy from s0 to s1 : (m,) [J/kg] at one melting point, and C : (m,) its derivative [J/kgK].

    mush : the melting point [K], the width W [K], L [J/kg].  c : of the solid and of the liquid [J/kgK].
    """
    T_m, W, L = mush
    dh = np.empty(s0.size)
    for i in range(s0.size):
        solid = c[0] * (min(s1[i], T_m) - min(s0[i], T_m))
        liquid = c[1] * (max(s1[i], T_m + W) - max(s0[i], T_m + W))
        phi0, phi1 = min(max((s0[i] - T_m) / W, 0.0), 1.0), min(max((s1[i] - T_m) / W, 0.0), 1.0)
        dh[i] = solid + liquid + L * (phi1 - phi0)
        C[i] = c[0] if s1[i] <= T_m else (L / W if s1[i] < T_m + W else c[1])
    return dh
