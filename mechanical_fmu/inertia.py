"""Inertia forces of a step, linear in the displacement at its end.  Eq. (23)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Inertia:
    """force(u) = matrix (u - origin) + constant, [N].

    matrix : (2 n, 2 n) [N/m].  origin : (n, 2) [m].  constant : (n, 2) [N], what the step's start contributes.
    """

    matrix: csr_matrix
    origin: Floats
    constant: Floats

    def force(self, u: Floats) -> Floats:
        """(n, 2) [N] at u : (n, 2) [m]."""
        return np.asarray(self.matrix @ (u - self.origin).ravel()).reshape(u.shape) + self.constant
