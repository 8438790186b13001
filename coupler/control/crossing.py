"""Where a quantity that falls towards zero will reach it, from a few of its values, and how sure that is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

# So many values are used: the fourth tells how far the curve through three is to be trusted, a fifth is history.
MOST = 4
# With two values nothing tells how the slope changes: so much of the way ahead is in doubt.
DOUBT = 0.1


@dataclass(frozen=True)
class Crossing:
    """t : where zero is reached.  doubt >= 0 : how far off that may be, in the same unit."""

    t: float
    doubt: float


def crossing(t: Sequence[float], left: Sequence[float]) -> Crossing | None:
    """Zero of a quantity by inverse interpolation (Neville's scheme for t as a function of what is left, at 0).

    t, left : times ascending and what was left then.  None where it is not falling or not above zero at the last one.
    Only the last values that fall throughout count.  Of the orders the one is taken that changed the answer least.
    """
    first = len(left) - 1
    # fault: extrapolated from values on both sides of a rise -> while first > 0 and len(left) - first < MOST: |
    #   coupler/test_events
    while first > 0 and len(left) - first < MOST and left[first - 1] > left[first]:
        first -= 1
    t, left = t[first:], left[first:]
    if len(t) < 2 or not left[-1] > 0.0 or not all(map(math.isfinite, left)):
        return None
    # The last value goes first, so that each order adds an older one.
    times, values = list(reversed(t)), list(reversed(left))
    column, answers = list(times), [times[0]]
    for order in range(1, len(times)):
        column = [(values[i + order] * column[i] - values[i] * column[i + 1]) / (values[i + order] - values[i])
                  for i in range(len(column) - 1)]
        answers.append(column[0])
    last = times[0]
    linear = answers[1]
    best = Crossing(linear, DOUBT * (linear - last))
    for older, newer in pairwise(answers[1:]):
        if abs(newer - older) < best.doubt and newer > last:
            best = Crossing(newer, abs(newer - older))
    return best
