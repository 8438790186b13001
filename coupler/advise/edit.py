"""Edits of a scenario: values put in and keys taken out, on plain values and on a commented file alike."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from coupler.scenario.document import Key

Tree = Mapping[str, Any]  # a scenario's values, as the file has them


@dataclass(frozen=True)
class Edit:
    """put : key -> value.  drop : keys taken out, items of lists too."""

    put: Mapping[Key, Any] = field(default_factory=dict)
    drop: tuple[Key, ...] = ()

    def plus(self, other: Edit) -> Edit:
        """Both; where they put the same key, the other's value."""
        return Edit({**self.put, **other.put}, (*self.drop, *other.drop))


def edited(tree: Any, edits: Iterable[Edit]) -> Any:
    """A copy of the tree with all puts done, then all drops.

    So an edit that takes a block out wins over one that changes something inside it, and numbers of list items are
    those of the tree as it came.
    """
    tree, gone = copy.deepcopy(tree), set()
    for edit in edits:
        for key, value in edit.put.items():
            _put(tree, key, copy.deepcopy(value))
        gone |= set(edit.drop)
    # Later items of a list first: the numbers of the others then stay right.
    # fault: advice: numbers of list items move when one is taken out -> for key in sorted(gone, key=_order): |
    #   coupler/test_advise
    for key in sorted(gone, key=_order, reverse=True):
        _drop(tree, key)
    return tree


def at(tree: Any, key: Key) -> Any:
    """What stands at a key; None where nothing does."""
    for part in key:
        if part not in _inside(tree):
            return None
        tree = tree[part]
    return tree


def _order(key: Key) -> tuple[tuple[str, int], ...]:
    return tuple(("", part) if isinstance(part, int) else (part, 0) for part in key)


def _put(tree: Any, key: Key, value: Any) -> None:
    for part in key[:-1]:
        if isinstance(tree, dict) and tree.get(part) is None:
            tree[part] = {}
        tree = tree[part]
    tree[key[-1]] = value


def _drop(tree: Any, key: Key) -> None:
    if key[-1] in _inside(holder := at(tree, key[:-1])):
        del holder[key[-1]]


def _inside(tree: Any) -> Any:
    """What a next part of a key may be."""
    return tree.keys() if isinstance(tree, Mapping) else range(len(tree)) if isinstance(tree, list) else ()
