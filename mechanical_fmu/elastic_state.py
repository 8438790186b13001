"""The state of the elastic half, all that evolves, and the conditions it has released."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import History
from contact.half.functions import SNAP
from mechanical_fmu.advance import StepDrive
from mechanical_fmu.dynamics import Rubbing
from mechanical_fmu.system import ForceBalance, System

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ElasticState:
    """u : (n, 2) [m] at time t [s], n nodes and the reference rows of rigid bodies.  contact : its history.

    anchor_u, anchor_T : where the stiffness was last taken, (n, 2) [m] and (n_nodes,) [K].
    anchored : whether its factor is in use.
    drive : what u is in equilibrium with.  solved : the time of that [s]; later steps were skipped.
    history : (n_history,) of points and cells (System.start_history).
    v, a : (n, 2) [m/s], [m/s2], and f : (n, 2) [N] internal less external force; (0, 2) without inertia.
    push : (n, 2) [N] the contact forces of f, stored : [J] in contact's springs, owed : [J] by it, rubbing : friction
    (dynamics.BodyMotion).
    skipped : steps left out in a row, all_skipped : since the start.
    damped : [J] of what damped bodies that contact did not hold yet, since the start.
    released : numbers of the displacements that prescribe nothing any more.  handed : (n, 2) [N] what held those that
    were released last, (0, 2) where none were.
    slid : (n_q,) [m] that slave nodes have slipped since the start, (0,) where nothing can.
    made : [J] that steps made from nothing since the start, with inertia (energy.py).
    trend : (n, 2) [m/s] at which nodes went in the last step, (0, 2) of none, with inertia, or where anchors serve.
    """

    t: float
    u: Floats
    contact: History
    anchor_u: Floats
    anchor_T: Floats
    anchored: bool
    drive: StepDrive
    solved: float
    history: Floats
    v: Floats
    a: Floats
    f: Floats
    push: Floats = field(default_factory=lambda: np.empty((0, 2)))
    stored: float = 0.0
    rubbing: Rubbing = field(default_factory=Rubbing)
    skipped: int = 0
    all_skipped: int = 0
    damped: float = 0.0
    released: tuple[int, ...] = ()
    handed: Floats = field(default_factory=lambda: np.empty((0, 2)))
    slid: Floats = field(default_factory=lambda: np.empty(0))
    made: float = 0.0
    owed: float = 0.0
    trend: Floats = field(default_factory=lambda: np.empty((0, 2)))


def after_release(system: System, state: ElasticState, found: ForceBalance) -> ElasticState:
    """Return the state with what is released from here on: at a time that has come, or by a pair that has closed."""
    going = [i for i, d in enumerate(system.spec.displacements) if d.until is not None and i not in state.released
             and _has_come(system, d.until, state.t, found)]
    if not going:
        return state if not len(state.handed) else replace(state, handed=np.empty((0, 2)))
    released = tuple(sorted({*state.released, *going}))
    free = system.without(released).constraints.free - system.constraints.free
    return replace(state, released=released, handed=(found.r.ravel() * free).reshape(found.r.shape), anchored=False)


def _has_come(system: System, until: float | str, t: float, found: ForceBalance) -> bool:
    if isinstance(until, float):
        return t >= until * (1.0 - SNAP)
    if found.tractions is None:
        return False
    slaves = system.contact.on_slaves([until])
    return bool((found.tractions.t_N[slaves] < 0.0).any())
