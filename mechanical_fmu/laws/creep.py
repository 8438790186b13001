"""Creep, Norton's de_c/dt = A q^n exp(-Q/(R T)), over one step, fully implicit, at any length of step.

The creep equivalent strain grows at A q^n, A = exp(creep_log_factor).  Over a step from the trial stress Q, with q at
its end:
    q + 3 G dt A q^n = Q.
With q = Q exp(v) and c = 3 G dt A Q^(n-1): log(exp(v) + c exp(n v)) = 0, convex and of a slope between 1 and n, so
Newton's method from the right converges from any start; c may be 1e-300 or 1e300.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from contact.compiled import inner
from contact.half.functions import Property
from mechanical_fmu.laws.law import CreepKernels, CreepLaw, Fields, Floats, Point, Points, lowest

GAS_CONSTANT = 8.31446261815324  # J/mol K, exact since 2019
# Newton's method converges quadratically from any start; more than some ten iterations have never been needed.
MAX_CREEP_ITERATIONS = 100
# exp() of more overflows.
MAX_EXPONENT = 700.0


@inner
def relaxed(p: Point, Q: float, dt: float) -> tuple[float, float]:
    """Compute q [Pa] at the end of a step of dt [s] and the creep strain made, from the trial stress Q > 0 [Pa]."""
    G, n = p.shear_modulus, p.creep_exponent
    # fault: creep strain of a whole step at twice the rate -> lc = np.log(6.0 * G) + np.log(dt) + p.creep_log_factor +
    #   (n - 1.0) * np.log(Q) | mechanical_fmu/test_points_flow mechanical_fmu/test_points_verification
    lc = np.log(3.0 * G) + np.log(dt) + p.creep_log_factor + (n - 1.0) * np.log(Q)
    v = -max(lc, 0.0) / n
    for _ in range(MAX_CREEP_ITERATIONS):
        other = lc + n * v
        top = max(v, other)
        here, there = np.exp(v - top), np.exp(other - top)
        step = (top + np.log(here + there)) * (here + there) / (here + n * there)
        v -= step
        if not abs(step) > 1e-15 * max(1.0, abs(v)):
            break
    return Q * np.exp(v), Q / (3.0 * G) * np.exp(min(lc + n * v, MAX_EXPONENT))


@inner
def strain(p: Point, q: float, dt: float) -> float:
    """Compute the creep strain of a step of dt [s] that ends at q [Pa]."""
    if q <= 0.0 or dt <= 0.0:
        return 0.0
    return np.exp(min(np.log(dt) + p.creep_log_factor + p.creep_exponent * np.log(q), MAX_EXPONENT))


@inner
def exponent(p: Point, q: float) -> float:
    """Return d ln(rate) / d ln(q) at q [Pa], the same at any q."""
    return p.creep_exponent


@dataclass(frozen=True)
class NortonLaw(CreepLaw):
    """de_c/dt = A q^n exp(-Q/(R T)), A : [1/(Pa^n s)], Q : [J/mol].  heat : fraction of its work that becomes heat."""

    A: Property
    n: float
    Q: float = 0.0
    heat: float = 1.0

    FIELDS: ClassVar[Fields] = {"creep_log_factor": float, "creep_exponent": float, "creep_heat": float}
    KERNELS: ClassVar = CreepKernels(relaxed, strain, exponent)

    def fill(self, p: Points, T: Floats) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K]."""
        with np.errstate(divide="ignore"):
            # A = 0 : log = -inf, which creeps nothing.
            # fault: Arrhenius with the wrong sign -> p["creep_log_factor"] = np.log(self.A(T)) + (self.Q /
            #   (GAS_CONSTANT * T) if self.Q else 0.0) | mechanical_fmu/test_points_flow
            p["creep_log_factor"] = np.log(self.A(T)) - (self.Q / (GAS_CONSTANT * T) if self.Q else 0.0)
        p["creep_exponent"], p["creep_heat"] = self.n, self.heat

    def refusal(self, T: Floats) -> str:
        """Say what is wrong with the law at T : (n,) [K], or ""."""
        if (self.A(T) < 0.0).any():
            return f"the creep factor A is {lowest(self.A(T), T)}"
        return "its creep needs temperatures above 0 K" if self.Q and (T <= 0.0).any() else ""


# Superplastic flow, q = K (de_c/dt)^m: Norton's law stated from the stress's side, A = K^(-1/m) and n = 1/m.

@dataclass(frozen=True)
class PowerLaw(CreepLaw):
    """q = K (de_c/dt)^m, K : [Pa s^m], 0 < m <= 1.  heat : fraction of its work that becomes heat."""

    K: Property
    m: float
    heat: float = 1.0

    FIELDS: ClassVar[Fields] = NortonLaw.FIELDS
    KERNELS: ClassVar = NortonLaw.KERNELS

    def fill(self, p: Points, T: Floats) -> None:
        """Fill the FIELDS of p : (n,) at T : (n,) [K]."""
        p["creep_log_factor"], p["creep_exponent"] = -np.log(self.K(T)) / self.m, 1.0 / self.m
        p["creep_heat"] = self.heat

    def refusal(self, T: Floats) -> str:
        """Say what is wrong with the law at T : (n,) [K], or ""."""
        low = self.K(T)
        return f"the factor K of its flow is {lowest(low, T)}" if (low <= 0.0).any() else ""
