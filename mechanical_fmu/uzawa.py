"""The augmented Lagrangian in rounds: equilibrium, and again with the pressures it found, until nothing penetrates.

Uzawa's iteration; semi_smooth.py goes to the same solution at once, where Newton's own method is used.  Each round
leaves 1/(1 + eps_N L/E) of the penetration of the round before, so with the default penalty E/h a body of twenty cells
is done in three or four.  It ends where the pressures have settled to the tolerance asked for, or where the forces do
not feel their change.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mechanical_fmu.contact_query import ContactQuery, unsettled
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, SolverSettings, solve
from mechanical_fmu.system import ForceBalance, Loading, System
from mechanical_fmu.tangent import StiffnessAnchor

# fault: one round of augmentation, whatever is left -> MAX_ROUNDS = 1 | mechanical_fmu/test_augment
MAX_ROUNDS = 40


def solve_in_rounds(system: System, loading: Loading, start: ForceBalance, anchor: StiffnessAnchor | None,
                    settings: SolverSettings) -> Equilibrium:
    """Find the equilibrium nearest to start whose multipliers have settled, in rounds around Newton's method.

    Raises NoEquilibriumError, SingularMatrixError, CellInversionError, ContactRefusedError.
    """
    query, augmented = loading.query, system.contact.on_slaves(system.spec.augmented)
    assert isinstance(query, ContactQuery)
    share = min(system.spec.augmented.values())
    found, changes = solve(system, loading, start, anchor, settings), np.zeros(augmented.size)
    for _ in range(MAX_ROUNDS):
        assert found.balance.tractions is not None
        pressed = np.where(augmented, found.balance.tractions.multipliers, 0.0)
        changes = pressed - query.history.multipliers
        # fault: pressures settle at once -> if np.abs(changes).max() <= 1e3 * float(np.abs(pressed).max()): |
        #   mechanical_fmu/test_augment
        if np.abs(changes).max() <= share * float(np.abs(pressed).max()):
            return found
        query = query.with_multipliers(pressed)
        again = replace(loading, query=query)
        more = solve(system, again, system.balance(found.balance.u, again), anchor, settings)
        found = replace(more, history=found.history + more.history[1:], fresh=found.fresh or more.fresh)
        # fault: settling asked of round-off -> if more.iterations < 0: | mechanical_fmu/test_augment
        if more.iterations == 0:
            # The forces do not feel the change: where bodies just touch, pressures are round-off and never settle.
            return found
    how_much, where = unsettled(system, changes, float(np.abs(pressed).max()))
    raise NoEquilibriumError(f"the contact pressures do not settle: after {MAX_ROUNDS} rounds they {how_much}; a "
                             f"larger penalty settles sooner, or method: semi_smooth (most on {where})")
