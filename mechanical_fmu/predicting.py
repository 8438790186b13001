"""Where Newton's method begins a step: where driven bodies are taken, and what deforms goes on to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import ContactRefusedError
from mechanical_fmu.carrying import carried
from mechanical_fmu.newton import SolverSettings
from mechanical_fmu.system import ForceBalance, ForceFloor, Loading, System
from mechanical_fmu.tangent import LooseBodyError, refuse_loose
from mechanical_fmu.volume import CellError

Floats = NDArray[np.float64]

# Prescribed components this close to their target (share of the largest body) are set, not solved for: round-off.
TARGET_ROUND_OFF = 1e-12
# Nodes go on as before where that leaves less than this share of what is out of balance otherwise.
BETTER = 0.5


def predicted(system: System, u: Floats, loading: Loading, tangent: bool) -> ForceBalance:
    """Compute the balance where driven bodies have moved by their mean prescribed increment, with tangent if asked for.

    u : (n_nodes, 2) [m] before they move.  Bodies that only contact holds go along with what they lie on.
    """
    moved = carried(system, u, system.constraints.moved(u, loading.target, system.interface.nodes), loading)
    fixed = system.constraints.fixed
    off = np.abs(moved.ravel()[fixed] - loading.target)
    if off.size and off.max() <= TARGET_ROUND_OFF * float(system.size.max()):
        moved.ravel()[fixed] = loading.target
    return system.balance(moved, loading, tangent)


def going_on(system: System, u: Floats, way: Floats, loading: Loading, first: ForceBalance, settings: SolverSettings
             ) -> ForceBalance:
    """Return the balance where nodes at u : (n, 2) [m] go on by way : (n, 2) [m]; `first` where forces do better there.

    Bodies that yield do so in the cells that yielded before.
    """
    floor, fixed = settings.floor(system, loading), system.constraints.fixed
    # Where nodes are prescribed to go on, where they were tells nothing of what is out of balance then.
    reached = first.u.copy()
    # fault: what is prescribed to go on is taken for at rest -> pass | mechanical_fmu/test_trend
    reached.ravel()[fixed] = loading.target
    on = u + way
    on.ravel()[fixed] = loading.target
    try:
        # fault: a body that nothing holds goes on by itself -> pass | mechanical_fmu/test_trend
        refuse_loose(system, first, loading.sticking)
        error = _error(system, first if np.array_equal(reached, first.u) else _at(system, reached, loading), floor)
        if error <= settings.tolerance:
            return first
        ahead = _at(system, on, loading, True)
    except (LooseBodyError, CellError, ContactRefusedError):
        return first  # nothing pushes a body on that contact does not hold; no cell can be there
    return ahead if _error(system, ahead, floor) < BETTER * error else first


def _error(system: System, balance: ForceBalance, floor: ForceFloor) -> float:
    return float(system.error(balance, floor).max())


def _at(system: System, u: Floats, loading: Loading, tangent: bool = False) -> ForceBalance:
    return system.balance(u if system.rigid is None else system.rigid.placed(u), loading, tangent)
