"""The energy account: heat the mechanical half made, what of it was delivered, what is carried to the next window."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EnergyAccount:
    """Energies [J].  carry : (n_cells,) made but not yet delivered.  made, delivered : totals over the run.

    Energies cross the border, not rates: a rate of one window used over a window of another length loses heat.
    """

    carry: Array
    made: float = 0.0
    delivered: float = 0.0

    def deliver(self) -> EnergyAccount:
        """The account after the carry was handed to the thermal half."""
        return replace(self, carry=np.zeros_like(self.carry), delivered=self.delivered + float(self.carry.sum()))

    def make(self, E_M: Array | float) -> EnergyAccount:
        """The account after the mechanical half made E_M : (n_cells,) [J], or 0 where it makes none."""
        if isinstance(E_M, float):
            return self
        return replace(self, carry=self.carry + E_M, made=self.made + float(E_M.sum()))
