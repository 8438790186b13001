"""Thermal material."""

from __future__ import annotations

from dataclasses import dataclass

from contact.half.property import Property


@dataclass(frozen=True)
class Material:
    """rho : reference density [kg/m3].  k : conductivity [W/mK].  c : heat capacity [J/kgK]."""

    rho: float
    k: Property
    c: Property
