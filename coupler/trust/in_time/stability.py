"""Whether the exchange between the halves is stable, from what windows make of a disturbance (coupler.control.gain)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from coupler.trust.checks import Check, TrustVerdict, measured
from coupler.trust.in_time.errors import Looked

NAME = "exchange is stable"
# |m| of what turns round: it rings beyond the first, and grows beyond the second.
RINGS, GROWS = 0.5, 1.0
# So many windows that went wrong before it was seen that the exchange is unstable are no answer, whatever came later.
STAND = 2


@dataclass(frozen=True)
class Mended:
    """A window that was put back because the exchange rings in it.  what : was done.  m : of it.

    stand : windows before it that bent as much and stand.  solves : of either half that looking at it took.
    """

    what: str
    m: float
    stand: int
    solves: int = 0


@dataclass(frozen=True)
class StabilityLog:
    """worst, second : the largest two |m| of windows that turn a disturbance round; 0.0: there was none.

    t [s], H [s], limit [s] : end, size and longest stable size of the window of the second.  measured : windows.
    mended : windows that were put back for it, and what was done about the first of them.
    """

    worst: float = 0.0
    second: float = 0.0
    t: float = 0.0
    H: float = 0.0
    limit: float = math.inf
    measured: int = 0
    mended: int = 0
    first: str = ""


def watched(log: StabilityLog, seen: Looked, t: float, H: float) -> StabilityLog:
    """Return the log after a window of H to t [s]."""
    if math.isnan(seen.m):
        return log
    log = replace(log, measured=log.measured + 1)
    size = max(-seen.m, 0.0)
    if size <= log.second:
        return log
    # One window alone, in which something touches, is no verdict: the second largest is what is told.
    log = replace(log, worst=max(size, log.worst), second=min(size, log.worst))
    return replace(log, t=t, H=H, limit=min(seen.limit, log.limit))


def mended(log: StabilityLog, found: Mended, t: float, H: float) -> StabilityLog:
    """Return the log after a window of H to t [s] that was put back because it rings."""
    log = replace(log, mended=log.mended + 1, first=log.first or found.what)
    # fault: windows that rang before it was seen are forgiven -> if True: | coupler/test_instability
    if found.m > -GROWS or found.stand < STAND or -found.m <= log.second:
        return log
    return replace(log, second=-found.m, t=t, H=H)


def check(log: StabilityLog, looked: int, adaptive: bool = False) -> Check:
    """Return the check at the end.

    looked : windows that were, and would have been measured where they were rough.  adaptive : whether windows find
    their own size, and so what does not ring.
    """
    if adaptive:
        return Check(NAME, TrustVerdict.UNCHECKED,
                     what="windows are adaptive: what rings is an error that shortens them")
    if not looked:
        return Check(NAME, TrustVerdict.UNCHECKED, what="no window could be solved twice: a half cannot save its state")
    if not (log.measured or log.mended):
        return Check(NAME, TrustVerdict.UNCHECKED, what="no probe bent by much in two windows in a row, or "
                     "no such window could be measured")
    # fault: one window in which something touches condemns a run -> number = log.worst | coupler/test_gain
    number = log.second
    until = f": windows up to about {log.limit:.3g} s are stable" if math.isfinite(log.limit) else ""
    times = f"by {-number:.3g} from one window of {log.H:.3g} s to the next, at t = {log.t:.6g} s{until}"
    grows = number > GROWS
    if log.mended and number <= RINGS:
        more = f" (the first of {log.mended} times)" if log.mended > 1 else ""
        return Check(NAME, TrustVerdict.NOTED, number, GROWS, t=log.t, what=log.first + more,
                     remedy="After this the exchange is stable")
    return measured(
        NAME, number, (RINGS, GROWS), t=log.t,
        what=("unstable exchange: a disturbance alternates and grows, " if grows else
              "ringing: a disturbance alternates and decays slowly, ") + times,
        remedy="Use scheme: iterated or smaller windows")
