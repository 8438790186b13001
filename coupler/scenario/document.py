"""A scenario's text as plain values that still know the line each one stands on."""

from __future__ import annotations

import datetime
import io
import itertools
import re
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq, TaggedScalar
from ruamel.yaml.constructor import DuplicateKeyError, RoundTripConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError

from contact.problem.errors import UNKNOWN, wrongs
from coupler.errors import UNPRINTABLE, ScenarioError, together
from coupler.scenario.unit_system import UnitSystem

Key = tuple[str | int, ...]


def dotted(key: Key) -> str:
    """`coupling.windows.3.size` of ("coupling", "windows", 3, "size"): the form overrides use too."""
    return ".".join(str(part) for part in key)


@dataclass(frozen=True)
class Document:
    """A scenario as read: nothing but dict, list, str, int, float, bool and None.

    lines : line number of every key and list item, 1-based.  overridden : keys set from outside the file.
    written : what stood at keys whose value with a unit was made a plain number.
    system : the units of the file's plain numbers, which were made SI; None where they are SI.
    """

    path: Path
    text: str
    tree: dict[str, Any]
    lines: Mapping[Key, int]
    overridden: frozenset[Key] = field(default_factory=frozenset)
    written: Mapping[Key, str] = field(default_factory=dict)
    system: UnitSystem | None = None

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
            value=shown(self.written.get(key, self.value(key))),
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


class DocumentErrors:
    """Gathers what is wrong with a document, so that all of it is told at once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._errors: list[ScenarioError] = []

    def wrong(self, key: Key, text: str, remedy: str = "") -> None:
        """Note what is wrong at a key; what was noted before is not noted again."""
        self._add(self._document.error(key, text, remedy))

    @contextmanager
    def each(self) -> Iterator[None]:
        """Go on behind the block where it raises a ScenarioError, which is noted."""
        try:
            yield
        except ScenarioError as exc:
            for error in (exc, *exc.others):
                self._add(error)

    def __bool__(self) -> bool:
        """Whether there is anything to tell."""
        return bool(self._errors)

    def stop(self) -> None:
        """Raise the ScenarioError that tells all, if there is anything to tell."""
        if self._errors:
            raise together(self._errors)

    def _add(self, error: ScenarioError) -> None:
        error.others = ()
        if all((error.key, error.message) != (e.key, e.message) for e in self._errors):
            self._errors.append(error)


def scenario_error(document: Document, error: ValidationError) -> ScenarioError:
    """Make the error of a file whose form is wrong: unknown keys first, then by line."""
    found = sorted(wrongs(error), key=lambda w: (w.text != UNKNOWN, document.line(w.key), len(w.key)))
    return together([document.error(w.key, w.text, w.remedy) for w in dict.fromkeys(found)])


# From a file to a Document: YAML 1.2, one document, bounded in size, depth and aliases.

# A scenario is some kilobytes; reading takes some 40 us a byte, so this much takes 10 s. Meshes have own files.
MAX_BYTES = 250_000
# Aliases within aliases stand for 10^9 values in a few lines, and merging a mapping into many others is slow too.
MAX_ALIASES = 200
MAX_VALUES = 100_000
MAX_DEPTH = 40
MAX_MERGED = 10_000  # keys that all `<<` bring in, which the reader copies one by one
HDF5 = b"\x89HDF\r\n\x1a\n"  # how each file of results begins
MAX_NAME = 100  # letters of a key: names become those of files and of variables
YAML_REMEDY = "Check indentation, brackets, colons and quotes there and on the line before."
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
            remedy="Start with `slideline: 2`; see docs/scenario.md.",
        )
    reading = _Reading(str(path))
    # fault: what is done to a document is done to all of its text -> tree = node |
    #   coupler/test_scenario_reading::test_what_is_done_to_a_document_another_of_the_same_text_does_not_see
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
            "there is no such file", file=file,
            remedy="Check the path; `slideline list` names the scenarios that are installed."
        )
    if not path.is_file():
        raise ScenarioError("this is not a regular file", file=file, remedy="Give the path of the YAML file.")
    try:
        with path.open("rb") as stream:
            # fault: files of any size read -> data = stream.read(MAX_BYTES) | coupler/test_scenario_reading
            data = stream.read(MAX_BYTES + 1)
    except OSError as exc:
        raise ScenarioError(f"the file cannot be read ({exc.strerror})", file=file,
                            remedy="Check that you may read it.") from exc
    if len(data) > MAX_BYTES:
        raise ScenarioError(
            f"the file is larger than {MAX_BYTES} bytes",
            file=file,
            remedy="A scenario holds no meshes and no long series; put the mesh into a file of its own.",
        )
    # fault: a results file in place of a scenario is told as bad text -> if False: | coupler/test_scenario_reading
    if data.startswith(HDF5):
        raise ScenarioError("this is a results file, not a scenario", file=file,
                            remedy="Give the YAML file; `slideline report` reads results.")
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
    try:
        return _nodes(text)
    except _TooManyMergedError as exc:
        raise ScenarioError(f"the merges (<<) bring in more than {MAX_MERGED} keys", file=file, line=exc.line,
                            remedy="Write the values out, or merge fewer.") from exc
    except DuplicateKeyError as exc:
        # The message lists ways to switch the check off; only its first line is of use here.
        # fault: the whole value of a duplicated key is told -> said = str(exc.problem).splitlines()[0] |
        #   coupler/test_scenario_reading
        said = str(exc.problem).splitlines()[0].partition(" with value ")[0].removeprefix("found duplicate key ")
        raise ScenarioError(f"a key is duplicated: {said}", file=file, line=_line_of(exc),
                            remedy="Remove or rename one of the two.") from exc
    except MarkedYAMLError as exc:
        said = str(exc.problem or exc.context)
        # fault: a tab is told as a token that cannot start -> remedy = YAML_REMEDY | coupler/test_scenario_reading
        remedy = "Indent with blanks, not with tabs." if r"'\t'" in said else YAML_REMEDY
        raise ScenarioError(f"not valid YAML: {said}", file=file, line=_line_of(exc), remedy=remedy) from exc
    except YAMLError as exc:
        raise ScenarioError(f"not valid YAML: {str(exc).splitlines()[0]}", file=file, remedy=YAML_REMEDY) from exc
    except RecursionError as exc:
        raise ScenarioError("the text is nested too deeply", file=file,
                            remedy=f"At most {MAX_DEPTH} levels deep.") from exc
    except ValueError as exc:
        # ruamel lets these out for scalars that look like a number or a date and are none (`2020-13-45`).
        raise ScenarioError(f"not valid YAML: {exc}", file=file, remedy=YAML_REMEDY) from exc


@lru_cache(maxsize=16)
def _nodes(text: str) -> Any:
    """The nodes of a text, of which _Reading makes values and changes nothing.

    Studies, and whoever loads a scenario with other overrides, parse it once: 15 ms for a small one.
    """
    yaml = YAML(typ="rt", pure=True)
    yaml.Constructor = _CountingConstructor
    return yaml.load(text)


class _TooManyMergedError(Exception):
    """Merges bring in too many keys.  line : of the mapping where they became too many."""

    def __init__(self, line: int) -> None:
        super().__init__(line)
        self.line = line


class _CountingConstructor(RoundTripConstructor):
    """Makes the values of a text, and counts the keys that merges bring in as they come."""

    merged = 0

    def flatten_mapping(self, node: Any) -> Any:
        found = super().flatten_mapping(node)
        self.merged += sum(len(mapping) for mapping in found or ())
        # fault: merges without limit -> if False: | coupler/test_scenario_reading
        if self.merged > MAX_MERGED:
            raise _TooManyMergedError(node.start_mark.line + 1)
        return found


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
            # fault: a place written by a program of YAML 1.1 is not understood -> on = False |
            #   coupler/test_scenario_reading::test_an_on_that_became_true_is_understood
            on = name is True
            raise self._error(key, f"the key {str(name).lower() if on else repr(name)} is not text",
                              "A program that writes YAML 1.1 makes `true` of `on`: write on." if on else
                              "Write the key as a word, or in quotes; a number has a decimal point, not a comma.")
        self._refuse_controls(name, key)
        # fault: names of any length -> if False: | coupler/test_scenario_reading
        if len(name) > MAX_NAME:
            raise self._error(key, f"the key {name[:20]}... has {len(name)} letters", f"At most {MAX_NAME} are allowed")
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
        if isinstance(node, str):
            self._refuse_controls(node, key)
        for kind in (str, int, float):
            if isinstance(node, kind):
                return kind(node)
        if isinstance(node, TaggedScalar):
            raise self._error(key, f"the tag {node.tag.value} has no meaning here", "Remove the tag.")
        if isinstance(node, datetime.date | datetime.datetime):
            raise self._error(key, f"{node} reads as a date", "Write numbers in SI, text in quotes.")
        raise self._error(key, f"a {type(node).__name__} has no meaning here")

    def _refuse_controls(self, text: str, key: Key) -> None:
        """Refuse what a terminal takes for a command, and what no file can hold: controls, lone surrogates."""
        found = UNPRINTABLE.search(text)
        # fault: text that steers a terminal goes by -> if False: | coupler/test_scenario_reading
        if found is not None:
            raise self._error(key, f"the text holds the character U+{ord(found[0]):04X}, which cannot be printed",
                              "Remove it; a character beyond U+FFFF is written as itself.")

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
