"""Linear solves that reuse the factors of an earlier matrix: GMRES about an anchor.

From one substep to the next the matrix changes little (the step's size, the pieces that face each other), and a solve
with known factors costs a twentieth of new ones.  The anchor, the matrix that was factored, is part of the state: the
factors are rebuilt from it where they are not at hand, so hot and cold caches give the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.sparse import Solve, factorise

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# More iterations than this cost about half of new factors (measured at 1 250 and 7 500 unknowns), which also serve
# the steps to come.
MAX_ITERATIONS = 8
PATIENCE = 2  # iterations before their rate is held against them: the first ones tell little
SMALLEST = 400  # unknowns; below, new factors cost no more than a few products in Python


@dataclass(frozen=True)
class Anchor:
    """The matrix whose factors are used, as CSR arrays."""

    indptr: Ints
    indices: Ints
    data: Floats

    def matrix(self) -> csr_matrix:
        """The matrix itself."""
        n = self.indptr.size - 1
        return csr_matrix((self.data, self.indices, self.indptr), shape=(n, n))


@dataclass(frozen=True)
class Solution:
    """x : (n,).  anchor : for the next solve, the one that came in where its factors served."""

    x: Floats
    anchor: Anchor


class Factors:
    """The factors of the last anchor asked for.  Equal matrices have equal factors, to the bit."""

    def __init__(self) -> None:
        self._anchor: Anchor | None = None
        self._solve: Solve | None = None
        self.made = 0

    def of(self, anchor: Anchor) -> Solve:
        """Factors of the anchor.  Raises SingularMatrixError."""
        # fault: factors of an old matrix -> if self._solve is None or self._anchor is None : |
        #   thermal_fmu/test_thermal_solver
        if self._solve is None or self._anchor is None or not _equal(self._anchor, anchor):
            self._solve = factorise(anchor.matrix())
            self.made += 1
        self._anchor = anchor
        return self._solve


def solve(A: csr_matrix, b: Floats, target: float, anchor: Anchor | None, factors: Factors) -> Solution:
    """Solve A x = b : (n,) until the sum of |b - A x| is at most target, or exactly where that takes new factors.

    Raises SingularMatrixError.
    """
    if anchor is not None and b.size >= SMALLEST and anchor.indptr.size == b.size + 1:
        x = _gmres(A, b, target / np.sqrt(b.size), factors.of(anchor))
        if x is not None and float(np.abs(b - A @ x).sum()) <= target:
            return Solution(x, anchor)
    fresh = Anchor(A.indptr, A.indices, A.data)
    return Solution(factors.of(fresh)(b), fresh)


def _gmres(A: csr_matrix, b: Floats, target: float, precondition: Callable[[Floats], Floats]) -> Floats | None:
    """x with |b - A x|_2 <= target by right preconditioned GMRES from 0; None as soon as it will take too long."""
    size = float(np.linalg.norm(b))
    if size == 0.0:
        return np.zeros(b.size)
    V, Z = np.zeros((MAX_ITERATIONS + 1, b.size)), np.zeros((MAX_ITERATIONS, b.size))
    H = np.zeros((MAX_ITERATIONS + 1, MAX_ITERATIONS))
    start = np.zeros(MAX_ITERATIONS + 1)
    V[0], start[0] = b / size, size
    for j in range(MAX_ITERATIONS):
        Z[j] = precondition(V[j])
        w = A @ Z[j]
        for _ in range(2):  # the second pass keeps V orthogonal to round-off
            h = V[: j + 1] @ w
            w -= h @ V[: j + 1]
            H[: j + 1, j] += h
        H[j + 1, j] = np.linalg.norm(w)
        y, left = _least(H[: j + 2, : j + 1], start[: j + 2])
        # fault: linear residual not checked -> if left <= 1e6 * target: | thermal_fmu/test_thermal_solver
        if left <= target:
            return np.asarray(y @ Z[: j + 1])
        if not np.isfinite(left) or (j >= PATIENCE and (left / size) ** (MAX_ITERATIONS / (j + 1)) * size > target):
            return None
        V[j + 1] = w / H[j + 1, j]
    return None


def _least(H: Floats, start: Floats) -> tuple[Floats, float]:
    """y that makes |start - H y| least, and that norm, for a tiny upper Hessenberg H."""
    Q, R = np.linalg.qr(H, mode="complete")
    turned = Q.T @ start
    m = H.shape[1]
    if not R.diagonal().all():
        return np.zeros(m), np.inf
    return np.linalg.solve(R[:m], turned[:m]), float(abs(turned[m]))


def _equal(one: Anchor, other: Anchor) -> bool:
    return one is other or all(a is b or np.array_equal(a, b) for a, b in (
        (one.indptr, other.indptr), (one.indices, other.indices), (one.data, other.data)))
