"""The heat of a substep by mechanism: what the ledger of a run is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.boundary import TERMS

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Heat:
    """Energies INTO the bodies [J], weighted with the stages the method used.

    stored : (n_bodies,) increase of enthalpy, from quadrature points.  temperature : through prescribed temperatures,
    from the residual at their nodes.  terms : in the order of boundary.TERMS.
    """

    stored: Floats
    temperature: float
    terms: Floats

    def __add__(self, other: Heat) -> Heat:
        return Heat(self.stored + other.stored, self.temperature + other.temperature,
                    self.terms + other.terms)

    def outputs(self, bodies: Sequence[str]) -> dict[str, float]:
        """By the names of the outputs heat.*"""
        named = {f"heat.stored.{body}": float(J) for body, J in zip(bodies, self.stored, strict=True)}
        named["heat.temperature"] = self.temperature
        return named | {f"heat.{name}": float(J) for name, J in zip(TERMS, self.terms, strict=True)}


def no_heat(n_bodies: int) -> Heat:
    """Nothing has flowed yet."""
    return Heat(np.zeros(n_bodies), 0.0, np.zeros(len(TERMS)))


def names_of(bodies: Sequence[str]) -> tuple[str, ...]:
    """The names of the outputs heat.*"""
    return tuple(no_heat(len(bodies)).outputs(bodies))
