"""Values with units: what `20 mm`, `200 GPa`, `25 degC` and `5 kW/m2` are, to the last bit.

A table of our own: importing pint and building its registry takes 0.21 s, a fifth of `slideline check`.
Factors are fractions, so a value with a unit is rounded once: 20 mm is the double nearest to 0.02.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

BASE = ("m", "kg", "s", "K", "mol", "rad")
Powers = tuple[Fraction, ...]  # of BASE
NONE: Powers = (Fraction(0),) * len(BASE)
# No quantity of engineering goes beyond; a longer text, or a power that takes minutes, is refused before it is read.
MOST_LETTERS, MOST_POWER, MOST_EXPONENT = 60, 100, 400
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


class UnitError(ValueError):
    """A unit that is not known.  remedy : what to write instead."""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


@dataclass(frozen=True)
class Unit:
    """SI value = factor * value + offset.  powers : of BASE.  offset : of a scale of temperature that stands alone."""

    factor: Fraction
    powers: Powers = NONE
    offset: Fraction | None = None


@dataclass(frozen=True)
class Quantity:
    """A value with its unit, exact."""

    value: Fraction
    unit: Unit

    @property
    def powers(self) -> Powers:
        """Its dimension."""
        return self.unit.powers

    def si(self) -> Fraction:
        """Return it in SI; of a temperature, in K above absolute zero."""
        return self.value * self.unit.factor + (self.unit.offset or 0)


def _base(**powers: int) -> Powers:
    return tuple(Fraction(powers.get(name, 0)) for name in BASE)


_LENGTH, _TIME, _MASS, _KELVIN = _base(m=1), _base(s=1), _base(kg=1), _base(K=1)
_FORCE, _STRESS = _base(kg=1, m=1, s=-2), _base(kg=1, m=-1, s=-2)
_ENERGY, _POWER, _ANGLE = _base(kg=1, m=2, s=-2), _base(kg=1, m=2, s=-3), _base(rad=1)
_POUND_FORCE = Fraction("0.45359237") * Fraction("9.80665")
_INCH = Fraction("0.0254")
_TURN = 2 * Fraction(math.pi)  # of the double pi, as everywhere else
# Scales of temperature: their zero is not absolute zero.  Within a longer unit (W/m2degC) they are differences.
SCALES: Mapping[str, Unit] = {
    **dict.fromkeys(("degC", "°C"), Unit(Fraction(1), _KELVIN, Fraction("273.15"))),
    **dict.fromkeys(("degF", "°F"), Unit(Fraction(5, 9), _KELVIN, Fraction("459.67") * 5 / 9)),
    "K": Unit(Fraction(1), _KELVIN, Fraction(0))}
_TABLE: tuple[tuple[Powers, Mapping[str, int | str | Fraction]], ...] = (
    (_LENGTH, {"m": 1, "km": 1000, "cm": "1e-2", "mm": "1e-3", "um": "1e-6", "µm": "1e-6", "μm": "1e-6",
               "nm": "1e-9", "in": _INCH, "inch": _INCH, "ft": 12 * _INCH}),
    (_TIME, {"s": 1, "sec": 1, "us": "1e-6", "µs": "1e-6", "ms": "1e-3", "min": 60, "h": 3600, "d": 86400}),
    (_MASS, {"kg": 1, "g": "1e-3", "mg": "1e-6", "t": 1000, "lb": "0.45359237"}),
    (_KELVIN, {**{name: unit.factor for name, unit in SCALES.items()}}),
    (_FORCE, {"N": 1, "kN": 1000, "MN": 10**6, "lbf": _POUND_FORCE}),
    (_STRESS, {"Pa": 1, "mPa": "1e-3", "hPa": 100, "kPa": 1000, "MPa": 10**6, "GPa": 10**9, "bar": 10**5,
               "mbar": 100, "atm": 101325, "psi": _POUND_FORCE / _INCH**2, "ksi": 1000 * _POUND_FORCE / _INCH**2}),
    (_ENERGY, {"J": 1, "mJ": "1e-3", "kJ": 1000, "MJ": 10**6}),
    (_POWER, {"W": 1, "mW": "1e-3", "kW": 1000, "MW": 10**6}),
    (_base(mol=1), {"mol": 1, "kmol": 1000}), (_base(s=-1), {"Hz": 1}),
    (_ANGLE, {"rad": 1, "deg": _TURN / 360, "°": _TURN / 360}), (_base(rad=1, s=-1), {"rpm": _TURN / 60}),
    (NONE, {"1": 1, "%": "1e-2", "ppm": "1e-6"}))
SYMBOLS: Mapping[str, tuple[Fraction, Powers]] = {
    name: (Fraction(factor), powers) for powers, units in _TABLE for name, factor in units.items()}
# What a value of a dimension is called, and its SI unit; the first that fits is told.
CALLED: Mapping[str, str] = {
    "1": "a pure number", "m": "a length", "s": "a time", "kg": "a mass", "K": "a temperature", "rad": "an angle",
    "Pa": "a pressure or stress", "N": "a force", "J": "an energy or moment", "W": "a power", "m2": "an area",
    "m3": "a volume", "m/s": "a velocity", "m/s2": "an acceleration", "rad/s": "an angular velocity", "1/s": "a rate",
    "K/s": "a rate of temperature", "kg/m3": "a density", "W/mK": "a conductivity", "J/kgK": "a heat capacity",
    "J/kg": "a latent heat", "W/m2": "a heat flux", "W/m2K": "a conductance", "W/m3": "a heat source",
    "1/K": "a thermal expansion", "Pa/m": "a stiffness", "m2K/W": "a thermal resistance", "N/m": "a force per length",
    "Pa s": "a viscosity", "J/mol": "an activation energy"}

_TOKEN = re.compile(r"(?P<symbol>" + "|".join(re.escape(s) for s in sorted(SYMBOLS, key=len, reverse=True)) +
                    r")(?:(?:\^|\*\*)?(?P<power>-?\d+(?:\.\d+)?))?|(?P<mark>[/*·.() ])")
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


@lru_cache(maxsize=256)
def unit_from(text: str) -> Unit:
    """Return the unit that a text names: symbols, powers (m2, m^2, m²), a stroke before all that divides.

    `W/m2K`, `W/(m2 K)` and `W/m2/K` are the same.  Raises UnitError.
    """
    text = text.strip()
    if len(text) > MOST_LETTERS:
        raise UnitError(f"the unit {text[:20]}... is too long")
    if text in SCALES:
        return SCALES[text]
    factor, powers, sign, joined = Fraction(1), NONE, 1, False
    rest = text.translate(_RAISED)
    rest = "1" + rest if rest.startswith("/") else rest
    open_brackets = 0
    while rest:
        match = _TOKEN.match(rest)
        if match is None:
            raise _unknown(text)
        rest = rest[match.end():]
        if (mark := match["mark"]) is not None:
            open_brackets += (mark == "(") - (mark == ")")
            if mark == "/" and open_brackets:
                raise UnitError(f"the unit {text!r} has a stroke in brackets", "Write one stroke: W/(m2 K).")
            if mark == "/":
                # fault: what follows a stroke multiplies -> pass | coupler/test_scenario_units
                sign = -1
            elif mark in "*·." and sign < 0 and not open_brackets:
                raise UnitError(f"the unit {text!r} can be read in two ways", "Put what divides in brackets: W/(m2*K).")
            if open_brackets not in (0, 1):
                raise UnitError(f"the brackets of the unit {text!r} do not match")
            continue
        joined |= match["symbol"] != "1" or text == "1"
        power = sign * Fraction(match["power"] or 1)
        if abs(power) > MOST_POWER:
            raise UnitError(f"the unit {text!r} has a power above {MOST_POWER}")
        size, of = SYMBOLS[match["symbol"]]
        factor *= size ** int(power) if power.denominator == 1 else Fraction(float(size) ** float(power))
        powers = tuple(a + power * b for a, b in zip(powers, of, strict=True))
    if open_brackets or not joined:
        raise UnitError(f"the brackets of the unit {text!r} do not match") if open_brackets else _unknown(text)
    return Unit(factor, powers)


def _unknown(text: str) -> UnitError:
    # fault: 60,5 is told to have the unit ,5 -> if False: | coupler/test_scenario_errors
    if re.match(r"[.,]\d", text):
        return UnitError("a number has one decimal point, no comma, and nothing between its thousands",
                         "Write 60.5 for 60,5 and 2.1e11 for 210.000.000.000.")
    near = difflib.get_close_matches(text, [*SYMBOLS, *CALLED], n=3, cutoff=0.6)
    return UnitError(f"the unit {text!r} is not known",
                     (f"Did you mean {' or '.join(near)}? " if near else "") +
                     "docs/scenario.md lists the units; or write the number in SI, without a unit.")


def quantity_from(text: str) -> Quantity | None:
    """Return the quantity that a text states, None where it is no number with a unit.  Raises UnitError."""
    if (match := NUMBER.fullmatch(text)) is None or not match[2]:
        return None
    digits, unit = match.groups()
    mantissa, _, exponent = digits.lower().partition("e")
    if len(mantissa) > MOST_LETTERS or len(exponent) > MOST_LETTERS or abs(int(exponent or 0)) > MOST_EXPONENT:
        raise UnitError("the number is too large or too long")
    return Quantity(Fraction(digits), unit_from(unit))


def as_float(value: Fraction) -> float:
    """Return the nearest double.  Raises UnitError where there is none."""
    try:
        return float(value)
    except OverflowError:
        raise UnitError("the number is too large") from None


def si_name(powers: Powers) -> str:
    """Return the SI unit of a dimension: the usual one, or one made of base units."""
    for name in CALLED:
        if unit_from(name).powers == powers:
            return name
    above = [f"{name}{p if p != 1 else ''}" for name, p in zip(BASE, powers, strict=True) if p > 0]
    below = [f"{name}{-p if p != -1 else ''}" for name, p in zip(BASE, powers, strict=True) if p < 0]
    return " ".join(above or ["1"]) + (f"/({' '.join(below)})" if len(below) > 1 else f"/{below[0]}" if below else "")


def called(powers: Powers) -> str:
    """Return what a value of a dimension is called, with its SI unit: "a length [m]"."""
    name = si_name(powers)
    return "a pure number" if powers == NONE else f"{CALLED.get(name, 'a value')} [{name}]"
