"""Accelerations on linear problems with known contraction, their guards, and what is remembered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupler.scenario.options import Acceleration, Iteration
from coupler.schemes.acceleration import LARGEST_FACTOR, LEAST_FACTOR, Trail, contraction, next_guess, remembered

NONE, CONSTANT, AITKEN, IQN_ILS = Acceleration


def problem(*eigenvalues: float) -> tuple[np.ndarray, np.ndarray]:
    """H(g) = A g + b with A of these eigenvalues on orthogonal axes that are not the coordinates'."""
    n = len(eigenvalues)
    Q = np.linalg.qr(np.random.default_rng(1).normal(size=(n, n)))[0]
    return Q @ np.diag(eigenvalues) @ Q.T, np.arange(1.0, n + 1)


def solve(how: Iteration, A: np.ndarray, b: np.ndarray, memory=()) -> tuple[int, Trail]:
    """(iterates until |r| < 1e-10, or 0 if 60 were not enough; the trail)."""
    guess, trail = np.zeros(len(b)), Trail()
    for k in range(1, 61):
        trail = trail.plus(guess, A @ guess + b)
        if np.abs(trail.residual()).max() < 1e-10:
            return k, trail
        guess, factor = next_guess(how, trail, memory)
        trail = replace(trail, factors=(*trail.factors, factor))
    return 0, trail


@pytest.mark.parametrize(("eigenvalues", "needed"), [
    ((-3.0,), 3), ((-800.0,), 3), ((1.8,), 3), ((-3.0, -0.5, 0.2), 5), ((-3.0, 0.5, 1.8), 6),
    ((-800.0, -300.0, -2.0, 0.1), 8)])
def test_quasi_newton_needs_few_more_iterates_than_modes_whatever_the_contraction(eigenvalues, needed):
    A, b = problem(*eigenvalues)
    assert solve(Iteration(acceleration=NONE), A, b)[0] == 0
    iterates, trail = solve(Iteration(acceleration=IQN_ILS), A, b)
    assert iterates == needed
    np.testing.assert_allclose(trail.guesses[-1], np.linalg.solve(np.eye(len(b)) - A, b), rtol=1e-9)


@pytest.mark.parametrize(("eigenvalues", "iterates"), [((-3.0,), 3), ((-800.0,), 3), ((1.8,), 3),
                                                       ((-3.0, -0.5, 0.2), 20), ((-3.0, 0.5, 1.8), 30)])
def test_aitken_where_plain_iteration_diverges(eigenvalues, iterates):
    A, b = problem(*eigenvalues)
    assert solve(Iteration(acceleration=AITKEN), A, b)[0] == iterates


def test_a_constant_factor_at_its_optimum_is_there_at_once():
    """1/(1 + r), r the contraction (sign taken out): one step from any guess."""
    A, b = problem(-3.0, -3.0)
    assert solve(Iteration(acceleration=CONSTANT, relaxation=0.25), A, b)[0] == 2
    assert solve(Iteration(acceleration=CONSTANT, relaxation=0.6), A, b)[0] == 0


def test_plain_iteration_takes_the_outcome_itself():
    A, b = problem(0.5, -0.3)
    trail = solve(Iteration(acceleration=NONE), A, b)[1]
    for k in range(1, len(trail.guesses)):
        assert trail.guesses[k].tobytes() == trail.outcomes[k - 1].tobytes()


def test_equal_residuals_keep_the_factor():
    """H(g) = g + c: every residual is the same, and both accelerations must not divide by their difference."""
    A, b = np.eye(2), np.array([1.0, 2.0])
    for kind in (AITKEN, IQN_ILS):
        _, trail = solve(Iteration(acceleration=kind, relaxation=0.5), A, b)
        assert np.isfinite(trail.guesses[-1]).all()
        assert set(trail.factors) == {0.5}


def test_the_factor_is_bounded_and_keeps_its_sign():
    for slope, factor in ((0.999, LARGEST_FACTOR), (1.001, -LARGEST_FACTOR), (-1e6, LEAST_FACTOR), (-1.0, 0.5)):
        g = np.array([1.0])
        trail = Trail((g, 2 * g), (slope * g + 1, slope * 2 * g + 1), (1.0,))
        assert next_guess(Iteration(acceleration=AITKEN), trail, ())[1] == pytest.approx(factor, rel=1e-9)


def test_columns_that_add_nothing_are_left_out():
    """The same difference twice but for 1e-9: without the filter the least squares answer is noise a thousand times
    the step."""
    r = np.array([1.0, 1.0])
    memory = (((np.array([1.0, 0.0]), np.array([0.0, 0.0])), (np.array([1.0, 1e-9]), np.array([5.0, 0.0]))),)
    guess, _ = next_guess(Iteration(acceleration=IQN_ILS), Trail((np.zeros(2),), (r,)), memory)
    np.testing.assert_allclose(guess, r, atol=1e-12)


def test_windows_are_remembered_as_many_as_wanted():
    A, b = problem(-3.0, 0.5)
    how = Iteration(acceleration=IQN_ILS, reuse=2)
    memory: tuple = ()
    alone = solve(how, A, b + 3)[0]
    for k in range(4):
        trail = solve(how, A, b + k, memory)[1]
        memory = remembered(memory, trail, how)
    assert len(memory) == 2
    # What a window learnt serves the next.
    assert (alone, len(trail.guesses)) == (5, 4)
    assert remembered(memory, trail, how.changed(reuse=0)) == ()
    assert remembered((), trail, Iteration(acceleration=AITKEN)) == ()


def test_contraction_is_what_plain_iteration_would_do_whatever_was_in_use():
    A, b = problem(-3.0)
    for kind in (NONE, AITKEN, IQN_ILS):
        assert contraction(solve(Iteration(acceleration=kind), A, b)[1], 1e-9) == pytest.approx(3.0, rel=1e-9)
    mixed = solve(Iteration(acceleration=IQN_ILS), *problem(-3.0, -0.5, 0.2))[1]
    assert 1.0 < contraction(mixed, 1e-9) <= 3.0 + 1e-9
    assert np.isnan(contraction(Trail().plus(b, b), 1e-9))
