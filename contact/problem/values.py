"""What may stand at a key: numbers, names, signals, fields, properties; and the mapping that holds the keys.

A scenario file and a model.json are read by the same classes.  In a file temperatures have the file's unit and a signal
may be the name of one; in a model.json all is SI,
kelvin and written out (coupler.scenario.si goes from one to the other).
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from math import inf
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    SerializerFunctionWrapHandler,
    Tag,
    ValidationError,
    WithJsonSchema,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

At = tuple[str | int, ...]

# What people write behind a number, as (factor, SI unit); temperatures are in the unit the scenario states.
UNITS: dict[str, tuple[float, str]] = {
    "m": (1, "m"), "cm": (1e-2, "m"), "mm": (1e-3, "m"), "um": (1e-6, "m"), "µm": (1e-6, "m"),
    "μm": (1e-6, "m"), "nm": (1e-9, "m"), "in": (0.0254, "m"), "inch": (0.0254, "m"), "ft": (0.3048, "m"),
    "s": (1, "s"), "sec": (1, "s"), "ms": (1e-3, "s"), "min": (60, "s"), "h": (3600, "s"),
    "Pa": (1, "Pa"), "kPa": (1e3, "Pa"), "MPa": (1e6, "Pa"), "GPa": (1e9, "Pa"), "bar": (1e5, "Pa"),
    "psi": (6894.757293168, "Pa"), "N/mm2": (1e6, "Pa"),
    "W/mK": (1, "W/mK"), "W/m/K": (1, "W/mK"), "W/(mK)": (1, "W/mK"),
    "J/kgK": (1, "J/kgK"), "kJ/kgK": (1e3, "J/kgK"),
    "kg/m3": (1, "kg/m3"), "g/cm3": (1e3, "kg/m3"), "W/m2K": (1, "W/m2K"), "kW/m2K": (1e3, "W/m2K"),
    "W/m2": (1, "W/m2"), "kW/m2": (1e3, "W/m2"), "W/m3": (1, "W/m3"), "1/K": (1, "1/K"),
    "%": (1e-2, "a fraction"),
}
# Longer lists than this are not read.
MANY = 16
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")


def problem(text: str, remedy: str = "", at: At = ()) -> PydanticCustomError:
    """Make the error of a wrong value, in our words.  at : where, from the place being checked downwards."""
    return PydanticCustomError("slideline", "{text}", {"text": text, "remedy": remedy, "at": at})


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Name the nearest of the known words, then the others (of many, the nearest ones)."""
    names = sorted(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    guess = f"Did you mean {near[0]!r}? " if near else ""
    more = ""
    if len(names) > MANY:
        more = f" and {len(names) - MANY} more"
        names = difflib.get_close_matches(word, names, n=MANY, cutoff=0.0)
    return f"{guess}Known here: {', '.join(names) or 'none'}{more}."


# Single values


def looks_like_number(text: str) -> bool:
    """Tell whether a text begins with a number, such as "40 mm"."""
    return _QUANTITY.fullmatch(text) is not None


def number(value: Any) -> float:
    """Return a finite number; text with a unit is answered with the number to write.  Raises PydanticCustomError."""
    if isinstance(value, str):
        raise _text_for_number(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        what = {bool: "true or false", list: "a list", dict: "a mapping", type(None): "nothing"}
        raise problem(f"a number is needed here, not {what.get(type(value), type(value).__name__)}")
    try:
        as_float = float(value)
    except OverflowError:
        raise problem("the number is too large") from None
    if not math.isfinite(as_float):
        raise problem("the number is not finite", "Give a finite number; leave optional keys out.")
    return as_float


def _text_for_number(text: str) -> PydanticCustomError:
    match = _QUANTITY.fullmatch(text)
    if match is None:
        return problem("a number is needed here, not text")
    digits, unit = match.groups()
    if not unit:
        return problem("a number is needed here, not text", f"Write {digits} without quotes.")
    if unit in UNITS:
        factor, si = UNITS[unit]
        return problem("a number without its unit is needed here; all is SI",
                       f"Write {float(digits) * factor:.12g} ({si}).")
    if unit in ("K", "C", "degC", "°C", "F", "degF", "°F"):
        return problem("a number without its unit is needed here",
                       "Temperatures are in the unit that units.temperature states (degC or K).")
    return problem(
        "a number without its unit is needed here; all is SI",
        f"Convert it to SI and write the number alone (m, s, kg, Pa, W, J); the unit {unit!r} is not known.",
    )


def whole(value: Any) -> int:
    """Return a whole number, at least 1.  Raises PydanticCustomError."""
    as_float = number(value)
    if as_float != int(as_float) or as_float < 1:
        raise problem("must be a whole number, 1 or more")
    return int(as_float)


def count(value: Any) -> int:
    """Return a whole number, 0 or more.  Raises PydanticCustomError."""
    as_float = number(value)
    if as_float != int(as_float) or as_float < 0:
        raise problem("must be a whole number, 0 or more")
    return int(as_float)


def flag(value: Any) -> bool:
    """Return true or false, and nothing that is like it.  Raises PydanticCustomError."""
    if not isinstance(value, bool):
        raise problem("true or false is needed here")
    return value


def name(value: Any) -> str:
    """Return a name: it stands in dotted keys, FMI variables and HDF5 paths, so no dots, blanks or slashes."""
    if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]{0,63}", value):
        raise problem(
            "not usable as a name", "Use letters, digits, _ and -, beginning with a letter, at most 64."
        )
    return value


def dotted_name(value: Any) -> str:
    """Return a name that may have dots inside, such as that of a probe.  Raises PydanticCustomError."""
    if not isinstance(value, str) or len(value) > 200:
        raise problem("not usable as a name")
    for part in value.split("."):
        name(part)
    return value


def text(value: Any) -> str:
    """Return a text.  Raises PydanticCustomError for anything else."""
    if not isinstance(value, str):
        raise problem("text is needed here", "Put it in quotes.")
    return value


def _positive(value: float) -> float:
    if value <= 0:
        raise problem("must be greater than zero")
    return value


def _not_negative(value: float) -> float:
    if value < 0:
        raise problem("must not be negative")
    return value


class SignalName(str):
    """The name of a signal in a scenario file, not yet looked up."""

    __slots__ = ()

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(lambda value: cls(text(value)))


Number = Annotated[float, BeforeValidator(number)]
Positive = Annotated[Number, AfterValidator(_positive), WithJsonSchema({"type": "number", "exclusiveMinimum": 0})]
NotNegative = Annotated[Number, AfterValidator(_not_negative), WithJsonSchema({"type": "number", "minimum": 0})]
Whole = Annotated[int, BeforeValidator(whole), WithJsonSchema({"type": "integer", "minimum": 1})]
Count = Annotated[int, BeforeValidator(count), WithJsonSchema({"type": "integer", "minimum": 0})]
Flag = Annotated[bool, BeforeValidator(flag)]
Name = Annotated[str, BeforeValidator(name), WithJsonSchema({"type": "string",
                                                             "pattern": "^[A-Za-z_][A-Za-z0-9_-]{0,63}$"})]
DottedName = Annotated[str, BeforeValidator(dotted_name)]
Text = Annotated[str, BeforeValidator(text)]


# One key and the mapping that holds it


@dataclass(frozen=True)
class Entry:
    """What is said of one key, once: its meaning, unit and bounds.  Stands in an Annotated type of a Part.

    text : its meaning, for the tables of the pages and for editors.  unit : SI.
    above, least, below, most : bounds of every number, of a signal or property each of its values.
    temperature : in the file's unit of temperature, kelvin in a model.json.  degrees : in degrees, rad in a model.json.
    zero_in_table : a property table may be zero in places, not everywhere.
    default : shown in place of the default's value.  why : the reason for the default.
    kind : shown in place of the type.  remedy : what to do about a value out of bounds.
    """

    text: str
    unit: str = ""
    above: float = -inf
    least: float = -inf
    below: float = inf
    most: float = inf
    temperature: bool = False
    degrees: bool = False
    zero_in_table: bool = False
    default: str = ""
    why: str = ""
    kind: str = ""
    remedy: str = ""

    @property
    def bounded(self) -> bool:
        """Whether any number is out of bounds."""
        return max(self.above, self.least) > -inf or min(self.below, self.most) < inf

    @property
    def bounds(self) -> str:
        """The bounds in words, as they follow "must"."""
        low = self.above if self.above > -inf else self.least
        high = self.below if self.below < inf else self.most
        if low > -inf and high < inf:
            ends = (low == self.above, high == self.below)
            if self.above == 0.0 and not ends[1]:
                return f"be greater than zero and at most {high:g}"
            excluded = {(True, True): ", both excluded", (True, False): f", {low:g} excluded",
                        (False, True): f", {high:g} excluded", (False, False): ""}[ends]
            return f"lie between {low:g} and {high:g}{excluded}"
        if self.above > -inf:
            return "be greater than zero" if self.above == 0.0 else f"be greater than {self.above:g}"
        if self.least > -inf:
            return "not be negative" if self.least == 0.0 else f"be at least {self.least:g}"
        return f"be less than {self.below:g}" if self.below < inf else f"be at most {self.most:g}"

    def holds(self, value: float) -> bool:
        """Tell whether a number is within the bounds."""
        return self.above < value < self.below and self.least <= value <= self.most

    def check(self, value: Any) -> Any:
        """Return a value whose numbers are all within the bounds.  Raises PydanticCustomError at the first that is not.

        Names of signals, sums and polynomials pass: they are checked where more is known of them.
        """
        for at, one, table in _numbers_in(value, ()):
            may_be_zero = one == 0.0 and self.zero_in_table and table is not None and any(table)
            # fault: bounds of keys not looked at -> if False: | coupler/test_scenario_errors
            if not self.holds(one) and not may_be_zero:
                raise problem(f"must {self.bounds}", self.remedy, at=at)
        return value

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        schema = handler(source)
        return core_schema.no_info_after_validator_function(self.check, schema) if self.bounded else schema

    def __get_pydantic_json_schema__(self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler) -> Any:
        made = dict(handler(schema))
        if made.get("type") in ("number", "integer"):
            ends = {"exclusiveMinimum": self.above, "minimum": self.least, "exclusiveMaximum": self.below,
                    "maximum": self.most}
            made |= {key: value for key, value in ends.items() if abs(value) < inf}
        unit = "in the unit of units.temperature" if self.temperature else self.unit
        said = " ".join(part for part in (self.text.replace("\\|", "|"), f"[{unit}]" if unit else "") if part)
        return made | ({"description": said + (f" {self.why}" if self.why else "")} if said else {})


class Part(BaseModel):
    """A mapping of a scenario or a model.json, frozen; an unknown key is an error that names the nearest known one."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True, defer_build=True)

    @model_validator(mode="wrap")
    @classmethod
    def _known_keys_only(cls, data: Any, handler: Callable[[Any], Any]) -> Any:
        if isinstance(data, cls):
            return data
        keys = cls.keys()
        if not isinstance(data, Mapping):
            raise problem(f"a mapping is needed here, with the keys {', '.join(keys)}")
        # fault: unknown keys accepted -> unknown: list[str] = [] | coupler/test_scenario_override
        #   coupler/test_scenario_errors
        unknown = [key for key in data if not cls.knows(key)]
        if not unknown:
            return handler(data)
        errors = [InitErrorDetails(type=problem("unknown key", did_you_mean(str(key), keys)), loc=(key,),
                                   input=data[key]) for key in unknown]
        try:
            handler({key: value for key, value in data.items() if cls.knows(key)})
        except ValidationError as exc:
            errors += details_of(exc)
        except PydanticCustomError:
            pass  # what the keys make together is judged when each of them is right
        raise ValidationError.from_exception_data(cls.__name__, errors)

    @model_serializer(mode="wrap")
    def _what_is_said(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        needed = {name for name, field in type(self).model_fields.items() if field.is_required()}
        return {key: value for key, value in handler(self).items() if value is not None or key in needed}

    def plain(self) -> dict[str, Any]:
        """Return what it says as JSON has it: defaults written out, keys that are not given left out."""
        return self.model_dump(mode="json")

    @classmethod
    def knows(cls, key: object) -> bool:
        """Tell whether the mapping may have this key."""
        return key in list(cls.keys())

    @classmethod
    def keys(cls) -> list[str]:
        """List the keys as the file has them: one that Python keeps for itself, such as `for`, is an alias."""
        return [field.alias or name for name, field in cls.model_fields.items()]

    @classmethod
    def entry(cls, name: str) -> Entry | None:
        """Return what is said of a key, None where nothing is."""
        return next((m for m in cls.model_fields[name].metadata if isinstance(m, Entry)), None)


def details_of(error: ValidationError) -> list[InitErrorDetails]:
    """Return the single errors of one that was caught, to be raised again with others."""
    found = []
    for details in error.errors(include_url=False):
        kind: Any = details["type"]
        if kind == "slideline":
            context = details["ctx"]
            kind = problem(context["text"], context["remedy"], context["at"])
        elif kind == "missing":
            kind = problem("a required key is missing", "See docs/scenario.md.")
        else:
            kind = PydanticCustomError(kind, details["msg"].replace("{", "{{").replace("}", "}}"),
                                       dict(details.get("ctx", {})))
        found.append(InitErrorDetails(type=kind, loc=details["loc"], input=details["input"]))
    return found


def exactly_one(part: Part, names: Iterable[str]) -> str:
    """Return the one of these keys that is given.  Raises PydanticCustomError where none or several are."""
    names = tuple(names)
    given = [n for n in names if getattr(part, n) is not None]
    if len(given) != 1:
        have = " and ".join(given) or "none"
        raise problem(f"exactly one of {', '.join(names)} is needed, {have} is given")
    return given[0]


# Curves over time, temperature and place


class Form(StrEnum):
    """What joins the points of a table."""

    LINEAR = "linear"
    CUBIC = "cubic"


class Beyond(StrEnum):
    """What follows beyond the last point of a table."""

    FLAT = "flat"
    SLOPE = "slope"


class SignalTable(Part):
    """A table over time: linear in between, constant outside.  Two values at one time make a jump."""

    t: Annotated[tuple[Number, ...], Entry("times, not decreasing; one given twice makes a jump", "s")]
    value: Annotated[tuple[Number, ...], Entry("values; at a jump the first holds before it, the second from it on")]

    @model_validator(mode="after")
    def _is_a_signal(self) -> SignalTable:
        t = self.t
        if not t or len(t) != len(self.value):
            raise problem("a signal needs as many values as times, and at least one")
        for i in range(1, len(t)):
            if t[i] < t[i - 1]:
                raise problem(f"time goes backwards, from {t[i - 1]:g} to {t[i]:g}",
                              "Times of a signal must not decrease; equal ones make a jump.", at=("t", i))
        if any(t[i] == t[i + 2] for i in range(len(t) - 2)):
            raise problem("a signal has at most two values at one time (before and after a jump)")
        return self


class PropertyTable(Part):
    """A table over temperature, constant outside."""

    T: Annotated[tuple[Number, ...], Entry("temperatures, increasing", "K", temperature=True)]
    value: Annotated[tuple[Number, ...], Entry("values")]
    form: Annotated[Form, Entry("between the points: straight lines, or a monotone cubic",
                              why="As tables of norms and of other programs are meant.")] = Form.LINEAR

    @model_validator(mode="after")
    def _is_a_table(self) -> PropertyTable:
        if not self.T or len(self.T) != len(self.value):
            raise problem("a table needs as many values as temperatures, and at least one")
        if any(b <= a for a, b in pairwise(self.T)):
            raise problem("the temperatures of a table must increase")
        return self


class Polynomial(Part):
    """a0 + a1 (T - T_ref) + a2 (T - T_ref)^2 + ..."""

    polynomial: Annotated[tuple[Number, ...], Entry("coefficients a0, a1, ...")]
    T_ref: Annotated[Number, Entry("the temperature it counts from", "K", temperature=True)] = 0.0

    @model_validator(mode="after")
    def _has_a_term(self) -> Polynomial:
        if not self.polynomial:
            raise problem("at least one coefficient is needed", at=("polynomial",))
        return self


class ProfileTable(Part):
    """A table over a coordinate: linear in between, constant outside."""

    at: Annotated[tuple[Number, ...], Entry("places, increasing", "m")]
    value: Annotated[tuple[Number, ...], Entry("values")]

    @model_validator(mode="after")
    def _is_a_profile(self) -> ProfileTable:
        if not self.at or len(self.at) != len(self.value):
            raise problem("a profile needs as many values as places, and at least one")
        for i, (before, after) in enumerate(pairwise(self.at), start=1):
            if after <= before:
                raise problem(f"the places of a profile must increase, {after:g} m follows {before:g} m", at=("at", i))
        return self


class ProfilePolynomial(Part):
    """a0 + a1 s + a2 s^2 + ..., s the coordinate [m]."""

    polynomial: Annotated[tuple[Number, ...], Entry("coefficients a0, a1, ...")]

    @model_validator(mode="after")
    def _has_a_term(self) -> ProfilePolynomial:
        if not self.polynomial:
            raise problem("at least one coefficient is needed", at=("polynomial",))
        return self


# Tags in angle brackets are taken out of the place of an error again.
def _signal_form(value: Any) -> str:
    if isinstance(value, Mapping | SignalTable):
        return "<table>"
    return "<name>" if isinstance(value, str) and not looks_like_number(value) else "<number>"


def _property_form(value: Any) -> str:
    if isinstance(value, Polynomial) or (isinstance(value, Mapping) and "polynomial" in value):
        return "<polynomial>"
    return "<table>" if isinstance(value, Mapping | PropertyTable) else "<number>"


def _profile_form(value: Any) -> str:
    if isinstance(value, ProfilePolynomial) or (isinstance(value, Mapping) and "polynomial" in value):
        return "<polynomial>"
    return "<table>"


ANumber = Annotated[Number, Tag("<number>")]
ASignalName = Annotated[SignalName, WithJsonSchema({"type": "string"}), Tag("<name>")]
ASignalTable = Annotated[SignalTable, Tag("<table>")]
APropertyTable = Annotated[PropertyTable, Tag("<table>")]
APolynomial = Annotated[Polynomial, Tag("<polynomial>")]

SignalSpec = Annotated[ANumber | ASignalName | ASignalTable, Discriminator(_signal_form)]
PropertySpec = Annotated[ANumber | APropertyTable | APolynomial, Discriminator(_property_form)]
ProfileSpec = Annotated[Annotated[ProfileTable, Tag("<table>")] | Annotated[ProfilePolynomial, Tag("<polynomial>")],
                        Discriminator(_profile_form)]


class Phases(Part):
    """A property of its own for each phase, blended by the solid fraction."""

    solid: Annotated[PropertySpec, Entry("of the solid")]
    liquid: Annotated[PropertySpec, Entry("of the liquid")]


class Term(Part):
    """A product of a signal and two profiles; what is left out is 1."""

    t: Annotated[SignalSpec, Entry("over time")] = 1.0
    x: Annotated[ProfileSpec | None, Entry("over x (r)")] = None
    y: Annotated[ProfileSpec | None, Entry("over y (z)")] = None

    @model_validator(mode="after")
    def _says_something(self) -> Term:
        if not self.model_fields_set:
            raise problem("a term needs at least one of t, x, y")
        return self


class FieldSum(Part):
    """A sum of products at the current coordinates x (r), y (z)."""

    terms: Annotated[tuple[Term, ...], Entry("the products")]

    @model_validator(mode="after")
    def _has_a_term(self) -> FieldSum:
        if not self.terms:
            raise problem("at least one term is needed", "Write {terms: [{t: 3}]}, or a number.", at=("terms",))
        return self


def _field_form(value: Any) -> str:
    if isinstance(value, FieldSum):
        return "<terms>"
    # A term without its list belongs here too: the answer then is the key `terms`.
    if isinstance(value, Mapping) and ({"terms", "x", "y"} & value.keys() or not {"t", "value"} & value.keys()):
        return "<terms>"
    return _signal_form(value)


def phased_form(value: Any) -> str:
    """Return the tag of what stands for a property that may change on melting."""
    if isinstance(value, Phases) or (isinstance(value, Mapping) and {"solid", "liquid"} & value.keys()):
        return "<phases>"
    return _property_form(value)


APhases = Annotated[Phases, Tag("<phases>")]
FieldSpec = Annotated[ANumber | ASignalName | ASignalTable | Annotated[FieldSum, Tag("<terms>")],
                      Discriminator(_field_form)]
PhasedSpec = Annotated[ANumber | APropertyTable | APolynomial | APhases, Discriminator(phased_form)]


def _numbers_in(value: Any, at: At) -> Iterator[tuple[At, float, tuple[float, ...] | None]]:
    """Every number of a value that bounds are of, its place, and the property table it stands in."""
    if isinstance(value, bool) or value is None:
        return
    if isinstance(value, int | float):
        yield at, float(value), None
    elif isinstance(value, PropertyTable | SignalTable):
        table = value.value if isinstance(value, PropertyTable) else None
        for i, one in enumerate(value.value):
            yield (*at, "value", i), one, table
    elif isinstance(value, tuple):
        for i, one in enumerate(value):
            yield from _numbers_in(one, (*at, i))
    elif isinstance(value, Mapping):
        for key, one in value.items():
            yield from _numbers_in(one, (*at, key))
    elif isinstance(value, Part):
        for place, one in properties_in(value, ()):
            if place:
                yield from _numbers_in(one, (*at, *place))


def properties_in(spec: Any, at: At) -> Iterator[tuple[At, Any]]:
    """Every property that makes up a material's datum, and its place; none for None."""
    parts = [n for n in ("solid", "liquid", "k_1", "k_2") if isinstance(spec, Part) and n in type(spec).model_fields]
    for part in parts:
        yield from properties_in(getattr(spec, part), (*at, part))
    if not parts and spec is not None:
        yield at, spec
