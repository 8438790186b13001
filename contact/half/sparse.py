"""Sparse assembly on a fixed pattern, and its direct solve by SuperLU, or by PARDISO where chosen."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass

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

    slots : (n_entries,) place in `data` of every block entry, blocks in the order given to `pattern_of`, row-major.
    """

    n: int
    indptr: Ints
    indices: Ints
    slots: NDArray[np.intp]

    def matrix(self, entries: Floats) -> csr_matrix:
        """Sum the entries of all blocks (flat, in order) into the matrix."""
        data = np.bincount(self.slots, weights=entries, minlength=self.indices.size)
        return csr_matrix((data, self.indices, self.indptr), shape=(self.n, self.n))


def pattern_of(n: int, *dofs: NDArray[np.integer]) -> Pattern:
    """The pattern of square blocks on the given degrees of freedom.

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


Solve = Callable[[Floats], Floats]
"""A factored matrix: called with a right-hand side b it returns the x of A x = b, or raises SingularMatrixError."""


def factorise(A: csr_matrix, symmetric: bool | None = None) -> Solve:
    """Factor a square matrix, which must not change while its factors are used; the result solves A x = b.

    symmetric : what the caller knows of the values; None: they are looked at, where it matters.
    SLIDELINE_SOLVER = superlu | pardiso chooses; the default is superlu, so that numbers do not depend on
    what is installed.  Equal matrices have equal factors, to the bit, whatever was factored before.
    Raises SingularMatrixError; ImportError or ValueError where the choice cannot be kept.
    """
    choice = os.environ.get("SLIDELINE_SOLVER", "superlu")
    if choice not in ("superlu", "pardiso"):
        raise ValueError(f"SLIDELINE_SOLVER is {choice!r}; known: superlu, pardiso")
    if choice == "superlu":
        return _superlu(A)
    from contact.half.pardiso import Factored  # loads MKL, hundreds of megabytes

    return Factored(A, symmetric)


def _superlu(A: csr_matrix) -> Solve:
    # MMD on A'+A in symmetric mode: 1.4 to 2.4 times faster than scipy's default ordering on these matrices.
    # The order of a pattern is not kept: that would save 0 to 28 % and change bits.
    try:
        lu = splu(csc_matrix(A), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                  options={"SymmetricMode": True})
    except RuntimeError as exc:
        raise SingularMatrixError(str(exc)) from exc
    solve: Solve = lu.solve
    return solve
