"""Heat of a substep by mechanism: the terms of a run's heat balance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermal_fmu.boundary import TERMS
from thermal_fmu.problem import Model

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Heat:
    """Energies INTO the bodies [J], weighted with the stages the method used.

    stored : (n_bodies,) increase of enthalpy, from where it is stored: quadrature points, nodes of what melts.
    temperature : (2,) through prescribed temperatures, in at some nodes and out (< 0) at others, from the residual
    there: a net sum would be round-off where as much comes in as goes out.  terms : (n_terms,) as boundary.TERMS.
    """

    stored: Floats
    temperature: Floats
    terms: Floats

    def __add__(self, other: Heat) -> Heat:
        return Heat(self.stored + other.stored, self.temperature + other.temperature,
                    self.terms + other.terms)

    def outputs(self, model: Model) -> dict[str, float]:
        """Return the outputs heat.* by name: the terms that the scene can have."""
        named = {f"heat.stored.{body.name}": float(J) for body, J in zip(model.bodies, self.stored, strict=True)}
        for direction, J in zip(("in", "out"), self.temperature, strict=True):
            named[f"heat.temperature.{direction}"] = float(J)
        possible = terms_of(model)
        return named | {f"heat.{name}": float(J) for name, J in zip(TERMS, self.terms, strict=True) if name in possible}


def inflow_outflow(through: Floats) -> Floats:
    """Return (2,) the sums of positive and of negative values [J] of through : (n,) [J]."""
    return np.array([through[through > 0.0].sum(), through[through < 0.0].sum()])


def no_heat(n_bodies: int) -> Heat:
    """Return the heat before the first step: zeros."""
    return Heat(np.zeros(n_bodies), np.zeros(2), np.zeros(len(TERMS)))


def terms_of(model: Model) -> frozenset[str]:
    """Return those of boundary.TERMS that a scene can have."""
    near = any(pair is not None and pair.emissivities is not None for pair in model.pairs)
    possible = {"radiation": bool(model.radiators), "near_radiation": near, "friction": bool(model.pairs)}
    return frozenset(name for name in TERMS if possible.get(name.partition(".")[0], True))


def names_of(model: Model) -> tuple[str, ...]:
    """Return the names of the outputs heat.*"""
    return tuple(no_heat(len(model.bodies)).outputs(model))
