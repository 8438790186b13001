"""The energy accounts: heat the mechanical half made, what of it was delivered, what is carried to the next window."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Block that crosses -> plain name.  Each has an account of its own.
HEATS = {"E_M": "mechanical heat", "E_S": "entropy part", "contact.E_friction": "friction heat"}
AT_ONCE = frozenset(("E_S",))  # a temperature jump at the start of the first substep; the others are spread in time


@dataclass(frozen=True)
class EnergyAccount:
    """Energies [J].  carry : (n_cells,) or (n_s,) made but not yet delivered.  made, delivered : totals over the run.

    Energies cross the border, not rates: a rate of one window used over a window of another length loses heat.
    """

    carry: Array
    made: float = 0.0
    delivered: float = 0.0

    def deliver(self) -> EnergyAccount:
        """The account after the carry was handed to the thermal half."""
        if not self.carry.any():
            return self
        # fault: friction heat is delivered twice -> return EnergyAccount(self.carry, self.made, self.delivered +
        #   float(self.carry.sum())) | scenarios/test_friction_heat
        return EnergyAccount(np.zeros(self.carry.shape), self.made, self.delivered + float(self.carry.sum()))

    def make(self, energy: Array | float) -> EnergyAccount:
        """The account after the mechanical half made an energy of the carry's shape [J], or 0 where it makes none."""
        if isinstance(energy, float):
            return self
        # fault: friction heat forgotten between windows -> return EnergyAccount(self.carry, self.made +
        #   float(energy.sum()), self.delivered) | coupler/test_accounts
        return EnergyAccount(self.carry + energy, self.made + float(energy.sum()), self.delivered)


Accounts = Mapping[str, EnergyAccount]


def share_of(accounts: Accounts, share: float, first: bool) -> dict[str, Array]:
    """What a thermal substep is given of each carry: its share of the window, or all of it in the first substep."""
    # fault: entropy part handed to every substep -> shares = {n: 1.0 if n in AT_ONCE else share for n in accounts} |
    #   coupler/test_accounts
    shares = {n: float(first) if n in AT_ONCE else share for n in accounts}
    return {n: a.carry if shares[n] == 1.0 else a.carry * shares[n] for n, a in accounts.items()}


def delivered(accounts: Accounts, taken: Container[str]) -> dict[str, EnergyAccount]:
    """The accounts after a thermal half went over a window.  taken : blocks it has; one it lacks is carried on."""
    return {n: a.deliver() if n in taken else a for n, a in accounts.items()}


def with_made(accounts: Accounts, made: Mapping[str, Array]) -> dict[str, EnergyAccount]:
    """The accounts after a mechanical half went over a window: what it made is due."""
    return {n: a.make(made.get(n, 0.0)) for n, a in accounts.items()}
