"""All laws of flow in one place: a law is a file of this folder and a row here.

HARDENING and CREEP give each law its number; POINT is the record of a point's parameters; `flow_stress` and the three
functions of creep are what compiled code calls, whichever law a point has.
"""

from __future__ import annotations

import numpy as np

from contact.compiled import inner, one_of
from contact.problem.flow import Plastic
from mechanical_fmu.laws.creep import NortonLaw, PowerLaw
from mechanical_fmu.laws.hardening import KinematicLaw, LinearLaw, OverstressLaw, TableLaw, VoceLaw
from mechanical_fmu.laws.law import CreepLaw, Floats, IsotropicHardening, Point
from mechanical_fmu.laws.liquid import LiquidLaw

HARDENING: tuple[type[IsotropicHardening], ...] = (LinearLaw, VoceLaw, TableLaw)
CREEP: tuple[type[CreepLaw], ...] = (NortonLaw, PowerLaw)
# Laws that the return mapping knows by itself: there is one of each.
OTHERS = (KinematicLaw, OverstressLaw, LiquidLaw)

# Every point has the shear modulus G [Pa], the solid fraction and the numbers of its laws; plastic_heat : fraction of
# the plastic work that becomes heat.
_FIELDS: dict[str, type] = {"shear_modulus": float, "solid_fraction": float, "hardening": int, "creep": int,
                            "plastic_heat": float}
for _of_law in (*(law.FIELDS for law in HARDENING), *(law.FIELDS for law in CREEP), *(law.FIELDS for law in OTHERS)):
    _FIELDS |= _of_law
POINT = np.dtype((np.record, np.dtype(list(_FIELDS.items()), align=True)))

_CREEP_KERNELS = tuple(dict.fromkeys(law.KERNELS for law in CREEP))

_flow_stress = one_of([law.FLOW_STRESS for law in HARDENING])
_relaxed = one_of([kernels.relaxed for kernels in _CREEP_KERNELS])
_strain = one_of([kernels.strain for kernels in _CREEP_KERNELS])
_exponent = one_of([kernels.exponent for kernels in _CREEP_KERNELS])


def hardening_law(stated: Plastic) -> IsotropicHardening:
    """Make the hardening of a material; where none is stated the flow stress stays, which is linear with H = 0."""
    by_name = {law.NAME: law for law in HARDENING}
    return by_name["linear" if stated.hardening is None else stated.hardening.law].made(stated)


def hardening_number(law: IsotropicHardening) -> int:
    """Give the number compiled code knows a hardening law by."""
    return HARDENING.index(type(law))


def creep_number(law: CreepLaw) -> int:
    """Give the number compiled code knows a creep law by."""
    return _CREEP_KERNELS.index(law.KERNELS)


@inner
def flow_stress(p: Point, tables: Floats, e: float) -> tuple[float, float]:
    """Compute R [Pa], not below 0, and dR/de [Pa] at the plastic equivalent strain e >= 0.

    tables : (n_t,) hardening curves of all materials, strains [1], stresses and slopes [Pa].
    """
    R, slope = _flow_stress(p.hardening, p, tables, e)
    if R < 0.0:
        return 0.0, 0.0
    return R, slope


@inner
def creep_relaxed(p: Point, Q: float, dt: float) -> tuple[float, float]:
    """Compute q [Pa] at the end of a step of dt [s] and the creep strain made, from the trial stress Q > 0 [Pa]."""
    return _relaxed(p.creep, p, Q, dt)


@inner
def creep_strain(p: Point, q: float, dt: float) -> float:
    """Compute the creep strain of a step of dt [s] that ends at q [Pa]."""
    return _strain(p.creep, p, q, dt)


@inner
def creep_exponent(p: Point, q: float) -> float:
    """Compute d ln(creep rate) / d ln(q) at q [Pa]."""
    return _exponent(p.creep, p, q)
