"""Overstress: what stress beyond yield a rate takes, q = R + K (de_p/dt)^m (Perzyna's form, a power of the rate)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from contact.compiled import inner
from contact.half.functions import Property
from mechanical_fmu.laws.law import Fields, Floats, Point, Points, lowest


@inner
def overstress(p: Point, dp: float, dt: float) -> tuple[float, float]:
    """Compute the stress [Pa] beyond yield of a plastic strain dp > 0 made in dt > 0 [s], and its slope by dp [Pa]."""
    over = p.overstress_factor * (dp / dt) ** p.overstress_exponent
    return over, p.overstress_exponent * over / dp


@inner
def overstress_strain(p: Point, excess: float, dt: float) -> float:
    """Compute the plastic strain an excess > 0 [Pa] makes in dt [s]; infinite where the rate costs nothing."""
    if not p.overstress_factor > 0.0:
        return np.inf
    return dt * np.exp(np.log(excess / p.overstress_factor) / p.overstress_exponent)


@dataclass(frozen=True)
class OverstressLaw:
    """K (de_p/dt)^m beyond the flow stress, K : [Pa s^m], 0 < m <= 1."""

    K: Property
    m: float

    FIELDS: ClassVar[Fields] = {"overstress_factor": float, "overstress_exponent": float}

    def fill(self, p: Points, T: Floats) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K]."""
        p["overstress_factor"], p["overstress_exponent"] = self.K(T), self.m

    def refusal(self, T: Floats) -> str:
        """Say what is wrong with the law at T : (n,) [K], or ""."""
        return f"the overstress K is {lowest(self.K(T), T)}" if (self.K(T) < 0.0).any() else ""
