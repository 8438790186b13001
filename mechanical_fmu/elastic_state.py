"""The state of the elastic half: all that evolves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.surfaces import History
from mechanical_fmu.drive import Drive

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ElasticState:
    """u : (n, 2) [m] at time t [s], n nodes and the reference rows of rigid bodies.  contact : its history.

    anchor_u, anchor_T : where the stiffness was last taken, (n, 2) [m] and (n_nodes,) [K].
    anchored : whether its factor is in use.
    drive : what u is in equilibrium with.  solved : the time of that [s]; later steps were skipped.
    history : (n_history,) of points and cells (System.start_history).
    v, a : (n, 2) [m/s], [m/s2], and f : (n, 2) [N] internal less external force; (0, 2) without inertia.
    skipped : steps left out in a row, all_skipped : since the start.
    """

    t: float
    u: Floats
    contact: History
    anchor_u: Floats
    anchor_T: Floats
    anchored: bool
    drive: Drive
    solved: float
    history: Floats
    v: Floats
    a: Floats
    f: Floats
    skipped: int = 0
    all_skipped: int = 0
