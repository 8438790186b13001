"""Temperatures of earlier times, from which errors of a mesh began to grow: the start, and where data bend or jump."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# So many are kept, their ages about as far apart as powers are.
MOST = 4
# Of a time: what came to be later by this part of it still counts.
ROUND_OFF = 1e-9


@dataclass(frozen=True)
class Earlier:
    """t : (k,) [s], the earliest first.  s : (k, n) what the half solved for then [K]."""

    t: Floats = field(default_factory=lambda: np.empty(0))
    s: Floats = field(default_factory=lambda: np.empty((0, 0)))

    def then(self, t: float, s: Floats, h: float) -> Earlier:
        """Return them with s : (n,) at t [s], of which a step of h [s] begins."""
        times = np.append(self.t, t)
        keep = np.ones(times.size, dtype=bool)
        if times.size > MOST:
            # The one whose age is most like that of the one before; not the first, nor the last.
            ages = t + h - times
            # fault: the oldest is forgotten first -> keep[0] = False | thermal_fmu/test_surplus
            keep[1 + int(np.argmax(ages[1:-1] / ages[:-2]))] = False
        return Earlier(times[keep], np.vstack([self.s.reshape(self.t.size, s.size), s])[keep])

    def since(self, t: float) -> Floats | None:
        """Return s : (n,) of the earliest from t [s] on; None where there is none."""
        # fault: what was long before errors began counts for them -> later = np.arange(self.t.size) |
        #   thermal_fmu/test_surplus
        later = np.flatnonzero(self.t >= t - ROUND_OFF * abs(t))
        return self.s[later[0]] if later.size else None
