"""The units of a whole file: `units: mm, MPa, degC` says in which units all plain numbers of a scenario are.

A length and one unit that has mass in it (stress, force or mass) fix all others, as analysts choose them for programs
without units; times are in s.  With mm and MPa masses are in t, forces in N, densities in t/mm3.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from contact.problem.units import BASE, SYMBOLS, Powers, UnitError, si_name, unit_from
from contact.problem.values import did_you_mean

# Key of `units` -> what it may be.  The first that a text names is the one meant.
CHOICES: Mapping[str, tuple[str, ...]] = {
    "temperature": ("degC", "K"), "length": ("m", "cm", "mm", "um"), "stress": ("Pa", "kPa", "MPa", "GPa"),
    "force": ("N", "kN", "MN"), "mass": ("kg", "g", "t")}
WITH_MASS = ("stress", "force", "mass")
_METRE, _KILOGRAM = BASE.index("m"), BASE.index("kg")
_WHOLE = re.compile(r"kg|rad|mol|Pa|[NJWKsm]")
_SHOWN = ("kg", "N", "J", "W", "kg/m3", "W/mK", "J/kgK", "W/m2K")  # told in words: where slips are made
_SHOWN_AS = ("mass", "force", "energy", "power", "density", "conductivity", "heat capacity", "conductance")


@dataclass(frozen=True)
class UnitSystem:
    """length, of_mass : symbols.  metre, kilogram : their sizes in SI."""

    length: str
    of_mass: str
    metre: Fraction
    kilogram: Fraction

    def factor(self, powers: Powers) -> Fraction:
        """Return what one unit of a dimension is in SI."""
        size = Fraction(1)
        for base, power in ((self.metre, powers[_METRE]), (self.kilogram, powers[_KILOGRAM])):
            # fault: a file in mm is read in m -> size *= 1 | coupler/test_scenario_file_units
            size *= base ** int(power) if power.denominator == 1 else Fraction(float(base) ** float(power))
        return size

    def name(self, powers: Powers) -> str:
        """Return the unit of a dimension: `t/mm3` of a density in mm, MPa."""
        return _WHOLE.sub(lambda match: self._symbol(match[0]), si_name(powers))

    def _symbol(self, si: str) -> str:
        powers = unit_from(si).powers
        size = self.factor(powers)
        if size == 1:
            return si
        return next((name for name, (factor, of) in SYMBOLS.items() if (factor, of) == (size, powers)),
                    f"({float(size):g} {si})")

    @property
    def symbols(self) -> str:
        """What the file says of it: "mm, MPa"."""
        return f"{self.length}, {self.of_mass}"

    @property
    def sentence(self) -> str:
        """What follows for other quantities, in words."""
        told = ", ".join(f"{what} {self.name(unit_from(si).powers)}"
                         for what, si in zip(_SHOWN_AS, _SHOWN, strict=True))
        return f"plain numbers are in {self.symbols} and s, so {told}"


def system_of(units: Any) -> UnitSystem | None:
    """Return the system that a mapping `units` states; None where it states none, or not all of one."""
    if not isinstance(units, Mapping):
        return None
    given = {key: units[key] for key in ("length", *WITH_MASS) if key in units}
    length, second = given.pop("length", None), next(iter(given), None)
    if second is None or len(given) > 1 or length not in CHOICES["length"] or given[second] not in CHOICES[second]:
        return None
    metre, size = SYMBOLS[length][0], SYMBOLS[given[second]][0]
    # Pa = kg/(m s2), N = kg m/s2
    # fault: the unit of mass forgets the length -> kilogram = size |
    #   coupler/test_scenario_file_units
    kilogram = size * {"stress": metre, "force": 1 / metre, "mass": Fraction(1)}[second]
    return UnitSystem(length, given[second], metre, kilogram)


def units_from(text: str) -> dict[str, str]:
    """Return the mapping `units` that a text such as "mm, MPa, degC" stands for.  Raises UnitError."""
    made: dict[str, str] = {}
    for symbol in re.split(r"[,\s]+", text.strip(" ,")):
        if symbol == "s":
            continue  # times are
        kind = next((kind for kind, names in CHOICES.items() if symbol in names), None)
        if kind is None:
            raise UnitError(f"{symbol[:20]!r} is no unit of a whole file",
                            did_you_mean(symbol, [name for names in CHOICES.values() for name in names]))
        # fault: of two units of length the last holds -> if False: | coupler/test_scenario_file_units
        if kind in made:
            raise UnitError(f"two units of {kind}, {made[kind]} and {symbol}", "Name one.")
        made[kind] = symbol
    return made
