"""Melting: one unknown s a node that gives both temperature and phase, so that no step loses latent heat.

At a temperature of phase change T alone does not say how much has melted.  The nodal unknown of a body that melts is
therefore s [K], along which T, f_s and the enthalpy h are explicit and never turn back:

    solid   s <= T_s            T = s
    mush    s - T_s in [0, W]   phi = (s - T_s)/W,  T = T_s + phi (T_l - T_s),  f_s = 1 - phi
    liquid  s >= T_s + W        T = s - W + T_l - T_s

with h = int c_s dT, then + L phi + int (f_s c_s + (1 - f_s) c_l) dT, then + int c_l dT.  T_s = T_l is the isothermal
case: T rests while s crosses the width W = T_l - T_s + L/c_s(T_s).  Everywhere else s is T, the same array.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import factorial

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property

Floats = NDArray[np.float64]

BLUR_SLOPE = 0.5  # dT/ds of the blurred law: between 0, the mush of a pure metal, and 1, a body that does not melt
LEAST_SLOPE = 1e-3  # of dT/ds in the matrix of a steady state


@dataclass(frozen=True)
class PhaseChange:
    """Melting and freezing of a material.

    L : latent heat [J/kg].  T_s, T_l : solidus and liquidus [K].  solid, liquid : their heat capacity [J/kgK].
    """

    L: float
    T_s: float
    T_l: float
    solid: Property
    liquid: Property

    @cached_property
    def W(self) -> float:
        """Width of the mush in s [K]; with it dh/ds is about c_s there, without a cliff in the residual."""
        return self.T_l - self.T_s + self.L / float(self.solid(np.array(self.T_s)))

    @cached_property
    def mush(self) -> Property:
        """f_s c_s + (1 - f_s) c_l between T_s and T_l [J/kgK]."""
        return blend(self.solid, self.liquid, self.T_s, self.T_l)

    def temperature(self, s: Floats) -> Floats:
        """Return T : (m,) [K] at s : (m,) [K]."""
        mushy = self.T_s + self._phi(s) * (self.T_l - self.T_s)
        return np.where(s <= self.T_s, s, np.where(s < self.T_s + self.W, mushy, s - self._shift))

    def temperature_slope(self, s: Floats) -> Floats:
        """Return dT/ds : (m,) [1] at s : (m,) [K]."""
        return np.where(self._mushy(s), (self.T_l - self.T_s) / self.W, 1.0)

    def solid_fraction(self, s: Floats) -> Floats:
        """Return f_s : (m,) [1] at s : (m,) [K]."""
        return 1.0 - self._phi(s)

    def solid_fraction_slope(self, s: Floats) -> Floats:
        """Return df_s/ds : (m,) [1/K] at s : (m,) [K]."""
        return np.where(self._mushy(s), -1.0 / self.W, 0.0)

    def unknown(self, T: Floats) -> Floats:
        """Return s : (m,) [K] at T : (m,) [K].  What is exactly at T_s = T_l counts as liquid."""
        phi = (T - self.T_s) / (self.T_l - self.T_s) if self.T_l > self.T_s else np.zeros(np.shape(T))
        return np.where(self.T_l <= T, T + self._shift, np.where(self.T_s >= T, T, self.T_s + phi * self.W))

    def increase(self, s0: Floats, s: Floats) -> Floats:
        """Return h(s) - h(s0) [J/kg] of s0, s : (m,) [K], phase by phase, so that the increases of a path add up."""
        low0, low = np.minimum(s0, self.T_s), np.minimum(s, self.T_s)
        high0, high = (np.maximum(v - self._shift, self.T_l) for v in (s0, s))
        phi0, phi = self._phi(s0), self._phi(s)
        span = self.T_l - self.T_s
        # fault: latent heat twice -> dh = self.solid.increase(low0, low) + self.liquid.increase(high0, high) + 2.0 *
        #   self.L * (phi - phi0) | thermal_fmu/test_thermal_phase::test_a9_no_step_loses_latent_heat
        dh = self.solid.increase(low0, low) + self.liquid.increase(high0, high) + self.L * (phi - phi0)
        return dh + self.mush.increase(self.T_s + phi0 * span, self.T_s + phi * span) if span > 0.0 else dh

    def capacity(self, s: Floats) -> Floats:
        """Return dh/ds : (m,) [J/kgK] at s : (m,) [K]."""
        T, slope = self.temperature(s), self.temperature_slope(s)
        mushy = self.L / self.W + (slope * self.mush(T) if self.T_l > self.T_s else 0.0)
        return np.where(self._mushy(s), mushy, np.where(s <= self.T_s, self.solid(T), self.liquid(T)))

    @cached_property
    def _shift(self) -> float:
        return self.W - (self.T_l - self.T_s)

    def _phi(self, s: Floats) -> Floats:
        return np.clip((s - self.T_s) / self.W, 0.0, 1.0)

    def _mushy(self, s: Floats) -> NDArray[np.bool_]:
        return (s > self.T_s) & (s < self.T_s + self.W)


@dataclass(frozen=True)
class Melting:
    """One body that melts.  nodes : (m,) of the body."""

    nodes: NDArray[np.intp]
    change: PhaseChange


@dataclass(frozen=True)
class NodalFields:
    """What nodal s stands for.

    T : (n,) [K].  f_s [1], dT = dT/ds [1], df = df_s/ds [1/K] : (n,) where a body melts, else None (then s is T).
    """

    T: Floats
    f_s: Floats | None = None
    dT: Floats | None = None
    df: Floats | None = None


def melting_of(node_body: NDArray[np.integer], changes: Sequence[PhaseChange | None]) -> tuple[Melting, ...]:
    """List the bodies that melt.

    node_body : (n,) body of each node.  changes : the phase change of each body, or None.
    """
    return tuple(Melting(np.flatnonzero(node_body == b), change)
                 for b, change in enumerate(changes) if change is not None)


def temperature(melting: Sequence[Melting], s: Floats) -> Floats:
    """Return T : (n,) [K] of s : (n,) [K]; s itself, the same array, where nothing melts."""
    if not melting:
        return s
    T = s.copy()
    for body in melting:
        T[body.nodes] = body.change.temperature(s[body.nodes])
    return T


def unknown(melting: Sequence[Melting], T: Floats) -> Floats:
    """Return s : (n,) [K] of T : (n,) [K]; T itself, the same array, where nothing melts."""
    if not melting:
        return T
    s = T.copy()
    for body in melting:
        s[body.nodes] = body.change.unknown(T[body.nodes])
    return s


def solid_fraction(melting: Sequence[Melting], s: Floats) -> Floats:
    """Return f_s : (n,) [1] of s : (n,) [K]; 1 in bodies that do not melt."""
    f_s = np.ones(s.size)
    for body in melting:
        f_s[body.nodes] = body.change.solid_fraction(s[body.nodes])
    return f_s


def prescribe(melting: Sequence[Melting], s: Floats, T: Floats, fixed: NDArray[np.bool_]) -> Floats:
    """Put the temperatures T : (n,) [K] into s : (n,) [K] at fixed nodes; return T itself where nothing melts.

    fixed : (n,) True at fixed nodes.  Where nothing melts T must be s but for the fixed nodes.
    """
    return np.where(fixed, unknown(melting, T), s) if melting else T


def fields(melting: Sequence[Melting], s: Floats) -> NodalFields:
    """Evaluate T and f_s with their derivatives at s : (n,) [K]."""
    if not melting:
        return NodalFields(s)
    dT, df = np.ones(s.size), np.zeros(s.size)
    for body in melting:
        own = s[body.nodes]
        dT[body.nodes] = body.change.temperature_slope(own)
        df[body.nodes] = body.change.solid_fraction_slope(own)
    return NodalFields(temperature(melting, s), solid_fraction(melting, s), dT, df)


def blurred(melting: Sequence[Melting], at: NodalFields, s: Floats, blur: float,
            fixed: NDArray[np.bool_]) -> NodalFields:
    """Replace T by (1 - blur) T + blur (T_s + BLUR_SLOPE (s - T_s - W/2)) at free nodes that melt.

    s : (n,) [K].  fixed : (n,) True at fixed nodes.  At blur = 1 no melting is left in T(s), at 0 all of it is: a path
    that
    Newton's method can follow (phase continuation).
    """
    assert at.dT is not None
    T, dT = at.T.copy(), at.dT.copy()
    for body in melting:
        nodes, change = body.nodes[~fixed[body.nodes]], body.change
        line = change.T_s + BLUR_SLOPE * (s[nodes] - change.T_s - 0.5 * change.W)
        T[nodes] += blur * (line - T[nodes])
        dT[nodes] += blur * (BLUR_SLOPE - dT[nodes])
    return replace(at, T=T, dT=dT)


def sloped(at: NodalFields) -> NodalFields:
    """Keep dT/ds >= LEAST_SLOPE, for a steady matrix: without storage a melting point makes it singular."""
    return at if at.dT is None else replace(at, dT=np.maximum(at.dT, LEAST_SLOPE))


def between(start: NodalFields, end: NodalFields, theta: float) -> NodalFields:
    """Return start + theta (end - start), with the derivatives of the end: those of the fields themselves lack a theta.
    """
    T = (1.0 - theta) * start.T + theta * end.T
    if start.f_s is None or end.f_s is None:
        return NodalFields(T)
    return NodalFields(T, (1.0 - theta) * start.f_s + theta * end.f_s, end.dT, end.df)


def blend(solid: Property, liquid: Property, T_s: float, T_l: float) -> Property:
    """Return (1 - phi) solid + phi liquid, phi = (T - T_s)/(T_l - T_s), as one piecewise polynomial on [T_s, T_l]."""
    if solid is liquid:
        return solid
    ends = np.concatenate([[] if p.curve is None else p.curve.x for p in (solid, liquid)])
    knots = np.unique(np.concatenate([[T_s, T_l], ends[(ends > T_s) & (ends < T_l)]]))
    pieces = []
    for at in knots[:-1]:
        phi = np.array([(at - T_s), 1.0]) / (T_l - T_s)
        a, b = (np.convolve(taylor(p, at), q) for p, q in ((solid, [1.0 - phi[0], -phi[1]]), (liquid, phi)))
        size = max(a.size, b.size)
        pieces.append(np.pad(a, (0, size - a.size)) + np.pad(b, (0, size - b.size)))
    size = max(p.size for p in pieces)
    rows = np.array([np.pad(p, (0, size - p.size)) for p in pieces]).T[::-1]
    from scipy.interpolate import PPoly  # 0.1 s, and most scenes do not melt

    return Property(None, PPoly(np.ascontiguousarray(rows), knots), T_s, T_l)


def taylor(p: Property, T: float) -> Floats:
    """Return (k,) coefficients of p in powers of the distance above T [K], lowest first."""
    if p.curve is None or not p.low <= T < p.high:
        return p(np.array([T]))
    return np.array([float(p.curve(T, k)) / factorial(k) for k in range(len(p.curve.c))])
