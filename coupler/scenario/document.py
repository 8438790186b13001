"""A scenario's text as plain values that still know the line each one stands on."""

from __future__ import annotations

import datetime
import difflib
import io
import itertools
import math
import re
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BeforeValidator, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq, TaggedScalar
from ruamel.yaml.constructor import DuplicateKeyError
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from coupler.errors import ScenarioError

Key = tuple[str | int, ...]


def dotted(key: Key) -> str:
    """`coupling.windows.3.size` of ("coupling", "windows", 3, "size"): the form overrides use too."""
    return ".".join(str(part) for part in key)


@dataclass(frozen=True)
class Document:
    """A scenario as read: nothing but dict, list, str, int, float, bool and None.

    lines : line number of every key and list item, 1-based.  overridden : keys set from outside the file.
    """

    path: Path
    text: str
    tree: dict[str, Any]
    lines: Mapping[Key, int]
    overridden: frozenset[Key] = field(default_factory=frozenset)

    def line(self, key: Key) -> int:
        """Line of a key, or of the nearest thing around it that has one; 0 where an override put it."""
        for n in range(len(key), 0, -1):
            if key[:n] in self.overridden:
                return 0
            if key[:n] in self.lines:
                return self.lines[key[:n]]
            if any(other[:n] == key[:n] for other in self.overridden):
                return 0  # an override made this on its way to something within
        return 1

    def value(self, key: Key) -> Any:
        """What stands at a key; None where nothing does."""
        node: Any = self.tree
        for part in key:
            inside = (
                node.keys() if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
            )
            if part not in inside:
                return None
            node = node[part]
        return node

    def error(self, key: Key, message: str, remedy: str = "") -> ScenarioError:
        """The one error a problem at this key becomes; the caller raises it."""
        line = self.line(key)
        if line == 0:
            message = f"{message} [set by an override]"
        return ScenarioError(
            message,
            file=str(self.path),
            line=line,
            key=dotted(key),
            value=shown(self.value(key)),
            remedy=remedy,
        )


def shown(value: Any) -> Any:
    """A value short enough for a message: what is long is cut, what is nested is left out."""
    if isinstance(value, dict):
        return None
    if isinstance(value, list | tuple) and any(isinstance(v, dict | list | tuple) for v in value):
        return None
    return _Cut(reprlib.repr(value)) if len(repr(value)) > 60 else value


class _Cut(str):
    """Text that is its own repr: the value was already written out and cut."""

    def __repr__(self) -> str:
        return str(self)


# What a single value in a scenario may be: numbers, names, and the help given where it is something else.

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


def problem(text: str, remedy: str = "", at: tuple[str | int, ...] = ()) -> PydanticCustomError:
    """A wrong value, said in our words.  at : where, from the place being checked downwards."""
    return PydanticCustomError("slideline", "{text}", {"text": text, "remedy": remedy, "at": at})


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A remedy that names the nearest of the known words, then the others (of many, the nearest ones)."""
    names = sorted(known)
    near = difflib.get_close_matches(word, names, n=1, cutoff=0.6)
    guess = f"Did you mean {near[0]!r}? " if near else ""
    more = ""
    if len(names) > MANY:
        more = f" and {len(names) - MANY} more"
        names = difflib.get_close_matches(word, names, n=MANY, cutoff=0.0)
    return f"{guess}Known here: {', '.join(names) or 'none'}{more}."


def looks_like_number(text: str) -> bool:
    """True for text that begins with a number, such as "40 mm"."""
    return _QUANTITY.fullmatch(text) is not None


def number(value: Any) -> float:
    """A finite number; text with a unit is answered with the number to write."""
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


def _positive(value: float) -> float:
    if value <= 0:
        raise problem("must be greater than zero")
    return value


def _not_negative(value: float) -> float:
    if value < 0:
        raise problem("must not be negative")
    return value


def whole(value: Any) -> int:
    """A whole number, at least 1."""
    as_float = number(value)
    if as_float != int(as_float) or as_float < 1:
        raise problem("must be a whole number, 1 or more")
    return int(as_float)


def name(value: Any) -> str:
    """A name: what stands in dotted keys, FMI variables and HDF5 paths, so no dots, blanks or slashes."""
    if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]{0,63}", value):
        raise problem(
            "not usable as a name", "Use letters, digits, _ and -, beginning with a letter, at most 64."
        )
    return value


def dotted_name(value: Any) -> str:
    """A name that may have dots inside, such as that of a probe."""
    if not isinstance(value, str) or len(value) > 200:
        raise problem("not usable as a name")
    for part in value.split("."):
        name(part)
    return value


def text(value: Any) -> str:
    if not isinstance(value, str):
        raise problem("text is needed here", "Put it in quotes.")
    return value


Number = Annotated[float, BeforeValidator(number)]
Positive = Annotated[Number, AfterValidator(_positive)]
NotNegative = Annotated[Number, AfterValidator(_not_negative)]
Whole = Annotated[int, BeforeValidator(whole)]
Name = Annotated[str, BeforeValidator(name)]
DottedName = Annotated[str, BeforeValidator(dotted_name)]
Text = Annotated[str, BeforeValidator(text)]


# From what pydantic found wrong to the one ScenarioError that is raised.

@dataclass(frozen=True)
class Problem:
    """A wrong value: where, what, and what to write instead."""

    key: Key
    message: str
    remedy: str


def scenario_error(document: Document, error: ValidationError) -> ScenarioError:
    """The problem to show: unknown keys first (a misspelt key is also a missing one), then by line."""
    problems = [_problem(details, document) for details in error.errors(include_url=False)]
    first = min(problems, key=lambda p: (p.message != "unknown key", document.line(p.key), len(p.key)))
    return document.error(first.key, first.message, first.remedy)


def _problem(details: ErrorDetails, document: Document) -> Problem:
    # Tags of unions stand in angle brackets, "[key]" marks a name that is itself wrong: not in the file.
    key: Key = tuple(p for p in details["loc"] if not (isinstance(p, str) and (p[:1] == "<" or p == "[key]")))
    context = details.get("ctx", {})
    kind = details["type"]
    if kind == "slideline":
        return Problem((*key, *context["at"]), context["text"], context["remedy"])
    if kind == "missing" and isinstance(key[-1], int):
        return Problem(key[:-1], "the list is too short", "")
    if kind == "missing":
        return Problem(key, "a required key is missing", "See docs/scenario.md.")
    if kind in ("enum", "literal_error"):
        known = [word.strip(" '") for word in str(context["expected"]).replace(" or ", ",").split(",")]
        return Problem(key, "not known here", did_you_mean(str(details["input"]), known))
    if kind in ("tuple_type", "list_type"):
        return Problem(key, "a list is needed here", "Write [a, b, ...].")
    if kind == "dict_type":
        return Problem(key, "a mapping of names is needed here", "Write {name: ...}.")
    if kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        return Problem(key, f"a list of {wanted} is needed here, not of {context['actual_length']}", "")
    if kind == "bool_type":
        return Problem(key, "true or false is needed here", "")
    return Problem(key, details["msg"][:1].lower() + details["msg"][1:], "")


# From a file to a Document: YAML 1.2, one document, bounded in size, depth and aliases.

# A scenario is some kilobytes; reading takes some 40 us a byte, so this much takes 10 s. Meshes have own files.
MAX_BYTES = 250_000
# Aliases within aliases stand for 10^9 values in a few lines, and merging a mapping into many others is slow too.
MAX_ALIASES = 200
MAX_VALUES = 100_000
MAX_DEPTH = 40
_ALIAS = re.compile(r"(?:^|[\s\[{,])\*[^\s\[\]{},*]", re.MULTILINE)
_BRACKET = re.compile(r"[\[{\]}]")


def read_document(path: Path) -> Document:
    """Read a scenario file.

    Raises ScenarioError if it is missing, not a file, too big, not UTF-8, not YAML, empty, or not a mapping
    at its top.
    """
    return document_from(path, _read_text(path))


def document_from(path: Path, text: str) -> Document:
    """The document of a text that stood in a file, which need not be there any more.  Raises ScenarioError."""
    node = _parse(text, str(path))
    if node is None:
        raise ScenarioError("the file is empty", file=str(path), remedy="See docs/scenario.md for the form.")
    if not isinstance(node, CommentedMap):
        raise ScenarioError(
            "a scenario is a mapping of keys at its top, not a list or a single value",
            file=str(path),
            line=1,
            remedy="Start with `slideline: 1`; see docs/scenario.md.",
        )
    reading = _Reading(str(path))
    tree = reading.plain(node, ())
    return Document(path, text, tree, reading.lines)


def yaml_value(text: str, origin: str) -> Any:
    """The plain value of a piece of YAML, that of an override.  Raises ScenarioError naming origin."""
    return _Reading(origin).plain(_parse(text, origin), ())


def plain_value(value: Any) -> Any:
    """A Python value as the file could have held it.  Raises TypeError for what no file can hold."""
    if isinstance(value, Mapping):
        return {str(k): plain_value(v) for k, v in value.items()}
    if isinstance(value, np.generic | np.ndarray):
        return plain_value(value.tolist())
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return [plain_value(v) for v in value]
    if isinstance(value, Path):
        return str(value)
    if value is None or isinstance(value, str | bool | int | float):
        return value
    raise TypeError(f"a scenario cannot hold a {type(value).__name__}")


def _read_text(path: Path) -> str:
    file = str(path)
    if not path.exists():
        raise ScenarioError(
            "there is no such file", file=file, remedy="Check the path."
        )
    if not path.is_file():
        raise ScenarioError("this is not a regular file", file=file, remedy="Give the path of the YAML file.")
    try:
        with path.open("rb") as stream:
            # fault: files of any size read -> data = stream.read(MAX_BYTES) | coupler/test_scenario_reading
            data = stream.read(MAX_BYTES + 1)
    except OSError as exc:
        raise ScenarioError(f"the file cannot be read ({exc.strerror})", file=file) from exc
    if len(data) > MAX_BYTES:
        raise ScenarioError(
            f"the file is larger than {MAX_BYTES} bytes",
            file=file,
            remedy="A scenario holds no meshes and no long series; put the mesh into a file of its own.",
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        raise ScenarioError("the file is not UTF-8 text", file=file, line=data[: exc.start].count(b"\n") + 1,
                            remedy="Save it as UTF-8.") from exc


def _refuse_bombs(text: str, file: str) -> None:
    """Refuse what would take the YAML reader minutes, before it sees it; brackets and stars in text count too."""
    # fault: aliases without limit -> if False: | coupler/test_scenario_reading
    if len(_ALIAS.findall(text)) > MAX_ALIASES:
        raise ScenarioError(f"the text has more than {MAX_ALIASES} aliases", file=file, remedy="Write the values out.")
    steps = (1 if match.group() in "[{" else -1 for match in _BRACKET.finditer(text))
    if any(depth > MAX_DEPTH for depth in itertools.accumulate(steps)):
        raise ScenarioError("the text is nested too deeply", file=file, remedy=f"At most {MAX_DEPTH} brackets deep.")


def _parse(text: str, file: str) -> Any:
    _refuse_bombs(text, file)
    yaml = YAML(typ="rt", pure=True)
    try:
        return yaml.load(text)
    except DuplicateKeyError as exc:
        # The message lists ways to switch the check off; only its first line is of use here.
        said = str(exc.problem).splitlines()[0]
        raise ScenarioError(f"a key stands twice: {said}", file=file, line=_line_of(exc),
                            remedy="Remove or rename one of the two.") from exc
    except MarkedYAMLError as exc:
        raise ScenarioError(
            f"not valid YAML: {exc.problem or exc.context}", file=file, line=_line_of(exc)
        ) from exc
    except YAMLError as exc:
        raise ScenarioError(f"not valid YAML: {str(exc).splitlines()[0]}", file=file) from exc
    except RecursionError as exc:
        raise ScenarioError("the text is nested too deeply", file=file) from exc
    except ValueError as exc:
        # ruamel lets these out for scalars that look like a number or a date and are none (`2020-13-45`).
        raise ScenarioError(f"not valid YAML: {exc}", file=file) from exc


def _line_of(exc: MarkedYAMLError) -> int:
    return exc.problem_mark.line + 1 if exc.problem_mark is not None else 0


@dataclass
class _Reading:
    """Writes out one parsed text as plain values, counting them and noting their lines."""

    file: str
    lines: dict[Key, int] = field(default_factory=dict)
    count: int = 0

    def plain(self, node: Any, key: Key) -> Any:
        self.count += 1
        if self.count > MAX_VALUES or len(key) > MAX_DEPTH:
            raise self._error(key, "the text stands for too many values (aliases within aliases?)",
                              f"At most {MAX_VALUES} values, {MAX_DEPTH} deep.")
        if isinstance(node, CommentedMap):
            self._refuse_tag(node, key)
            return {self._name(node, k, key): self.plain(v, (*key, k)) for k, v in node.items()}
        if isinstance(node, CommentedSeq):
            self._refuse_tag(node, key)
            return [self._item(node, i, v, key) for i, v in enumerate(node)]
        return self._scalar(node, key)

    def _name(self, node: CommentedMap, name: Any, key: Key) -> str:
        if not isinstance(name, str):
            raise self._error(key, f"the key {name!r} is not text", "Write the key as a word, or in quotes.")
        # Keys merged in by `<<` have no line of their own; those of the mapping around them serve.
        place = (node.lc.data or {}).get(name)
        if place is not None:
            self.lines[(*key, name)] = place[0] + 1
        return str(name)

    def _item(self, node: CommentedSeq, i: int, value: Any, key: Key) -> Any:
        self.lines[(*key, i)] = node.lc.data[i][0] + 1
        return self.plain(value, (*key, i))

    def _scalar(self, node: Any, key: Key) -> Any:
        if node is None or isinstance(node, bool):
            return node
        # ruamel's own scalars (quoted, hexadecimal, anchored, ...) are subclasses of these.
        if type(node).__name__ == "ScalarBoolean":
            return bool(node)
        for kind in (str, int, float):
            if isinstance(node, kind):
                return kind(node)
        if isinstance(node, TaggedScalar):
            raise self._error(key, f"the tag {node.tag.value} has no meaning here", "Remove the tag.")
        if isinstance(node, datetime.date | datetime.datetime):
            raise self._error(key, f"{node} reads as a date", "Write numbers in SI, text in quotes.")
        raise self._error(key, f"a {type(node).__name__} has no meaning here")

    def _refuse_tag(self, node: CommentedMap | CommentedSeq, key: Key) -> None:
        if node.tag.value is not None:
            raise self._error(key, f"the tag {node.tag.value} has no meaning here", "Remove the tag.")

    def _error(self, key: Key, message: str, remedy: str = "") -> ScenarioError:
        line = next((self.lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in self.lines), 1)
        # A key inside an alias bomb is as long as the bomb is deep.
        name = dotted(key[:6]) + ("..." if len(key) > 6 else "")
        return ScenarioError(message, file=self.file, line=line, key=name, remedy=remedy)


# Values as the text of a scenario file, laid out as ours are.

WIDTH = 120


def layout() -> YAML:
    """What reads a file with its comments and writes it again: lists stand under their key, lines end at WIDTH."""
    yaml = YAML()
    yaml.width = WIDTH
    yaml.indent(mapping=2, sequence=4, offset=2)
    return yaml


def dumped(tree: Any, yaml: YAML) -> str:
    """The text of a tree, plain or with comments."""
    out = io.StringIO()
    yaml.dump(tree, out)
    return out.getvalue()
