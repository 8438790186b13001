"""Material functions of temperature, ready for the inner loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PPoly

from contact.half.property import Property, property_from

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """A Property with its derivative and integral made once, not at every call."""

    source: Property
    first: PPoly | None
    primitive: PPoly | None

    @property
    def is_constant(self) -> bool:
        """True where nothing depends on temperature."""
        return self.source.is_constant

    def value(self, T: Floats) -> Floats:
        """Value at T : any shape [K]."""
        return self.source(T)

    def slope(self, T: Floats) -> Floats:
        """Derivative by temperature at T : any shape [K]; 0 beyond a table."""
        if self.first is None:
            return np.zeros(T.shape)
        inside = (self.source.low <= T) & (self.source.high >= T)
        return np.where(inside, self.first(np.clip(T, self.source.low, self.source.high)), 0.0)

    def increase(self, T0: Floats, T: Floats) -> Floats:
        """Integral from T0 to T : same shape [K].  For a constant the difference is taken before the product."""
        if self.primitive is None or self.source.curve is None:
            assert self.source.constant is not None
            return self.source.constant * (T - T0)
        return self._integral(T) - self._integral(T0)

    def _integral(self, T: Floats) -> Floats:
        assert self.primitive is not None
        assert self.source.curve is not None
        inner = np.clip(T, self.source.low, self.source.high)
        total: Floats = self.primitive(inner)
        outside = T - inner
        if outside.any():
            total = total + outside * self.source.curve(inner)
        return total


def positive_curve(spec: float | Mapping[str, Any]) -> Curve:
    """A Curve from the PROPERTY form of model.json.  Raises ValueError where a number or table is not positive.

    A polynomial cannot be checked here: the step that meets a value <= 0 is discarded.
    """
    source = property_from(spec)
    if source.curve is None:
        if source.constant is None or not (np.isfinite(source.constant) and source.constant > 0):
            raise ValueError(f"must be positive, not {source.constant}")
        return Curve(source, None, None)
    if isinstance(spec, Mapping) and "value" in spec and not (np.asarray(spec["value"], dtype=float) > 0).all():
        raise ValueError(f"must be positive everywhere, not {spec['value']}")
    return Curve(source, source.curve.derivative(), source.curve.antiderivative())


@dataclass(frozen=True)
class Material:
    """rho : reference density [kg/m3].  k : conductivity [W/mK].  c : heat capacity [J/kgK]."""

    rho: float
    k: Curve
    c: Curve
