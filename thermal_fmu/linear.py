"""Linear solves of the thermal half: GMRES about an anchor, the matrix that was factored.

From one substep to the next the matrix changes little (the step's size, the pieces that face each other), and a
solve with existing factors costs a twentieth of new ones.  Where only the surfaces change, as while bodies slide, they
are corrected exactly, on the unknowns of the surface nodes (P picks them, E is the change of the matrix there):
    (A_0 + P E P')^-1 b = A_0^-1 b - W E w,   (1 + P' W E) w = P' A_0^-1 b,   W = A_0^-1 P.
The anchor is part of the state: the factors and W are rebuilt from it where they are not at hand, so hot and cold
caches give the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.linalg import Solve, factorise
from thermal_fmu.kernels import surface_change, times

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# More iterations than this cost about half of new factors (measured at 1 250 and 7 500 unknowns), which also serve
# the steps to come.
MAX_KRYLOV = 8
PATIENCE = 2  # iterations before their rate is judged: the first ones say little about it
SMALLEST = 400  # unknowns: below, new factors cost no more than a few products in Python

# W takes a solve for every surface node, many at a time: about half of one alone each.  It is worked out once solves
# about anchors with the same matrix inside bodies have cost as much, so it costs at most as much again where that ends.
NEW_FACTORS = 20  # solves that new factors cost
SAME_INSIDE = 1e-3  # of the largest entry: what entries inside bodies may differ by
MOST_ENTRIES = 1_000_000  # of W: beyond, a product with it costs as much as a solve
RIGHT_SIDES = 64  # solved at a time, which keeps memory small
KEPT = 2  # anchors whose factors are kept where W may be: whole windows and halves of them take turns


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
    one's; None: nothing.  spent : solves that W would have saved, about it and those before it with the same matrix
    inside bodies.
    """

    indptr: Ints
    indices: Ints
    data: Floats
    learnt: Learnt | None = None
    spent: int = 0

    def matrix(self) -> csr_matrix:
        """Return the matrix itself."""
        n = self.indptr.size - 1
        return csr_matrix((self.data, self.indices, self.indptr), shape=(n, n))


@dataclass(frozen=True)
class LinearSolution:
    """x : (n,).  anchor : for the next solve, the one that came in where its factors served."""

    x: Floats
    anchor: AnchorMatrix


class FactoredAnchor:
    """An anchor's factors and, once asked for, W : (n, n_s) [K/J] of the surface nodes (n_s,)."""

    def __init__(self, anchor: AnchorMatrix, nodes: Ints) -> None:
        """Raises SingularMatrixError."""
        self.anchor, self.nodes = anchor, nodes
        self.solve: Solve = factorise(anchor.matrix())

    @cached_property
    def W(self) -> Floats:
        """Solve for the temperatures that a joule at each surface node makes."""
        n, W = self.anchor.indptr.size - 1, np.empty((self.anchor.indptr.size - 1, self.nodes.size))
        for start in range(0, self.nodes.size, RIGHT_SIDES):
            some = self.nodes[start : start + RIGHT_SIDES]
            unit = np.zeros((n, some.size), order="F")
            unit[some, np.arange(some.size)] = 1.0
            W[:, start : start + RIGHT_SIDES] = self.solve(unit)
        return W

    def corrected(self, E: Floats) -> Solve:
        """Return the solver of A_0 + P E P'; E : (n_s, n_s) [J/K]."""
        active = np.flatnonzero(E.any(axis=0) | E.any(axis=1))
        if not active.size:
            return self.solve
        nodes, E = self.nodes[active], E[np.ix_(active, active)]
        # E (1 + P' W E)^-1 once for all iterations.
        # fault: surfaces corrected by half their change -> onto = 0.5 * E @ np.linalg.inv(np.eye(active.size) +
        #   self.W[np.ix_(nodes, active)] @ E) | thermal_fmu/test_thermal_solver
        onto = E @ np.linalg.inv(np.eye(active.size) + self.W[np.ix_(nodes, active)] @ E)

        def solve(b: Floats) -> Floats:
            x, change = self.solve(b), np.zeros(self.nodes.size)
            change[active] = onto @ x[nodes]
            return np.asarray(x - self.W @ change)

        return solve


class Factors:
    """The factors of the last anchors asked for.  Equal matrices have equal factors, to the bit.

    nodes : (n_s,) unknowns at surfaces, which may be corrected; None: no surface is.
    """

    def __init__(self, nodes: Ints | None = None) -> None:
        self.nodes = np.empty(0, np.int32) if nodes is None else nodes
        self._kept: list[FactoredAnchor] = []
        self._place = np.empty(0, np.int32)
        self.made = 0

    def of(self, anchor: AnchorMatrix) -> Solve:
        """Return the factors of an anchor.  Raises SingularMatrixError."""
        return self.factored(anchor).solve

    def factored(self, anchor: AnchorMatrix) -> FactoredAnchor:
        """Return an anchor with its factors.  Raises SingularMatrixError."""
        # fault: factors of an old matrix -> found = next(iter(self._kept), None) | thermal_fmu/test_thermal_solver
        found = next((one for one in self._kept if _equal(one.anchor, anchor)), None)
        if found is None:
            # Before the new ones: of large matrices the memory of both is too much.
            del self._kept[(KEPT if self._may_correct(anchor.indptr.size - 1) else 1) - 1 :]
            found = FactoredAnchor(anchor, self.nodes)
            self.made += 1
        self._kept = [found, *(one for one in self._kept if one is not found)]
        return found

    def change(self, anchor: AnchorMatrix, A: csr_matrix) -> Floats | None:
        """Compute E : (n_s, n_s) [J/K] of a matrix; None where it differs inside bodies too, or no surface counts."""
        if not self._may_correct(A.shape[0]):
            return None
        if self._place.size != A.shape[0]:
            self._place = np.full(A.shape[0], -1, np.int32)
            self._place[self.nodes] = np.arange(self.nodes.size, dtype=np.int32)
        E, inside, largest = surface_change(A.indptr, A.indices, A.data, anchor.indptr, anchor.indices, anchor.data,
                                            self._place, self.nodes.size)
        return E if inside <= SAME_INSIDE * largest else None

    def _may_correct(self, n: int) -> bool:
        return 0 < n * self.nodes.size <= MOST_ENTRIES


def solve(A: csr_matrix, b: Floats, target: float, anchor: AnchorMatrix | None, factors: Factors,
          round_off: float = 0.0) -> LinearSolution:
    """Solve A x = b : (n,) until the sum of |b - A x| is at most target, or exactly where that takes new factors.

    round_off : what b may have of it, added up [J]; where b is no more, x is what the factors at hand say.
    Raises SingularMatrixError.
    """
    spent = 0
    if anchor is not None and b.size >= SMALLEST and anchor.indptr.size == b.size + 1:
        # Where b is round-off all but a little A Z has as much of it, and what is least shares the rest out at random.
        # fault: what is left of heat is shared out by round-off -> if False: | thermal_fmu/test_thermal_ledger
        if float(np.abs(b).sum()) <= round_off:
            return LinearSolution(factors.of(anchor)(b), anchor)
        known, E = factors.factored(anchor), factors.change(anchor, A)
        pays = E is not None and 2 * anchor.spent >= factors.nodes.size
        found = _gmres(A, b, target / np.sqrt(b.size), known.corrected(E) if pays and E is not None else known.solve)
        spent = 0 if E is None else anchor.spent + (MAX_KRYLOV if found is None else found.solves)
        if found is not None and float(np.abs(b - times(A.indptr, A.indices, A.data, found.x)).sum()) <= target:
            # fault: what was spent is not counted -> return LinearSolution(found.x, anchor) |
            #   thermal_fmu/test_thermal_solver
            return LinearSolution(found.x, anchor if pays else replace(anchor, spent=spent))
        spent += NEW_FACTORS if E is not None else 0
    fresh = AnchorMatrix(A.indptr, A.indices, A.data, spent=spent)
    return LinearSolution(factors.of(fresh)(b), fresh)


@dataclass(frozen=True)
class _Found:
    """x : (n,).  solves : how often the factors were used."""

    x: Floats
    solves: int


def _gmres(A: csr_matrix, b: Floats, target: float, precondition: Callable[[Floats], Floats]) -> _Found | None:
    """Find x : (n,) with |b - A x|_2 <= target by right preconditioned GMRES from 0; None as soon as it will take too

    long.  The least squares are turned along, column by column (Saad, Iterative Methods for Sparse Linear Systems,
    2nd ed., 6.5.3): plain numbers, because an array of four costs more than what is done with it.
    """
    size = float(np.linalg.norm(b))
    if size == 0.0:
        return _Found(np.zeros(b.size), 0)
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
            return _Found(np.asarray(_back(columns, turned) @ Z[: j + 1]), j + 1)
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
