"""Single values of a scenario or a model.json: numbers, names and text, and how a wrong one is told.

A scenario file and a model.json are read by the same classes.  In a file temperatures have the file's unit and a signal
may be the name of one; in a model.json all is SI, kelvin and written out (coupler.scenario.si goes from one to the
other).
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Collection, Iterable
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, GetCoreSchemaHandler, WithJsonSchema
from pydantic_core import PydanticCustomError, core_schema

from contact.problem.near import nearest
from contact.problem.units import NUMBER, UnitError, as_float, quantity_from, si_name

At = tuple[str | int, ...]

# Longer lists than this are not read.
MANY = 16
NO_TEXT = "text is needed here"


def problem(text: str, remedy: str = "", at: At = ()) -> PydanticCustomError:
    """Make the error of a wrong value, in our words.  at : where, from the place being checked downwards."""
    return PydanticCustomError("slideline", "{text}", {"text": text, "remedy": remedy, "at": at})


def covers(words: Collection[str], path: str) -> bool:
    """Tell whether one of the words is the path or stands above it."""
    return any(path == word or path.startswith(f"{word}.") for word in words)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Name the nearest of the known words, then the others (of many, the nearest ones)."""
    names = sorted(known)
    near = nearest(word, names)
    guess = f"Did you mean {near!r}? " if near else ""
    more = ""
    if len(names) > MANY:
        more = f" and {len(names) - MANY} more"
        names = sorted(difflib.get_close_matches(word, names, n=MANY, cutoff=0.0))
    return f"{guess}Known here: {', '.join(names) or 'none'}{more}."


def no_such_surface(name: str, known: Iterable[str], bodies: Iterable[str]) -> str:
    """Say what to write instead of a surface that is not known."""
    names, body = list(known), name.partition(".")[0]
    # fault: a mesh file that names no surface is not told -> if True: | coupler/test_scenario_mesh
    if body not in bodies or any(other.partition(".")[0] == body for other in names):
        return did_you_mean(name, names)
    return (f"{body} has none: a mesh file names them as groups of lines (gmsh: Physical Curve). "
            f"Known here: {', '.join(sorted(names)) or 'none'}.")


# Single values

LARGEST = 1e75  # of a number of a file: nothing beyond is meant, and its fourth power (radiation) is no longer finite


def looks_like_number(text: str) -> bool:
    """Tell whether a text begins with a number, such as "40 mm"."""
    return NUMBER.fullmatch(text) is not None


def number(value: Any) -> float:
    """Return a finite number; text with a unit is answered with the number to write.  Raises PydanticCustomError.

    Values with units were made numbers before, where the key says its unit (coupler.scenario.quantities).
    """
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
    # fault: numbers whose powers overflow are taken -> if False: | coupler/test_scenario_errors
    if abs(as_float) > LARGEST:
        raise problem("the number is too large", f"Numbers are at most {LARGEST:g} in size; leave optional keys out.")
    return as_float


class Refused(str):
    """A text of a file that cannot be what its key needs: 20 mm for a temperature.  message, remedy : what is told."""

    message: str
    remedy: str

    def __new__(cls, text: str, message: str = "", remedy: str = "") -> Refused:
        made = super().__new__(cls, text)
        made.message, made.remedy = message, remedy
        return made


def _text_for_number(text: str) -> PydanticCustomError:
    if isinstance(text, Refused):
        return problem(text.message, text.remedy)
    match = NUMBER.fullmatch(text)
    if match is None:
        return problem("a number is needed here, not text")
    digits, unit = match.groups()
    if not unit:
        return problem("a number is needed here, not text", f"Write {digits} without quotes.")
    if unit in ("K", "degC", "°C", "degF", "°F"):
        return problem("a number without its unit is needed here",
                       "Temperatures are in the unit that units.temperature states (degC or K).")
    try:
        quantity = quantity_from(text)
        assert quantity is not None, "a number and a unit were found"
        return problem("a number without its unit is needed here; all is SI",
                       f"Write {as_float(quantity.si()):.12g} ({si_name(quantity.powers)}).")
    except UnitError as exc:
        return problem(f"a number is needed here; {exc}", exc.remedy)


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
    if isinstance(value, Refused):
        raise problem(value.message, value.remedy)
    if not isinstance(value, str):
        raise problem(NO_TEXT, "Put it in quotes.")
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
