"""A search that does not get on: the next guess is between iterates on either side of a solution, or by a slope there.

Where contact closes within a hair of the solution, H answers to one side of it weakly and to the other a hundred times
as strongly.  A line through two iterates then comes to lie on the weak side again and again, a tenth nearer each time
(the false position that keeps one of its ends), and so does a fit through all of them.  A line through two iterates of
the strong side leads to the solution, and halving the way to the nearest of them always gets on.  Where several modes
have such a kink no line passes through all of them: by turns the slopes on either side are asked, from the iterates
that lie nearest to the best one, and to the nearest of those that point against it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.half.quasi_newton import Trail, guess_by_nearest

Array = NDArray[np.float64]

# A search gets on where its smallest residual has halved within so many iterates.
HALVES_IN, HALVED = 2, 0.5
# A smooth problem of a few modes is solved in fewer iterates than these, among which residuals may grow.
MANY = 8
# Residuals point against each other, so that a solution lies between, where the cosine between them is below this: of
# one mode it is -1.  Of several modes, of which only some have passed their kink, it is less.
AGAINST, OPPOSITE = -0.9, -0.5
# Two guesses are the same that are so much nearer to each other than to the last one.
SAME = 1e-6


def stuck_guess(trail: Trail, fitted: Array | None) -> Array | None:
    """Return a guess (n,), scaled, for a search that does not get on; None where it does.

    fitted : the guess of a search left to itself.  One that was tried before does not get on either.
    """
    sizes = [float(np.linalg.norm(trail.residual(k))) for k in range(len(trail.guesses))]
    gets_on = len(sizes) < MANY or min(sizes[-HALVES_IN:]) <= HALVED * min(sizes[:-HALVES_IN])
    # fault: a search that stands still is left to itself -> if True: | coupler/test_bracket
    if gets_on and not (fitted is not None and _tried(trail, fitted)):
        return None
    best = sizes.index(min(sizes))
    ways = [_by_slope(trail, best), _by_slope(trail, *_against(trail, best, OPPOSITE)[:1]), between(trail)]
    # A line that keeps one of its ends hardly gets on, either: the middle first, every other time.
    by_turns, turn = divmod(len(sizes), len(ways))
    if by_turns % 2 and len(sizes) > 2 * MANY:
        ways[2] = ways[2][::-1]
    # fault: a search that stands still is only ever put between two iterates -> found = ways[-1] | coupler/test_bracket
    found = [new for way in (*ways[turn:], *ways[:turn]) for new in way]
    return next((new for new in found if not _tried(trail, new)), None)


def _by_slope(trail: Trail, *iterates: int) -> list[Array]:
    """Guesses by the slopes at these iterates."""
    return [new for k in iterates if (new := guess_by_nearest(trail, k)) is not None]


def between(trail: Trail) -> list[Array]:
    """Return guesses (n,), scaled, between two iterates on either side of a solution, the best first.

    Between the iterate of the smallest residual that has one across, and the nearest of those: where the line through
    that one and the next on its side comes to nothing, or in the middle; and the same of the last iterate.  None where
    no two residuals point against each other.
    """
    last = len(trail.guesses) - 1
    order = sorted(range(last + 1), key=lambda k: float(np.linalg.norm(trail.residual(k))))
    near = next((k for k in order if _against(trail, k, AGAINST)), None)
    return [] if near is None else _towards(trail, near) + _towards(trail, last)


def _tried(trail: Trail, new: Array) -> bool:
    """Whether a guess is one of those before, as far as can be told from the last one."""
    last = trail.guesses[-1]
    return any(float(np.linalg.norm(new - old)) <= SAME * float(np.linalg.norm(last - old)) for old in trail.guesses)


def _against(trail: Trail, k: int, cosine: float) -> list[int]:
    """Number the iterates whose residuals point against that of iterate k, the nearest to it first.

    cosine : between the two, at most.
    """
    r = trail.residual(k)
    size = float(np.linalg.norm(r))
    others = [trail.residual(i) for i in range(len(trail.guesses))]
    # fault: iterates on the same side taken for a bracket -> found = [i for i in range(len(others)) if i != k] |
    #   coupler/test_bracket
    found = [i for i, other in enumerate(others) if float(other @ r) < cosine * float(np.linalg.norm(other)) * size]
    return sorted(found, key=lambda i: float(np.linalg.norm(trail.guesses[i] - trail.guesses[k])))


def _towards(trail: Trail, near: int) -> list[Array]:
    """Guesses between iterate `near` and the nearest across, the best first; none where none is across."""
    across = _against(trail, near, AGAINST)
    if not across:
        return []
    far, *beyond = across
    r = trail.residual(far)
    way = trail.guesses[near] - trail.guesses[far]
    middle = trail.guesses[far] + 0.5 * way
    if not beyond or not (change := r - trail.residual(beyond[0])).any():
        return [middle]
    step = trail.guesses[far] - trail.guesses[beyond[0]]
    share = -float(r @ change) / float(change @ change) * float(step @ way) / float(way @ way)
    # fault: between two iterates on either side always the middle -> return [middle] | coupler/test_bracket
    return [trail.guesses[far] + share * way, middle] if 0.0 < share < 1.0 else [middle]
