"""Numbers and units as a reader wants them: SI inside, a fitting multiple on the page."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# For each SI unit: multiples from small to large; the largest with which the greatest value is still >= 1 is used.
MULTIPLES = {
    "Pa": ((1.0, "Pa"), (1e-3, "kPa"), (1e-6, "MPa"), (1e-9, "GPa")),
    "J": ((1.0, "J"), (1e-3, "kJ"), (1e-6, "MJ"), (1e-9, "GJ")),
    "W/m2": ((1.0, "W/m²"), (1e-3, "kW/m²"), (1e-6, "MW/m²")),
}
MICROMETRES_TO, METRES_FROM = 1e-3, 2.0  # m: between them engineers read lengths in mm


@dataclass(frozen=True)
class Shown:
    """How a quantity is shown: (value + shift) * factor in `unit`."""

    factor: float
    shift: float
    unit: str

    def __call__(self, value: Array) -> Array:
        return (np.asarray(value, dtype=float) + self.shift) * self.factor

    def text(self, value: float, digits: int = 4) -> str:
        """One value with its unit."""
        return f"{number(float(self(np.array(value))), digits)} {self.unit}"


def shown(unit: str, largest: float, temperature_unit: str = "K") -> Shown:
    """How to show values of an SI unit whose greatest magnitude is `largest`."""
    if unit == "K":
        return Shown(1.0, -273.15, "°C") if temperature_unit == "degC" else Shown(1.0, 0.0, "K")
    if unit == "m":
        factor, name = (1e6, "µm") if 0 < largest < MICROMETRES_TO else (1e3, "mm")
        return Shown(factor, 0.0, name) if largest < METRES_FROM else Shown(1.0, 0.0, "m")
    multiples = MULTIPLES.get(unit, ((1.0, unit),))
    factor, name = [m for m in multiples if largest * m[0] >= 1.0 or m is multiples[0]][-1]
    return Shown(factor, 0.0, name)


def axis_names(geometry: str) -> tuple[str, str]:
    """What the two coordinates of a scene are called."""
    return ("r", "z") if geometry == "axisymmetric" else ("x", "y")


def number(value: float, digits: int = 4) -> str:
    """A number for reading: no exponent where none is needed.

    >>> number(25000.0), number(14772.7272, 6), number(3.2e-15, 2)
    ('25000', '14772.7', '3.2e-15')
    """
    if value != 0.0 and 1e-4 <= abs(value) < 1e6:
        decimals = max(digits - 1 - int(np.floor(np.log10(abs(value)))), 0)
        text = f"{value:.{decimals}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    return f"{value:.{digits}g}"


def duration(seconds: float) -> str:
    """Wall-clock time: "1.25 s", "3 min 5 s", "2 h 10 min"."""
    if seconds < 60:
        return f"{number(seconds, 3)} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"


def counted(n: int, noun: str) -> str:
    """ "1 window", "2 windows"."""
    return f"{n} {noun}" if n == 1 else f"{n} {noun}s"
