"""Sees after a step whether a node went beyond what pulls it, as a method does that leaves some of the stiff part.

At the end of a step of backward Euler the heat that flows into a node has the sign of the heat the node took up: it
is between what it was and what its neighbours, the other side of a contact and the surroundings now pull it to.  That
is its maximum principle.  Where the signs differ, the node passed the point of balance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.cells import capacities
from thermal_fmu.methods import Stage
from thermal_fmu.newton import SolvedStage
from thermal_fmu.scene import SubstepData, ThermalScene

Floats = NDArray[np.float64]

# Of the range of temperatures.  A node that follows slow surroundings turns a little late, at every reversal of them.
MOST = 5e-3
# Of it, where a node leaves all temperatures there were: the span of the data, to what is seen of them.
MOST_OUTSIDE = 1e-7


def overshoots(scene: ThermalScene, substep: SubstepData, stage: Stage, s_n: Floats, last: SolvedStage,
               dt: float) -> bool:
    """Return whether a node overshot in a step of dt [s] from s_n : (n,) [K] with the last stage `last`.

    The flow at the end follows from that of the stage by its matrix M + theta a dt K: dt f(s) = dt f(stage) -
    (1 - theta) dt K (s - s_n).  By how far a node passed its balance is that flow over the diagonal of dt K, at most
    its own change.  Only nodes that forget a jump within half a step can: K dt (1 - theta) > M.
    """
    J, free, ds = last.linear.jacobian, ~scene.fixed, last.s - s_n
    M, diagonal = capacities(scene.volume, substep.masses, scene.model.bodies, last.linear.s), J.diagonal()
    own = M * ds
    conducted = J @ np.where(free, ds, 0.0) - own
    if last.linear.pull is not None:
        conducted += last.linear.pull
    weight = stage.a * dt
    into = weight * last.balance.flow - (1.0 - stage.theta) / stage.theta * conducted
    stiff = free & (diagonal > M * (1.0 + stage.theta / max(1.0 - stage.theta, 0.5)))
    past = stiff & (into * ds < 0.0)
    if not past.any():
        return False
    by = np.where(past, np.minimum(np.abs(ds), stage.theta * np.abs(into) / diagonal), 0.0)
    low, high = float(s_n.min()), float(s_n.max())
    span = max(high, float(last.s.max())) - min(low, float(last.s.min()))
    outside = past & ((last.s > high + MOST_OUTSIDE * span) | (last.s < low - MOST_OUTSIDE * span))
    return bool((by > MOST * span).any() or (by[outside] > MOST_OUTSIDE * span).any())
