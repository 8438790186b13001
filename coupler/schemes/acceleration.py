"""Acceleration: from the guesses and outcomes so far to the next guess.  Pure functions on vectors.

With guess g, outcome H(g) and residual r = H(g) - g a window is solved where r = 0.  Plain iteration, g' = H(g),
converges only where H contracts; the others use what the residuals tell about the slope of H.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from contact.half.quasi_newton import Column as Column
from contact.half.quasi_newton import Trail as Trail
from contact.half.quasi_newton import quasi_newton_guess
from coupler.scenario.options import Acceleration, Iteration
from coupler.schemes.bracket import stuck_guess

Array = NDArray[np.float64]

# Bounds of Aitken's factor.  A pressure law makes H step over the solution by up to a thousand times (1e-4 is below
# 1/(1 + 1000)); ten plain steps at once is as far as one measured slope is worth.
LEAST_FACTOR, LARGEST_FACTOR = 1e-4, 10.0
# Residuals that differ by less than this share of themselves are equal but for round-off: no slope in them.
EQUAL = 1e-12

Memory = tuple[tuple[Column, ...], ...]  # columns of windows past, the newest first


def remembered(memory: Memory, trail: Trail, how: Iteration) -> Memory:
    """The memory after a window; empty for accelerations that keep none."""
    if how.acceleration is not Acceleration.IQN_ILS or how.reuse == 0:
        return ()
    return ((trail.columns, *memory) if trail.columns else memory)[: how.reuse]


def next_guess(how: Iteration, trail: Trail, memory: Memory) -> tuple[Array, float]:
    """Return the next guess (n,) scaled [1] and the factor of its step.

    The factor is its length over that of a plain step, signed for Aitken.
    """
    if how.acceleration is Acceleration.IQN_ILS:
        fitted = quasi_newton_guess(trail, [column for window in memory for column in window])
        stuck = stuck_guess(trail, fitted)
        guess = fitted if stuck is None else stuck
        if guess is None:
            return relaxed(how, trail)
        length = float(np.linalg.norm(trail.residual()))
        return guess, float(np.linalg.norm(guess - trail.guesses[-1])) / length if length > 0.0 else 0.0
    factor = _factor(how, trail)
    return _stepped(trail, factor), factor


def relaxed(how: Iteration, trail: Trail) -> tuple[Array, float]:
    """Return the careful step (n,) scaled [1] and its factor.

    It is a share of the way to the outcome, so between two vectors that are both in bounds.
    """
    return _stepped(trail, how.relaxation), how.relaxation


def contraction(trail: Trail, least: float) -> float:
    """The largest of `contractions` without their signs; nan if there is none."""
    return max((abs(ratio) for ratio in contractions(trail, least)), default=math.nan)


def contractions(trail: Trail, least: float) -> tuple[float, ...]:
    """|H(g) - H(g')|/|g - g'| of successive iterates, the nearest to the solution last; < 0 where they point apart.

    It is the ratio of successive residuals of plain iteration, below 1 where that converges, whatever acceleration
    was in use.  least : differences of guesses shorter than this are round-off.
    """
    found = []
    for k in range(1, len(trail.guesses)):
        step = trail.guesses[k] - trail.guesses[k - 1]
        apart = float(np.linalg.norm(step))
        if apart > least:
            # fault: contraction upside down -> ratio = float(np.linalg.norm(trail.guesses[k] - trail.guesses[k - 1])) /
            #   apart | coupler/test_acceleration
            ratio = float(np.linalg.norm(trail.outcomes[k] - trail.outcomes[k - 1])) / apart
            # fault: iterates that turn round taken for what drives itself on -> found.append(math.copysign(ratio,
            #   -float(step @ (trail.outcomes[k] - trail.outcomes[k - 1])))) | coupler/test_auto
            found.append(math.copysign(ratio, float(step @ (trail.outcomes[k] - trail.outcomes[k - 1]))))
    return tuple(found)


def _stepped(trail: Trail, factor: float) -> Array:
    if factor == 1.0:
        return trail.outcomes[-1]
    return trail.guesses[-1] + factor * trail.residual()


def _factor(how: Iteration, trail: Trail) -> float:
    if how.acceleration is Acceleration.NONE:
        return 1.0
    if how.acceleration is Acceleration.CONSTANT or len(trail.guesses) < 2:
        return how.relaxation
    r = trail.residual()
    change, step = r - trail.residual(-2), trail.guesses[-1] - trail.guesses[-2]
    # fault: equal residuals divided by -> if float(np.linalg.norm(change)) < 0.0: | coupler/test_acceleration
    if float(np.linalg.norm(change)) <= EQUAL * float(np.linalg.norm(r)):
        return trail.factors[-1]
    # The step that was made, not factor times residual: a guess held at a bound made another.
    factor = -float(step @ change) / float(change @ change)
    # fault: Aitken's factor without a bound -> return math.copysign(abs(factor), factor) | coupler/test_acceleration
    return math.copysign(min(max(abs(factor), LEAST_FACTOR), LARGEST_FACTOR), factor)
