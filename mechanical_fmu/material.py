"""Material of a deformable body: what a cell needs to know of it at its temperature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property
from mechanical_fmu.laws.catalogue import POINT, creep_number, hardening_number
from mechanical_fmu.laws.hardening import KinematicLaw, OverstressLaw
from mechanical_fmu.laws.law import (
    CREEP,
    KINEMATIC,
    LIQUID,
    ONE,
    OVERSTRESS,
    PLASTIC,
    CreepLaw,
    IsotropicHardening,
    Points,
    lowest,
)
from mechanical_fmu.laws.liquid import LiquidLaw

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PlasticFlow:
    """Von Mises plasticity.  factor : of R by temperature.  chi : fraction of the dissipation that becomes heat.

    softening : R may fall with strain.
    """

    hardening: IsotropicHardening
    factor: Property = ONE
    kinematic: KinematicLaw | None = None
    overstress: OverstressLaw | None = None
    chi: float = 0.9
    softening: bool = False

    @property
    def kind(self) -> int:
        """Return what its points can do (laws/law.py)."""
        return (PLASTIC + (KINEMATIC if self.kinematic else 0) + (OVERSTRESS if self.overstress else 0))

    def fill(self, p: Points, T: Floats, start: int) -> None:
        """Fill p : (n,) at T : (n,) [K]; start : where the curves of this material stand in `tables`."""
        p["hardening"], p["plastic_heat"] = hardening_number(self.hardening), self.chi
        self.hardening.fill(p, T, self.factor(T), start)
        for law in (self.kinematic, self.overstress):
            if law:
                law.fill(p, T)

    def refusal(self, T: Floats) -> str:
        """Say what is wrong at T : (n,) [K], or ""."""
        if ((factor := self.factor(T)) < 0.0).any():
            return f"the factor of the yield stress is {lowest(factor, T)}"
        for law in (self.overstress, self.kinematic):
            if law and (why := law.refusal(T)):
                return why
        # fault: softening goes unsaid -> if self.softening and self.hardening.softens(T): |
        #   mechanical_fmu/test_points_material
        if not self.softening and self.hardening.softens(T):
            return "its flow stress falls with plastic strain, which must be meant: write \"softening\": true"
        return self.hardening.refusal(T)


@dataclass(frozen=True)
class FlowLaws:
    """All that makes a material flow; each part may be absent."""

    plastic: PlasticFlow | None = None
    creep: CreepLaw | None = None
    liquid: LiquidLaw | None = None

    @property
    def kind(self) -> int:
        """Return what point.update is to do."""
        return ((self.plastic.kind if self.plastic else 0) + (CREEP if self.creep else 0)
                + (LIQUID if self.liquid else 0))

    @property
    def data(self) -> Floats:
        """Return (n_t,) numbers of its hardening curves: strains [1], stresses and slopes [Pa]."""
        return self.plastic.hardening.data if self.plastic else np.empty(0)

    def fill(self, p: Points, T: Floats, start: int) -> None:
        """Fill p : (n,) of POINT at T : (n,) [K], but for G and the solid fraction."""
        if self.liquid:
            self.liquid.fill(p, T)
        if self.creep:
            p["creep"] = creep_number(self.creep)
            self.creep.fill(p, T)
        if self.plastic:
            self.plastic.fill(p, T, start)

    def refusal(self, T: Floats) -> str:
        """Say what is wrong at T : (n,) [K], or ""."""
        laws = (self.plastic, self.creep, self.liquid)
        return next((why for law in laws if law and (why := law.refusal(T))), "")


Index = NDArray[np.intp]

ELASTIC = FlowLaws()


@dataclass(frozen=True)
class SolidMaterial:
    """E : [Pa], nu : [1], alpha : [1/K] the SECANT coefficient from T_ref [K].  flow : what it does beyond elasticity.

    alpha (T - T_ref) is the whole free stretch less one, so a table of alpha is of mean coefficients from T_ref.
    """

    name: str
    E: Property
    nu: Property
    alpha: Property
    T_ref: float
    flow: FlowLaws = ELASTIC

    @property
    def kind(self) -> int:
        """Return what its points can do (laws/law.py); 0 : elastic, neo-Hookean."""
        return self.flow.kind


@dataclass(frozen=True)
class Moduli:
    """Per cell: mu, kappa : (n_e,) [Pa].  e_th : (n_e, n_th) = 3 ln(1 + alpha (T - T_ref) + shrinkage (1 - f_s)).

    n_th is 1, or with enhanced strain the number of points, each of which has its own.
    p : (n_e,) parameters of points, records of POINT; (0,) where all cells are elastic.
    tables : (n_t,) hardening curves of all materials.  T : (n_nodes,) [K] they are of, for a volume that is given.
    """

    mu: Floats
    kappa: Floats
    e_th: Floats
    p: Points = field(default_factory=lambda: np.empty(0, POINT))
    tables: Floats = field(default_factory=lambda: np.empty(0))
    T: Floats | None = None

    @property
    def E(self) -> Floats:
        """Young's modulus (n_e,) [Pa]."""
        return 9.0 * self.kappa * self.mu / (3.0 * self.kappa + self.mu)


class MaterialRangeError(ArithmeticError):
    """A property left the range in which the material makes sense."""


def moduli(materials: tuple[SolidMaterial, ...], material_of: Index, T: Floats, f_s: Floats | None = None,
           inside: tuple[Floats, Floats | None] | None = None) -> Moduli:
    """Compute the moduli of cells at their mean temperature T : (n_e,) [K] and solid fraction f_s : (n_e,) [1].

    f_s : None : each melting material takes it from T.  material_of : (n_e,) index into materials.
    inside : T and f_s at the places of each cell that have a thermal strain, (n_e, n_th) each; None: the means.
    Raises MaterialRangeError naming material and temperature.
    """
    # fault: the points of a cell expand by its mean temperature -> warm, melted = T[:, None], None |
    #   mechanical_fmu/test_thermal_bending
    warm, melted = inside if inside is not None else (T[:, None], None if f_s is None else f_s[:, None])
    mu, kappa = np.empty_like(T), np.empty_like(T)
    flows = any(materials[i].kind for i in np.unique(material_of))
    p, start = np.zeros(len(T) if flows else 0, POINT), 0
    for i, material in enumerate(materials):
        here = material_of == i
        if here.any():
            solid = _solid_fraction(material, T[here], None if f_s is None else f_s[here])
            mu[here], kappa[here] = _elasticity(material, T[here], solid)
            if flows:
                p[here] = _parameters(material, T[here], solid, mu[here], start)
        # fault: curves of the second material read from the first's place -> start += 0 |
        #   mechanical_fmu/test_points_material
        start += material.flow.data.size
    tables = np.concatenate([m.flow.data for m in materials]) if flows else np.empty(0)
    return Moduli(mu, kappa, thermal_strain(materials, material_of, warm, melted), p, tables)


def thermal_strain(materials: Sequence[SolidMaterial], material_of: Index, T: Floats, f_s: Floats | None) -> Floats:
    """Compute e_th : (n_e, n_th) [1] of a Moduli, at T : (n_e, n_th) [K] and f_s : (n_e, n_th) [1] or None.

    material_of : (n_e,) index into materials.  Raises MaterialRangeError.
    """
    e_th = np.empty_like(T)
    for i in np.unique(material_of):
        here, material = material_of == i, materials[i]
        solid = _solid_fraction(material, T[here], None if f_s is None else f_s[here])
        e_th[here] = _expansion(material, T[here], solid)
    return e_th


def thermoelastic_heat(materials: Sequence[SolidMaterial], material_of: Index, T: Floats, kappa: Floats,
                       change: Floats) -> Floats:
    """Compute the heat of a step [J/m3 of reference volume]: - kappa T (de_th/dT) d(ln theta); compression heats.

    material_of : (n_e,) index into materials.  T : (n_e,) [K].  kappa : (n_e,) [Pa].  change : (n_e,) [1] of ln theta
    over the step.  The result is (n_e,).  The share in the elastic entropy of moduli that change with temperature, and
    what pressure does to melting, are left out.
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


def _refuse(material: SolidMaterial, T: Floats, value: Floats, what: str) -> None:
    if not (value > 0.0).all():
        at = T.flat[int(np.argmin(value))]
        raise MaterialRangeError(f"material {material.name}: {what} is {value.min():.6g} at {at:.6g} K")


def _expansion(material: SolidMaterial, T: Floats, solid: Floats | None) -> Floats:
    """e_th of one material at T, of any shape.  solid : likewise f_s, None where it does not melt."""
    stretch = 1.0 + material.alpha(T) * (T - material.T_ref)
    liquid = material.flow.liquid
    if liquid is not None and solid is not None:
        # fault: shrinkage with the wrong sign -> stretch = stretch + liquid.shrinkage * (solid - 1.0) |
        #   mechanical_fmu/test_points_melting
        # fault: a casting that shrinks by half of it -> stretch = stretch + 0.5 * liquid.shrinkage * (1.0 - solid) |
        #   scenarios/test_aluminium_can
        stretch = stretch + liquid.shrinkage * (1.0 - solid)
    _refuse(material, T, stretch, "the free stretch 1 + alpha (T - T_ref)")
    # fault: thermal strain once instead of three times -> return np.asarray(np.log(stretch)) |
    #   mechanical_fmu/test_elastic_patch
    return np.asarray(3.0 * np.log(stretch))


def _elasticity(material: SolidMaterial, T: Floats, solid: Floats | None) -> tuple[Floats, Floats]:
    """mu, kappa : (n,) of one material.  solid : (n,) f_s, None where it does not melt."""
    E, nu, liquid = material.E(T), material.nu(T), material.flow.liquid
    for value, what in ((E, "E"), (0.5 - nu, "1/2 - nu"), (1.0 + nu, "1 + nu")):
        _refuse(material, T, value, what)
    # fault: bulk modulus of plane stress -> kappa = E / (3.0 * (1.0 - nu)) | mechanical_fmu/test_elastic_cylinder
    kappa = E / (3.0 * (1.0 - 2.0 * nu))
    if liquid is not None and solid is not None:
        kappa = solid * kappa + (1.0 - solid) * liquid.bulk(T)
    return E / (2.0 * (1.0 + nu)), kappa


def _solid_fraction(material: SolidMaterial, T: Floats, f_s: Floats | None) -> Floats | None:
    if material.flow.liquid is None:
        return None
    return material.flow.liquid.solid_fraction(T) if f_s is None else np.clip(f_s, 0.0, 1.0)


def _parameters(material: SolidMaterial, T: Floats, solid: Floats | None, mu: Floats, start: int) -> Points:
    """(n,) parameters of one material."""
    if why := material.flow.refusal(T):
        raise MaterialRangeError(f"material {material.name}: {why}")
    p = np.zeros(len(T), POINT)
    p["shear_modulus"], p["solid_fraction"] = mu, 1.0 if solid is None else solid
    material.flow.fill(p, T, start)
    return p
