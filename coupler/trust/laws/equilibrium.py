"""Whether the equilibria of a run are stable: a column under more than Euler's load stays straight only on paper.

The mechanical half counts the directions in which its bodies would leave an equilibrium by themselves.  That costs a
factorisation, so it is asked for at the start, a dozen times on the way, and at the end.

Cells that bend too stiffly hide that.  So the half tells too, of the motion against which its bodies are softest, which
share of the stiffness that loads leave there is made by the mesh (mechanical_fmu/softest.py).  Deflections along it are
off by about as much; from a half on the bodies might well leave their equilibrium on a finer mesh.  Cells that are too
soft, below 0, hide nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from coupler.trust.checks import Check, TrustVerdict, measured

NAME = "equilibrium is stable"
OUTPUT = "unstable_directions"  # of the mechanical half; below 0: not known
SOFT = "mesh.stiffness_off"  # of the mechanical half; where it is not known unstable_directions may not be either
FINE = "cells fine enough for stability"
LIMITS = (0.1, 0.5)  # of the stiffness that loads leave: noted, broken
EVERY = 1.0 / 12.0  # of the time of a run, from one look to the next


@dataclass(frozen=True)
class EquilibriumLog:
    """What was told so far.

    looks : so many, of which `known` told; the last at `last` [s].  most : the most directions, of `unstable` looks,
    the first of them at t [s].
    soft : what was told of SOFT, the largest in size, at soft_t [s]; of `looks_soft` looks.  untold : looks at which
    it was not known.
    """

    looks: int = 0
    known: int = 0
    last: float = -math.inf
    most: float = 0.0
    unstable: int = 0
    t: float = 0.0
    soft: float = 0.0
    soft_t: float = 0.0
    looks_soft: int = 0
    untold: int = 0


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


def softened(log: EquilibriumLog, share: float, t: float) -> EquilibriumLog:
    """Return the log after the half told at t [s] of its softest motion.  share [1]: SOFT; -1: not known."""
    if share <= -1.0:
        return replace(log, untold=log.untold + 1)
    # fault: what the mesh makes of the stiffness that is left is forgotten -> larger = True |
    #   coupler/test_trust_equilibrium
    larger = abs(share) >= abs(log.soft)
    return replace(log, soft=share if larger else log.soft, soft_t=t if larger else log.soft_t,
                   looks_soft=log.looks_soft + 1)


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
                            "held"), *_fine(log))


def _fine(log: EquilibriumLog) -> tuple[Check, ...]:
    # fault: what was not known at the load that counts holds -> hidden = False | coupler/test_trust_equilibrium
    hidden = log.untold > 0 and abs(log.soft) <= LIMITS[0]
    if hidden:
        looks = log.untold + log.looks_soft
        return (Check(FINE, TrustVerdict.UNCHECKED,
                      what=f"at {log.untold} of {looks} looks loads soften a single row of quads, of which nothing "
                           "tells how stiff it is: use two rows or more, or mechanical.elastic.element: enhanced"),)
    if not log.looks_soft:
        return ()
    # fault: cells that are too soft are taken to hide a body that buckles -> limits = LIMITS |
    #   coupler/test_trust_equilibrium
    limits = LIMITS if log.soft > 0.0 else (LIMITS[0], math.inf)
    how, so = (("stiff", "they bend more than told, and leave their equilibrium at lower loads") if log.soft > 0.0 else
               ("soft", "they bend less than told"))
    more = max(2, math.ceil(math.sqrt(abs(log.soft) / LIMITS[0])))
    return (measured(FINE, abs(log.soft), limits, t=log.soft_t,
                     what=f"loads take back much of what the bodies resist their softest motion with, and their mesh "
                          f"is too {how}: by {100.0 * abs(log.soft):.3g} % of what is left at t = {log.soft_t:.6g} "
                          f"s, so {so}",
                     remedy=f"Use {more} times as many cells along each edge of the body that bends, or "
                            "mechanical.elastic.element: enhanced"),)
