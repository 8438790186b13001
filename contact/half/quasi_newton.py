"""Quasi-Newton iteration: from the guesses and outcomes of a fixed-point problem to the next guess (IQN-ILS).

With guess g, outcome H(g) and residual r = H(g) - g the problem is solved where r = 0.  The differences of successive
residuals tell about the slope of H (Degroote, Bathe, Vierendeels, Computers & Structures 87 (2009) 793).  Pure
functions on vectors: the coupler iterates windows by them, a half that is a program its surface.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Column = tuple[Array, Array]  # differences of two residuals and of the two outcomes

# A column is left out if those before it already span it but for this share (QR2 filter): where melting fronts move,
# the rest is the curvature of H, not a direction. On linear problems it costs an iterate or two.
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


def quasi_newton_guess(trail: Trail, older: Sequence[Column] = ()) -> Array | None:
    """Return g' = H + W a (n,), where a makes |r + V a| least; V, W : columns of residual and outcome differences.

    older : columns of problems solved before, the newest first.  None while there is no column.
    """
    return _from_iterate(trail, len(trail.guesses) - 1, [*trail.columns, *older])


def guess_by_nearest(trail: Trail, k: int) -> Array | None:
    """Return the same (n,) from iterate k, by its differences from all others, the nearest first.

    Successive iterates that lie far apart tell of the way between them, those about iterate k of the slope there.
    """
    others = [i for i in range(len(trail.guesses)) if i != k]
    # fault: the slope at an iterate by those farthest from it -> others = others[::-1] | coupler/test_bracket
    others.sort(key=lambda i: float(np.linalg.norm(trail.guesses[i] - trail.guesses[k])))
    return _from_iterate(trail, k, [(trail.residual(i) - trail.residual(k), trail.outcomes[i] - trail.outcomes[k])
                                    for i in others])


def _from_iterate(trail: Trail, k: int, columns: Sequence[Column]) -> Array | None:
    """The guess from iterate k by columns, the first of which count most; None while there is none."""
    basis, triangle, kept = _filtered([v for v, _ in columns])
    if not kept:
        return None
    # fault: quasi-Newton step of the wrong sign -> a = np.linalg.solve(triangle, basis.T @ trail.residual(k)) |
    #   coupler/test_acceleration
    a = np.linalg.solve(triangle, -(basis.T @ trail.residual(k)))
    return np.asarray(trail.outcomes[k] + np.column_stack([columns[i][1] for i in kept]) @ a)


def _filtered(columns: Sequence[Array]) -> tuple[Array, Array, list[int]]:
    """Q (n, m), R (m, m) and numbers of the columns kept: the first, and each later one that adds a direction."""
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
