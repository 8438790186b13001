"""Hardening: how the flow stress grows with plastic strain (isotropic, kinematic) and with its rate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from contact.compiled import inner
from contact.half.functions import Property, property_from
from contact.problem.curves import Beyond, Form
from contact.problem.flow import LinearHardening, Plastic, TableHardening, VoceHardening
from mechanical_fmu.laws.law import NOTHING, Fields, Floats, IsotropicHardening, Point, Points, lowest

# Linear hardening, R = yield_stress + H e; perfectly plastic with H = 0.

@inner
def linear_flow_stress(p: Point, tables: Floats, e: float) -> tuple[float, float]:
    """Compute R [Pa] and dR/de [Pa] at e >= 0; tables : (n_t,), not read by this law."""
    return p.yield_stress + p.hardening_modulus * e, p.hardening_modulus


@dataclass(frozen=True)
class LinearLaw(IsotropicHardening):
    """R = yield_stress + H e.  yield_stress, H : [Pa]."""

    yield_stress: Property
    H: Property = NOTHING

    NAME: ClassVar = "linear"
    FIELDS: ClassVar[Fields] = {"yield_stress": float, "hardening_modulus": float}
    FLOW_STRESS: ClassVar = linear_flow_stress

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


# Voce's hardening, which saturates: R = yield_stress + Q (1 - exp(-b e)) + H e (Voce 1948).

@inner
def voce_flow_stress(p: Point, tables: Floats, e: float) -> tuple[float, float]:
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
    FLOW_STRESS: ClassVar = voce_flow_stress

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


# IsotropicHardening by measured curves: the flow stress at points of plastic strain, for one temperature or several.
#
# The numbers of all materials lie in one array, `tables`; those of a law are its strains (n), then for every
# temperature its stresses (n) and slopes (n).  Between two temperatures the flow stress is linear.

# A table is cubic between its knots (else straight), and goes on with its last slope (else flat).
CUBIC, SLOPED = 1, 2


@inner
def table_flow_stress(p: Point, tables: Floats, e: float) -> tuple[float, float]:
    """Compute R [Pa] and dR/de [Pa] at e >= 0; tables : (n_t,), read from where p says."""
    n, row = p.table_knots, p.table_row
    R, slope = curve(tables, p.table_start, row, n, p.table_form, e)
    if p.table_next > 0.0:
        R1, slope1 = curve(tables, p.table_start, row + 2 * n, n, p.table_form, e)
        R += p.table_next * (R1 - R)
        slope += p.table_next * (slope1 - slope)
    return R * p.table_factor, slope * p.table_factor


@inner
def curve(tables: Floats, strains: int, row: int, n: int, form: int, e: float) -> tuple[float, float]:
    """Interpolate the stress [Pa] and slope [Pa] of one curve at e.

    tables : (n_t,) of all materials; strains, row : where in it its strains, and its stresses, begin.
    """
    if e >= tables[strains + n - 1]:
        slope = tables[row + 2 * n - 1] if form & SLOPED else 0.0
        return tables[row + n - 1] + slope * (e - tables[strains + n - 1]), slope
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        # fault: hardening forgotten past the first knot -> if tables[strains + middle] < 0.0: |
        #   mechanical_fmu/test_points_material
        if tables[strains + middle] <= e:
            low = middle
        else:
            high = middle
    width = tables[strains + low + 1] - tables[strains + low]
    x = e - tables[strains + low]
    y0, y1 = tables[row + low], tables[row + low + 1]
    if form & CUBIC:
        t = x / width
        a, b = tables[row + n + low] * width, tables[row + n + low + 1] * width
        c2, c3 = 3.0 * (y1 - y0) - 2.0 * a - b, a + b - 2.0 * (y1 - y0)
        return y0 + t * (a + t * (c2 + t * c3)), (a + t * (2.0 * c2 + t * 3.0 * c3)) / width
    slope = (y1 - y0) / width
    return y0 + slope * x, slope


@dataclass(frozen=True)
class TableLaw(IsotropicHardening):
    """R from curves over plastic strain, linear between temperatures, the end's value beyond them.

    strain : (n,) from 0.  T : (n_T,) [K].  stress, slope : (n_T, n) [Pa].  form : sum of CUBIC and SLOPED.
    """

    strain: Floats
    T: Floats
    stress: Floats
    slope: Floats
    form: int

    NAME: ClassVar = "table"
    # table_start, table_row : where in `tables` the strains begin, and the stresses of the temperature below.
    # table_next : weight of the temperature above, 0 to 1.  table_factor : times all of R.
    FIELDS: ClassVar[Fields] = {"table_start": int, "table_knots": int, "table_row": int, "table_form": int,
                                "table_next": float, "table_factor": float}
    FLOW_STRESS: ClassVar = table_flow_stress

    @classmethod
    def made(cls, stated: Plastic) -> Self:
        """Make the law of a material that states it, with the slopes of its curves."""
        law = stated.hardening
        assert isinstance(law, TableHardening)
        strain, T = np.array(law.strain), np.array(law.T or (0.0,))
        stress = [np.array(row) for row in law.rows]
        cubic, sloped = law.form is Form.CUBIC, law.beyond is Beyond.SLOPE
        if cubic:
            from scipy.interpolate import PchipInterpolator  # 0.2 s, and most scenes have no such table

            slope = [PchipInterpolator(strain, row).derivative()(strain) for row in stress]
        else:
            slope = [np.append(d := np.diff(row) / np.diff(strain), d[-1]) for row in stress]
        return cls(strain, T, np.array(stress), np.array(slope), CUBIC * cubic + SLOPED * sloped)

    @property
    def data(self) -> Floats:
        """Return (n + 2 n n_T,) numbers: strains [1], then stresses and slopes [Pa] of every temperature."""
        return np.concatenate([self.strain, np.concatenate([self.stress, self.slope], axis=1).ravel()])

    def fill(self, p: Points, T: Floats, factor: Floats, start: int) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K], with all of R times factor : (n,) [1].

        start : where `data` stands in the tables of all materials.
        """
        n, last = self.strain.size, len(self.T) - 1
        row = np.clip(np.searchsorted(self.T, T, side="right") - 1, 0, max(last - 1, 0))
        if last > 0:
            p["table_next"] = np.clip((T - self.T[row]) / (self.T[row + 1] - self.T[row]), 0.0, 1.0)
        p["table_start"], p["table_knots"], p["table_form"], p["table_factor"] = start, n, self.form, factor
        p["table_row"] = start + n + 2 * n * row

    def refusal(self, T: Floats) -> str:
        """Return "", whatever T : (n,) [K]: the curves were checked when read."""
        return ""

    def softens(self, T: Floats) -> bool:
        """Say whether a curve falls with e somewhere, whatever T : (n,) [K]."""
        return bool((np.diff(self.stress, axis=1) < 0.0).any())


# Kinematic hardening: dX = 2/3 C dEp - gamma X de_p, Armstrong and Frederick's; with gamma = 0 Prager's.
#
# Over a step, backward Euler, n the direction of flow: X = theta (X_n + C dp n), theta = 1/(1 + gamma dp).

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


# Overstress: what stress beyond yield a rate takes, q = R + K (de_p/dt)^m (Perzyna's form, a power of the rate).

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
