"""One key of a scenario or a model.json, what is said of it, and the mapping that holds the keys."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, ClassVar, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError, core_schema

from contact.problem.values import At, did_you_mean, problem

# A number that bounds are of: its place, itself, and all values of the property table it stands in (None: of none).
BoundedNumber = tuple[At, float, tuple[float, ...] | None]


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

    # The key of which a number stands for that is written in place of the mapping, "": of none.
    alone: ClassVar[str] = ""

    @model_validator(mode="wrap")
    @classmethod
    def _known_keys_only(cls, data: Any, handler: Callable[[Any], Any]) -> Any:
        if isinstance(data, cls):
            return data
        keys = cls.keys()
        if not isinstance(data, Mapping):
            # fault: nobody says how to write a coefficient alone -> number = False | coupler/test_scenario_errors
            number = cls.alone and isinstance(data, int | float) and not isinstance(data, bool)
            raise problem(f"a mapping is needed here, with the keys {', '.join(keys)}",
                          f"Write {{{cls.alone}: {data:g}}}." if number else "")
        # fault: unknown keys accepted -> unknown: list[str] = [] | coupler/test_scenario_override
        #   coupler/test_scenario_errors
        unknown = [key for key in data if not cls.knows(key)]
        if not unknown:
            return handler(data)
        errors = [InitErrorDetails(type=problem("unknown key", cls.meant_by(str(key))), loc=(key,),
                                   input=data[key]) for key in unknown]
        try:
            handler({key: value for key, value in data.items() if cls.knows(key)})
        except ValidationError as exc:
            errors += details_of(exc)
        except PydanticCustomError:
            pass  # what the keys make together is judged when each of them is right
        raise ValidationError.from_exception_data(cls.__name__, errors)

    @classmethod
    def meant_by(cls, key: str) -> str:
        """Say what to write instead of a key that is not known."""
        return did_you_mean(key, cls.keys())

    @model_serializer(mode="wrap")
    def _what_is_said(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        needed = {name for name, field in type(self).model_fields.items() if field.is_required()}
        return {key: value for key, value in handler(self).items() if value is not None or key in needed}

    def changed(self, **changes: Any) -> Self:
        """Return a copy with other values of some keys, which are not checked again."""
        return self.model_copy(update=changes)

    def plain(self) -> dict[str, Any]:
        """Return what it says as JSON has it: defaults written out, keys that are not given left out."""
        return self.model_dump(mode="json")

    def numbers(self) -> Iterator[BoundedNumber]:
        """Every number that the bounds of its key are of: those of the properties that it is made of."""
        for place, one in properties_in(self, ()):
            if place:
                yield from _numbers_in(one, place)

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
        raise problem(f"exactly one of {', '.join(names)} is needed, not {have}")
    return given[0]


def law_tag(value: Any) -> str:
    """Return the tag of a mapping that says by `law` what it is."""
    return f"<{value.get('law') if isinstance(value, Mapping) else getattr(value, 'law', None)}>"


def law_known(laws: Sequence[str], wanted: str, remedy: str) -> Callable[[Any], Any]:
    """Make the check that a value is a mapping whose `law` is one of these, which runs before any other.

    wanted, remedy : what is told of a value that is no mapping.
    """
    def check(value: Any) -> Any:
        if isinstance(value, Part):
            return value
        if not isinstance(value, Mapping):
            raise problem(wanted, remedy)
        if "law" not in value:
            raise problem("a required key is missing", f"Write law: {', '.join(laws)}.", at=("law",))
        if value["law"] not in laws:
            raise problem("not known here", did_you_mean(str(value["law"]), laws), at=("law",))
        return value

    return check


def _numbers_in(value: Any, at: At) -> Iterator[BoundedNumber]:
    if isinstance(value, bool) or value is None:
        return
    if isinstance(value, int | float):
        yield at, float(value), None
    elif isinstance(value, tuple):
        for i, one in enumerate(value):
            yield from _numbers_in(one, (*at, i))
    elif isinstance(value, Mapping):
        for key, one in value.items():
            yield from _numbers_in(one, (*at, key))
    elif isinstance(value, Part):
        for place, one, table in value.numbers():
            yield (*at, *place), one, table


def properties_in(spec: Any, at: At) -> Iterator[tuple[At, Any]]:
    """Every property that makes up a material's datum, and its place; none for None."""
    parts = [n for n in ("solid", "liquid", "k_1", "k_2") if isinstance(spec, Part) and n in type(spec).model_fields]
    for part in parts:
        yield from properties_in(getattr(spec, part), (*at, part))
    if not parts and spec is not None:
        yield at, spec
