"""Exact temperatures of a slab 0 <= x <= 1, k = rho c = 1, insulated at x = 0, at 0 everywhere when t = 0.

What acts at x = 1 (or inside) is named by the function.  With l_n = (n + 1/2) pi, and b_n the roots of b tan b = 1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq
from scipy.special import erfc

Floats = np.ndarray
TERMS = np.arange(60)  # enough for t >= .001: the last one is below exp(-30)
L_N = (TERMS + 0.5) * np.pi
SIGN = (-1.0) ** TERMS
B_N = np.array([brentq(lambda b: b * np.sin(b) - np.cos(b), n * np.pi + 1e-9, (n + 0.5) * np.pi) for n in TERMS])
C_N = 4.0 * np.sin(B_N) / (2.0 * B_N + np.sin(2.0 * B_N))


def _sum(weights: Floats, roots: Floats, x: Floats, t: float) -> Floats:
    """sum_n w_n cos(r_n x) exp(-r_n^2 t)."""
    return np.cos(np.outer(x, roots)) @ (weights * np.exp(-(roots**2) * t))


def step(x: Floats, t: float) -> Floats:
    """T(1, t) = 1."""
    return 1.0 - 2.0 * _sum(SIGN / L_N, L_N, x, t)


def flux(x: Floats, t: float) -> Floats:
    """A flux of 1 enters at x = 1."""
    n = TERMS[1:]
    return t + (3.0 * x**2 - 1.0) / 6.0 - 2.0 / np.pi**2 * _sum(SIGN[1:] / n**2, np.pi * n, x, t)


def convection(x: Floats, t: float) -> Floats:
    """h = 1 to an ambient of 1."""
    return 1.0 - _sum(C_N, B_N, x, t)


def generation(x: Floats, t: float) -> Floats:
    """Q_T = 1, T(1, t) = 0."""
    return 0.5 * (1.0 - x**2) - 2.0 * _sum(SIGN / L_N**3, L_N, x, t)


def growth(x: Floats, t: float) -> Floats:
    """T(1, t) = exp(.1 t)."""
    root = np.sqrt(0.1)
    return np.exp(0.1 * t) * np.cosh(root * x) / np.cosh(root) - 2.0 * _sum(SIGN * L_N / (L_N**2 + 0.1), L_N, x, t)


def root_flux(x: Floats, t: float) -> Floats:
    """A flux of 1/sqrt t enters at x = 1: its transform is sqrt(pi) cosh(sqrt(s) x)/(s sinh(sqrt s))."""
    n, size = 2.0 * TERMS + 1.0, 2.0 * np.sqrt(t)
    return np.sqrt(np.pi) * sum(erfc((m - x) / size) + erfc((m + x) / size) for m in n)


def ramp(x: Floats, t: float) -> Floats:
    """h = 1 to an ambient of t: the integral over time of `convection`."""
    return t + 0.5 * x**2 - 1.5 + _sum(C_N / B_N**2, B_N, x, t)


EXACT: dict[str, Callable[[Floats, float], Floats]] = {
    "3.1": step, "3.2": flux, "3.3": convection, "3.4a": generation, "3.5": growth, "3.6": root_flux, "3.7": ramp}
