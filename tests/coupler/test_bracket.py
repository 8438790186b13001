"""Iterates whose solution is within a hair of where contact closes come to it, and what gets on is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupler.scenario.options import Iteration
from coupler.scenario.timing import MOST_WHERE_STEADY
from coupler.schemes.acceleration import Trail, next_guess
from coupler.schemes.bracket import between, stuck_guess


def taken(H, guess, most: int) -> int:
    """How many iterates it takes to |r| < 1e-6, 0 if `most` are not enough."""
    trail = Trail()
    for k in range(1, most + 1):
        trail = trail.plus(guess, H(guess))
        if np.linalg.norm(trail.residual()) < 1e-6:
            return k
        guess, factor = next_guess(Iteration(), trail, ())
        trail = replace(trail, factors=(*trail.factors, factor))
    return 0


def iterates(weak: float, strong: float, kink: float, modes: int) -> int:
    """How many one kink takes.

    H answers to the first mode by -weak up to its kink, where the residual still is `kink`, and by -strong beyond; to
    all others by 0.2.
    """
    Q = np.linalg.qr(np.random.default_rng(modes).normal(size=(modes, modes)))[0]

    def H(g):
        q = Q.T @ g
        return Q @ np.array([kink - (weak if q[0] <= 0.0 else strong) * q[0], *(0.2 * q[1:] + 1.0)])

    return taken(H, Q @ np.array([-1.0, *np.zeros(modes - 1)]), 60)


@pytest.mark.parametrize("modes", [1, 4])
@pytest.mark.parametrize("kink", [0.1, 0.01, 1e-3, 1e-4])
@pytest.mark.parametrize(("weak", "strong"), [(0.15, 20.0), (0.15, 200.0), (-0.7, 300.0), (0.0, 3000.0)])
def test_a_kink_beside_the_solution_is_passed(weak, strong, kink, modes):
    """In 8 to 34 iterates.  Left to itself the search is not there after 60 for all that answer by 200 or more."""
    assert 0 < iterates(weak, strong, kink, modes) <= 36


@pytest.mark.few(
    "slopes1-kinks0-modes0", "slopes1-kinks0-modes1", "slopes2-kinks1-modes0", "slopes0-kinks2-modes0",
    "slopes1-kinks3-modes0")
@pytest.mark.parametrize("modes", [((1.0, 0.3), (-0.2, 1.0)), ((0.7, 0.7), (-0.7, 0.7))])
@pytest.mark.parametrize("kinks", [(1e-1, 3e-2), (1e-2, 3e-3), (1e-3, 1e-3), (1e-4, 1e-2)])
@pytest.mark.parametrize("slopes", [(30.0, 3.0), (300.0, 30.0), (300.0, 300.0)])
def test_two_kinks_are_passed_at_once(slopes, kinks, modes):
    """Two modes with a kink each, as of the two corners of a face that comes to touch by a hair."""

    def H(g):
        q = np.array(modes) @ g
        return np.array(kinks) - np.where(q > 0.0, slopes, 0.1) * q

    assert taken(H, np.array([-1.0, -0.5]), MOST_WHERE_STEADY) > 0


def test_a_search_that_gets_on_is_left_alone():
    trail = Trail()
    for k in range(12):
        r = (-0.4) ** k
        trail = trail.plus(np.array([1.0 - r]), np.array([1.0]))
        assert stuck_guess(trail, np.array([1.0])) is None


def test_iterates_on_one_side_have_nothing_between_them():
    trail = Trail()
    for k in range(12):
        trail = trail.plus(np.array([0.1 * k, 0.0]), np.array([0.1 * k + 1.0, 0.1 * k]))
        assert between(trail) == []


def test_nothing_is_tried_twice():
    """Two iterates by turns, on either side: none of the guesses is one of those that were, at any time."""
    a, b = (np.array([0.0]), np.array([1.0])), (np.array([1.0]), np.array([-29.0]))
    trail = Trail()
    for _ in range(5):
        trail = trail.plus(*a).plus(*b)
    for _ in range(4):
        new = stuck_guess(trail, b[0])
        assert new is not None
        assert all(new != pytest.approx(old) for old in trail.guesses)
        trail = trail.plus(new, new - 5.0)


def test_a_fit_that_was_tried_before_is_not_tried_again_however_early():
    trail = Trail().plus(np.array([0.0]), np.array([1.0])).plus(np.array([1.0]), np.array([-29.0]))
    assert stuck_guess(trail, np.array([0.5])) is None
    assert 0.0 < stuck_guess(trail, np.array([1.0])) < 1.0
