"""Acceleration: from the guesses and outcomes so far to the next guess.  Pure functions on vectors.

With guess g, outcome H(g) and residual r = H(g) - g a window is solved where r = 0.  Plain iteration, g' = H(g),
converges only where H contracts; the others use what the residuals tell about the slope of H.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupler.scenario.options import Acceleration, Iteration

Array = NDArray[np.float64]
Column = tuple[Array, Array]  # differences of two residuals and of the two outcomes

# Bounds of Aitken's factor.  A pressure law makes H step over the solution by up to a thousand times (1e-4 is below
# 1/(1 + 1000)); ten plain steps at once is as far as one measured slope is worth.
LEAST_FACTOR, LARGEST_FACTOR = 1e-4, 10.0
# Residuals that differ by less than this share of themselves are equal but for round-off: no slope in them.
EQUAL = 1e-12
# A column is left out if those newer already span it but for this share (QR2 filter): where melting fronts move, the
# rest is the curvature of H, not a direction. On linear problems it costs an iterate or two.
FILTER = 0.1


@dataclass(frozen=True)
class Trail:
    """The iterates of a window.  guesses, outcomes : scaled vectors.  factors : of the steps between them."""

    guesses: tuple[Array, ...] = ()
    outcomes: tuple[Array, ...] = ()
    factors: tuple[float, ...] = ()

    def plus(self, guess: Array, outcome: Array) -> Trail:
        """Return the trail with one more iterate.

        guess : (n,) scaled by the floors of its fields [1].  outcome : (n,) scaled the same [1].
        """
        return Trail((*self.guesses, guess), (*self.outcomes, outcome), self.factors)

    def residual(self, k: int = -1) -> Array:
        """Return the residual r = H(g) - g of an iterate, (n,) scaled [1], of the last by default."""
        return self.outcomes[k] - self.guesses[k]

    @property
    def columns(self) -> tuple[Column, ...]:
        """Differences of successive iterates, the newest first."""
        r = [h - g for g, h in zip(self.guesses, self.outcomes, strict=True)]
        return tuple((r[k] - r[k - 1], self.outcomes[k] - self.outcomes[k - 1]) for k in range(len(r) - 1, 0, -1))


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
        return _iqn_ils(how, trail, memory)
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


def _iqn_ils(how: Iteration, trail: Trail, memory: Memory) -> tuple[Array, float]:
    """g' = H + W a, where a makes |r + V a| least; V, W : columns of residual and outcome differences."""
    r = trail.residual()
    columns = [*trail.columns, *(c for window in memory for c in window)]
    basis, triangle, kept = _filtered([v for v, _ in columns])
    if not kept:
        return relaxed(how, trail)
    # fault: quasi-Newton step of the wrong sign -> a = np.linalg.solve(triangle, basis.T @ r) |
    #   coupler/test_acceleration
    a = np.linalg.solve(triangle, -(basis.T @ r))
    guess = trail.outcomes[-1] + np.column_stack([columns[i][1] for i in kept]) @ a
    length = float(np.linalg.norm(r))
    return guess, float(np.linalg.norm(guess - trail.guesses[-1])) / length if length > 0.0 else 0.0


def _filtered(columns: Sequence[Array]) -> tuple[Array, Array, list[int]]:
    """Q (n, m), R (m, m) and numbers of the columns kept: the newest, and of each older one that adds a direction."""
    basis: list[Array] = []
    rows: list[Array] = []
    kept: list[int] = []
    for i, column in enumerate(columns):
        rest, size = column, float(np.linalg.norm(column))
        parts = np.zeros(len(columns))
        for j, q in enumerate(basis):
            parts[j] = float(q @ rest)
            rest = rest - parts[j] * q
        length = float(np.linalg.norm(rest))
        # fault: columns not filtered -> if length > 0.0 and len(basis) < len(column): | coupler/test_acceleration
        if length > FILTER * size and len(basis) < len(column):
            parts[len(basis)] = length
            basis.append(rest / length)
            rows.append(parts)
            kept.append(i)
    m = len(kept)
    if not m:
        return np.zeros((0, 0)), np.zeros((0, 0)), []
    return np.column_stack(basis), np.array(rows)[:, :m].T, kept
