"""Units in a scenario: each value becomes the number that a file in SI could have held, before anything is checked.

A key says its unit once, in its Entry.  So after this walk `20 mm`, 20 in a file in mm, and 0.02 are the same scenario,
with the same hash.
"""

from __future__ import annotations

import re
import typing
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from pydantic import Discriminator, Tag

from contact.problem import curves, laws
from contact.problem.part import Part
from contact.problem.units import (
    NONE,
    SCALES,
    Powers,
    Quantity,
    UnitError,
    as_float,
    called,
    quantity_from,
    unit_from,
)
from contact.problem.values import Refused, SignalName, looks_like_number
from coupler.errors import together
from coupler.scenario.document import Document, Key
from coupler.scenario.edits import apply_overrides
from coupler.scenario.mesh import MeshFile
from coupler.scenario.options import Tolerance
from coupler.scenario.rule_schema import ActionSpec, Condition, DriveSpec
from coupler.scenario.schema import Binding, Geometry, ScenarioFile, StudyReference, StudySpec
from coupler.scenario.unit_system import UnitSystem, system_of, units_from

# Keys that say no unit because theirs is that of the key around them.
AS_AROUND = {(curves.SignalTable, "value"), (curves.PropertyTable, "value"), (curves.Phases, "solid"),
             (curves.Phases, "liquid"), (curves.FieldSum, "terms"), (curves.Term, "t"), (Tolerance, "atol")}
# Mappings whose numbers are of what only the run knows (a monitor), or of powers of a unit: SI, without a unit.
WITHOUT: tuple[type[Part], ...] = (curves.Polynomial, curves.ProfilePolynomial, curves.ProfileTable, Condition,
                                   ActionSpec, DriveSpec, Binding)
# Mappings whose numbers no unit of a file can be given to: of what they are only the run knows.
OF_MONITORS: tuple[type[Part], ...] = (Condition, DriveSpec)
# Of a plane scene they are those of a slice: one unit of length of the file deep, one metre in SI.
OF_A_SLICE = frozenset(unit_from(name).powers for name in ("N", "J"))
_EXPONENT = re.compile(r"\^(?:\((\d+) \+ (\w+)\)|([A-Za-z]\w*))")


@dataclass(frozen=True)
class Wanted:
    """The unit a key wants.  powers : its dimension; None of a signal, which takes any.

    temperature : absolute, in the file's unit.  degrees : in degrees.  unit : as the pages have it.
    """

    powers: Powers | None = NONE
    temperature: bool = False
    degrees: bool = False
    unit: str = ""

    @property
    def called(self) -> str:
        """What it is, in words."""
        if self.temperature:
            return "a temperature (degC, K or degF)"
        assert self.powers is not None
        words = called(self.powers)
        return words.replace("a temperature", "a difference of temperatures") if words.endswith("[K]") else words


def with_overrides(document: Document, overrides: Mapping[str, Any]) -> Document:
    """Return the document with values put in place of its own, all as plain numbers in SI.

    The units of a whole file are those of its own numbers: overrides are in SI, or have units.  Raises ScenarioError.
    """
    # fault: overrides of a file in mm are taken for mm -> plain = document |
    #   coupler/test_scenario_file_units::test_overrides_are_in_si
    plain = with_plain_numbers(document) if _units_of(document)[1] is not None else document
    changed = apply_overrides(plain, overrides)
    before, after = plain.tree.get("units"), changed.tree.get("units")
    # The scale of temperatures of a file in SI may be changed: nothing has been converted yet.
    if after != before and (plain.system is not None or _units_of(changed)[1] is not None):
        key = next(key for key in sorted(changed.overridden, key=str) if key[:1] == ("units",))
        raise changed.error(key, "the units of a file are those of its own numbers",
                            "Change them in the file, with its numbers.")
    return with_plain_numbers(changed)


def with_plain_numbers(document: Document) -> Document:
    """Return the document with every value that has a unit as the plain number of its key.

    SI; temperatures in the unit of the file.  A unit has what is written behind a number, or what `units` says of all.
    What does not fit its key stays as a `Refused` text, which the check of the form tells with its place.
    Raises ScenarioError for units of a whole file that are none, and for numbers that they leave open.
    """
    units, system = _units_of(document)
    if units != document.tree.get("units"):
        document = replace(document, tree={**document.tree, "units": units})
    if system is None and not any(_has_unit(text) for text in _texts(document.tree)):
        return document
    walk = _Walk(str(units.get("temperature")) if isinstance(units, Mapping) else "", system,
                 document.tree.get("geometry") == Geometry.PLANE.value)
    signals = document.tree.get("signals")
    if system is not None:  # what a signal's plain numbers are is asked where it is used
        walk.tree(ScenarioFile, {key: value for key, value in document.tree.items() if key != "signals"}, ())
        walk.written.clear()
        walk.open.clear()
    if isinstance(signals, Mapping):  # first: what they are is asked where they are used
        walk.tree(ScenarioFile, {"signals": signals}, ())
    tree = walk.tree(ScenarioFile, document.tree, ())
    if walk.open:
        raise together([document.error(*one) for one in dict.fromkeys(walk.open)])
    if system is not None:
        tree["units"] = {"temperature": units.get("temperature")}
    written = {**document.written, **walk.written}
    # fault: values with units are left as they are -> return document | coupler/test_scenario_units
    return replace(document, tree=tree, written=written, system=system or document.system)


def _units_of(document: Document) -> tuple[Any, UnitSystem | None]:
    """The mapping `units` of a document, and the system it states.  Raises ScenarioError for a text that is none."""
    units = document.tree.get("units")
    if isinstance(units, str):
        try:
            units = units_from(units)
        except UnitError as exc:
            raise document.error(("units",), str(exc), exc.remedy) from None
        if "temperature" not in units:
            raise document.error(("units",), "no unit of temperature is named", "Add degC or K.")
    return units, system_of(units)


def _texts(node: Any) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    elif isinstance(node, Mapping):
        for one in node.values():
            yield from _texts(one)
    elif isinstance(node, list):
        for one in node:
            yield from _texts(one)


def _has_unit(text: str) -> bool:
    try:
        return quantity_from(text) is not None
    except UnitError:
        return True


@cache
def _hints(part: type[Part]) -> Mapping[str, Any]:
    return get_type_hints(part, include_extras=True)


@dataclass
class _Walk:
    """Goes through a tree along the types of its keys.

    scale : the file's unit of temperature.  system : the units of its plain numbers, None for SI.
    plane : its geometry.
    signals : name -> its dimension, where it says one.  used : name -> what the keys want that use it.
    written : what stood where a number is now.  open : numbers whose unit nobody knows (place, text, remedy).
    """

    scale: str
    system: UnitSystem | None = None
    plane: bool = False
    used: dict[str, list[Wanted]] = field(default_factory=dict)
    open: list[tuple[Key, str, str]] = field(default_factory=list)
    signals: dict[str, Powers] = field(default_factory=dict)
    written: dict[Key, str] = field(default_factory=dict)

    def tree(self, part: type[Part], data: Mapping[str, Any], at: Key, around: Wanted | None = None) -> dict[str, Any]:
        """The plain values of a mapping."""
        names = {info.alias or name: name for name, info in part.model_fields.items()}
        hints = _hints(part)
        extra = get_args(hints.get("__pydantic_extra__"))
        made: dict[str, Any] = {}
        for key, value in data.items():
            if self.system is not None and self._of_its_own(part, key, value, (*at, key), around, made):
                continue
            if key in names:
                made[key] = self.value(hints[names[key]], value, (*at, key),
                                       self._wanted(part, names[key], data, at, around))
            else:
                made[key] = self.value(extra[1], value, (*at, key), None) if extra else value
        if self.system is not None and part is MeshFile:
            # fault: a mesh file in a scenario in mm is read in m -> made.setdefault("unit", "m") |
            #   coupler/test_scenario_file_units::test_a_mesh_file_is_in_the_unit_of_the_file
            made.setdefault("unit", self.system.length)
        return made

    def _of_its_own(self, part: type[Part], key: str, value: Any, at: Key, around: Wanted | None,
                    made: dict[str, Any]) -> bool:
        """Convert or note what follows no unit of its key: coefficients, bounds of rules, values of a grid."""
        assert self.system is not None
        if key == "polynomial" and isinstance(value, list) and around is not None and around.powers is not None:
            whole = part is curves.Polynomial
            first = around.powers if whole else NONE
            # fault: coefficients of a profile in mm are all alike -> per = NONE |
            #   coupler/test_scenario_file_units::test_units_with_powers_and_coefficients
            per = SCALES["K"].powers if whole else unit_from("m").powers
            made[key] = [self._scaled(one, (*at, i), Wanted(tuple(a - i * b for a, b in zip(first, per, strict=True))))
                         for i, one in enumerate(value)]
            return True
        if part in OF_MONITORS or (part is ActionSpec and key == "set"):
            self._open_numbers(value, at, "what a rule compares or sets has the unit of its monitor or load",
                               "Write this file in SI, with units behind single values (20 mm).")
        elif (part is StudySpec and key == "grid") or (part is StudyReference and key == "set"):
            grids = value if isinstance(value, list) else [value]
            for k, grid in enumerate(grids):
                for axis, values in grid.items() if isinstance(grid, Mapping) else ():
                    if "." in axis:
                        place = (*at, k, axis) if isinstance(value, list) else (*at, axis)
                        self._open_numbers(values, place, "values of a grid are put in place of those of the file",
                                           "Give each its unit (20 mm; 0.3 1 of a pure number).")
        return False

    def _open_numbers(self, value: Any, at: Key, why: str, remedy: str) -> None:
        """Note every plain number inside: the units of the file cannot be given to it."""
        assert self.system is not None
        if isinstance(value, Mapping):
            for key, one in value.items():
                if key not in ("for", "of", "rate", "lag", "gain", "cells") and not str(key).startswith("load."):
                    self._open_numbers(one, (*at, key), why, remedy)
        elif isinstance(value, list):
            for i, one in enumerate(value):
                self._open_numbers(one, (*at, i), why, remedy)
        elif isinstance(value, int | float) and not isinstance(value, bool):
            # fault: bounds of rules in a file in mm, MPa are read in SI without a word -> pass |
            #   coupler/test_scenario_file_units::test_what_the_units_leave_open_is_refused
            self.open.append((at, f"the file is in {self.system.symbols}, and {why}, so its unit is not known", remedy))

    def _scaled(self, value: Any, at: Key, wanted: Wanted | None) -> Any:
        """A plain number in SI; what is none is left to the check of the form."""
        if (self.system is None or wanted is None or wanted.temperature or wanted.degrees or isinstance(value, bool)
                or not isinstance(value, int | float) or not abs(value) < float("inf")):
            return value
        powers = wanted.powers
        if powers is None:  # of a signal: as the keys want that use it
            uses = self.used.get(str(at[1]), [])
            powers = uses[0].powers if uses and not uses[0].temperature else NONE
            if any(one.powers != uses[0].powers for one in uses):
                kinds = " and ".join(dict.fromkeys(one.called for one in uses))
                return Refused(f"{value:g}", f"the signal is used as {kinds}, so the unit of its numbers is not known",
                               "Make two signals of it, or give its values a unit.")
            assert powers is not None, "a key that wants anything is no use"
        factor, deep = self.system.factor(powers), ""
        # fault: a force in a plane file in mm is that of a metre of depth -> if False: |
        #   coupler/test_scenario_file_units::test_a_force_is_that_of_a_slice coupler/test_deck_units
        if self.plane and powers in OF_A_SLICE:
            factor, deep = factor / self.system.metre, f" per {self.system.length} of depth"
        if factor == 1:
            return value
        try:
            plain = as_float(Fraction(repr(value)) * factor)
        except UnitError as exc:
            return Refused(repr(value), str(exc), exc.remedy)
        self.written[at] = f"{value!r} {self.system.name(powers)}{deep}"
        return plain

    def value(self, hint: Any, value: Any, at: Key, wanted: Wanted | None) -> Any:
        """The plain value of a key."""
        hint = _chosen(hint, value)
        if isinstance(value, str):
            if hint is float and wanted is not None and looks_like_number(value):
                return self._number(value, at, wanted)
            return self._use(value, wanted) if hint is SignalName else value
        if hint is float:
            return self._scaled(value, at, wanted)
        origin, inner = get_origin(hint), get_args(hint)
        if isinstance(value, list) and origin is tuple:
            kinds = [inner[0]] * len(value) if inner[-1:] == (Ellipsis,) else list(inner)
            return [self.value(kind, one, (*at, i), wanted) for i, (kind, one) in enumerate(
                zip(kinds, value, strict=False))] + value[len(kinds):]
        if isinstance(value, Mapping) and origin is dict:
            return {key: self.value(inner[1], one, (*at, key), Wanted(None) if at == ("signals",) else wanted)
                    for key, one in value.items()}
        if isinstance(value, Mapping) and isinstance(hint, type) and issubclass(hint, Part):
            return self.tree(hint, value, at, wanted)
        return value

    def _wanted(self, part: type[Part], name: str, data: Mapping[str, Any], at: Key,
                around: Wanted | None) -> Wanted | None:
        """What a key of a mapping wants; None where no unit can be read."""
        entry = part.entry(name)
        if (part, name) in AS_AROUND:
            # Terms of a sum are added: of two temperatures one would be a difference, and which one nobody says.
            return None if part is curves.Term and around is not None and around.temperature else around
        if part is laws.Table and name == "x":
            if data.get("variable") == laws.TableVariable.T.value:
                return Wanted(SCALES["K"].powers, temperature=True)
            return Wanted(unit_from("m" if "open" in at[2:] else "Pa").powers)
        if entry is not None and entry.temperature:
            return Wanted(SCALES["K"].powers, temperature=True)
        if entry is not None and entry.degrees:
            return Wanted(unit_from("rad").powers, degrees=True)
        if entry is not None and entry.unit:
            unit = _EXPONENT.sub(lambda m: f"^{_exponent(part, data, m)}", entry.unit)
            return Wanted(unit_from(unit).powers)
        return None if part in WITHOUT else Wanted()

    def _number(self, text: str, at: Key, wanted: Wanted) -> Any:
        try:
            quantity = quantity_from(text)
            if quantity is None:
                return text  # a number in quotes: told where numbers are read
            if wanted.powers is None:
                self._of_signal(quantity, str(at[1]))
                wanted = Wanted(quantity.powers, temperature=quantity.powers == SCALES["K"].powers)
            plain = as_float(self._plain(quantity, wanted))
            self.written[at] = text
            return plain
        except UnitError as exc:
            return Refused(text, str(exc), exc.remedy)

    def _plain(self, quantity: Quantity, wanted: Wanted) -> Fraction:
        """The number of a quantity as its key wants it.  Raises UnitError where it is of another kind."""
        # fault: a length is taken for a temperature -> if False: |
        #   coupler/test_scenario_units::test_what_is_of_another_kind_is_refused
        if quantity.powers != wanted.powers:
            raise UnitError(f"{wanted.called} is needed here, not {called(quantity.powers)}",
                            "Give it in a unit of its kind, or in SI without a unit.")
        if wanted.temperature:
            if self.scale not in SCALES:
                raise UnitError("the file says no unit of temperature", "Write units: {temperature: K}.")
            # fault: degrees Celsius taken for the file's kelvin -> return quantity.value |
            #   coupler/test_scenario_units
            return quantity.si() - (SCALES[self.scale].offset or 0)
        # fault: 20 degC is a difference of 293.15 K -> if False: |
        #   coupler/test_scenario_units::test_a_difference_is_in_kelvin
        if quantity.unit.offset:
            raise UnitError("a difference of temperatures [K] is needed here, not a temperature",
                            f"Write {as_float(quantity.value * quantity.unit.factor):.12g} K if it is the difference.")
        return quantity.si() / unit_from("deg").factor if wanted.degrees else quantity.si()

    def _of_signal(self, quantity: Quantity, name: str) -> None:
        """Note of what kind a signal is.  Raises UnitError where its values are of two."""
        first = self.signals.setdefault(name, quantity.powers)
        if first != quantity.powers:
            raise UnitError(f"the signal has {called(first)} before, and {called(quantity.powers)} here",
                            "All values of a signal are of one kind.")

    def _use(self, name: str, wanted: Wanted | None) -> str:
        """A signal's name where it is used; it is refused where the signal is of another kind than its key."""
        if wanted is not None and wanted.powers is not None:
            self.used.setdefault(name, []).append(wanted)
        powers = self.signals.get(name)
        # fault: a signal of another kind is used in silence -> if True: |
        #   coupler/test_scenario_units::test_a_signal_is_of_the_kind_of_its_key
        if powers is None or wanted is None or wanted.powers in (None, powers):
            return name
        return Refused(name, f"{wanted.called} is needed here, but the signal {name!r} is {called(powers)}",
                       "Give the signal in a unit of the kind of this key.")


def _exponent(part: type[Part], data: Mapping[str, Any], match: re.Match[str]) -> str:
    """The exponent of a unit that depends on another key of the same mapping, such as Pa s^m."""
    first, summand, alone = match.groups()
    name = summand or alone
    value = data.get(name, part.model_fields[name].default)
    number = float(value) if isinstance(value, int | float) and abs(value) < 100.0 else 0.0
    return f"{float(first or 0) + number:.12g}"


def _chosen(hint: Any, value: Any) -> Any:
    """The one type of a key that a value is checked by: of a union the same one as pydantic takes."""
    while True:
        metadata: tuple[Any, ...] = ()
        if get_origin(hint) is Annotated:
            hint, *rest = get_args(hint)
            metadata = tuple(rest)
        if get_origin(hint) not in (typing.Union, UnionType):
            return hint
        members = [one for one in get_args(hint) if one is not NoneType]
        choose = next((m.discriminator for m in metadata if isinstance(m, Discriminator)), None)
        hint = _tagged(members, choose, value) if callable(choose) else _fitting(members, value)
        if hint is None:
            return NoneType


def _tagged(members: list[Any], choose: Callable[[Any], Any], value: Any) -> Any:
    tag = choose(value)
    return next((one for one in members if get_origin(one) is Annotated
                 and any(isinstance(m, Tag) and m.tag == tag for m in get_args(one)[1:])), None)


def _fitting(members: list[Any], value: Any) -> Any:
    """The member of a union without tags that a value of the file can be."""
    bare = [(one, get_args(one)[0] if get_origin(one) is Annotated else one) for one in members]
    for whole, one in bare:
        origin = get_origin(one)
        if ((isinstance(value, Mapping) and (origin is dict or (isinstance(one, type) and issubclass(one, Part))))
                or (isinstance(value, list) and origin is tuple)
                or (isinstance(value, str) and one is float and looks_like_number(value))
                or (isinstance(value, int | float) and one is float)):
            return whole
    # An annotated union within the union says itself what it takes.
    return next((whole for whole, one in bare if get_origin(one) in (typing.Union, UnionType)), None)
