"""Enhanced strain (Simo & Armero 1992): modes inside a quad that let it bend, and their elimination.

    F = 1 + du/dX + sum_m a_m (x) e_m,   e_m = (R_0 j_0)/(R j) J_0^-T dM_m/dxi,   M_1 = xi^2 / 2, M_2 = eta^2 / 2,
Wilson's modes with the map of the cell's middle (index 0; R = 1 in the plane), so that the integral of e_m over the
cell vanishes and constant stress does no work on them: the patch test.  A mode is a vector a_m [m] in space, like a
node with gradients e_m; it turns with the body.  About an axis a fifth number enters the hoop stretch alone,
F_33 += a_5 (R_0 j_0)/(R j) xi eta / R_0.  The modes are found from zero out-of-balance inside each cell.
Limit: under strong compression the element shows hourglasses (Wriggers & Reese 1996).  A square block of 4 x 4 cells,
pressed and free to widen, has a tangent with a negative eigenvalue from a stretch of .64 on (nu = .3; .68 at
nu = .4999), by mean dilatation not before .44.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner

Floats = NDArray[np.float64]

# xi, eta of the four points of contact.half.elements' quad table are +-1/sqrt(3); signs follow from its N.
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
# Newton's method inside a cell: found when the modes strain it by less than this, or by no less than before.
MODE_TOLERANCE, MODE_ROUND_OFF = 1e-14, 1e-7
MOST_LOCAL = 60
# Its steps strain the cell by no more than LONGEST_MODE, and are shortened to no less than SHORTEST of themselves.
LONGEST_MODE, SHORTEST = 0.3, 0.1


def mode_count(axisymmetric: bool) -> int:
    """Numbers a cell of enhanced strain carries."""
    return 5 if axisymmetric else 4


def mode_gradients(X: Floats, N: Floats, det: Floats, axisymmetric: bool) -> tuple[Floats, Floats]:
    """Gradients (n_e, 4, n_m, 2) and hoop parts (n_e, 4, n_m) [1/m] of the modes, as if they were nodes.

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
    return gradients, hoop


@inner
def eliminate(K: Floats, r: Floats, n: int, m: int) -> bool:
    """Eliminate rows n to n + m of K and r in place, pivoting; False where they are singular.

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
    """After `eliminate` with n = 0: r becomes the solution of K x = r, m unknowns."""
    for k in range(n, n + m):
        for j in range(n, k):
            r[k] -= K[k, j] * r[j]
        r[k] /= K[k, k]
