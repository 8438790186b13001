"""A scenario's text as plain values that still know the line each one stands on."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

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
