"""Whether the equilibria of a run are stable: a column under more than Euler's load stays straight only on paper.

The mechanical half counts the directions in which its bodies would leave an equilibrium by themselves.  That costs a
factorisation, so it is asked for at the start, a dozen times on the way, and at the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from coupler.trust.checks import Check, TrustVerdict, measured

NAME = "equilibrium is stable"
OUTPUT = "unstable_directions"  # of the mechanical half; below 0: not known
EVERY = 1.0 / 12.0  # of the time of a run, from one look to the next


@dataclass(frozen=True)
class EquilibriumLog:
    """What was told so far.

    looks : so many, of which `known` told; the last at `last` [s].  most : the most directions, of `unstable` looks,
    the first of them at t [s].
    """

    looks: int = 0
    known: int = 0
    last: float = -math.inf
    most: float = 0.0
    unstable: int = 0
    t: float = 0.0


def due(log: EquilibriumLog, t: float, end: float, at_end: bool) -> bool:
    """Whether to look at time t [s] of a run to `end` [s].  at_end : it is over."""
    return at_end or t - log.last >= EVERY * end


def watched(log: EquilibriumLog, directions: float, t: float) -> EquilibriumLog:
    """Return the log after a look at time t [s].  directions [1]: as told."""
    log = replace(log, looks=log.looks + 1, last=t)
    if directions < 0.0:
        return log
    log = replace(log, known=log.known + 1)
    # fault: an equilibrium that bodies would leave is trusted -> if directions >= 0.0: |
    #   coupler/test_trust_equilibrium
    if directions == 0.0:
        return log
    return replace(log, most=max(log.most, directions), unstable=log.unstable + 1, t=log.t if log.unstable else t)


def checks(log: EquilibriumLog) -> tuple[Check, ...]:
    """Return the check at the end, none where no half was asked."""
    if not log.looks:
        return ()
    if not log.known:
        return (Check(NAME, TrustVerdict.UNCHECKED, what="at each look surfaces slipped with friction, or the "
                                                         "stiffness was not to be had"),)
    many = "direction" if log.most == 1.0 else "directions"
    what = (f"at t = {log.t:.6g} s, and at {log.unstable} of {log.known} looks, the bodies would leave their "
            f"equilibrium by themselves, in up to {log.most:.0f} {many}: they buckle, snap or yield without end, and "
            "what was computed is an equilibrium that cannot last")
    return (measured(NAME, log.most, (0, 0), unit="directions", t=log.t, what=what,
                     remedy="Follow the motion with inertia (mechanical.elastic.dynamics), or draw the imperfection "
                            "that decides which way the bodies go; lower loads, or prescribed displacements, may be "
                            "held"),)
