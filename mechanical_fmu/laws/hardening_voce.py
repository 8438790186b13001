"""Voce's hardening, which saturates: R = yield_stress + Q (1 - exp(-b e)) + H e (Voce 1948)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from contact.compiled import inner
from contact.half.functions import Property, property_from
from contact.problem.flow import Plastic, VoceHardening
from mechanical_fmu.laws.hardening_linear import refused_yield
from mechanical_fmu.laws.law import NOTHING, Fields, Floats, IsotropicHardening, Point, Points


@inner
def flow_stress(p: Point, tables: Floats, e: float) -> tuple[float, float]:
    """Compute R [Pa] and dR/de [Pa] at e >= 0; tables : (n_t,), not read by this law."""
    Q, b, H = p.saturation_stress, p.saturation_rate, p.hardening_modulus
    fade = Q * np.exp(-b * e) if Q != 0.0 else 0.0
    return p.yield_stress + Q - fade + H * e, b * fade + H


@dataclass(frozen=True)
class VoceLaw(IsotropicHardening):
    """R = yield_stress + Q (1 - exp(-b e)) + H e.  yield_stress, Q, H : [Pa], b : [1]."""

    yield_stress: Property
    Q: Property
    b: float
    H: Property = NOTHING

    NAME: ClassVar = "voce"
    FIELDS: ClassVar[Fields] = {"yield_stress": float, "saturation_stress": float, "saturation_rate": float,
                                "hardening_modulus": float}
    FLOW_STRESS: ClassVar = flow_stress

    @classmethod
    def made(cls, stated: Plastic) -> Self:
        """Make the law of a material that states it."""
        law = stated.hardening
        assert isinstance(law, VoceHardening)
        assert stated.s_y is not None, "checked by the class"
        return cls(property_from(stated.s_y), property_from(law.Q), law.b, property_from(law.H))

    def fill(self, p: Points, T: Floats, factor: Floats, start: int) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K], with all of R times factor : (n,) [1]."""
        p["yield_stress"], p["saturation_stress"] = self.yield_stress(T) * factor, self.Q(T) * factor
        p["saturation_rate"], p["hardening_modulus"] = self.b, self.H(T) * factor

    def refusal(self, T: Floats) -> str:
        """Say what is wrong with the law at T : (n,) [K], or ""."""
        return refused_yield(self.yield_stress, T)

    def softens(self, T: Floats) -> bool:
        """Say whether R falls with e somewhere, at T : (n,) [K]."""
        H = self.H(T)
        return bool((np.minimum(H, H + self.b * self.Q(T)) < 0.0).any())
