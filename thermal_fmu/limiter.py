"""Sees after a step whether a node went beyond what pulls it, as a method does that leaves some of the stiff part.

At the end of a step of backward Euler the heat that flows into a node has the sign of the heat the node took up: it
is between what it was and what its neighbours, the other side of a contact and the surroundings now pull it to.  That
is its maximum principle.  Where the signs differ, the node passed the point of balance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.methods import Stage
from thermal_fmu.newton import SolvedStage
from thermal_fmu.scene import SubstepData, ThermalScene

Floats = NDArray[np.float64]

# Of the range of temperatures.  A node that follows slow surroundings turns a little late, at every reversal of them.
MOST = 5e-3
# Of it, where a node leaves all temperatures there were: the span of the data, to what is seen of them.
MOST_OUTSIDE = 1e-7


@dataclass(frozen=True)
class NodesAtEnd:
    """A step at its end, a row each node.

    s_n, s : (n,) [K] at its start and end.  free : (n,).  into : (n,) dt times the heat that flows into the node at the
    end [J].  M : (n,) heat capacity [J/K].  diagonal : (n,) of M + theta a dt K [J/K].
    """

    s_n: Floats
    s: Floats
    free: NDArray[np.bool_]
    into: Floats
    M: Floats
    diagonal: Floats


def went_beyond(end: NodesAtEnd, theta: float) -> bool:
    """Return whether a node passed the point of balance with what pulls it.

    By how far is its flow over the diagonal of dt K, at most its own change.  Only nodes that forget a jump within half
    a step can: (1 - theta) dt K > M.
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
    # fault: steps that overshoot pass -> return False | thermal_fmu/test_thermal_limits
    return bool((by > np.where(outside, MOST_OUTSIDE, MOST) * span).any())


def end_of(scene: ThermalScene, substep: SubstepData, stage: Stage, s_n: Floats, last: SolvedStage,
           dt: float) -> NodesAtEnd:
    """Return a step of dt [s] from s_n : (n,) [K] at its end, `last` its last stage.

    The flow at the end follows from that of the stage by its matrix M + theta a dt K: dt f(s) = dt f(stage) -
    (1 - theta) dt K (s - s_n).
    """
    J, free = last.linear.jacobian, ~scene.fixed
    M = scene.bulk.capacities(substep, last.linear.s)
    into = stage.a * dt * last.balance.flow
    if stage.theta != 1.0:
        ds = last.s - s_n
        conducted = J @ np.where(free, ds, 0.0) - M * ds
        if last.linear.pull is not None:
            conducted += last.linear.pull
        into = into - (1.0 - stage.theta) / stage.theta * conducted
    return NodesAtEnd(s_n, last.s, free, into, M, J.diagonal())
