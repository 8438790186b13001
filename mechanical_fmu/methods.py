"""Where to search next: full and modified Newton, and BFGS, on one tangent or many.

All give a direction d with d = gap on prescribed components and, on the others, d = -H r with
    newton           H = K(u)^-1 at every iterate;
    modified_newton  H = K^-1 of the iterate at which the last tangent was taken;
    bfgs             that, corrected by pairs s = change of u, y = change of r (two-loop recursion, Nocedal 1980).
A tangent is taken afresh where the old one no longer serves.  What a search remembers ends with the step.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.sparse import Solve, factorise
from mechanical_fmu.system import Balance, Loading, System
from mechanical_fmu.tangent import Anchor, finish, fresh_direction, held, refuse_loose, right_side, stiffness, symmetric

Floats = NDArray[np.float64]

# An iteration with an old factor that leaves more than this share of the residual is a poor one; after so many
# poor ones the tangent is taken fresh.  Contact that changes may cause one or two whatever the tangent.
POOR, MOST_POOR = 0.3, 3
# The same for modified Newton and BFGS, which live on old tangents and converge slowly by nature.
SLOW, MOST_SLOW = 0.7, 2
MOST_PAIRS = 15
# A pair whose curvature is less than this share of |s||y| says nothing.
FLAT = 1e-8


class Directions(Protocol):
    """A way to search within one step.  fresh : whether a tangent was taken in this step."""

    fresh: bool

    def direction(self, balance: Balance, gap: Floats) -> Floats:
        """d : (2 n,) [m] at a balance."""
        ...

    def learn(self, before: Balance, after: Balance, errors: tuple[float, float]) -> None:
        """What the last direction led to.  errors : relative residual before and after it."""
        ...


class Newton:
    """A fresh tangent in every iteration, or an anchor's as long as it serves."""

    def __init__(self, system: System, loading: Loading, anchor: Anchor | None) -> None:
        self.system, self.loading, self.anchor, self.poor, self.fresh = system, loading, anchor, 0, False

    def direction(self, balance: Balance, gap: Floats) -> Floats:
        if self.anchor is not None and self.poor < MOST_POOR:
            return self.anchor.direction(balance, gap)
        self.fresh = True
        return fresh_direction(self.system, with_tangent(self.system, balance, self.loading), self.loading, gap)

    def learn(self, before: Balance, after: Balance, errors: tuple[float, float]) -> None:
        self.poor += errors[1] > POOR * errors[0]


class Modified:
    """One tangent until it no longer serves; with pairs > 0, corrected by what was learnt since."""

    def __init__(self, system: System, loading: Loading, pairs: int) -> None:
        self.system, self.loading, self.most, self.fresh = system, loading, pairs, True
        self.factor: tuple[Solve, Balance] | None = None
        self.pairs: list[tuple[Floats, Floats]] = []
        self.slow = 0

    def direction(self, balance: Balance, gap: Floats) -> Floats:
        if self.factor is None or self.slow >= MOST_SLOW:
            if self.loading.inertia is None:
                refuse_loose(self.system, balance)
            taken = with_tangent(self.system, balance, self.loading)
            K = stiffness(self.system, taken, self.loading)
            self.factor, self.pairs, self.slow = (self._factor(K, taken), taken), [], 0
            if gap.any():
                return finish(self.system, balance, self.factor[0](right_side(self.system, balance, K, gap)), gap)
        solve, taken = self.factor
        if gap.any():
            b = right_side(self.system, balance, stiffness(self.system, taken, self.loading), gap)
            return finish(self.system, balance, solve(b), gap)
        return finish(self.system, balance, self._corrected(solve, -balance.r.ravel()), gap)

    def learn(self, before: Balance, after: Balance, errors: tuple[float, float]) -> None:
        self.slow = self.slow + 1 if errors[1] > SLOW * errors[0] else 0
        free = self.system.constraints.free
        s = (after.u - before.u).ravel() * free
        y = (after.r - before.r).ravel() * free
        moved = (after.u - before.u).ravel()[self.system.constraints.fixed].any()
        if self.most and not moved and s @ y > FLAT * np.linalg.norm(s) * np.linalg.norm(y):
            # fault: BFGS that learns nothing -> self.pairs = [] | mechanical_fmu/test_solution_methods
            self.pairs = [*self.pairs, (s, y)][-self.most :]

    def _factor(self, K: csr_matrix, taken: Balance) -> Solve:
        return factorise(held(self.system, K), symmetric(self.system, taken, self.loading))

    def _corrected(self, solve: Solve, b: Floats) -> Floats:
        free = self.system.constraints.free
        q, shares = b * free, []
        for s, y in reversed(self.pairs):
            shares.append((s @ q) / (s @ y))
            q = q - shares[-1] * y
        d = solve(q) * free
        for (s, y), share in zip(self.pairs, reversed(shares), strict=True):
            d = d + s * (share - (y @ d) / (s @ y))
        return d


def directions(method: str, system: System, loading: Loading, anchor: Anchor | None) -> Directions:
    """The search of a step by a method of METHODS."""
    if method == "newton":
        return Newton(system, loading, anchor)
    return Modified(system, loading, MOST_PAIRS if method == "bfgs" else 0)


def with_tangent(system: System, balance: Balance, loading: Loading) -> Balance:
    """The balance with the entries of its tangent."""
    return balance if balance.entries is not None else system.balance(balance.u, loading, tangent=True)
