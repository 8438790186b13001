"""Halves with one temperature across a rod, or in a whole body: how far that is from those of its surfaces.

The half itself tells by how much, as the Biot number of what its surfaces exchange says.  A surface that is off by a
share of the span of temperatures exchanges heat that is wrong by about as much.
"""

from __future__ import annotations

from dataclasses import dataclass

from coupler.trust.checks import Check, amount, measured

LIMITS = (0.02, 0.2)  # of the span of temperatures: noted, broken
NAME = "one temperature across bodies"


@dataclass(frozen=True)
class AcrossLog:
    """off [K]: the most that a surface differed from what stands for it, in a window to t [s].  told : by the half."""

    off: float = 0.0
    t: float = 0.0
    told: bool = False


def watched(log: AcrossLog, off: float | None, t: float) -> AcrossLog:
    """Return the log after a window to t [s].  off [K]: None of a half with temperatures at every node."""
    if off is None:
        return log
    return AcrossLog(off, t, True) if off > log.off or not log.told else log


def checks(log: AcrossLog, span: float) -> tuple[Check, ...]:
    """Return the check at the end, none where no half told.  span [K]: of all temperatures, those of the data too."""
    if not log.told:
        return ()
    # fault: a body that is warm at one side and cold at the other is trusted -> share = 0.0 |
    #   coupler/test_trust_across
    share = log.off / max(span, log.off) if log.off > 0.0 else 0.0
    what = (f"surfaces differ by up to {amount(log.off, 'K')} from the one temperature that stands for what is behind "
            f"them, {100 * share:.3g} % of the span of temperatures, at t = {log.t:.6g} s: the Biot number is not "
            "small")
    return (measured(NAME, share, LIMITS, what=what, t=log.t,
                     remedy="Use thermal.half: thermal, which has a temperature at every node"),)
