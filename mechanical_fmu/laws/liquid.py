"""A point between liquid and solid, mixed by the solid fraction f_s.

    s = f_s s_solid + (1 - f_s) 2 eta (e - e_n)/dt
The liquid remembers nothing.  The solid does, but what solidifies in a step does so stress-free in the shape it has:
of the solid at the end only w = f_n/f_s (at most 1) was there before, so its mean elastic strain, backstress and
plastic strain start the step at w times their value.  Then f_s s_solid does not jump when f_s grows, and what has
melted (f_s = 0) has forgotten.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from contact.compiled import inner
from contact.half.functions import Property
from mechanical_fmu.laws.law import (
    H_BACK,
    H_CREEP,
    H_INELASTIC,
    H_PLASTIC,
    H_SOLID,
    H_STRAIN,
    Fields,
    Floats,
    Point,
    Points,
    lowest,
)


@inner
def solidify(p: Point, h_n: Floats, h: Floats) -> None:
    """Turn h, a copy of h_n, into the history the solid at the end of the step begins it with.

    h_n, h : (15,) history of a melting point (laws/law.py), strains [1], backstress [Pa], solid fraction [1].
    """
    f, f_n = p.solid_fraction, h_n[H_SOLID]
    # fault: what solidifies inherits the strain of the liquid -> w = 1.0 | mechanical_fmu/test_points_melting
    w = 0.0 if f <= 0.0 else min(1.0, f_n / f)
    for i in range(4):
        h[H_INELASTIC + i] = h_n[H_STRAIN + i] - w * (h_n[H_STRAIN + i] - h_n[H_INELASTIC + i])
        h[H_BACK + i] = w * h_n[H_BACK + i]
    h[H_PLASTIC] = w * h_n[H_PLASTIC]
    h[H_CREEP] = w * h_n[H_CREEP]


@inner
def mix(p: Point, e: tuple[float, float, float, float], dt: float, h_n: Floats, h: Floats, S: Floats,
        D: Floats) -> float:
    """Mix the liquid into S and D of the solid and close h; returns the heat of the liquid [J/m3].

    e : deviator of E.  h_n, h : (15,) history at the start and at the end.  S : (4,) [Pa].  D : (4, 4) [Pa].
    In no time (dt = 0) a liquid cannot flow: it answers as an elastic solid would.
    """
    f = p.solid_fraction
    # fault: a liquid that resists by its strain -> twice = 2.0 * p.viscosity | mechanical_fmu/test_points_melting
    twice = 2.0 * (p.viscosity / dt if dt > 0.0 else p.shear_modulus)
    work = 0.0
    for i in range(4):
        de = e[i] - h_n[H_STRAIN + i]
        work += twice * de * de * (2.0 if i == 2 else 1.0)
        S[i] = f * S[i] + (1.0 - f) * twice * de
        for j in range(4):
            unit = (1.0 if i == j else 0.0) - (1.0 / 3.0 if i != 2 and j != 2 else 0.0)
            D[i, j] = f * D[i, j] + (1.0 - f) * twice * unit
        h[H_STRAIN + i] = e[i]
        if f <= 0.0:
            h[H_INELASTIC + i] = e[i]
    h[H_SOLID] = f
    return (1.0 - f) * p.liquid_heat * work if dt > 0.0 else 0.0


@dataclass(frozen=True)
class LiquidLaw:
    """Above T_l [K] liquid of viscosity eta [Pa s] and bulk modulus [Pa], below T_s solid, between them mixed by f_s.

    shrinkage : linear strain lost in solidifying.  heat : fraction of the viscous work that becomes heat.
    """

    eta: Property
    bulk: Property
    T_s: float
    T_l: float
    shrinkage: float = 0.0
    heat: float = 1.0

    FIELDS: ClassVar[Fields] = {"viscosity": float, "liquid_heat": float}

    def solid_fraction(self, T: Floats) -> Floats:
        """Compute f_s : same shape as T, 1 up to T_s, 0 from T_l, linear between; T : (n,) [K]."""
        if self.T_l == self.T_s:
            return np.where(self.T_s > T, 1.0, 0.0)
        return np.clip((self.T_l - T) / (self.T_l - self.T_s), 0.0, 1.0)

    def fill(self, p: Points, T: Floats) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K]."""
        p["viscosity"], p["liquid_heat"] = self.eta(T), self.heat

    def refusal(self, T: Floats) -> str:
        """Say what is wrong with the law at T : (n,) [K], or ""."""
        for value, what in ((self.eta(T), "the viscosity of the liquid"), (self.bulk(T), "the liquid's bulk modulus")):
            if (value <= 0.0).any():
                return f"{what} is {lowest(value, T)}"
        return ""
