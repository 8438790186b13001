"""Thermal material: what model.json says of it, checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.checks import keys, made, number
from contact.half.property import Property, positive_property
from thermal_fmu.phase import PhaseChange

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Phased:
    """f_s solid(T) + (1 - f_s) liquid(T); without a change on melting both are the same object."""

    solid: Property
    liquid: Property

    @property
    def is_one(self) -> bool:
        """True where both phases share one property."""
        return self.solid is self.liquid

    @property
    def is_constant(self) -> bool:
        """True where neither temperature nor phase changes the value."""
        return self.is_one and self.solid.is_constant

    def __call__(self, T: Floats, f_s: Floats | None = None) -> Floats:
        """Value at T : any shape [K] and f_s : same shape (None: solid)."""
        if self.is_one or f_s is None:
            return self.solid(T)
        # fault: the liquid conducts like the solid -> return self.solid(T) |
        #   thermal_fmu/test_thermal_phase::test_a9_two_phases
        return f_s * self.solid(T) + (1.0 - f_s) * self.liquid(T)

    def slope(self, T: Floats, f_s: Floats | None = None) -> Floats:
        """Derivative by T."""
        if self.is_one or f_s is None:
            return self.solid.slope(T)
        return f_s * self.solid.slope(T) + (1.0 - f_s) * self.liquid.slope(T)

    def phase_slope(self, T: Floats) -> Floats:
        """Derivative by f_s."""
        return np.zeros(np.shape(T)) if self.is_one else self.solid(T) - self.liquid(T)


@dataclass(frozen=True)
class Conductivity:
    """k [W/mK]: k_1 along axis 1, k_2 across it (None: isotropic).

    angle : of axis 1 to x in the reference [rad].  turns : whether the axes follow the rotation of the material.
    """

    k_1: Phased
    k_2: Phased | None = None
    angle: float = 0.0
    turns: bool = False

    @property
    def is_plain(self) -> bool:
        """True where one function of T says all."""
        return self.k_2 is None and self.k_1.is_one

    @property
    def is_constant(self) -> bool:
        """True where neither temperature nor phase changes it."""
        return self.k_1.is_constant and (self.k_2 is None or self.k_2.is_constant)


@dataclass(frozen=True)
class Material:
    """rho : reference density [kg/m3].  k : conductivity [W/mK].  c : heat capacity [J/kgK].

    phase : the change of phase, None where the material does not melt.
    """

    rho: float
    k: Conductivity
    c: Phased
    phase: PhaseChange | None = None

    def effusivity(self, T: Floats, f_s: Floats | None = None) -> Floats:
        """sqrt(k rho c) [J/(m2 K s^1/2)] at T : any shape [K]; k is the mean of the axes."""
        k = self.k.k_1(T, f_s)
        if self.k.k_2 is not None:
            k = 0.5 * (k + self.k.k_2(T, f_s))
        return np.asarray(np.sqrt(k * self.rho * self.c(T, f_s)))


def parse_material(spec: Any, where: str) -> Material:
    """The material of model.json at `where`.  Raises ValueError naming the key, the value and what would do."""
    keys(spec, where, {"rho", "k", "c"}, {"latent"})
    melts = "latent" in spec
    k = _conductivity(spec["k"], f"{where}.k", melts)
    c = _phased(spec["c"], f"{where}.c", "heat capacity", melts)
    rho = number(spec["rho"], f"{where}.rho", 0.0)
    return Material(rho, k, c, _latent(spec["latent"], f"{where}.latent", c) if melts else None)


def _conductivity(spec: Any, where: str, melts: bool) -> Conductivity:
    if not isinstance(spec, Mapping) or not {"k_1", "k_2", "angle", "turns"} & set(spec):
        return Conductivity(_phased(spec, where, "conductivity", melts))
    keys(spec, where, {"k_1", "k_2", "angle", "turns"})
    if not isinstance(spec["turns"], bool):
        raise ValueError(f"model.json: {where}.turns must be true or false, not {spec['turns']!r}")
    return Conductivity(_phased(spec["k_1"], f"{where}.k_1", "conductivity", melts),
                        _phased(spec["k_2"], f"{where}.k_2", "conductivity", melts),
                        number(spec["angle"], f"{where}.angle"), spec["turns"])


def _phased(spec: Any, where: str, what: str, melts: bool) -> Phased:
    if not isinstance(spec, Mapping) or not {"solid", "liquid"} & set(spec):
        one = _property(spec, where, what)
        return Phased(one, one)
    keys(spec, where, {"solid", "liquid"})
    if not melts:
        raise ValueError(f"model.json: {where} has a solid and a liquid, but the material has no 'latent' "
                         "(L, T_s, T_l) that says when it melts")
    return Phased(_property(spec["solid"], f"{where}.solid", what), _property(spec["liquid"], f"{where}.liquid", what))


def _property(spec: Any, where: str, what: str) -> Property:
    return made(lambda value: positive_property(value, what), spec, where)


def _latent(spec: Any, where: str, c: Phased) -> PhaseChange:
    keys(spec, where, {"L", "T_s", "T_l"})
    L = number(spec["L"], f"{where}.L", 0.0)
    T_s, T_l = (number(spec[key], f"{where}.{key}") for key in ("T_s", "T_l"))
    if T_s > T_l:
        raise ValueError(f"model.json: {where}: T_s <= T_l is needed (equal: one melting point), not {T_s}, {T_l}")
    if not c.solid(np.array(T_s)) > 0.0:
        raise ValueError(f"model.json: {where[:-len('.latent')]}.c is not positive at T_s = {T_s:g} K")
    return PhaseChange(L, T_s, T_l, c.solid, c.liquid)
