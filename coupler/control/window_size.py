"""How long a window should be: from the errors of the last two, or from what a small disturbance does in short ones."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupler.control.solve_window import SavedStates
from coupler.scenario.options import Scheme
from coupler.schemes.levels import Level, exchanged, predicted
from coupler.schemes.schemes import scheme_of
from coupler.schemes.state import CoupledState, Halves, Span
from coupler.schemes.sweep import mechanical_first

Array = NDArray[np.float64]


# The size of the next window from the errors of the last two: a PI controller with limits.
#
#     H_next = H * (error/AIM)^(-0.8/k) * (error_before/AIM)^(0.3/k),   k = order + 1
#
# The integral part alone would answer each wiggle of the estimate in full; with the proportional one the size follows
# the trend (powers near Gustafsson's, with which it is well damped).  Where both errors are far below AIM wiggles do
# not matter: the proportional part, which takes a small error before for a reason to wait, is left out.

# The error a window is meant to have, in tolerances: its problem is not quite that of the last, a window rejected costs
# as much as one taken, and what is carried on from a measured one is known within a factor of 3.
AIM = 0.2
AIM_IN_HALVES = 0.5  # the same where it will be kept in halves
I_POWER, P_POWER = 0.8, 0.3
# Errors below this share of AIM are far below it.  All defaults with 8 times the tolerances: two rods 862 -> 534 calls
# (4.6 and 5.4 % off), casting_1d to 20 s with its own 386 -> 310 (0.055 and 0.048 %); others the same within 20 %.
FAR = 0.25
# A window is at most so many times the last: what is known of the error is known of windows like the last.  Where two
# errors on end are far below AIM, as in the first windows of a run, it may be longer than after one that may be an
# accident (seizing rod to 1 % 205 calls -> 186, casting_1d 160 -> 120; three times after any error: two windows for one
# where mechanics come late).  Where the error itself would change it by no more than `STAY`, it stays: that gains less
# than the unrest costs.
GROW, GROW_FAR, SHRINK = 2.0, 3.0, 0.2
# fault: no deadband: the size follows every wiggle of the estimate -> STAY = (1.0, 1.0) | coupler/test_stepsize
STAY = (0.9, 1.25)
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
    factor, most = (now / AIM) ** (-I_POWER / k) * (max(before, LEAST_ERROR) / AIM) ** (P_POWER / k), GROW
    if (largest := max(now, before)) < FAR * AIM:
        # fault: windows far below their tolerance grow as if they were near it -> pass | coupler/test_stepsize
        factor = (largest / AIM) ** (-I_POWER / k)
        # fault: one error far below its aim may be an accident -> most = GROW_FAR | coupler/test_stepsize
        most = GROW_FAR if math.isfinite(memory.error) else GROW
    # fault: windows grow right after a rejection -> factor = min(max(factor, SHRINK), most) | coupler/test_stepsize
    factor = min(max(factor, SHRINK), 1.0 if memory.failed else most)
    if STAY[0] < (now / AIM) ** (-1.0 / k) < STAY[1]:
        factor = 1.0
    return _within(H * factor, limits), Memory(now)


def rejected(H: float, error: float, order: int) -> float:
    """The size [s] to try after one of H had too large an error, in tolerances: always smaller."""
    return H * max(SHRINK, (AIM / error) ** (1.0 / (order + 1)))


def failed(memory: Memory) -> Memory:
    """The memory after a window was rejected for its error."""
    return replace(memory, failed=True)


def forgotten(memory: Memory) -> Memory:
    """The memory past a kink or an event."""
    return Memory()


def _within(H: float, limits: StepLimits) -> float:
    return min(max(H, limits.least), limits.most)


# How long a window may be: from what a small disturbance does in short windows, before a run or along a coarse one.
#
# A body that is warmer by dT loses a dT more heat by its own slope, and b dT more because its gap or pressure follows
# (both over its heat capacity, 1/s).  An iterated window of H seconds multiplies a difference of guesses by -rho, rho
# = (b H/2)/(1 + theta a H), theta = 1/2 for the midpoint rule and 1 for backward Euler: two sizes tell b and theta a.
# The limits are those of docs/theory.md.  For one mode they are exact.  For a rod those of the midpoint rule, 2/b and
# 1/b, are too (b is the sum over its modes); those of backward Euler come out a sixth too low.

# The disturbance [K]: far above what solvers leave over, far below what bends a gas law, and taken to both sides, so
# that its curvature does not count.
DISTURBANCE = 0.1
# Turns of the disturbance towards what it comes out as: what is left of other modes shrinks by their ratio each time.
TURNS = 3
# The short window is this part of the long one.
SHORT = 64


@dataclass(frozen=True)
class Feedback:
    """b [1/s] : > 0 turns against what changed, < 0 drives it on.  damping : theta a [1/s].  at t [s]."""

    t: float
    b: float
    damping: float


@dataclass(frozen=True)
class WindowLimits:
    """The longest stable windows [s]; inf: any.  plain : for which iteration without acceleration converges."""

    staggered: float
    extrapolated: float
    plain: float


def limits(feedback: Feedback, method: str) -> WindowLimits:
    """Returns the limits for a method of the thermal half."""
    staggered, extrapolated = (longest(feedback, method, _gain(n)) for n in (Scheme.STAGGERED, Scheme.EXTRAPOLATED))
    return WindowLimits(staggered, extrapolated, _least(1.0, abs(feedback.b) / 2.0 - max(feedback.damping, 0.0)))


def longest(feedback: Feedback, method: str, gain: float) -> float:
    """Returns the longest stable window [s] of a scheme that solves each half once; inf: any.

    gain : f, how often the thermal half sees what alternates (CouplingScheme.alternating_gain).
    2 rho f = 1 + R with R = (1 - a H/2)/(1 + a H/2) or, of backward Euler, 1/(1 + a H).  Of any other method that of
    the midpoint rule: those between the two, sdirk2 too, are stable for somewhat longer.
    """
    # fault: predicted damping lost -> damped = 0.0 | coupler/test_predict
    damped = max(feedback.damping, 0.0) if method == "backward_euler" else 0.0
    return _least(2.0, gain * feedback.b - damped)


def _gain(name: Scheme) -> float:
    gain = scheme_of(name).alternating_gain
    assert gain is not None, f"{name.value} has a limit in closed form"
    return gain


def _least(over: float, rate: float) -> float:
    return over / rate if rate > 0.0 else math.inf


def feedback(halves: Halves, state: CoupledState, span: Span) -> Feedback:
    """b and theta a at the start of a window, from it and from a short one; 4 TURNS solves of each half.

    Both halves are put back.  Raises DiscardError where one cannot do such a window, CouplingError where one keeps no
    states.
    """
    first = replace(span, k1=span.k0 + max((span.k1 - span.k0) // SHORT, 1))
    (H, long), (h, short) = ((s.end - state.now.t, _slope(halves, state, s)) for s in (span, first))
    # 1/rho = 2/(b H) + 2 theta a/b: a line over 1/H.
    if short == 0.0 or long == 0.0:
        return Feedback(state.now.t, -2.0 * short / h, 0.0)
    # fault: predicted feedback a quarter too small -> b = 1.5 * (1.0 / h - 1.0 / H) / (1.0 / long - 1.0 / short) |
    #   coupler/test_predict
    b = 2.0 * (1.0 / h - 1.0 / H) / (1.0 / long - 1.0 / short)
    return Feedback(state.now.t, b, b / 2.0 * (-1.0 / long) - 1.0 / H)


def _slope(halves: Halves, state: CoupledState, span: Span) -> float:
    """What a window makes of a disturbance of its guess, < 0 where it turns it round: -rho."""
    base = predicted(state.now, state.before, span.end)
    return answer(lambda T: _outcome(halves, state, span, replace(base, T=T)), base.T, DISTURBANCE, TURNS)


def answer(outcome: Callable[[Array], Array], T: Array, size: float, turns: int) -> float:
    """Return what comes out of a disturbance of temperatures T : (n,) [K], over it, along what it turns to.

    outcome : of temperatures.  size [K] : of the disturbance, to both sides.  turns : towards what it comes out as.
    """
    direction, found = np.ones_like(T), 0.0
    for _ in range(turns):
        out = (outcome(T + size * direction) - outcome(T - size * direction)) / (2.0 * size)
        # fault: what comes out turned round is taken for what goes on -> found = abs(float(direction @ out)) /
        #   float(direction @ direction) | coupler/test_own_growth
        found = float(direction @ out) / float(direction @ direction)
        largest = float(np.abs(out).max())
        if largest == 0.0:
            return 0.0
        direction = out / largest
    return found


def _outcome(halves: Halves, state: CoupledState, span: Span, guess: Level) -> Array:
    """T at the end of a window whose mechanics are given a guess of it."""
    with SavedStates(halves, state.now.t, 0) as saved:
        T = mechanical_first(halves, state, span, exchanged(guess)).level.T
        saved.roll_back("a window is only looked at")
    return T
