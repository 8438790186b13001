"""Thermoelastic material: what a cell needs to know of it at its temperature."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from contact.half.property import Property
from mechanical_fmu.points import N_P

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Material:
    """Compressible neo-Hookean, E : [Pa], nu : [1], alpha : [1/K] the SECANT coefficient from T_ref [K].

    alpha (T - T_ref) is the whole free stretch less one, so a table of alpha is of mean coefficients from T_ref.
    """

    name: str
    E: Property
    nu: float
    alpha: Property
    T_ref: float

    @property
    def kind(self) -> int:
        """What its points do (points.py); 0 : elastic, neo-Hookean."""
        return 0


@dataclass(frozen=True)
class Moduli:
    """Per cell: mu, kappa : (n_e,) [Pa]; e_th : (n_e,) = 3 ln(1 + alpha (T - T_ref)).

    p : (n_e, N_P) parameters of inelastic points (points.py), (0, N_P) where all cells are elastic.
    tables : (n_t,) their hardening curves.
    """

    mu: Floats
    kappa: Floats
    e_th: Floats
    p: Floats = field(default_factory=lambda: np.empty((0, N_P)))
    tables: Floats = field(default_factory=lambda: np.empty(0))


class MaterialRangeError(ArithmeticError):
    """A property left the range in which the material makes sense."""


def moduli(materials: tuple[Material, ...], material_of: NDArray[np.intp], T: Floats) -> Moduli:
    """Moduli of cells at their mean temperature T : (n_e,) [K].

    material_of : (n_e,) index into materials.  Raises MaterialRangeError naming material and temperature.
    """
    mu, kappa, e_th = np.empty_like(T), np.empty_like(T), np.empty_like(T)
    for i, material in enumerate(materials):
        here = material_of == i
        E, stretch = material.E(T[here]), 1.0 + material.alpha(T[here]) * (T[here] - material.T_ref)
        for value, what in ((E, "E"), (stretch, "the free stretch 1 + alpha (T - T_ref)")):
            if (value <= 0.0).any():
                at = T[here][int(np.argmin(value))]
                raise MaterialRangeError(f"material {material.name}: {what} is {value.min():.6g} at {at:.6g} K")
        mu[here] = E / (2.0 * (1.0 + material.nu))
        kappa[here] = E / (3.0 * (1.0 - 2.0 * material.nu))
        e_th[here] = 3.0 * np.log(stretch)
    return Moduli(mu, kappa, e_th)
