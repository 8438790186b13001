"""Assembly on a fixed pattern, and its solvers: right, the same bits whatever came before, and never silent."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from contact.half import linalg
from contact.half.linalg import SingularMatrixError, factorise, joined, pattern_of

rng = np.random.default_rng(3)


@pytest.fixture(params=["superlu", "pardiso"])
def solver(request, monkeypatch):
    """Each solver in turn."""
    if request.param == "pardiso":
        pytest.importorskip("pypardiso")
    monkeypatch.setenv("SLIDELINE_SOLVER", request.param)
    return request.param


@pytest.fixture
def pardiso(monkeypatch):
    """The module, that solver chosen and nothing known yet."""
    pytest.importorskip("pypardiso")
    from contact.half import linalg

    monkeypatch.setenv("SLIDELINE_SOLVER", "pardiso")
    monkeypatch.setattr(linalg, "_patterns", [])
    return pardiso


def chain(n: int = 30):
    """Blocks of a chain of springs held to the ground, and the dense matrix they add up to."""
    dofs = np.column_stack([np.arange(n - 1), np.arange(1, n)])
    blocks = np.array([[2.0, -1.0], [-0.5, 2.0]]) * rng.uniform(1, 2, (n - 1, 1, 1))
    dense = np.zeros((n, n))
    for d, block in zip(dofs, blocks, strict=True):
        dense[np.ix_(d, d)] += block
    return dofs, blocks, dense


def plate(m: int, seed: int = 0, symmetric: bool = True, held: float = 1e-3):
    """A matrix on m x m quads with two unknowns a node, whose numbers follow from the seed."""
    grid = np.arange((m + 1) ** 2).reshape(m + 1, m + 1)
    cells = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    dofs = (2 * cells[:, :, None] + np.arange(2)).reshape(-1, 8)
    roots = np.random.default_rng(seed).normal(size=(len(cells), 8, 8))
    blocks = roots @ roots.transpose(0, 2, 1) + held * np.eye(8)
    if not symmetric:
        blocks[:, 0, 1:] *= 1.5
    return pattern_of(2 * grid.size, dofs).matrix(blocks.ravel())


def test_blocks_add_up_where_they_belong():
    dofs, blocks, dense = chain()
    pattern = pattern_of(len(dense), dofs)
    np.testing.assert_allclose(pattern.matrix(blocks.ravel()).toarray(), dense, rtol=1e-15)


def test_a_pattern_of_mixed_blocks_is_sorted_and_has_every_diagonal():
    """Blocks of three kinds, nodes in no order, one unknown in none of them; against a sum by places."""
    n = 40
    kinds = [np.array([rng.permutation(n - 1)[:m] for _ in range(count)]) for m, count in ((4, 23), (3, 17), (2, 5))]
    pattern = pattern_of(n, *kinds)
    blocks = [rng.random((len(dofs), dofs.shape[1], dofs.shape[1])) for dofs in kinds]
    dense, there = np.zeros((n, n)), np.eye(n, dtype=bool)
    for dofs, values in zip(kinds, blocks, strict=True):
        for d, block in zip(dofs, values, strict=True):
            dense[np.ix_(d, d)] += block
            there[np.ix_(d, d)] = True
    A = pattern.matrix(np.concatenate([b.ravel() for b in blocks]))
    np.testing.assert_allclose(A.toarray(), dense, rtol=1e-14)
    expected = csr_matrix(there)
    np.testing.assert_array_equal(pattern.indptr, expected.indptr)
    np.testing.assert_array_equal(pattern.indices, expected.indices)
    assert pattern.indptr.dtype == pattern.indices.dtype == np.int32


def test_solvers_solve(solver):
    dofs, blocks, dense = chain()
    matrix = pattern_of(len(dense), dofs).matrix(blocks.ravel())
    b = rng.random(len(dense))
    first, other = factorise(matrix), factorise(2.0 * matrix)  # two factors live side by side
    np.testing.assert_allclose(first(b), np.linalg.solve(dense, b), rtol=1e-12)
    np.testing.assert_allclose(other(b), 0.5 * np.linalg.solve(dense, b), rtol=1e-12)
    many = rng.random((len(dense), 5))
    np.testing.assert_allclose(first(many), np.linalg.solve(dense, many), rtol=1e-12)


@pytest.mark.parametrize("symmetric", [True, False, None])
def test_what_is_known_of_the_values_changes_no_answer(solver, symmetric):
    A = plate(6)
    b = np.cos(np.arange(A.shape[0]))
    x = factorise(A, symmetric)(b)
    np.testing.assert_allclose(x, np.linalg.solve(A.toarray(), b), rtol=1e-8)


def test_values_that_are_not_symmetric_are_seen(solver):
    A = plate(6, symmetric=False)
    b = np.cos(np.arange(A.shape[0]))
    np.testing.assert_allclose(factorise(A)(b), np.linalg.solve(A.toarray(), b), rtol=1e-8)


def test_a_symmetric_matrix_need_not_be_positive(solver):
    A = plate(6) - 3.0 * plate(6, seed=1)
    b = np.cos(np.arange(A.shape[0]))
    for _ in range(2):  # the second time with what the first one left behind
        np.testing.assert_allclose(factorise(A, symmetric=True)(b), np.linalg.solve(A.toarray(), b), rtol=1e-7)


def test_a_pattern_without_symmetry_is_solved_too(solver):
    A = csr_matrix(np.array([[2.0, 1.0, 0.0], [0.0, 3.0, 1.0], [1.0, 0.0, 4.0]]))
    np.testing.assert_allclose(factorise(A)(np.ones(3)), np.linalg.solve(A.toarray(), np.ones(3)), rtol=1e-14)


@pytest.mark.parametrize("symmetric", [True, False])
def test_a_known_pattern_gives_the_bits_of_a_first_call(pardiso, symmetric):
    """One analysis serves matrices that differ by orders of magnitude, each solved to the bits of a fresh one."""
    matrices = [plate(12, seed, symmetric) for seed in range(4)]
    matrices[2].data *= np.where(np.arange(matrices[2].nnz) % 7 == 0, 1.0 + 1e-15, 1.0)  # below what is looked at
    matrices[3] = matrices[3] * 1e9
    b = np.cos(np.arange(matrices[0].shape[0]))
    cold = []
    for A in matrices:
        linalg._patterns[:] = []
        cold.append(factorise(A)(b))
        gc.collect()
    linalg._patterns[:] = []
    before = linalg._Handle.made
    for k in (0, 1, 2, 3, 2, 0, 3, 1):
        again = matrices[k].copy()  # equal, not identical
        assert factorise(again)(b).tobytes() == cold[k].tobytes()
    assert linalg._Handle.made == before + 1


def test_few_patterns_are_kept(pardiso):
    for m in (*range(2, 9), 2):
        A = plate(m)
        assert factorise(A)(np.ones(A.shape[0])).size == A.shape[0]
    assert len(linalg._patterns) == linalg.MAX_PATTERNS
    assert all(len(pattern.idle) == 1 for pattern in linalg._patterns)


def test_what_cannot_be_solved_is_said(solver):
    matrix = pattern_of(2, np.array([[0, 1]])).matrix(np.ones(4))
    with pytest.raises(SingularMatrixError):
        factorise(matrix)(np.array([1.0, 0.0]))
    with pytest.raises(SingularMatrixError):
        factorise(csr_matrix(np.array([[1.0, 0.0], [0.0, 0.0]])))(np.ones(2))


@pytest.mark.parametrize("symmetric", [True, False])
def test_singular_factors_are_no_factors(pardiso, symmetric):
    """Pivots of round-off pass, or are replaced, in silence; a free floating plate is told at its first solve."""
    A = plate(10)
    free = A - csr_matrix(np.diag(np.asarray(A.sum(axis=1)).ravel()))  # each row adds up to zero
    with pytest.raises(SingularMatrixError):
        factorise(free, symmetric)(rng.normal(size=free.shape[0]))


def test_wrong_factors_are_told(pardiso):
    """Every solve is held against the matrix: here it changed after it was factored."""
    A = plate(4)
    solve = factorise(A)
    A.data[:] *= np.linspace(1.0, 2.0, A.nnz)
    with pytest.raises(SingularMatrixError, match="residual"):
        solve(np.ones(A.shape[0]))
    with pytest.raises(SingularMatrixError, match="residual"):
        solve(np.ones((A.shape[0], 3)))


@pytest.mark.parametrize("wrong", [0, 31, 63])
def test_one_wrong_side_of_many_is_told(pardiso, wrong):
    """Columns of any size, one of which reaches where the matrix changed after it was factored."""
    n = 80
    A = csr_matrix(np.diag(np.linspace(1.0, 2.0, n)))
    solve = factorise(A)
    sides = np.zeros((n, 64))
    sides[np.arange(64), np.arange(64)] = np.logspace(-12.0, 12.0, 64)
    assert np.allclose(A @ solve(sides), sides, rtol=1e-12, atol=0.0)
    A.data[wrong] *= 1.001
    with pytest.raises(SingularMatrixError, match=r"residual of 1\.0e-03"):
        solve(sides)


def test_an_unknown_solver_is_told(monkeypatch):
    monkeypatch.setenv("SLIDELINE_SOLVER", "cramer")
    with pytest.raises(ValueError, match="known: superlu, pardiso"):
        linalg.factorise(plate(2))


def test_blocks_of_nodes_are_joined_to_a_pattern() -> None:
    """Cells and contact blocks, some where cells are and some between others: the sum of both matrices."""
    rng = np.random.default_rng(4)
    cells = np.array([[0, 1, 2, 3], [2, 3, 4, 5], [8, 9, 10, 11]])
    pattern, entries = pattern_of(14, cells), rng.normal(size=3 * 16)
    starts, columns = np.array([0, 3, 3, 5, 5, 8, 8, 8], dtype=np.int32), np.array([0, 4, 2, 2, 0, 5, 4, 0], np.int32)
    blocks = rng.normal(size=(8, 2, 2))
    other = np.zeros((14, 14))
    for b, (node, column) in enumerate(zip(np.repeat(np.arange(7), np.diff(starts)), columns, strict=True)):
        other[2 * node : 2 * node + 2, 2 * column : 2 * column + 2] = blocks[b]
    both = joined(pattern, starts, columns)
    for factor in (1.0, 2.0):
        K = both.matrix(factor * entries, blocks)
        assert K.has_sorted_indices
        np.testing.assert_allclose(K.toarray(), factor * pattern.matrix(entries).toarray() + other, rtol=1e-14)
    assert both.is_of(starts.copy(), columns.copy())
    assert not both.is_of(starts, columns[::-1])
