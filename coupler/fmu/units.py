"""Units that an FMU declares, and how its numbers become SI: by its own definitions, or by what a unit is called."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree import ElementTree

from contact.half.layout import BASE, base_exponents


@dataclass(frozen=True)
class Conversion:
    """SI value = factor * value + offset."""

    factor: float = 1.0
    offset: float = 0.0

    @property
    def is_none(self) -> bool:
        """Whether the numbers are SI already."""
        return self.factor == 1.0 and self.offset == 0.0


SI = Conversion()
# By name, where an FMU defines no unit of that name: unit -> (its SI unit, how).
COMMON: Mapping[str, tuple[str, Conversion]] = {
    "degC": ("K", Conversion(1.0, 273.15)), "degF": ("K", Conversion(5.0 / 9.0, 459.67 * 5.0 / 9.0)),
    "mm": ("m", Conversion(1e-3)), "cm": ("m", Conversion(1e-2)), "um": ("m", Conversion(1e-6)),
    "km": ("m", Conversion(1e3)), "in": ("m", Conversion(0.0254)), "ft": ("m", Conversion(0.3048)),
    "kPa": ("Pa", Conversion(1e3)), "MPa": ("Pa", Conversion(1e6)), "GPa": ("Pa", Conversion(1e9)),
    "bar": ("Pa", Conversion(1e5)), "N/mm2": ("Pa", Conversion(1e6)), "N/m2": ("Pa", SI),
    "mJ": ("J", Conversion(1e-3)), "kJ": ("J", Conversion(1e3)), "W.s": ("J", SI), "N.mm": ("J", Conversion(1e-3)),
    "kN": ("N", Conversion(1e3)), "ms": ("s", Conversion(1e-3)), "min": ("s", Conversion(60.0)),
    "h": ("s", Conversion(3600.0)), "%": ("1", Conversion(1e-2)),
}


@dataclass(frozen=True)
class DeclaredUnit:
    """A unit of an FMU's UnitDefinitions.  exponents : base unit -> power, of those that are not 0."""

    exponents: Mapping[str, int]
    conversion: Conversion


def declared_units(root: ElementTree.Element) -> dict[str, DeclaredUnit]:
    """Return the units that a model description defines by base units, by name."""
    found = {}
    for unit in root.iterfind("UnitDefinitions/Unit"):
        base = unit.find("BaseUnit")
        if base is None:
            continue  # a name alone: what it is called says what it is
        powers = {name: int(base.get(name, "0")) for name in BASE}
        found[unit.get("name", "")] = DeclaredUnit(
            {name: power for name, power in powers.items() if power},
            Conversion(float(base.get("factor", "1")), float(base.get("offset", "0"))))
    return found


def type_units(root: ElementTree.Element) -> dict[str, str]:
    """Return the units that a model description's types state, by the type's name."""
    types = [(node.get("name", ""), node.find("Real")) for node in root.iterfind("TypeDefinitions/SimpleType")]
    types += [(node.get("name", ""), node) for node in root.iterfind("TypeDefinitions/Float64Type")]  # FMI 3.0
    return {name: real.get("unit", "") for name, real in types if real is not None and real.get("unit")}


def unit_of(value: ElementTree.Element, types: Mapping[str, str]) -> str:
    """Return the unit of a variable's `Real`, or of its `Float64`: its own, else that of its declared type.

    "" where neither says one.
    types : what type_units found.
    """
    # fault: the unit of a declared type is not seen -> return value.get("unit", "") | coupler/test_bind
    return value.get("unit", "") or types.get(value.get("declaredType", ""), "")


def conversion_of(unit: str, to: str, declared: Mapping[str, DeclaredUnit]) -> Conversion | None:
    """Return how numbers in `unit` become those in `to`, an SI unit; None where that is not known.

    declared : what the FMU defines.  It is not known either where the FMU defines a unit otherwise than its name says:
    one of the two is a mistake, and nobody here can tell which.
    """
    by_name = (to, SI) if unit == to else COMMON.get(unit)
    named = by_name[1] if by_name is not None and by_name[0] == to else None
    if by_name is not None and named is None:
        return None
    own = declared.get(unit)
    if own is None:
        return named
    if own.exponents != ({} if to == "1" else base_exponents(to)):
        return None
    return own.conversion if named is None or _alike(named, own.conversion) else None


def _alike(a: Conversion, b: Conversion) -> bool:
    return abs(a.factor - b.factor) <= 1e-9 * abs(a.factor) and abs(a.offset - b.offset) <= 1e-6 * (1 + abs(a.offset))
