"""Material of a deformable body: what a cell needs to know of it at its temperature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property
from mechanical_fmu.point import (
    CREEP,
    KINEMATIC,
    LIQUID,
    N_P,
    OVERSTRESS,
    P_B,
    P_C,
    P_CHI,
    P_CHI_LIQUID,
    P_CHI_VISCOUS,
    P_ETA,
    P_FORM,
    P_G,
    P_GAMMA,
    P_H,
    P_K,
    P_KNOTS,
    P_LOG_A,
    P_M,
    P_N,
    P_Q,
    P_ROW,
    P_SHARE,
    P_SOLID,
    P_TABLE,
    P_YIELD,
    PLASTIC,
)

# What makes a material flow: plasticity, creep, melting, as data that fills the parameters of points at their T.
#
# Every law is a frozen value with `fill(p, T)`, p : (n, N_P) rows of points.update, T : (n,) [K], and `refusal(T)`:
# what is wrong with it at these temperatures, or "".

Floats = NDArray[np.float64]

GAS_CONSTANT = 8.31446261815324  # J/mol K, exact since 2019
NOTHING, ONE = Property(0.0), Property(1.0)


@dataclass(frozen=True)
class Voce:
    """R = s0 + Q (1 - exp(-b e)) + H e, s0, Q, H : [Pa], b : [1].  Q = 0: linear; Q = H = 0: perfectly plastic."""

    s0: Property
    Q: Property = NOTHING
    b: float = 0.0
    H: Property = NOTHING

    @property
    def data(self) -> Floats:
        """No table."""
        return np.empty(0)

    def fill(self, p: Floats, T: Floats, start: int) -> None:
        p[:, P_YIELD], p[:, P_Q], p[:, P_B], p[:, P_H] = self.s0(T), self.Q(T), self.b, self.H(T)

    def refusal(self, T: Floats) -> str:
        if (self.s0(T) <= 0.0).any():
            return f"the yield stress is {self.s0(T).min():.6g} Pa at {T[np.argmin(self.s0(T))]:.6g} K"
        return ""

    def softens(self, T: Floats) -> bool:
        """Whether R falls with e somewhere."""
        H = self.H(T)
        return bool((np.minimum(H, H + self.b * self.Q(T)) < 0.0).any())


@dataclass(frozen=True)
class Curves:
    """R from curves over plastic strain, linear between temperatures, the end's value beyond them.

    strain : (n,) from 0.  T : (n_T,) [K].  stress, slope : (n_T, n) [Pa].  form : sum of CUBIC and SLOPED.
    """

    strain: Floats
    T: Floats
    stress: Floats
    slope: Floats
    form: int

    @property
    def data(self) -> Floats:
        """(n_t,) what points.update finds at P_TABLE: strains, then stresses and slopes of every temperature."""
        return np.concatenate([self.strain, np.concatenate([self.stress, self.slope], axis=1).ravel()])

    def fill(self, p: Floats, T: Floats, start: int) -> None:
        n, last = self.strain.size, len(self.T) - 1
        row = np.clip(np.searchsorted(self.T, T, side="right") - 1, 0, max(last - 1, 0))
        if last > 0:
            p[:, P_SHARE] = np.clip((T - self.T[row]) / (self.T[row + 1] - self.T[row]), 0.0, 1.0)
        p[:, P_YIELD], p[:, P_TABLE], p[:, P_KNOTS], p[:, P_FORM] = 1.0, start, n, self.form
        p[:, P_ROW] = start + n + 2 * n * row

    def refusal(self, T: Floats) -> str:
        return ""

    def softens(self, T: Floats) -> bool:
        """Whether a curve falls somewhere."""
        return bool((np.diff(self.stress, axis=1) < 0.0).any())


@dataclass(frozen=True)
class Plastic:
    """Von Mises plasticity.  factor : of R by temperature.  C [Pa], gamma [1]: dX = 2/3 C dEp - gamma X de_p.

    K [Pa s^m], m : overstress K (de_p/dt)^m.  chi : share of the dissipation that becomes heat.
    softening : R may fall with strain.
    """

    hardening: Voce | Curves
    factor: Property = ONE
    C: Property = NOTHING
    gamma: Property = NOTHING
    K: Property = NOTHING
    m: float = 1.0
    chi: float = 0.9
    softening: bool = False
    kinematic: bool = False
    overstress: bool = False

    @property
    def kind(self) -> int:
        return PLASTIC + KINEMATIC * self.kinematic + OVERSTRESS * self.overstress

    @property
    def data(self) -> Floats:
        return self.hardening.data

    def fill(self, p: Floats, T: Floats, start: int) -> None:
        """start : where this material's curves stand in `tables`."""
        self.hardening.fill(p, T, start)
        factor = self.factor(T)
        for place in (P_YIELD, P_Q, P_H):
            p[:, place] *= factor
        p[:, P_C], p[:, P_GAMMA], p[:, P_K] = self.C(T), self.gamma(T), self.K(T)
        p[:, P_M], p[:, P_CHI] = self.m, self.chi

    def refusal(self, T: Floats) -> str:
        for value, what in ((self.factor(T), "the factor of the yield stress"), (self.gamma(T), "gamma"),
                            (self.K(T), "the overstress K")):
            if (value < 0.0).any():
                return f"{what} is {value.min():.6g} at {T[np.argmin(value)]:.6g} K"
        if self.kinematic and (self.C(T) <= 0.0).any():
            return f"the kinematic modulus C is {self.C(T).min():.6g} Pa at {T[np.argmin(self.C(T))]:.6g} K"
        # fault: softening goes unsaid -> if self.softening and self.hardening.softens(T): |
        #   mechanical_fmu/test_points_material
        if not self.softening and self.hardening.softens(T):
            return "its flow stress falls with plastic strain, which must be meant: write \"softening\": true"
        return self.hardening.refusal(T)


@dataclass(frozen=True)
class Norton:
    """de_c/dt = A q^n exp(-Q/(R T)), A : [1/(Pa^n s)], Q : [J/mol].  heat : share of its work that becomes heat."""

    A: Property
    n: float
    Q: float = 0.0
    heat: float = 1.0

    def fill(self, p: Floats, T: Floats) -> None:
        with np.errstate(divide="ignore"):
            # A = 0 : log = -inf, which creeps nothing.
            # fault: Arrhenius with the wrong sign -> p[:, P_LOG_A] = np.log(self.A(T)) + (self.Q / (GAS_CONSTANT * T)
            #   if self.Q else 0.0) | mechanical_fmu/test_points_flow
            p[:, P_LOG_A] = np.log(self.A(T)) - (self.Q / (GAS_CONSTANT * T) if self.Q else 0.0)
        p[:, P_N], p[:, P_CHI_VISCOUS] = self.n, self.heat

    def refusal(self, T: Floats) -> str:
        if (self.A(T) < 0.0).any():
            return f"the creep factor A is {self.A(T).min():.6g} at {T[np.argmin(self.A(T))]:.6g} K"
        return "its creep needs temperatures above 0 K" if self.Q and (T <= 0.0).any() else ""


@dataclass(frozen=True)
class PowerLaw:
    """q = K (de_c/dt)^m : superplastic flow, K : [Pa s^m], 0 < m <= 1.  heat : share that becomes heat."""

    K: Property
    m: float
    heat: float = 1.0

    def fill(self, p: Floats, T: Floats) -> None:
        p[:, P_LOG_A], p[:, P_N], p[:, P_CHI_VISCOUS] = -np.log(self.K(T)) / self.m, 1.0 / self.m, self.heat

    def refusal(self, T: Floats) -> str:
        low = self.K(T)
        return f"the factor K of its flow is {low.min():.6g} at {T[np.argmin(low)]:.6g} K" if (low <= 0.0).any() else ""


@dataclass(frozen=True)
class Liquid:
    """Above T_l [K] liquid of viscosity eta [Pa s] and bulk modulus [Pa], below T_s solid, between them mixed by f_s.

    shrinkage : linear strain lost in solidifying.  heat : share of the viscous work that becomes heat.
    """

    eta: Property
    bulk: Property
    T_s: float
    T_l: float
    shrinkage: float = 0.0
    heat: float = 1.0

    def solid_fraction(self, T: Floats) -> Floats:
        """f_s : 1 up to T_s, 0 from T_l, linear between."""
        if self.T_l == self.T_s:
            return np.where(self.T_s > T, 1.0, 0.0)
        return np.clip((self.T_l - T) / (self.T_l - self.T_s), 0.0, 1.0)

    def fill(self, p: Floats, T: Floats) -> None:
        p[:, P_ETA], p[:, P_CHI_LIQUID] = self.eta(T), self.heat

    def refusal(self, T: Floats) -> str:
        for value, what in ((self.eta(T), "the viscosity of the liquid"), (self.bulk(T), "the liquid's bulk modulus")):
            if (value <= 0.0).any():
                return f"{what} is {value.min():.6g} at {T[np.argmin(value)]:.6g} K"
        return ""


@dataclass(frozen=True)
class Flow:
    """All that makes a material flow; each part may be absent."""

    plastic: Plastic | None = None
    creep: Norton | PowerLaw | None = None
    liquid: Liquid | None = None
    data: Floats = field(default_factory=lambda: np.empty(0))

    @property
    def kind(self) -> int:
        """What points.update is to do."""
        return ((self.plastic.kind if self.plastic else 0) + (CREEP if self.creep else 0)
                + (LIQUID if self.liquid else 0))

    def fill(self, p: Floats, T: Floats, start: int) -> None:
        """Fill rows p : (n, N_P) but for G and the solid fraction."""
        if self.liquid:
            self.liquid.fill(p, T)
        if self.creep:
            self.creep.fill(p, T)
        if self.plastic:
            self.plastic.fill(p, T, start)

    def refusal(self, T: Floats) -> str:
        """What is wrong at temperatures T, or ""."""
        laws = (self.plastic, self.creep, self.liquid)
        return next((why for law in laws if law and (why := law.refusal(T))), "")


Index = NDArray[np.intp]

ELASTIC = Flow()


@dataclass(frozen=True)
class Material:
    """E : [Pa], nu : [1], alpha : [1/K] the SECANT coefficient from T_ref [K].  flow : what it does beyond elasticity.

    alpha (T - T_ref) is the whole free stretch less one, so a table of alpha is of mean coefficients from T_ref.
    """

    name: str
    E: Property
    nu: Property
    alpha: Property
    T_ref: float
    flow: Flow = ELASTIC

    @property
    def kind(self) -> int:
        """What its points do (points.py); 0 : elastic, neo-Hookean."""
        return self.flow.kind


@dataclass(frozen=True)
class Moduli:
    """Per cell: mu, kappa : (n_e,) [Pa]; e_th : (n_e,) = 3 ln(1 + alpha (T - T_ref) + shrinkage (1 - f_s)).

    p : (n_e, N_P) parameters of points (points.py), (0, N_P) where all cells are elastic.
    tables : (n_t,) hardening curves of all materials.
    """

    mu: Floats
    kappa: Floats
    e_th: Floats
    p: Floats = field(default_factory=lambda: np.empty((0, N_P)))
    tables: Floats = field(default_factory=lambda: np.empty(0))


class MaterialRangeError(ArithmeticError):
    """A property left the range in which the material makes sense."""


def moduli(materials: tuple[Material, ...], material_of: Index, T: Floats, f_s: Floats | None = None) -> Moduli:
    """Moduli of cells at their mean temperature T : (n_e,) [K] and solid fraction f_s : (n_e,).

    f_s : None : each melting material takes it from T.  material_of : (n_e,) index into materials.
    Raises MaterialRangeError naming material and temperature.
    """
    mu, kappa, e_th = np.empty_like(T), np.empty_like(T), np.empty_like(T)
    flows = any(materials[i].kind for i in np.unique(material_of))
    p, start = np.zeros((len(T) if flows else 0, N_P)), 0
    for i, material in enumerate(materials):
        here = material_of == i
        if here.any():
            solid = _solid_fraction(material, T[here], None if f_s is None else f_s[here])
            mu[here], kappa[here], e_th[here] = _elasticity(material, T[here], solid)
            if flows:
                p[here] = _parameters(material, T[here], solid, mu[here], start)
        # fault: curves of the second material read from the first's place -> start += 0 |
        #   mechanical_fmu/test_points_material
        start += material.flow.data.size
    tables = np.concatenate([m.flow.data for m in materials]) if flows else np.empty(0)
    return Moduli(mu, kappa, e_th, p, tables)


def thermoelastic_heat(materials: Sequence[Material], material_of: Index, T: Floats, kappa: Floats,
                       change: Floats) -> Floats:
    """Heat of a step [J/m3 of reference volume]: - kappa T (de_th/dT) d(ln theta), so that compression heats.

    T : (n_e,) [K], kappa : (n_e,) [Pa], change : (n_e,) of ln theta over the step.  The share in the elastic
    entropy of moduli that change with temperature, and what pressure does to melting, are left out.
    """
    rate = np.empty_like(T)
    for i, material in enumerate(materials):
        here = material_of == i
        if here.any():
            alpha, d_alpha = material.alpha(T[here]), material.alpha.slope(T[here])
            warm = T[here] - material.T_ref
            rate[here] = 3.0 * (alpha + d_alpha * warm) / (1.0 + alpha * warm)
    # fault: expansion heats -> return kappa * T * rate * change | mechanical_fmu/test_points_verification
    return -kappa * T * rate * change


def _elasticity(material: Material, T: Floats, solid: Floats | None) -> tuple[Floats, Floats, Floats]:
    """mu, kappa, e_th : (n,) of one material.  solid : (n,) f_s, None where it does not melt."""
    E, nu = material.E(T), material.nu(T)
    stretch = 1.0 + material.alpha(T) * (T - material.T_ref)
    liquid = material.flow.liquid
    if liquid is not None and solid is not None:
        # fault: shrinkage with the wrong sign -> stretch = stretch + liquid.shrinkage * (solid - 1.0) |
        #   mechanical_fmu/test_points_melting
        # fault: a casting that shrinks by half of it -> stretch = stretch + 0.5 * liquid.shrinkage * (1.0 - solid) |
        #   scenarios/test_aluminium_can
        stretch = stretch + liquid.shrinkage * (1.0 - solid)
    for value, what in ((E, "E"), (stretch, "the free stretch 1 + alpha (T - T_ref)"), (0.5 - nu, "1/2 - nu"),
                        (1.0 + nu, "1 + nu")):
        if not (value > 0.0).all():
            at = T[int(np.argmin(value))]
            raise MaterialRangeError(f"material {material.name}: {what} is {value.min():.6g} at {at:.6g} K")
    # fault: bulk modulus of plane stress -> kappa = E / (3.0 * (1.0 - nu)) | mechanical_fmu/test_elastic_cylinder
    kappa = E / (3.0 * (1.0 - 2.0 * nu))
    if liquid is not None and solid is not None:
        kappa = solid * kappa + (1.0 - solid) * liquid.bulk(T)
    # fault: thermal strain once instead of three times -> return E / (2.0 * (1.0 + nu)), kappa, np.log(stretch) |
    #   mechanical_fmu/test_elastic_patch
    return E / (2.0 * (1.0 + nu)), kappa, 3.0 * np.log(stretch)


def _solid_fraction(material: Material, T: Floats, f_s: Floats | None) -> Floats | None:
    if material.flow.liquid is None:
        return None
    return material.flow.liquid.solid_fraction(T) if f_s is None else np.clip(f_s, 0.0, 1.0)


def _parameters(material: Material, T: Floats, solid: Floats | None, mu: Floats, start: int) -> Floats:
    """(n, N_P) rows of one material."""
    if why := material.flow.refusal(T):
        raise MaterialRangeError(f"material {material.name}: {why}")
    p = np.zeros((len(T), N_P))
    p[:, P_G], p[:, P_SOLID] = mu, 1.0 if solid is None else solid
    material.flow.fill(p, T, start)
    return p
