"""Errors of bodies with inertia: they do not die out, and those of fast waves lose their phase.

Nothing takes energy from a vibration that a step resolves, so an error of place or speed swings on with the body for
ever.  That of a wave of frequency w goes along its velocity, a shift of its phase, in each window with the same sign:
so errors add up, window after window, until the wave is off by its whole swing.  A wave of amplitude A that a window
makes wrong by e is there after 2 A/e windows, N.  What is made wrong later has a phase that knows nothing of the one
before: then errors add up as a random walk's steps do, of N windows each, sqrt(n/N) N e after n of them.  (A triangular
wave, of amplitudes that fall as 1/k^2 with phase errors that grow as k^3, is off by a sum that grows as sqrt(n).)

e/A is told by what windows were found to err by, of what probes bend in them, e/b, and by b/A = (w H)^2, from the
ratio of third to second differences, w H.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# A wave that is off by twice its amplitude is off by its whole swing.
SWING = 2.0


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True)
class PhaseLog:
    """Of n probes, (n,) each in SI.

    lasts : whose errors do not die out; (0,): nobody's.  slope [1/s], curve [1/s2] : of the last window, with their
    signs; nan where no window before tells them.  seconds, thirds : sums of |H^2 v''| and |H^3 v'''| of windows
    that tell both.  bends, squares : sums of what windows bend by
    (coupler.trust.in_time.errors), and of its squares.
    """

    lasts: Mask = field(default_factory=lambda: np.empty(0, dtype=bool))
    slope: Array = field(default_factory=_none)
    curve: Array = field(default_factory=_none)
    seconds: Array = field(default_factory=_none)
    thirds: Array = field(default_factory=_none)
    bends: Array = field(default_factory=_none)
    squares: Array = field(default_factory=_none)


def begun(lasts: Mask) -> PhaseLog:
    """Return the log at the start.  lasts : (n,) whether the errors of a probe do not die out."""
    if not lasts.any():
        return PhaseLog()
    none, unknown = np.zeros(len(lasts)), np.full(len(lasts), np.nan)
    return PhaseLog(lasts, unknown, unknown, none, none, none, none)


def watched(log: PhaseLog, went: Array, H: float, bend: Array, fresh: bool) -> PhaseLog:
    """Return the log after a window of H [s].

    went : (n,) what probes changed by in it.  bend : (n,) what they bent by.  fresh : it begins at a kink of the data,
    and tells nothing of differences that reach back over it.
    """
    if not log.lasts.size:
        return log
    slope = went / H
    # fault: differences that reach over a kink count as those of a fast wave -> curve = (slope - log.slope) / H |
    #   coupler/test_trust_phases
    curve = (slope - (np.nan if fresh else log.slope)) / H
    third = np.abs(curve - log.curve) * H**2
    known = np.isfinite(third)
    third, second = np.where(known, third, 0.0), np.where(known, np.abs(curve) * H**2, 0.0)
    return replace(log, slope=slope, curve=curve, seconds=log.seconds + second, thirds=log.thirds + third,
                   bends=log.bends + bend, squares=log.squares + bend**2)


def in_step(log: PhaseLog, errors: Array, bends: Array) -> Array:
    """Return what is left of a sum of errors for phases that know nothing of each other, (n,), at most 1.

    errors, bends : (n,) sums over windows that were looked at.
    """
    if not log.lasts.size:
        return np.ones(len(errors))
    fast = np.divide(log.thirds, log.seconds, out=np.zeros_like(bends), where=log.seconds > 0.0)
    a_window = np.divide(errors, bends, out=np.zeros_like(bends), where=bends > 0.0) * fast**2
    # What windows that bend by less leave is of fewer windows than there were.
    many = np.divide(log.bends**2, log.squares, out=np.ones_like(bends), where=log.squares > 0.0)
    # fault: errors of fast waves add up for ever -> share = np.ones_like(many) | coupler/test_trust_phases
    share = np.divide(SWING, a_window * many, out=np.ones_like(many), where=a_window * many > SWING)
    return np.where(log.lasts, np.sqrt(share), 1.0)
