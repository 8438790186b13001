"""The augmented Lagrangian: equilibrium, and again with the pressures it found, until they are those of no penetration.

Uzawa's iteration; semi_smooth.py goes to the same solution at once, where Newton's own method is used.  Each round
leaves the share 1/(1 + eps_N L/E) of the penetration of the round before, so with the default penalty E/h a body of
twenty cells is done in three or four.  It ends where the pressures have settled to the share asked for, or where the
forces do not feel their change.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from contact.half.surfaces import History
from mechanical_fmu.asking import Asking, unsettled
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, Settings, solve
from mechanical_fmu.semi_smooth import solve_at_once
from mechanical_fmu.system import Balance, Loading, System
from mechanical_fmu.tangent import Anchor

# fault: one round of augmentation, whatever is left -> MOST_ROUNDS = 1 | mechanical_fmu/test_augment
MOST_ROUNDS = 40


def settle(system: System, loading: Loading, start: Balance, anchor: Anchor | None, settings: Settings) -> Equilibrium:
    """Equilibrium with multipliers that have settled; where no pair is augmented, just equilibrium.

    Raises NoEquilibriumError, SingularMatrixError, InvertedCellError, ContactRefusedError.
    """
    ask, augmented = loading.ask, system.contact.on_slaves(system.spec.augmented)
    if not isinstance(ask, Asking) or not augmented.any():
        return solve(system, loading, start, anchor, settings)
    share = min(system.spec.augmented.values())
    if system.spec.at_once and settings.method == "newton":
        return solve_at_once(system, loading, start, anchor, settings, share)
    found, changes = solve(system, loading, start, anchor, settings), np.zeros(augmented.size)
    for _ in range(MOST_ROUNDS):
        assert found.balance.tractions is not None
        pressed = np.where(augmented, found.balance.tractions.multipliers, 0.0)
        changes = pressed - ask.history.multipliers
        # fault: pressures settle at once -> if np.abs(changes).max() <= 1e3 * float(np.abs(pressed).max()): |
        #   mechanical_fmu/test_augment
        if np.abs(changes).max() <= share * float(np.abs(pressed).max()):
            return found
        ask = ask.pressed(pressed)
        again = replace(loading, ask=ask)
        more = solve(system, again, system.balance(found.balance.u, again), anchor, settings)
        found = replace(more, history=found.history + more.history[1:], fresh=found.fresh or more.fresh)
        # fault: settling asked of round-off -> if more.iterations < 0: | mechanical_fmu/test_augment
        if more.iterations == 0:
            # The forces do not feel the change: where bodies just touch, pressures are round-off and never settle.
            return found
    how_much, where = unsettled(system, changes, float(np.abs(pressed).max()))
    raise NoEquilibriumError(f"the contact pressures do not settle: after {MOST_ROUNDS} rounds they {how_much}; a "
                             f"larger penalty settles sooner, or method: semi_smooth (most on {where})")


def remembered(system: System, balance: Balance, before: History) -> History:
    """What contact is to remember of an equilibrium."""
    if balance.tractions is None:
        return before
    at = system.interface.contact_nodes
    augmented = system.contact.on_slaves(system.spec.augmented)
    # fault: multipliers forgotten between steps -> return History(np.where(augmented, 0.0, 0.0),
    #   (system.interface.nodes + balance.u)[at], | mechanical_fmu/test_augment
    return History(np.where(augmented, balance.tractions.multipliers, 0.0), (system.interface.nodes + balance.u)[at],
                   balance.tractions.shear)
