"""Assembly on a fixed pattern, and its solvers."""

from __future__ import annotations

import numpy as np
import pytest

from contact.half.sparse import SingularMatrixError, factorise, pattern_of

rng = np.random.default_rng(3)


def chain(n: int = 30):
    """Blocks of a chain of springs held to the ground, and the dense matrix they add up to."""
    dofs = np.column_stack([np.arange(n - 1), np.arange(1, n)])
    blocks = np.array([[2.0, -1.0], [-0.5, 2.0]]) * rng.uniform(1, 2, (n - 1, 1, 1))
    dense = np.zeros((n, n))
    for d, block in zip(dofs, blocks, strict=True):
        dense[np.ix_(d, d)] += block
    return dofs, blocks, dense


def test_blocks_add_up_where_they_belong():
    dofs, blocks, dense = chain()
    pattern = pattern_of(len(dense), dofs)
    np.testing.assert_allclose(pattern.matrix(blocks.ravel()).toarray(), dense, rtol=1e-15)


@pytest.mark.parametrize("solver", ["superlu", "pardiso"])
def test_solvers_solve(monkeypatch, solver):
    if solver == "pardiso":
        pytest.importorskip("pypardiso")
    monkeypatch.setenv("SLIDELINE_SOLVER", solver)
    dofs, blocks, dense = chain()
    matrix = pattern_of(len(dense), dofs).matrix(blocks.ravel())
    b = rng.random(len(dense))
    first, other = factorise(matrix), factorise(2.0 * matrix)  # two factors live side by side
    np.testing.assert_allclose(first(b), np.linalg.solve(dense, b), rtol=1e-12)
    np.testing.assert_allclose(other(b), 0.5 * np.linalg.solve(dense, b), rtol=1e-12)


def test_what_cannot_be_solved_is_said(monkeypatch):
    matrix = pattern_of(2, np.array([[0, 1]])).matrix(np.ones(4))
    monkeypatch.setenv("SLIDELINE_SOLVER", "superlu")
    with pytest.raises(SingularMatrixError):
        factorise(matrix)
    monkeypatch.setenv("SLIDELINE_SOLVER", "cramer")
    with pytest.raises(ValueError, match="known: superlu, pardiso"):
        factorise(matrix)
