"""The augmented Lagrangian: equilibrium, and again with the pressures it found, until they are those of no penetration.

Uzawa's iteration.  Each round leaves the share 1/(1 + eps_N L/E) of the penetration of the round before, so with the
default penalty E/h a body of twenty cells is done in three or four.  It ends where the pressures have settled to the
share asked for, or where the forces do not feel their change.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.model import Link
from contact.half.surfaces import History
from contact.wire import Tractions
from mechanical_fmu.contact_forces import Contact
from mechanical_fmu.newton import Equilibrium, NoEquilibriumError, Settings, solve
from mechanical_fmu.system import Balance, Loading, System
from mechanical_fmu.tangent import Anchor

Floats = NDArray[np.float64]

MOST_ROUNDS = 40


@dataclass(frozen=True)
class Asking:
    """Contact tractions at x : (n_nodes, 2) [m], from what contact remembers.  Raises ContactRefusedError."""

    contact: Contact
    link: Link
    history: History

    def __call__(self, x: Floats) -> Tractions:
        return self.contact.tractions(self.link, x, self.history)


def asking(system: System, link: Link, history: History) -> Callable[[Floats], Tractions] | None:
    """How a step asks contact; None where nothing can touch."""
    return Asking(system.contact, link, history) if system.interface.pairs else None


def settle(system: System, loading: Loading, start: Balance, anchor: Anchor | None, settings: Settings) -> Equilibrium:
    """Equilibrium with multipliers that have settled; where no pair is augmented, just equilibrium.

    Raises NoEquilibriumError, SingularMatrixError, InvertedCellError, ContactRefusedError.
    """
    found = solve(system, loading, start, anchor, settings)
    ask, augmented = loading.ask, system.contact.on_slaves(system.spec.augmented)
    if not isinstance(ask, Asking) or not augmented.any():
        return found
    change = 0.0
    for _ in range(MOST_ROUNDS):
        assert found.balance.tractions is not None
        pressed = np.where(augmented, found.balance.tractions.multipliers, 0.0)
        change = float(np.abs(pressed - ask.history.multipliers).max())
        if change <= min(system.spec.augmented.values()) * float(np.abs(pressed).max()):
            return found
        ask = replace(ask, history=replace(ask.history, multipliers=pressed))
        again = replace(loading, ask=ask)
        more = solve(system, again, system.balance(found.balance.u, again), anchor, settings)
        found = replace(more, history=found.history + more.history[1:], fresh=found.fresh or more.fresh)
        if more.iterations == 0:
            # The forces do not feel the change: where bodies just touch, pressures are round-off and never settle.
            return found
    raise NoEquilibriumError(f"the contact pressures do not settle: after {MOST_ROUNDS} rounds they still change by "
                             f"{change:.3g} Pa (of at most {np.abs(pressed).max():.3g}); a larger penalty settles "
                             "sooner")


def remembered(system: System, balance: Balance, before: History) -> History:
    """What contact is to remember of an equilibrium."""
    if balance.tractions is None:
        return before
    at = system.interface.contact_nodes
    augmented = system.contact.on_slaves(system.spec.augmented)
    return History(np.where(augmented, balance.tractions.multipliers, 0.0), (system.interface.nodes + balance.u)[at],
                   balance.tractions.shear)
