"""Properties: material data as a function of temperature, with derivative and exact integral."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator, PPoly

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Property:
    """A function of temperature T [K]: constant, polynomial or monotone cubic table, one piecewise polynomial inside.

    Beyond its table a property keeps the value of the table's end.
    """

    constant: float | None
    curve: PPoly | None = None
    low: float = -np.inf
    high: float = np.inf

    def __call__(self, T: Array) -> Array:
        """Value at T : any shape [K]."""
        if self.curve is None:
            return np.full(np.shape(T), self.constant)
        return np.asarray(self.curve(np.clip(T, self.low, self.high)))

    def slope(self, T: Array) -> Array:
        """Derivative by temperature at T : any shape [K]; 0 beyond a table."""
        if self.curve is None:
            return np.zeros(np.shape(T))
        inside = (self.low <= T) & (self.high >= T)
        return np.where(inside, self._derivative(np.clip(T, self.low, self.high)), 0.0)

    def increase(self, T0: Array, T: Array) -> Array:
        """Exact integral over temperature from T0 to T : same shape [K].

        One antiderivative serves every temperature, so the increases of a path add up to that of its ends.  For a
        constant the difference is taken before the product: no round-off of large temperatures.
        """
        if self.curve is None:
            assert self.constant is not None
            return self.constant * (T - T0)
        return self._integral(T) - self._integral(T0)

    def _integral(self, T: Array) -> Array:
        assert self.curve is not None
        inner = np.clip(T, self.low, self.high)
        total: Array = self._antiderivative(inner)
        outside = T - inner
        if outside.any():
            total = total + outside * self.curve(inner)
        return total

    # Made once, not at every call: they are asked for in every iteration.

    @cached_property
    def _derivative(self) -> PPoly:
        assert self.curve is not None
        return self.curve.derivative()

    @cached_property
    def _antiderivative(self) -> PPoly:
        assert self.curve is not None
        return self.curve.antiderivative()

    @property
    def is_constant(self) -> bool:
        """True where the property does not depend on temperature."""
        return self.curve is None


def property_from(spec: float | Mapping[str, Any]) -> Property:
    """A Property from a number, {"T": [...], "value": [...]} or {"polynomial": [a0, a1, ...], "T_ref": K}.

    The polynomial is a0 + a1 (T - T_ref) + ...  Raises ValueError if a table's temperatures do not increase.
    """
    if not isinstance(spec, Mapping):
        return Property(float(spec))
    if "polynomial" in spec:
        a = np.asarray(spec["polynomial"], dtype=float)
        T_ref = float(spec.get("T_ref", 0.0))
        # One piece wide enough for any temperature; PPoly wants the highest power first, about its left end.
        return Property(None, PPoly(a[::-1, None], np.array([T_ref, T_ref + 1e9])))
    T, value = np.asarray(spec["T"], dtype=float), np.asarray(spec["value"], dtype=float)
    if T.ndim != 1 or T.shape != value.shape or T.size == 0:
        raise ValueError("a table needs as many values as temperatures, and at least one")
    if not (np.diff(T) > 0).all():
        raise ValueError("the temperatures of a table must increase")
    if T.size == 1:
        return Property(float(value[0]))
    if T.size == 2:
        slope = (value[1] - value[0]) / (T[1] - T[0])
        return Property(None, PPoly(np.array([[slope], [value[0]]]), T), float(T[0]), float(T[-1]))
    curve = PchipInterpolator(T, value)
    return Property(None, PPoly(curve.c, curve.x), float(T[0]), float(T[-1]))


def positive_property(spec: float | Mapping[str, Any], what: str) -> Property:
    """A Property that is positive wherever its number or table says what it is.  Raises ValueError: `what` must be.

    A polynomial cannot be checked here: the step that meets a value <= 0 is discarded.
    """
    made = property_from(spec)
    if isinstance(spec, Mapping) and "polynomial" in spec:
        return made
    values = np.asarray(spec["value"] if isinstance(spec, Mapping) else spec, dtype=float)
    if not (np.isfinite(values) & (values > 0.0)).all():
        raise ValueError(f"{what} must be positive, not {values.min():g}")
    return made
