"""Values with units in a scenario: each becomes the number that the file could have held, before anything is checked.

A key says its unit once, in its Entry.  So after this walk `20 mm` and 0.02 are the same scenario, with the same hash.
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
from coupler.scenario.document import Document, Key
from coupler.scenario.options import Tolerance
from coupler.scenario.rule_schema import ActionSpec, Condition, DriveSpec
from coupler.scenario.schema import Binding, ScenarioFile

# Keys that say no unit because theirs is that of the key around them.
AS_AROUND = {(curves.SignalTable, "value"), (curves.PropertyTable, "value"), (curves.Phases, "solid"),
             (curves.Phases, "liquid"), (curves.FieldSum, "terms"), (curves.Term, "t"), (Tolerance, "atol")}
# Mappings whose numbers are of what only the run knows (a monitor), or of powers of a unit: SI, without a unit.
WITHOUT: tuple[type[Part], ...] = (curves.Polynomial, curves.ProfilePolynomial, curves.ProfileTable, Condition,
                                   ActionSpec, DriveSpec, Binding)
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


def with_plain_numbers(document: Document) -> Document:
    """Return the document with every value that has a unit as the plain number of its key.

    SI; temperatures in the unit of the file.  What does not fit its key stays as a `Refused` text, which the check of
    the form tells with its place.
    """
    if not any(_has_unit(text) for text in _texts(document.tree)):
        return document
    units = document.tree.get("units")
    walk = _Walk(str(units.get("temperature")) if isinstance(units, Mapping) else "")
    signals = document.tree.get("signals")
    if isinstance(signals, Mapping):  # first: what they are is asked where they are used
        walk.tree(ScenarioFile, {"signals": signals}, ())
    tree = walk.tree(ScenarioFile, document.tree, ())
    # fault: values with units are left as they are -> return document | coupler/test_scenario_units
    return replace(document, tree=tree, written={**document.written, **walk.written})


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

    scale : the file's unit of temperature.  signals : name -> its dimension, where it says one.
    written : what stood where a number is now.
    """

    scale: str
    signals: dict[str, Powers] = field(default_factory=dict)
    written: dict[Key, str] = field(default_factory=dict)

    def tree(self, part: type[Part], data: Mapping[str, Any], at: Key, around: Wanted | None = None) -> dict[str, Any]:
        """The plain values of a mapping."""
        names = {info.alias or name: name for name, info in part.model_fields.items()}
        hints = _hints(part)
        extra = get_args(hints.get("__pydantic_extra__"))
        made = {}
        for key, value in data.items():
            if key in names:
                made[key] = self.value(hints[names[key]], value, (*at, key),
                                       self._wanted(part, names[key], data, at, around))
            else:
                made[key] = self.value(extra[1], value, (*at, key), None) if extra else value
        return made

    def value(self, hint: Any, value: Any, at: Key, wanted: Wanted | None) -> Any:
        """The plain value of a key."""
        hint = _chosen(hint, value)
        if isinstance(value, str):
            if hint is float and wanted is not None and looks_like_number(value):
                return self._number(value, at, wanted)
            return self._use(value, wanted) if hint is SignalName else value
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
                or (isinstance(value, str) and one is float and looks_like_number(value))):
            return whole
    # An annotated union within the union says itself what it takes.
    return next((whole for whole, one in bare if get_origin(one) in (typing.Union, UnionType)), None)
