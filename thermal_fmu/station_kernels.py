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
