"""Whether bodies would stay in the steady state that was found (coupler.control.own_growth)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from coupler.trust.checks import Check, measured
from coupler.trust.in_time.errors import Looked

NAME = "steady state is stable"
# Of a disturbance that comes out as large as it was nobody knows what becomes; what is measured is good to some 1 %.
NOTE_AT, LIMIT = 0.98, 1.0


@dataclass(frozen=True)
class SteadyLog:
    """growth : what becomes of a disturbance of the state at t [s]; nan: not measured."""

    growth: float = math.nan
    t: float = 0.0


def watched(log: SteadyLog, seen: Looked, t: float) -> SteadyLog:
    """Return the log after a window to t [s]."""
    return log if math.isnan(seen.growth) else SteadyLog(seen.growth, t)


def checks(log: SteadyLog) -> tuple[Check, ...]:
    """Return the row at the end, where temperatures are those of a steady state."""
    if math.isnan(log.growth):
        return ()
    return (measured(NAME, log.growth, (NOTE_AT, LIMIT), t=log.t,
                     what=f"a small disturbance of the temperatures comes out {log.growth:.3g} times as large by the "
                          "gaps and pressures that it makes: bodies would leave this steady state by themselves for "
                          "another one, or for none",
                     remedy="Compute the way there in time (thermal.method: midpoint, with the start that the bodies "
                            "have), which ends in a state that lasts"),)
