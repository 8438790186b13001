"""Sees after a step whether a node went beyond what pulls it, as a method does that leaves some of the stiff part.

At the end of a step of backward Euler the heat that flows into a node has the sign of the heat the node took up: it
is between what it was and what its neighbours, the other side of a contact and the surroundings now pull it to.  That
is its maximum principle.  Where the signs differ, the node passed the point of balance.

What pulls it is known in the middle of the step alone: coordinates are held.  A node that follows a contact which grows
or shrinks has passed the balance of the middle by half of what it moves, and rightly so; to hold it there makes it late
by half a step.  One that rings has not moved so before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.kernels import times
from thermal_fmu.methods import Stage
from thermal_fmu.newton import SolvedStage
from thermal_fmu.scene import SubstepData, ThermalScene

Floats = NDArray[np.float64]

# Of the range of temperatures.  A node that follows slow surroundings turns a little late, at every reversal of them.
MOST = 5e-3
# Of it, where a node leaves all temperatures there were: the span of the data, to what is seen of them.
MOST_OUTSIDE = 1e-7
# Of what a node would move at the rate of the step before.  A mode that goes beyond its balance (lambda dt > 2) moves
# less than 1/2 of it, whether quarter steps of backward Euler came before, 1/(1 + lambda dt/2), or its own method; one
# that rings by more than 1/6 of it moves less than 1/2 of it in the second step, (b - 2 J)/(b + 2 J).  Beside a contact
# that shrinks to nothing a node may move 4 times as much in the next step; a jump of 3/2 of b may hide in that, once.
LEAST_GOING_ON, MOST_GOING_ON = 0.5, 4.0


@dataclass(frozen=True)
class NodesAtEnd:
    """A step at its end, a row each node.

    s_n, s : (n,) [K] at its start and end.  free : (n,).  into : (n,) dt times the heat that flows into the node at the
    end [J].  M : (n,) heat capacity [J/K].  diagonal : (n,) of M + theta a dt K [J/K].
    before : (n,) what each would have moved at the rate of the step before [K]; None: nothing is known of it.
    """

    s_n: Floats
    s: Floats
    free: NDArray[np.bool_]
    into: Floats
    M: Floats
    diagonal: Floats
    before: Floats | None = None


def went_beyond(end: NodesAtEnd, theta: float) -> bool:
    """Return whether a node passed the point of balance with what pulls it.

    By how far is its flow over the diagonal of dt K, at most its own change.  Only nodes that forget a jump within half
    a step can: (1 - theta) dt K > M.  One that goes on as it did may, within all temperatures there were.
    """
    ds = end.s - end.s_n
    past = np.flatnonzero(end.free & (end.into * ds < 0.0))
    stiff = end.diagonal[past] > end.M[past] * (1.0 + theta / max(1.0 - theta, 0.5))
    past = past[stiff]
    if past.size == 0:
        return False
    s, by = end.s[past], np.minimum(np.abs(ds[past]), theta * np.abs(end.into[past]) / end.diagonal[past])
    low, high = float(end.s_n.min()), float(end.s_n.max())
    span = max(high, float(end.s.max())) - min(low, float(end.s.min()))
    outside = (s > high + MOST_OUTSIDE * span) | (s < low - MOST_OUTSIDE * span)
    if end.before is not None:
        by = np.where(~outside & _goes_on(ds[past], end.before[past]), 0.0, by)
    # fault: steps that overshoot pass -> return False | thermal_fmu/test_thermal_limits
    return bool((by > np.where(outside, MOST_OUTSIDE, MOST) * span).any())


def _goes_on(ds: Floats, before: Floats) -> NDArray[np.bool_]:
    """Return whether nodes that moved by ds : (n,) [K] go on as they did, which would be by before : (n,) [K]."""
    # fault: whatever moved on is taken for one that follows -> return np.asarray(ds * before > 0.0) |
    #   thermal_fmu/test_thermal_limits::test_a_node_that_rings_does_not_go_on
    return np.asarray((ds * before >= LEAST_GOING_ON * before**2) & (np.abs(ds) <= MOST_GOING_ON * np.abs(before)))


def end_of(scene: ThermalScene, substep: SubstepData, stage: Stage, s_n: Floats, last: SolvedStage,
           dt: float, rate: Floats | None = None) -> NodesAtEnd:
    """Return a step of dt [s] from s_n : (n,) [K] at its end, `last` its last stage.  rate : (n,) of the one before
    [K/s].

    The flow at the end follows from that of the stage by its matrix M + theta a dt K: dt f(s) = dt f(stage) -
    (1 - theta) dt K (s - s_n).
    """
    J, free = last.linear.jacobian, ~scene.fixed
    M = scene.bulk.capacities(substep, last.linear.s)
    into = stage.a * dt * last.balance.flow
    if stage.theta != 1.0:
        ds = last.s - s_n
        conducted = times(J.indptr, J.indices, J.data, np.where(free, ds, 0.0)) - M * ds
        if last.linear.pull is not None:
            conducted += last.linear.pull
        into = into - (1.0 - stage.theta) / stage.theta * conducted
    return NodesAtEnd(s_n, last.s, free, into, M, J.diagonal(), None if rate is None else dt * rate)
