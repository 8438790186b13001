"""Linear solves of the thermal half: GMRES about an anchor, the matrix that was factored.

From one substep to the next the matrix changes little (the step's size, the pieces that face each other), and a
solve with existing factors costs a twentieth of new ones.  The anchor is part of the state: the factors are rebuilt
from it where they are not at hand, so hot and cold caches give the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.linalg import Solve, factorise
from thermal_fmu.kernels import times

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# More iterations than this cost about half of new factors (measured at 1 250 and 7 500 unknowns), which also serve
# the steps to come.
MAX_KRYLOV = 8
PATIENCE = 2  # iterations before their rate is judged: the first ones say little about it
SMALLEST = 400  # unknowns: below, new factors cost no more than a few products in Python


@dataclass(frozen=True)
class Learnt:
    """What is known of a program from the stage before.  defect : (n,) [W].

    residuals, outcomes : (k, n) differences of what its iterates left and led to [W], the newest first.
    """

    defect: Floats
    residuals: Floats
    outcomes: Floats


@dataclass(frozen=True)
class AnchorMatrix:
    """The matrix whose factors are used, as CSR arrays.

    indptr : (n + 1,).  indices : (nnz,).  data : (nnz,) [J/K].  learnt : of a program, where the inside of bodies is
    one's; None: nothing.
    """

    indptr: Ints
    indices: Ints
    data: Floats
    learnt: Learnt | None = None

    def matrix(self) -> csr_matrix:
        """Return the matrix itself."""
        n = self.indptr.size - 1
        return csr_matrix((self.data, self.indices, self.indptr), shape=(n, n))


@dataclass(frozen=True)
class LinearSolution:
    """x : (n,).  anchor : for the next solve, the one that came in where its factors served."""

    x: Floats
    anchor: AnchorMatrix


class Factors:
    """The factors of the last anchor asked for.  Equal matrices have equal factors, to the bit."""

    def __init__(self) -> None:
        self._anchor: AnchorMatrix | None = None
        self._solve: Solve | None = None
        self.made = 0

    def of(self, anchor: AnchorMatrix) -> Solve:
        """Return the factors of an anchor.  Raises SingularMatrixError."""
        # fault: factors of an old matrix -> if self._solve is None or self._anchor is None : |
        #   thermal_fmu/test_thermal_solver
        if self._solve is None or self._anchor is None or not _equal(self._anchor, anchor):
            self._solve = factorise(anchor.matrix())
            self.made += 1
        self._anchor = anchor
        return self._solve


def solve(A: csr_matrix, b: Floats, target: float, anchor: AnchorMatrix | None, factors: Factors,
          round_off: float = 0.0) -> LinearSolution:
    """Solve A x = b : (n,) until the sum of |b - A x| is at most target, or exactly where that takes new factors.

    round_off : what b may have of it, added up [J]; where b is no more, x is what the factors at hand say.
    Raises SingularMatrixError.
    """
    if anchor is not None and b.size >= SMALLEST and anchor.indptr.size == b.size + 1:
        # Where b is round-off all but a little A Z has as much of it, and what is least shares the rest out at random.
        # fault: what is left of heat is shared out by round-off -> if False: | thermal_fmu/test_thermal_ledger
        if float(np.abs(b).sum()) <= round_off:
            return LinearSolution(factors.of(anchor)(b), anchor)
        x = _gmres(A, b, target / np.sqrt(b.size), factors.of(anchor))
        if x is not None and float(np.abs(b - times(A.indptr, A.indices, A.data, x)).sum()) <= target:
            return LinearSolution(x, anchor)
    fresh = AnchorMatrix(A.indptr, A.indices, A.data)
    return LinearSolution(factors.of(fresh)(b), fresh)


def _gmres(A: csr_matrix, b: Floats, target: float, precondition: Callable[[Floats], Floats]) -> Floats | None:
    """Find x : (n,) with |b - A x|_2 <= target by right preconditioned GMRES from 0; None as soon as it will take too

    long.  The least squares are turned along, column by column (Saad, Iterative Methods for Sparse Linear Systems,
    2nd ed., 6.5.3): plain numbers, because an array of four costs more than what is done with it.
    """
    size = float(np.linalg.norm(b))
    if size == 0.0:
        return np.zeros(b.size)
    V, Z = np.empty((MAX_KRYLOV + 1, b.size)), np.empty((MAX_KRYLOV, b.size))
    V[0], residual = b / size, size
    columns: list[list[float]] = []  # of the triangle R
    turned: list[float] = []  # the right side, as Q turned it
    turns: list[tuple[float, float]] = []  # cosine and sine of each rotation
    for j in range(MAX_KRYLOV):
        Z[j] = precondition(V[j])
        w = times(A.indptr, A.indices, A.data, Z[j])
        h = np.zeros(j + 1)
        for _ in range(2):  # the second pass keeps V orthogonal to round-off
            part = V[: j + 1] @ w
            w -= part @ V[: j + 1]
            h += part
        beyond = float(np.linalg.norm(w))
        column = h.tolist()
        for i, (c, s) in enumerate(turns):
            column[i], column[i + 1] = c * column[i] + s * column[i + 1], c * column[i + 1] - s * column[i]
        length = math.hypot(column[j], beyond)
        if length == 0.0 or not math.isfinite(length):
            return None
        # fault: the residual turned by the other angle -> c, s = beyond / length, column[j] / length |
        #   thermal_fmu/test_thermal_solver
        c, s = column[j] / length, beyond / length
        turns.append((c, s))
        column[j] = length
        columns.append(column)
        turned.append(c * residual)
        residual = -s * residual
        # fault: linear residual not checked -> if abs(residual) <= 1e6 * target: | thermal_fmu/test_thermal_solver
        if abs(residual) <= target:
            return np.asarray(_back(columns, turned) @ Z[: j + 1])
        if j >= PATIENCE and (abs(residual) / size) ** (MAX_KRYLOV / (j + 1)) * size > target:
            return None
        V[j + 1] = w / beyond
    return None


def _back(columns: list[list[float]], right: list[float]) -> Floats:
    """Return y : (m,) of R y = right, R the upper triangle of these columns."""
    y = list(right)
    for j in reversed(range(len(y))):
        y[j] /= columns[j][j]
        for i in range(j):
            y[i] -= columns[j][i] * y[j]
    return np.array(y)


def _equal(one: AnchorMatrix, other: AnchorMatrix) -> bool:
    return one is other or all(a is b or np.array_equal(a, b) for a, b in (
        (one.indptr, other.indptr), (one.indices, other.indices), (one.data, other.data)))
