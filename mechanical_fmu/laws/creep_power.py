"""Superplastic flow, q = K (de_c/dt)^m: Norton's law stated from the stress's side, A = K^(-1/m) and n = 1/m."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from contact.half.functions import Property
from mechanical_fmu.laws.creep_norton import NortonLaw
from mechanical_fmu.laws.law import CreepLaw, Fields, Floats, Points, lowest


@dataclass(frozen=True)
class PowerLaw(CreepLaw):
    """q = K (de_c/dt)^m, K : [Pa s^m], 0 < m <= 1.  heat : fraction of its work that becomes heat."""

    K: Property
    m: float
    heat: float = 1.0

    FIELDS: ClassVar[Fields] = NortonLaw.FIELDS
    KERNELS: ClassVar = NortonLaw.KERNELS

    def fill(self, p: Points, T: Floats) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K]."""
        p["creep_log_factor"], p["creep_exponent"] = -np.log(self.K(T)) / self.m, 1.0 / self.m
        p["creep_heat"] = self.heat

    def refusal(self, T: Floats) -> str:
        """Say what is wrong with the law at T : (n,) [K], or ""."""
        low = self.K(T)
        return f"the factor K of its flow is {lowest(low, T)}" if (low <= 0.0).any() else ""
