"""Temperatures of earlier times, from which errors of a mesh began to grow: the start, and where data bend or jump."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# So many are kept, their ages about as far apart as powers are.
MOST = 4
# Of a time: what came to be later by this part of it still counts.
ROUND_OFF = 1e-9


def _none() -> Floats:
    return np.empty((0, 0))


@dataclass(frozen=True)
class Began:
    """When errors began to grow.  t [s].  s : (n,) what the half solved for then [K].

    way : (n,) int (s - s then) dt from there on [K s].
    """

    t: float
    s: Floats
    way: Floats


@dataclass(frozen=True)
class Earlier:
    """t : (k,) [s], the earliest first.  s : (k, n) what the half solved for then [K].

    sums : (k, n) int s dt up to then, from the first on, and total : (n,) up to now [K s].
    """

    t: Floats = field(default_factory=lambda: np.empty(0))
    s: Floats = field(default_factory=_none)
    sums: Floats = field(default_factory=_none)
    total: Floats = field(default_factory=lambda: np.empty(0))

    def then(self, t: float, s: Floats, h: float) -> Earlier:
        """Return them with s : (n,) at t [s], at which a step of h [s] begins."""
        if not self.t.size:
            return Earlier(np.array([t]), s[None], np.zeros((1, s.size)), np.zeros(s.size))
        times, keep = np.append(self.t, t), np.ones(self.t.size + 1, dtype=bool)
        if times.size > MOST:
            # The one whose age is most like that of the one before; not the first, nor the last.
            ages = t + h - times
            # fault: the oldest is forgotten first -> keep[0] = False | thermal_fmu/test_surplus
            keep[1 + int(np.argmax(ages[1:-1] / ages[:-2]))] = False
        return Earlier(times[keep], np.vstack([self.s, s])[keep], np.vstack([self.sums, self.total])[keep], self.total)

    def after(self, h: float, before: Floats, s: Floats) -> Earlier:
        """Return them after a step of h [s] from before to s, (n,) each."""
        return replace(self, total=self.total + 0.5 * h * (before + s)) if self.t.size else self

    def since(self, t: float, now: float) -> Began | None:
        """Return the earliest from t [s] on, at the time now [s]; None where there is none."""
        # fault: what was long before errors began counts for them -> later = np.arange(self.t.size) |
        #   thermal_fmu/test_surplus
        later = np.flatnonzero(self.t >= t - ROUND_OFF * abs(t))
        if not later.size:
            return None
        k = later[0]
        return Began(float(self.t[k]), self.s[k], self.total - self.sums[k] - (now - self.t[k]) * self.s[k])
