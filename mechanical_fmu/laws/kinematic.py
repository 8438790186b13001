"""Kinematic hardening: dX = 2/3 C dEp - gamma X de_p, Armstrong and Frederick's; with gamma = 0 Prager's.

Over a step, backward Euler, n the direction of flow: X = theta (X_n + C dp n), theta = 1/(1 + gamma dp).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from contact.half.functions import Property
from mechanical_fmu.laws.law import NOTHING, Fields, Floats, Points, lowest


@dataclass(frozen=True)
class KinematicLaw:
    """C : [Pa] modulus of the backstress, gamma : [1] its recall."""

    C: Property
    gamma: Property = NOTHING

    FIELDS: ClassVar[Fields] = {"backstress_modulus": float, "backstress_recall": float}

    def fill(self, p: Points, T: Floats) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K]."""
        p["backstress_modulus"], p["backstress_recall"] = self.C(T), self.gamma(T)

    def refusal(self, T: Floats) -> str:
        """Say what is wrong with the law at T : (n,) [K], or ""."""
        if (self.gamma(T) < 0.0).any():
            return f"gamma is {lowest(self.gamma(T), T)}"
        if (self.C(T) <= 0.0).any():
            return f"the kinematic modulus C is {lowest(self.C(T), T, ' Pa')}"
        return ""
