"""Linear hardening, R = yield_stress + H e; perfectly plastic with H = 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

from contact.compiled import inner
from contact.half.functions import Property, property_from
from contact.problem.flow import LinearHardening, Plastic
from mechanical_fmu.laws.law import NOTHING, Fields, Floats, IsotropicHardening, Point, Points, lowest


@inner
def flow_stress(p: Point, tables: Floats, e: float) -> tuple[float, float]:
    """Compute R [Pa] and dR/de [Pa] at e >= 0; tables : (n_t,), not read by this law."""
    return p.yield_stress + p.hardening_modulus * e, p.hardening_modulus


@dataclass(frozen=True)
class LinearLaw(IsotropicHardening):
    """R = yield_stress + H e.  yield_stress, H : [Pa]."""

    yield_stress: Property
    H: Property = NOTHING

    NAME: ClassVar = "linear"
    FIELDS: ClassVar[Fields] = {"yield_stress": float, "hardening_modulus": float}
    FLOW_STRESS: ClassVar = flow_stress

    @classmethod
    def made(cls, stated: Plastic) -> Self:
        """Make the law of a material that states it, or no hardening at all."""
        assert stated.s_y is not None, "checked by the class"
        H = stated.hardening.H if isinstance(stated.hardening, LinearHardening) else 0.0
        return cls(property_from(stated.s_y), property_from(H))

    def fill(self, p: Points, T: Floats, factor: Floats, start: int) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K], with all of R times factor : (n,) [1]."""
        p["yield_stress"], p["hardening_modulus"] = self.yield_stress(T) * factor, self.H(T) * factor

    def refusal(self, T: Floats) -> str:
        """Say what is wrong with the law at T : (n,) [K], or ""."""
        return refused_yield(self.yield_stress, T)

    def softens(self, T: Floats) -> bool:
        """Say whether R falls with e somewhere, at T : (n,) [K]."""
        return bool((self.H(T) < 0.0).any())


def refused_yield(yield_stress: Property, T: Floats) -> str:
    """Say where the yield stress is not positive at T : (n,) [K], or ""."""
    value = yield_stress(T)
    return f"the yield stress is {lowest(value, T, ' Pa')}" if (value <= 0.0).any() else ""
