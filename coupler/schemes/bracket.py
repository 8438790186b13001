"""A search that does not get on between two iterates on either side of its solution: the next guess is between them.

Where contact closes within a hair of the solution, H answers to one side of it weakly and to the other a hundred times
as strongly.  A line through two iterates then comes to lie on the weak side again and again, a tenth nearer each time
(the false position that keeps one of its ends), and so does a fit through all of them.  A line through two iterates of
the strong side leads to the solution, and halving the way to the nearest of them always gets on.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from contact.half.quasi_newton import Trail

Array = NDArray[np.float64]

# A search gets on where its smallest residual has halved within so many iterates.
HALVES_IN, HALVED = 2, 0.5
# A smooth problem of a few modes is solved in fewer iterates than these, among which residuals may grow.  One of more
# modes is solved by the fit alone: every other guess is left to it.
MANY = 8
# Residuals point against each other where the cosine between them is below this: of one mode it is -1.
AGAINST = -0.98
ROUND_OFF = 1e-12


def between(trail: Trail) -> Array | None:
    """Return a guess (n,), scaled, between two iterates on either side of a solution.

    Between the iterate of the smallest residual that has one across, and the nearest of those: where the line through
    that one and the next on its side comes to nothing, or in the middle; or the same of the last iterate.  None where
    the search gets on, where no two residuals point against each other, or where all of that was tried.
    """
    r = [outcome - guess for guess, outcome in zip(trail.guesses, trail.outcomes, strict=True)]
    sizes = [float(np.linalg.norm(v)) for v in r]
    # fault: a search that stands still is left to itself -> if True: | coupler/test_bracket
    if len(r) < MANY or len(r) % 2 or min(sizes[-HALVES_IN:]) <= HALVED * min(sizes[:-HALVES_IN]):
        return None
    near = next((k for k in sorted(range(len(r)), key=lambda k: sizes[k]) if _across(trail, r, k)), None)
    if near is None:
        return None
    found, last = _towards(trail, r, near), len(r) - 1
    if _across(trail, r, last):
        found += _towards(trail, r, last)
    return next((new for new in found if not any(_same(new, guess) for guess in trail.guesses)), None)


def _same(a: Array, b: Array) -> bool:
    """Whether two guesses are equal but for the round-off of their scale."""
    return float(np.linalg.norm(a - b)) <= ROUND_OFF * float(np.linalg.norm(a))


def _across(trail: Trail, r: Sequence[Array], k: int) -> list[int]:
    """Number the iterates whose residuals point against that of iterate k, the nearest to it first."""
    size = float(np.linalg.norm(r[k]))
    # fault: iterates on the same side taken for a bracket -> found = [i for i in range(len(r)) if i != k] |
    #   coupler/test_bracket
    found = [i for i in range(len(r)) if float(r[i] @ r[k]) < AGAINST * float(np.linalg.norm(r[i])) * size]
    return sorted(found, key=lambda i: float(np.linalg.norm(trail.guesses[i] - trail.guesses[k])))


def _towards(trail: Trail, r: Sequence[Array], near: int) -> list[Array]:
    """Guesses between iterate `near` and the nearest across, the best first."""
    far, *beyond = _across(trail, r, near)
    way = trail.guesses[near] - trail.guesses[far]
    middle = trail.guesses[far] + 0.5 * way
    if not beyond or not (change := r[far] - r[beyond[0]]).any():
        return [middle]
    step = trail.guesses[far] - trail.guesses[beyond[0]]
    share = -float(r[far] @ change) / float(change @ change) * float(step @ way) / float(way @ way)
    # fault: between two iterates on either side always the middle -> return [middle] | coupler/test_bracket
    return [trail.guesses[far] + share * way, middle] if 0.0 < share < 1.0 else [middle]
