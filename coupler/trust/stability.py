"""Whether the exchange between the halves is stable, from what windows make of a disturbance (coupler.control.gain)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from coupler.trust.checks import Check, TrustVerdict, measured
from coupler.trust.errors import Looked

NAME = "exchange is stable"
# |m| of what turns round: it rings beyond the first, and grows beyond the second.
RINGS, GROWS = 0.5, 1.0


@dataclass(frozen=True)
class StabilityLog:
    """worst, second : the largest two |m| of windows that turn a disturbance round; 0.0: there was none.

    t [s], H [s], limit [s] : end, size and longest stable size of the window of the second.  measured : windows.
    """

    worst: float = 0.0
    second: float = 0.0
    t: float = 0.0
    H: float = 0.0
    limit: float = math.inf
    measured: int = 0


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


def check(log: StabilityLog, looked: int) -> Check:
    """Return the check at the end.  looked : windows that were, and would have been measured where they were rough."""
    if not looked:
        return Check(NAME, TrustVerdict.UNCHECKED, what="windows find their own size, or none could be solved twice")
    # fault: one window in which something touches condemns a run -> number = log.worst | coupler/test_gain
    number = log.second
    until = f": windows up to about {log.limit:.3g} s are stable" if math.isfinite(log.limit) else ""
    times = f"by {-number:.3g} from one window to the next, of {log.H:.3g} s to t = {log.t:.6g} s{until}"
    grows = number > GROWS
    return measured(
        NAME, number, (RINGS, GROWS), t=log.t,
        what=("unstable exchange: a disturbance turns round and grows, " if grows else
              "ringing: a disturbance turns round and dies slowly, ") + times,
        remedy="scheme: iterated, or smaller windows, end it")
