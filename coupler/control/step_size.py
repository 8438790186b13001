"""The size of the next window from the errors of the last two: a PI controller with limits.

    H_next = H * (error/AIM)^(-0.8/k) * (error_before/AIM)^(0.3/k),   k = order + 1

The integral part alone would answer each wiggle of the estimate in full; with the proportional one the size follows the
trend (powers near Gustafsson's, with which it is well damped).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

# The error a window is meant to have, in tolerances: its problem is not quite that of the last, and a window rejected
# costs as much as one taken.
AIM = 0.5
I_POWER, P_POWER = 0.8, 0.3
# A window is at most so many times the last: what is known of the error is known of windows like the last.  Where the
# error itself would change it by no more than `STAY`, it stays: that gains less than the unrest costs.
GROW, SHRINK = 2.0, 0.2
# fault: no deadband: the size follows every wiggle of the estimate -> STAY = (1.0, 1.0) | coupler/test_stepsize
STAY = (0.9, 1.25)
# A rejected window is tried again at this share at most; what was rejected by a hair must not be rejected twice.
AGAIN = 0.7
LEAST_ERROR = 1e-4  # an error of nothing at all is no reason for more than the largest growth


@dataclass(frozen=True)
class Memory:
    """error : of the last window, in tolerances; nan where it is not known.  failed : a window was just rejected."""

    error: float = math.nan
    failed: bool = False


@dataclass(frozen=True)
class StepLimits:
    """No window is planned shorter than least or longer than most [s]."""

    least: float
    most: float


def proposed(memory: Memory, H: float, error: float | None, order: int, limits: StepLimits) -> tuple[float, Memory]:
    """The next size [s] after a window of H was taken.  error : in tolerances, None where it is not known.

    order : the local error goes with H^(order + 1).  Right after a rejection no window grows.
    """
    if error is None:
        return _within(H, limits), replace(memory, failed=False)
    now, k = max(error, LEAST_ERROR), order + 1
    before = memory.error if math.isfinite(memory.error) else now
    # fault: the proportional part of the controller with the wrong sign -> factor = (now / AIM) ** (-I_POWER / k) *
    #   (max(before, LEAST_ERROR) / AIM) ** (-P_POWER / k) | coupler/test_stepsize
    factor = (now / AIM) ** (-I_POWER / k) * (max(before, LEAST_ERROR) / AIM) ** (P_POWER / k)
    # fault: windows grow right after a rejection -> factor = min(max(factor, SHRINK), GROW) | coupler/test_stepsize
    factor = min(max(factor, SHRINK), 1.0 if memory.failed else GROW)
    if STAY[0] < (now / AIM) ** (-1.0 / k) < STAY[1]:
        factor = 1.0
    return _within(H * factor, limits), Memory(now)


def rejected(H: float, error: float, order: int) -> float:
    """The size [s] to try after one of H had too large an error, in tolerances: always smaller."""
    return H * min(AGAIN, max(SHRINK, (AIM / error) ** (1.0 / (order + 1))))


def failed(memory: Memory) -> Memory:
    """The memory after a window was rejected for its error."""
    return replace(memory, failed=True)


def forgotten(memory: Memory) -> Memory:
    """The memory past a kink or an event."""
    return Memory()


def _within(H: float, limits: StepLimits) -> float:
    return min(max(H, limits.least), limits.most)
