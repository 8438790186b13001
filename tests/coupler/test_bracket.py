"""Iterates whose solution is within a hair of where contact closes come to it, and what gets on is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupler.scenario.options import Iteration
from coupler.schemes.acceleration import Trail, next_guess
from coupler.schemes.bracket import between


def iterates(weak: float, strong: float, kink: float, modes: int, most: int = 60) -> int:
    """How many it takes to |r| < 1e-6, 0 if `most` were not enough.

    H answers to the first mode by -weak up to its kink, where the residual still is `kink`, and by -strong beyond; to
    all others by 0.2.
    """
    Q = np.linalg.qr(np.random.default_rng(modes).normal(size=(modes, modes)))[0]

    def H(g):
        q = Q.T @ g
        return Q @ np.array([kink - (weak if q[0] <= 0.0 else strong) * q[0], *(0.2 * q[1:] + 1.0)])

    guess, trail = Q @ np.array([-1.0, *np.zeros(modes - 1)]), Trail()
    for k in range(1, most + 1):
        trail = trail.plus(guess, H(guess))
        if np.linalg.norm(trail.residual()) < 1e-6:
            return k
        guess, factor = next_guess(Iteration(), trail, ())
        trail = replace(trail, factors=(*trail.factors, factor))
    return 0


@pytest.mark.parametrize("modes", [1, 4])
@pytest.mark.parametrize("kink", [0.1, 0.01, 1e-3, 1e-4])
@pytest.mark.parametrize(("weak", "strong"), [(0.15, 20.0), (0.15, 200.0), (-0.7, 300.0), (0.0, 3000.0)])
def test_a_kink_beside_the_solution_is_passed(weak, strong, kink, modes):
    """In 9 to 43 iterates.  Left to itself the search is not there after 60 for all that answer by 200 or more."""
    assert 0 < iterates(weak, strong, kink, modes) <= 45


def test_a_search_that_gets_on_is_left_alone():
    trail = Trail()
    for k in range(12):
        r = (-0.4) ** k
        trail = trail.plus(np.array([1.0 - r]), np.array([1.0]))
        assert between(trail) is None


def test_iterates_on_one_side_have_nothing_between_them():
    trail = Trail()
    for k in range(12):
        trail = trail.plus(np.array([0.1 * k, 0.0]), np.array([0.1 * k + 1.0, 0.1 * k]))
        assert between(trail) is None


def test_nothing_is_tried_twice():
    """Two iterates by turns, on either side: first between them, then not there again."""
    a, b = (np.array([0.0]), np.array([1.0])), (np.array([1.0]), np.array([-29.0]))
    trail = Trail()
    for _ in range(5):
        trail = trail.plus(*a).plus(*b)
    middle = between(trail)
    assert middle is not None
    assert between(trail.plus(middle, middle - 5.0)) != pytest.approx(middle)
