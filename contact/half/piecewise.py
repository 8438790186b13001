"""The compiled loop that reads curves of properties: alone, for who imports no curve need not import numba."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel

Floats = NDArray[np.float64]


@kernel
def piecewise(c: Floats, x: Floats, low: float, high: float, T: Floats) -> None:
    """Replace T : (n,) by a piecewise polynomial at it, held between low and high; to the bit what PPoly gives.

    c : (k, m) coefficients, the highest power first, about the left ends of the pieces between x : (m + 1,).
    """
    for i in range(T.size):
        t = min(max(T[i], low), high)
        piece = 0
        while piece < c.shape[1] - 1 and t >= x[piece + 1]:
            piece += 1
        power, total = 1.0, 0.0
        for k in range(c.shape[0] - 1, -1, -1):
            total += c[k, piece] * power
            # fault: a table is read from the start of its first piece -> power *= t - x[0] |
            #   contact/test_half_property
            power *= t - x[piece]
        T[i] = total if T[i] == T[i] else T[i]
