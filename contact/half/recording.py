"""What a run left of one half, over time, as arrays of interface.h5: what the half `replay` plays.

In `start` of interface.h5, each name after `replay.`: `t` (n_t,) [s]; the outputs of the half by name, a row a time.
Energies (ENERGIES) are of the time since the row before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface

Floats = NDArray[np.float64]

PREFIX, TIMES = "replay.", "t"
ENERGIES = ("E_M", "E_S", "contact.E_friction")
# What the coupler asks of either half, and its unit.
OUTPUTS: Mapping[str, Mapping[str, str]] = {
    "thermal": {"T": "K", "f_s": "1"},
    "mechanical": {"x": "m", "contact.t_N": "Pa", "contact.gap": "m", "contact.covered": "1",
                   "E_M": "J", "E_S": "J", "contact.E_friction": "J"}}


@dataclass(frozen=True)
class Recording:
    """Outputs of a half over time, on straight lines between times.

    t : (n_t,) [s], ascending.  outputs : name -> (n_t, ...) in the unit of OUTPUTS.
    """

    t: Floats
    outputs: Mapping[str, Floats]

    @property
    def arrays(self) -> dict[str, Floats]:
        """What stands in `start` of interface.h5."""
        return {PREFIX + TIMES: self.t, **{PREFIX + name: values for name, values in self.outputs.items()}}

    def at(self, name: str, t: float) -> Floats:
        """Return an output at t [s], in its unit; before the first time the first row, after the last the last."""
        values = self.outputs[name]
        if self.t.size == 1:
            return values[0]
        k = int(np.clip(np.searchsorted(self.t, t), 1, self.t.size - 1))
        share = float(np.clip((t - self.t[k - 1]) / (self.t[k] - self.t[k - 1]), 0.0, 1.0))
        # fault: a recording stands still between its rows -> return np.asarray(values[k - 1] if share < 1.0 else
        #   values[k]) | contact/test_recording
        return np.asarray(values[k] if share == 1.0 else (1.0 - share) * values[k - 1] + share * values[k])

    def energy(self, name: str, t0: float, t1: float) -> Floats:
        """Return what of an energy falls between t0 and t1 [s], in J, made evenly since the row before each."""
        ends, begins = np.clip(self.t[1:], t0, t1), np.clip(self.t[:-1], t0, t1)
        # fault: the energy of a row is given out in every step -> shares = (ends > begins).astype(float) |
        #   contact/test_recording
        shares = (ends - begins) / np.diff(self.t)
        return np.asarray(np.tensordot(shares, self.outputs[name][1:], axes=1))

    def coarseness(self, name: str) -> tuple[float, float]:
        """Return how far straight lines may be off [unit of the output], and when [s]; (0, 0) of fewer than three rows.

        Each row is compared with the line between its neighbours: of a smooth course that is four times the error of
        the lines between all rows, for it goes with the square of the step; of a kink it is more than that error.
        """
        if self.t.size < 3:
            return 0.0, 0.0
        values = self.outputs[name]
        share = ((self.t[1:-1] - self.t[:-2]) / (self.t[2:] - self.t[:-2])).reshape(-1, *[1] * (values.ndim - 1))
        off = np.abs(values[1:-1] - (1.0 - share) * values[:-2] - share * values[2:]).reshape(self.t.size - 2, -1)
        worst = off.max(axis=1)
        k = int(worst.argmax())
        return 0.25 * float(worst[k]), float(self.t[k + 1])


def recording_in(interface: Interface, role: str) -> Recording:
    """Return what an interface file has of a half's recording.  Raises ValueError where it has none."""
    start = interface.start
    found = {name: start[PREFIX + name] for name in OUTPUTS[role] if PREFIX + name in start}
    need = "T" if role == "thermal" else "x"
    if PREFIX + TIMES not in start or need not in found:
        raise ValueError(f"interface.h5: no recording of a {role} half (start/{PREFIX}{need})")
    return Recording(start[PREFIX + TIMES], found)
