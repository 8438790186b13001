"""A scene's document stated otherwise, key by key as the declaration of keys says: other units, another start of time.

Which number is a temperature, and what powers of metre, kilogram, second and kelvin are in its unit, is read from
contact.problem and the scenario's schema (Entry), so a key that is added there is converted here.  Only four units
stand where no Entry says them: of a table of conductance (pressure, gap or temperature), of tolerances and of what has
a property a phase (their parent's), of polynomials over a place.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from math import prod
from typing import Any

from contact.problem import laws
from contact.problem.curves import FieldSum, Phases, Polynomial, ProfilePolynomial, PropertyTable, SignalTable
from contact.problem.part import Entry, Part
from contact.problem.values import SignalName
from coupler.scenario.options import ErrorTolerances, Tolerances
from coupler.scenario.schema import ScenarioFile
from random_scenes.scene import Scene

POWERS = {"m": (1, 0, 0, 0), "kg": (0, 1, 0, 0), "s": (0, 0, 1, 0), "K": (0, 0, 0, 1), "rad": (0, 0, 0, 0),
          "degrees": (0, 0, 0, 0), "Pa": (-1, 1, -2, 0), "N": (1, 1, -2, 0), "J": (2, 1, -2, 0), "W": (2, 1, -3, 0),
          "mol": (2, 1, -2, -1)}
"""Unit -> powers of m, kg, s, K in it.  A mole is so much that the gas constant, 8.314 J/mol K, stays what it is."""
EXTENSIVE = ("N", "J", "N m", "W")  # in plane geometry these are per metre of depth
_TOKEN = re.compile(r"(degrees|kg|Pa|mol|rad|K|m|s|N|J|W)(?:\^?(\d+)|\^([a-z])|\^\((\d+) \+ ([a-z]+)\))?")
STUB = {"file": {"path": "in the scene"}}


class NotApplicable(ValueError):  # noqa: N818  (it says no error, but that a change has no meaning in a scene)
    """A change that cannot be made of a scene.  Its text is the reason."""


def powers_of(unit: str, part: Part | None = None) -> tuple[float, ...]:
    """The powers of m, kg, s, K in a unit such as "W/m2K".

    part : where exponents of its own, such as Pa^n, are found.  Raises NotApplicable for a unit that is not understood.
    """
    above, *below = unit.split("/")
    total = [0.0] * 4
    for sign, text in ((1.0, above), *((-1.0, b) for b in below)):
        if rest := _TOKEN.sub("", text).strip(" 1()"):
            raise NotApplicable(f"unit {unit!r} is not understood: {rest!r}")
        for name, digits, letter, more, word in _TOKEN.findall(text):
            own = float(getattr(part, letter or word)) if letter or word else 0.0
            exponent = float(digits) if digits else own + float(more or 0.0) if letter or word else 1.0
            total = [a + sign * exponent * b for a, b in zip(total, POWERS[name], strict=True)]
    return tuple(total)


@dataclass(frozen=True)
class Units:
    """How many new metres, kilograms, seconds and kelvin are in an old one."""

    m: float = 1.0
    kg: float = 1.0
    s: float = 1.0
    K: float = 1.0

    def of(self, unit: str, part: Part | None = None) -> float:
        """How many new ones of a unit are in an old one."""
        bases = (self.m, self.kg, self.s, self.K)
        return float(prod(base**power for base, power in zip(bases, powers_of(unit, part), strict=True)))


OLD_UNITS = Units()


@dataclass(frozen=True)
class Restating:
    """units : the new ones.  offset : what is added to temperatures.  lead : [s] of quiet before all."""

    signals: Mapping[str, Any]
    plane: bool
    units: Units = OLD_UNITS
    offset: float = 0.0
    lead: float = 0.0

    def factor(self, entry: Entry | None, part: Part) -> float:
        """By what a number is multiplied."""
        if entry is None or not entry.unit or self.units == OLD_UNITS:
            return 1.0
        depth = self.units.m if self.plane and entry.unit in EXTENSIVE else 1.0
        return self.units.of(entry.unit, part) / depth

    def temperature(self, T: float) -> float:
        """A temperature."""
        return T * self.units.K + self.offset

    def part(self, part: Part, entry: Entry | None = None) -> dict[str, Any]:
        """A mapping as plain data.  entry : what is said of it as a whole."""
        made: dict[str, Any] = {}
        names = [*type(part).model_fields, *(part.__pydantic_extra__ or {})]
        if isinstance(part, ErrorTolerances | Tolerances):
            # What a file does not state of a tolerance is of the scene: written out, it would be a number.
            for name, (_, usual) in zip(names, type(part)(), strict=True):
                own = getattr(part, name)
                stated = {key: value for key, value in self.part(own, self.entry(part, name, entry)).items()
                          if getattr(own, key) != getattr(usual, key)}
                made.update({name: stated} if stated else {})
            return made
        for name in names:
            value = getattr(part, name)
            field = type(part).model_fields.get(name)
            if value is None and not (field is not None and field.is_required()):
                continue
            key = (field.alias or name) if field is not None else name
            made[key] = self.value(value, self.entry(part, name, entry), part)
        return made

    def entry(self, part: Part, name: str, whole: Entry | None) -> Entry | None:
        """What is said of a key."""
        if name not in type(part).model_fields:
            return None
        said = type(part).entry(name)
        if isinstance(part, laws.Table) and name == "x":
            kelvin = part.variable is laws.TableVariable.T
            # whole : "closed" or "open", the branch whose table it is
            return Entry("", unit="K" if kelvin else "Pa" if whole is not None and whole.text == "closed" else "m",
                         temperature=kelvin)
        if said is None and name == "atol" and whole is not None:
            return replace(whole, temperature=False)
        if isinstance(part, Phases) or (isinstance(part, laws.Sum) and name == "of"):
            return whole
        return said

    def value(self, value: Any, entry: Entry | None, part: Part) -> Any:
        """What stands at a key, as plain data."""
        if isinstance(value, SignalName):
            if value not in self.signals:
                raise NotApplicable(f"there is no signal {value!r}")
            value = self.signals[value]
        if isinstance(value, bool | None | Enum):
            return value.value if isinstance(value, Enum) else value
        if isinstance(value, str | int):
            return str(value) if isinstance(value, str) else value
        if isinstance(value, float):
            kelvin = entry is not None and entry.temperature
            return self.temperature(value) if kelvin else value * self.factor(entry, part)
        if isinstance(value, SignalTable):
            return self.signal({"t": list(value.t), "value": [self.value(v, entry, part) for v in value.value]})
        if isinstance(value, PropertyTable):
            return {"T": [self.temperature(T) for T in value.T], "form": value.form.value,
                    "value": [self.value(v, entry, part) for v in value.value]}
        if isinstance(value, Polynomial):
            factors = [self.value(a, entry, part) / self.units.K**i for i, a in enumerate(value.polynomial)]
            return {"polynomial": factors, "T_ref": self.temperature(value.T_ref)}
        if isinstance(value, ProfilePolynomial):
            return {"polynomial": [a / self.units.m**i for i, a in enumerate(value.polynomial)]}
        if isinstance(value, FieldSum):
            return self.sum(value, entry, part)
        if isinstance(value, Part):
            inner = entry
            if isinstance(part, laws.Sum):
                inner = entry
            elif isinstance(value, laws.Table | laws.Sum):
                closed = getattr(part, "closed", None) is value
                inner = Entry("closed" if closed else "open")
            return self.part(value, inner)
        if isinstance(value, tuple):
            return [self.value(v, entry, part) for v in value]
        if isinstance(value, Mapping):
            return {str(name): self.value(v, entry, part) for name, v in value.items()}
        raise NotApplicable(f"a {type(value).__name__} is not understood")

    def sum(self, value: FieldSum, entry: Entry | None, part: Part) -> dict[str, Any]:
        """A sum of products: `t` carries its unit; one of temperatures gets one more, the others are differences."""
        difference = None if entry is None else replace(
            entry, temperature=False, unit="K" if entry.temperature else entry.unit)
        terms = [{"t": self.value(term.t, difference, part),
                  **{axis: self.value(profile, None, term) for axis in ("x", "y")
                     if (profile := getattr(term, axis)) is not None}} for term in value.terms]
        if entry is not None and entry.temperature and self.offset:
            terms.append({"t": self.offset})
        return {"terms": terms}

    def signal(self, table: dict[str, Any]) -> dict[str, Any]:
        """A signal after the lead: before it what it is at time 0, after a jump there."""
        if not self.lead:
            return {**table, "t": [t * self.units.s for t in table["t"]]}
        t, v = table["t"], table["value"]
        later = [k for k in range(len(t)) if t[k] > 0.0]
        start = value_at(table, 0.0)
        return {"t": [self.lead, *(t[k] + self.lead for k in later)], "value": [start, *(v[k] for k in later)]}


def value_at(signal: Any, t: float, side: int = 1) -> float:
    """The value of a number or a plain table {t, value} at t [s]; at a jump the later (side 1) or earlier (-1) one."""
    if not isinstance(signal, Mapping):
        return float(signal)
    times, values = signal["t"], signal["value"]
    for k, when in enumerate(times):
        if when > t or (when == t and side < 0):
            if k == 0:
                return float(values[0])
            if times[k] == times[k - 1]:
                return float(values[k - 1])
            return float(values[k - 1] + (t - times[k - 1]) / (times[k] - times[k - 1]) * (values[k] - values[k - 1]))
    return float(values[-1])


def form_of(doc: Mapping[str, Any]) -> ScenarioFile:
    """The declared form of a scene's document."""
    bodies = {name: {"mesh": STUB, **body} for name, body in doc["bodies"].items()}
    return ScenarioFile.model_validate({**doc, "bodies": bodies})


def restated(scene: Scene, *, units: Units = OLD_UNITS, offset: float = 0.0, lead: float = 0.0) -> dict[str, Any]:
    """The document of a scene with signals and defaults written out, in other units, or with a lead.

    units : the new ones.  offset : added to every temperature.  lead : [s], of data over time only.
    Raises NotApplicable where the declaration does not say how.
    """
    doc = scene.copied_doc()
    if any("mesh" in body for body in doc["bodies"].values()):
        raise NotApplicable("a body is meshed by its document")
    kinds = (doc["thermal"].get("half", "thermal"), doc["mechanical"]["half"])
    if any(doc[role].get("options") for role in ("thermal", "mechanical")) or not (
            kinds[0] in ("thermal", "lumped", "rod") and kinds[1] in ("elastic", "rigid", "rod")):
        raise NotApplicable("a half of another package may mean anything by its keys")
    if doc.get("rules") and (units != OLD_UNITS or offset or lead):
        raise NotApplicable("numbers of rules have the unit of what they look at")
    if units.K != 1.0 and doc["units"]["temperature"] != "K":
        raise NotApplicable("degrees Celsius have another zero")
    file = form_of(doc)
    how = Restating(file.signals, doc["geometry"] == "plane", units, offset, lead)
    made = {key: value for key, value in how.part(file).items() if key not in ("signals", "study", "rules", "output")}
    for body in made["bodies"].values():
        del body["mesh"]
    for key in ("rules", "output"):
        if key in doc:
            made[key] = doc[key]
    return made
