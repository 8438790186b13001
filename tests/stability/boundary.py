"""Where a scheme stops being stable: growth of a small disturbance over windows, and bisection on the window."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from cases import Case
from numpy.typing import NDArray

from coupler.scenario.options import Acceleration, Iteration, OnMax, Scheme, Seen

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from coupled_run import couple

Array = NDArray[np.float64]
QUIET = 1e-4  # of the first increment: below it round-off may grow
DISTURBANCE = 1e-6  # share of the range: small enough that every law is its tangent


def path(case: Case, scheme: Scheme, size: float, n: int, d: float = DISTURBANCE) -> Array:
    """What is watched after each of n windows : (n + 1, m)."""
    halves, state = case.make(d)
    _, tried = couple(halves, state, (n * size, n), scheme, how=case.how)
    return np.array([case.watch(state.now), *(case.watch(w.solved.state.now) for w in tried if w.accepted)])


def growth(case: Case, scheme: Scheme, size: float, n: int = 160) -> float:
    """Increments of the last quarter of n windows over those of the quarter before; inf where they have left what is
    small, for there a cycle may have come to its full size."""
    steps = np.abs(np.diff(path(case, scheme, size, n), axis=0)).max(axis=1)
    q = len(steps) // 4
    if steps[-q:].max() < QUIET * steps[0]:
        return 0.0
    if steps[-q:].max() > 1e3 * steps[0]:
        return float("inf")
    return float(steps[-q:].max() / steps[-2 * q:-q].max())


def bisected(grows: Callable[[float], bool], low: float, high: float, share: float = 2e-3) -> float:
    """The window between low, where nothing grows, and high, where it does, to a share of itself.

    Raises AssertionError where the two do not enclose it.
    """
    assert not grows(low), f"grows at {low:g} already"
    assert grows(high), f"does not grow at {high:g} yet"
    while high / low > 1.0 + share:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if grows(middle) else (middle, high)
    return float(np.sqrt(low * high))


def limit(case: Case, scheme: Scheme, about: float) -> float:
    """The largest stable window of a scheme, looked for between a half and the double of `about` [s]."""
    return bisected(lambda size: growth(case, scheme, size) > 1.0, 0.5 * about, 2.0 * about)


def contraction(case: Case, size: float, level: Seen) -> float:
    """What plain iteration multiplies a difference by in the first window, as the coupler measures it."""
    how = Iteration(acceleration=Acceleration.NONE, max_iterations=4, on_max=OnMax.ACCEPT,
                    tolerance=case.how.tolerance, level=level)
    halves, state = case.make(1e-3)
    _, tried = couple(halves, state, (size, 1), Scheme.ITERATED, how=how)
    assert tried[0].solved.history is not None
    return tried[0].solved.history.contraction
