"""What one step asks the contact service: tractions, and how they answer to the multipliers of the moment."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.contact_client import History
from contact.half.model import Link
from contact.messages import Couplings, Tractions
from mechanical_fmu.contact import MeshContact
from mechanical_fmu.system import ForceBalance, System

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ContactQuery:
    """Contact tractions at x : (n_nodes, 2) [m], from what contact remembers.  Raises ContactRefusedError."""

    contact: MeshContact
    link: Link
    history: History

    def __call__(self, x: Floats) -> Tractions:
        """Ask for the contact tractions at x : (n_nodes, 2) [m].  Raises ContactRefusedError."""
        return self.contact.tractions(self.link, x, self.history)

    def couplings(self, x: Floats) -> Couplings:
        """Ask how contact at x : (n_nodes, 2) [m] answers to its multipliers.  Raises ContactRefusedError."""
        return self.contact.couplings(self.link, x, self.history)

    def with_multipliers(self, multipliers: Floats) -> ContactQuery:
        """Replace the multipliers of contact; multipliers : (n_s,) [Pa]."""
        return replace(self, history=replace(self.history, multipliers=multipliers))


def contact_query(system: System, link: Link, history: History) -> Callable[[Floats], Tractions] | None:
    """Make the query of a step; None where nothing can touch."""
    return ContactQuery(system.contact, link, history) if system.interface.pairs else None


def unsettled(system: System, change: Floats, largest: float) -> tuple[str, str]:
    """Say by how much pressures still change, and where most.

    change : (n_s,) [Pa], of pressures up to largest [Pa].
    """
    # fault: a node that does not settle misnamed -> worst = int(np.argmin(np.abs(change))) |
    #   mechanical_fmu/test_semi_smooth
    worst = int(np.argmax(np.abs(change)))
    node = int(system.interface.contact_nodes[worst])
    names = [pair.name for pair in system.interface.pairs
             if pair.name in system.spec.augmented and system.contact.on_slaves([pair.name])[worst]]
    x, y = system.interface.nodes[node]
    return (f"still change by {abs(change[worst]):.3g} Pa (of at most {largest:.3g})",
            f"pair {' and '.join(names)}, node {node + 1} (at the start at {x:.6g}, {y:.6g} m)")


def contact_history(system: System, balance: ForceBalance, before: History) -> History:
    """Make what contact remembers of an equilibrium, the multipliers of augmented pairs among it."""
    if balance.tractions is None:
        return before
    at = system.interface.contact_nodes
    augmented = system.contact.on_slaves(system.spec.augmented)
    # fault: multipliers forgotten between steps -> return History(np.where(augmented, 0.0, 0.0),
    #   (system.interface.nodes + balance.u)[at], | mechanical_fmu/test_augment
    return History(np.where(augmented, balance.tractions.multipliers, 0.0), (system.interface.nodes + balance.u)[at],
                   balance.tractions.shear)
