"""Sparse matrices of a half: assembly on a fixed pattern, and direct solves by SuperLU, or by PARDISO where chosen.

PARDISO's analysis (ordering, tree, supernodes) is made once a pattern, from the pattern alone: scaling and matching by
values are switched off.  So new factors on a cached pattern are the same bits as those of a first call, and the cache
is invisible.  Where the values are symmetric half the matrix is factored, in half the time.
"""

from __future__ import annotations

import ctypes
import os
import weakref
from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class SingularMatrixError(ArithmeticError):
    """The matrix has no inverse to working precision."""


@dataclass(frozen=True)
class Pattern:
    """Where element blocks land in a symmetric-pattern CSR matrix of n rows.

    indptr : (n + 1,).  indices : (nnz,).  slots : (n_entries,) place in `data` of every block entry, blocks in the
    order given to `pattern_of`, row-major.
    """

    n: int
    indptr: Ints
    indices: Ints
    slots: NDArray[np.intp]

    def matrix(self, entries: Floats) -> csr_matrix:
        """Sum the entries of all blocks into the matrix (n, n), in their unit.

        entries : (n_entries,) of the blocks, flat, in order, all in the same unit (a stiffness: [N/m]).
        """
        return self.of(np.bincount(self.slots, weights=entries, minlength=self.indices.size).astype(float, copy=False))

    def of(self, data: Floats) -> csr_matrix:
        """Return the matrix (n, n) of the values data : (nnz,) at the places of the pattern, in their unit."""
        matrix: csr_matrix = copy(self._zeros)  # an eighth of the time of making one, which checks the places again
        matrix.data = data
        return matrix

    @cached_property
    def _zeros(self) -> csr_matrix:
        return csr_matrix((np.zeros(self.indices.size), self.indices, self.indptr), shape=(self.n, self.n))


def pattern_of(n: int, *dofs: NDArray[np.integer]) -> Pattern:
    """Build the pattern of square blocks on the given degrees of freedom.

    n : number of unknowns.  dofs : arrays (n_blocks, m), one per kind of block; block b couples all of dofs[b].
    """
    ends = np.concatenate([np.full(d.size, d.shape[1]) for d in dofs] + [np.ones(n, np.int64)]).cumsum()
    rows = np.concatenate([d.ravel() for d in dofs] + [np.arange(n)]).astype(np.int32)
    cols = np.concatenate([np.tile(d, (1, d.shape[1])).ravel() for d in dofs] + [np.arange(n)]).astype(np.int32)
    # Each row of each block is a row here.  Turning it over sorts by column, turning it back by row: two counting
    # sorts, a third of the time of a sort of all entries (measured from 1e4 to 2e5 unknowns).
    by_column = csr_matrix((np.arange(cols.size, dtype=np.int32), cols, np.concatenate([[0], ends])),
                           shape=(rows.size, n)).tocsc()
    entries = csc_matrix((by_column.data, rows[by_column.indices], by_column.indptr), shape=(n, n)).tocsr()
    # A row cannot begin with the column the one before ends with: the pattern is symmetric.
    is_first = np.ones(cols.size, dtype=bool)
    np.not_equal(entries.indices[1:], entries.indices[:-1], out=is_first[1:])
    places = np.cumsum(is_first) - 1
    slots = np.empty(cols.size, dtype=np.intp)
    # fault: block entries added up in the order of the matrix -> slots[:] = places | contact/test_sparse
    slots[entries.data] = places
    indptr = np.append(places[entries.indptr[:-1]], places[-1] + 1).astype(np.int32)
    return Pattern(n, indptr, entries.indices[is_first].astype(np.int32), slots[: cols.size - n])


@dataclass(frozen=True)
class JoinedPattern:
    """A pattern that has room for the 2 x 2 blocks of some nodes, too.

    starts : (n/2 + 1,) and columns : (n_b,) of those blocks, by rows.  own : the pattern of both, into which the blocks
    of the other's own pattern are put.  slots : (4 n_b,) places in its `data` of the values of the blocks.
    """

    starts: Ints
    columns: Ints
    own: Pattern
    slots: NDArray[np.intp]

    def is_of(self, starts: Ints, columns: Ints) -> bool:
        """Say whether these blocks are those it has room for."""
        return np.array_equal(starts, self.starts) and np.array_equal(columns, self.columns)

    def matrix(self, entries: Floats, blocks: Floats) -> csr_matrix:
        """Sum both into the matrix (n, n); entries : as of Pattern.matrix, blocks : (n_b, 2, 2), in the same unit."""
        total = self.own.matrix(entries)
        # No two blocks are of the same place.
        # fault: joined blocks turned over -> total.data[self.slots] += blocks.transpose(0, 2, 1).ravel() |
        #   contact/test_sparse
        total.data[self.slots] += blocks.ravel()
        return total


def joined(pattern: Pattern, starts: Ints, columns: Ints) -> JoinedPattern:
    """Make room in a pattern for blocks; starts : (n/2 + 1,), columns : (n_b,) of nodes, in any order in a row."""
    n, node = pattern.n, np.repeat(np.arange(starts.size - 1, dtype=np.int64), np.diff(starts))
    both = np.arange(2, dtype=np.int64)
    at = ((2 * node[:, None, None] + both[:, None]) * n + 2 * columns.astype(np.int64)[:, None, None] + both).ravel()
    before = np.repeat(np.arange(n, dtype=np.int64), np.diff(pattern.indptr)) * n + pattern.indices
    places = np.union1d(before, at)
    indptr = np.searchsorted(places, n * np.arange(n + 1, dtype=np.int64)).astype(np.int32)
    own = Pattern(n, indptr, (places % n).astype(np.int32), np.searchsorted(places, before)[pattern.slots])
    return JoinedPattern(starts, columns, own, np.searchsorted(places, at))


Solve = Callable[[Floats], Floats]
"""A factored matrix: called with a right-hand side b it returns the x of A x = b, or raises SingularMatrixError."""


def factorise(A: csr_matrix, symmetric: bool | None = None) -> Solve:
    """Factor a square matrix, which must not change while its factors are used; the result solves A x = b.

    symmetric : whether the values are, as the caller says; None: they are compared, where it matters.
    SLIDELINE_SOLVER = superlu | pardiso chooses; the default is superlu, so that numbers do not depend on
    what is installed.  Equal matrices have equal factors, to the bit, whatever was factored before.
    Raises SingularMatrixError; ImportError or ValueError where the choice cannot be met.
    """
    if _chosen() == "superlu":
        solve: Solve = _superlu(A).solve
        return solve
    return Factored(A, symmetric)


def _chosen() -> str:
    choice = os.environ.get("SLIDELINE_SOLVER", "superlu")
    if choice not in ("superlu", "pardiso"):
        raise ValueError(f"SLIDELINE_SOLVER is {choice!r}; known: superlu, pardiso")
    return choice


WIDE = 20_000  # unknowns from which on panels of two columns are the faster ones


def negative_pivots(A: csr_matrix) -> int:
    """Count the negative eigenvalues of a symmetric matrix: by Sylvester's law the negative pivots of L D L' of it.

    By the solver that `factorise` takes.  Raises SingularMatrixError where a pivot is zero, and as `factorise`.
    """
    if _chosen() == "pardiso":
        return Factored(A, True).negative
    lu = _superlu(A)
    # Without a zero on the diagonal no rows are exchanged, and U is D L'.
    if not np.array_equal(lu.perm_r, lu.perm_c):
        raise SingularMatrixError("a pivot is zero")
    return int(np.count_nonzero(lu.U.diagonal() < 0.0))


def _superlu(A: csr_matrix) -> Any:
    # MMD on A'+A in symmetric mode: 1.4 to 2.4 times faster than scipy's default ordering on these matrices.
    # The order of a pattern is not kept: that would save 0 to 28 % and change bits.
    # Narrow panels: beside SuperLU's 20 columns these take 0.80 (hot_upsetting, 1 066 unknowns) to 0.73 (3 200 to
    # 9 800) of the time, and two columns 0.82 at 39 200, 0.96 at 96 800.
    try:
        return splu(csc_matrix(A), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                    panel_size=1 if A.shape[0] < WIDE else 2, options={"SymmetricMode": True})
    except RuntimeError as exc:
        raise SingularMatrixError(str(exc)) from exc


# PARDISO

POSITIVE, INDEFINITE, GENERAL = 2, -2, 11  # PARDISO's numbers of matrix types
ANALYSE, FACTOR, SOLVE, RELEASE_FACTORS, RELEASE_ALL = 11, 22, 33, 0, -1  # and of phases
MAX_PATTERNS = 4  # known at a time: two halves in one process, each with and without contact
ROUND_OFF = 1e-14  # of the largest entry: values that differ by less from their mirror image are symmetric
# Small pivots are replaced in silence, so every solve is checked against the matrix.  Newton's directions need few
# digits and good factors leave many: a residual above this part of the right-hand side is no round-off.
MAX_RELATIVE_RESIDUAL = 1e-4
SINGULAR, NO_MEMORY = (-4, -7), (-2, -9)  # error numbers


@cache
def _library() -> Any:
    """Load the entry point of MKL.  Raises ImportError."""
    try:
        from pypardiso import PyPardisoSolver
    except ImportError as exc:
        raise ImportError("SLIDELINE_SOLVER=pardiso needs pypardiso: pip install 'slideline[fast]'") from exc
    entry = PyPardisoSolver().libmkl["pardiso"]
    entry.restype = None
    return entry


def _settings(kind: int) -> Ints:
    """Return iparm : (64,), numbered from 1 in the manual: none left to a default that looks at values."""
    iparm = np.zeros(64, dtype=np.int32)
    iparm[0] = 1  # (1) all of them are given here
    iparm[1] = 2  # (2) nested dissection
    iparm[9] = 13 if kind == GENERAL else 8  # (10) pivots below 1e-13 or 1e-8 of the norm are perturbed
    iparm[20] = 1 if kind == INDEFINITE else 0  # (21) 1 x 1 and 2 x 2 pivots
    iparm[34] = 1  # (35) rows and columns count from 0
    return iparm  # (11) scaling and (13) matching stay 0


def _address(array: NDArray[Any] | None) -> ctypes.c_void_p | None:
    return None if array is None else ctypes.c_void_p(array.ctypes.data)


def _call(handle: NDArray[np.int64], kind: int, phase: int, iparm: Ints, *arrays: Any) -> int:
    """Call PARDISO; arrays : data, indptr, indices, b, x.  Returns its error number."""
    data, indptr, indices, b, x = arrays
    error, idle = ctypes.c_int32(0), np.zeros(1, dtype=np.int32)
    columns = 1 if b is None or b.ndim == 1 else b.shape[1]
    one, n = ctypes.c_int32(1), ctypes.c_int32(0 if indptr is None else indptr.size - 1)
    by = ctypes.byref
    _library()(_address(handle), by(one), by(one), by(ctypes.c_int32(kind)), by(ctypes.c_int32(phase)), by(n),
               _address(data), _address(indptr), _address(indices), _address(idle), by(ctypes.c_int32(columns)),
               _address(iparm), by(ctypes.c_int32(0)), _address(b), _address(x), by(error))
    return error.value


class _Handle:
    """PARDISO's memory of one analysis, and of one matrix's factors at most."""

    made: ClassVar[int] = 0  # analyses so far

    def __init__(self, kind: int, indptr: Ints, indices: Ints) -> None:
        self.kind, self.iparm = kind, _settings(kind)
        self._arrays = (indptr, indices)
        self._pt = np.zeros(64, dtype=np.int64)
        weakref.finalize(self, _call, self._pt, kind, RELEASE_ALL, self.iparm, None, None, None, None,
                         None).atexit = False
        _Handle.made += 1
        # fault: analysis kept that looked at values: matching by the first matrix -> self.iparm[10] = self.iparm[12] =
        #   1; self.run(ANALYSE, np.cos(np.arange(indices.size) * float(_Handle.made))) | contact/test_sparse
        self.run(ANALYSE, np.zeros(indices.size))

    def run(self, phase: int, data: Floats | None = None, b: Floats | None = None, x: Floats | None = None) -> None:
        """Run a phase.  data : (nnz,).  b, x : (n,) or (n, m).  Raises SingularMatrixError, MemoryError."""
        error = _call(self._pt, self.kind, phase, self.iparm, data, *self._arrays, b, x)
        if error in SINGULAR:
            raise SingularMatrixError("PARDISO met a pivot of zero")
        if error in NO_MEMORY:
            raise MemoryError("PARDISO ran out of memory")
        if error:
            raise RuntimeError(f"PARDISO failed in phase {phase} with error {error}")

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues of the symmetric matrix factored last."""
        return int(self.iparm[22]) if self.kind == INDEFINITE else 0

    @property
    def perturbed(self) -> int:
        """Number of pivots that were too small and were replaced."""
        return int(self.iparm[13])


@dataclass(frozen=True)
class _Pattern:
    """Rows and columns of a matrix with sorted rows, and the handles on it that nobody uses."""

    indptr: Ints
    indices: Ints
    idle: list[_Handle] = field(default_factory=list)

    def is_of(self, A: csr_matrix) -> bool:
        """Return whether A has this pattern."""
        return all(a is b or np.array_equal(a, b) for a, b in ((self.indptr, A.indptr), (self.indices, A.indices)))

    @cached_property
    def mirrored(self) -> Ints | None:
        """Return the place (nnz,) of (j, i) for the entry at (i, j); None where it lacks symmetry or a diagonal."""
        n = self.indptr.size - 1
        places = np.arange(self.indices.size, dtype=np.int32)
        turned = csr_matrix((places, self.indices, self.indptr), shape=(n, n)).tocsc()
        same = np.array_equal(turned.indptr, self.indptr) and np.array_equal(turned.indices, self.indices)
        rows = np.repeat(np.arange(n), np.diff(self.indptr))
        return turned.data if same and np.count_nonzero(rows == self.indices) == n else None

    @cached_property
    def upper(self) -> tuple[Ints, Ints, NDArray[np.intp]]:
        """Return indptr (n + 1,) and indices (m,) of the upper triangle, and the places (m,) of its entries."""
        rows = np.repeat(np.arange(self.indptr.size - 1), np.diff(self.indptr))
        places = np.flatnonzero(self.indices >= rows)
        counts = np.bincount(rows[places], minlength=self.indptr.size - 1)
        return np.concatenate([[0], np.cumsum(counts)]).astype(np.int32), self.indices[places], places

    def is_symmetric(self, data: Floats) -> bool:
        """Return whether the entries data : (nnz,) are their own mirror image, to round-off."""
        if self.mirrored is None:
            return False
        return bool(np.abs(data - data[self.mirrored]).max() <= ROUND_OFF * np.abs(data).max())

    def handle(self, kind: int) -> _Handle:
        """Return an idle handle, or a new one."""
        for i, handle in enumerate(self.idle):
            if handle.kind == kind:
                return self.idle.pop(i)
        return _Handle(kind, *((self.indptr, self.indices) if kind == GENERAL else self.upper[:2]))


_patterns: list[_Pattern] = []  # the last used is the last


def _pattern_of(A: csr_matrix) -> _Pattern:
    pattern = next((p for p in reversed(_patterns) if p.is_of(A)), None)
    if pattern is None:
        if not np.diff(A.indptr).all():
            raise SingularMatrixError("a row of the matrix is empty")
        pattern = _Pattern(A.indptr, A.indices)
    # The list is small: rebuilding it keeps the order of use.
    _patterns[:] = [*(p for p in _patterns if p is not pattern), pattern][-MAX_PATTERNS:]
    return pattern


def _give_back(pattern: _Pattern, handle: _Handle) -> None:
    """Keep the analysis for the next matrix, but not the factors, which are ten times as large."""
    if all(other.kind != handle.kind for other in pattern.idle):
        handle.run(RELEASE_FACTORS)
        # fault: analysis of a pattern not kept -> handle.run(RELEASE_FACTORS) | contact/test_sparse
        pattern.idle.append(handle)


class Factored:
    """A matrix factored by PARDISO; called with b : (n,) or (n, m) it returns the x of A x = b."""

    def __init__(self, A: csr_matrix, symmetric: bool | None) -> None:
        """Factor A.  Raises SingularMatrixError, MemoryError, ImportError."""
        if not A.has_sorted_indices:
            A = A.sorted_indices()
        pattern = _pattern_of(A)
        if symmetric is None:
            # fault: any matrix taken for a symmetric one -> symmetric = True | contact/test_sparse
            symmetric = pattern.is_symmetric(A.data)
        self._A = A
        self._data = A.data[pattern.upper[2]] if symmetric else np.ascontiguousarray(A.data)
        # fault: symmetric matrices taken for positive -> self._handle = self._factors(pattern, (POSITIVE,) if symmetric
        #   else (GENERAL,)) | contact/test_sparse
        self._handle = self._factors(pattern, (POSITIVE, INDEFINITE) if symmetric else (GENERAL,))
        weakref.finalize(self, _give_back, pattern, self._handle).atexit = False
        if self._handle.perturbed:  # a singular matrix, or none: a right-hand side like any other tells
            self(np.cos(np.arange(A.shape[0])))

    def _factors(self, pattern: _Pattern, kinds: tuple[int, ...]) -> _Handle:
        handle = pattern.handle(kinds[0])
        try:
            handle.run(FACTOR, self._data)
        except SingularMatrixError:
            _give_back(pattern, handle)
            if len(kinds) == 1:
                raise
            return self._factors(pattern, kinds[1:])
        return handle

    @property
    def negative(self) -> int:
        """Number of its negative eigenvalues; of a symmetric matrix."""
        return self._handle.negative

    def __call__(self, b: Floats) -> Floats:
        """Solve A x = b; return x in the shape of b, in its unit over that of A; columns one after the other.

        b : (n,) or (n, m), in any unit; columns one after the other are not copied.  Raises SingularMatrixError where
        the factors do not solve the matrix they were made of.
        """
        rhs = np.asfortranarray(b, dtype=np.float64)
        x = np.zeros_like(rhs)
        self._handle.run(SOLVE, self._data, rhs, x)
        if x.ndim == 2 and _relative_residual(self._A, *_in_one(x, rhs)) <= MAX_RELATIVE_RESIDUAL:
            return x
        residual = _relative_residual(self._A, x, rhs)
        # fault: factors believed without a look at the residual -> if residual < 0.0: | contact/test_sparse
        if not residual <= MAX_RELATIVE_RESIDUAL:
            raise SingularMatrixError(f"the factors leave a residual of {residual:.1e} of the right-hand side "
                                      f"({self._handle.perturbed} pivots were zero to working precision)")
        return x


def _in_one(x: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Return the sum of the columns of x and b : (n, m), (n, 1) each, all of one size, with signs of no order.

    A column that is wrong is so in the sum: its residual is one of m vectors that are nothing.  That takes one product,
    where those of all columns take as long as the solve.
    """
    size = np.sqrt(np.einsum("ij,ij->j", b, b))
    signs = np.random.default_rng(0).choice([-1.0, 1.0], b.shape[1])
    # fault: the largest of many right-hand sides is not looked at -> weights = (size < size.max()) *
    #   np.divide(signs, size, out=signs, where=size > 0.0) | contact/test_sparse
    weights = np.divide(signs, size, out=signs, where=size > 0.0)
    return (x @ weights)[:, None], (b @ weights)[:, None]


def _relative_residual(A: csr_matrix, x: Floats, b: Floats) -> float:
    """Return the largest |b - A x| / |b| of the columns of b : (n,) or (n, m)."""
    size = np.linalg.norm(b, axis=0)
    return float(np.max(np.linalg.norm(b - A @ x, axis=0) / np.where(size > 0.0, size, 1.0), initial=0.0))
