"""Overrides: values put in place of a scenario's own before it is checked."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from coupler.errors import ScenarioError
from coupler.scenario.document import Document, Key, dotted, plain_value, yaml_value

# Setting one side takes the other out, so that `coupling.windows.3.size=2` works on any range.
ALTERNATIVES = (
    (frozenset({"size"}), frozenset({"first", "last"})),
    (frozenset({"rectangle"}), frozenset({"file"})),
    (frozenset({"windows"}), frozenset({"adaptive"})),
)


def parse_override(text: str) -> tuple[str, Any]:
    """(dotted key, value) of `key=value`, the value being YAML.  Raises ScenarioError if it is not that."""
    key, equals, value = text.partition("=")
    if not equals or not key.strip():
        raise ScenarioError(
            "an override is key=value", value=text, remedy="For example coupling.scheme=staggered."
        )
    return key.strip(), yaml_value(value, f"override {key.strip()}")


def apply_overrides(document: Document, overrides: Mapping[str, Any]) -> Document:
    """The document with values put at dotted keys; list items by their number from 0.

    Whether a key exists is the schema's to say; here an override must only find its way.
    Raises ScenarioError.
    """
    tree = copy.deepcopy(document.tree)
    _leave_options(tree, overrides)
    keys = set(document.overridden)
    for name, value in overrides.items():
        try:
            keys.add(_put(tree, name, plain_value(value)))
        except TypeError as exc:
            raise ScenarioError(str(exc), key=name, remedy="Give numbers, text, lists and mappings.") from exc
    return replace(document, tree=tree, overridden=frozenset(keys))


def _leave_options(tree: dict[str, Any], overrides: Mapping[str, Any]) -> None:
    """Take the options of a half out where another one takes its place: no other half has them."""
    for role in ("thermal", "mechanical"):
        stated, kind = tree.get(role), overrides.get(f"{role}.half")
        # fault: a half is given the options of the one before -> if False: | coupler/test_scenario_override
        if kind is not None and isinstance(stated, dict) and stated.get("half") != kind:
            stated.pop("options", None)


def _put(tree: dict[str, Any], name: str, value: Any) -> Key:
    node: Any = tree
    rest = name.split(".")
    done: list[str | int] = []
    while True:
        part, rest = _next_part(node, rest, tuple(done), name)
        done.append(part)
        if not rest:
            _drop_alternatives(node, part)
            # fault: overrides change nothing -> pass | coupler/test_scenario_override
            node[part] = value
            return tuple(done)
        if isinstance(node, dict) and node.get(part) is None:
            node[part] = {}
        node = node[part]


def _next_part(node: Any, parts: list[str], done: Key, name: str) -> tuple[str | int, list[str]]:
    """The next step into node and what is left: names may hold dots (those of probes do): the longest wins."""
    if isinstance(node, list):
        if parts[0].isdecimal() and int(parts[0]) < len(node):
            return int(parts[0]), parts[1:]
        raise ScenarioError(
            f"{dotted(done)} is a list of {len(node)}; {parts[0]!r} is none of its items",
            key=name,
            remedy=f"Items are numbered 0 to {len(node) - 1}; or give the whole list.",
        )
    if not isinstance(node, dict):
        raise ScenarioError(f"{dotted(done)} is a single value, with nothing inside it", key=name, value=node,
                            remedy=f"Set {dotted(done)} itself, to a mapping.")
    for n in range(len(parts), 1, -1):
        if (joined := ".".join(parts[:n])) in node:
            return joined, parts[n:]
    return parts[0], parts[1:]


def _drop_alternatives(node: Any, part: str | int) -> None:
    for one, other in ALTERNATIVES:
        for mine, theirs in ((one, other), (other, one)):
            if part in mine and isinstance(node, dict):
                for key in theirs & node.keys():
                    del node[key]


# A scenario's windows and meshes, longer and finer by a factor.

Tree = Mapping[str, Any]  # a scenario's values, as the file has them


def windows_times(tree: Tree, factor: float) -> dict[Key, Any]:
    """Every fixed window `factor` times as long, none longer than its range; {} where windows are adaptive."""
    ranges = (tree.get("coupling") or {}).get("windows")
    if not isinstance(ranges, list):
        return {}
    start, scaled = 0.0, []
    for r in ranges:
        length = r["until"] - start
        # fault: windows of a study longer than their range -> scaled.append({k: v if k == "until" else v * factor for
        #   k, v in r.items()}) | coupler/test_study
        scaled.append({k: v if k == "until" else min(v * factor, length) for k, v in r.items()})
        start = r["until"]
    return {("coupling", "windows"): scaled}


def cells_as(tree: Tree, count: Callable[[int], int]) -> dict[Key, Any]:
    """Every rectangle with `count` of its cells along each edge; meshes from files are not among them."""
    return {("bodies", name, "mesh", "rectangle", "cells"): [count(int(n)) for n in rectangle["cells"]]
            for name, body in tree.get("bodies", {}).items()
            if (rectangle := (body.get("mesh") or {}).get("rectangle")) is not None}


def cells_times(tree: Tree, factor: float) -> dict[Key, Any]:
    """`factor` times as many cells along every edge; an edge of one cell stands for no direction and stays one."""
    return cells_as(tree, lambda n: 1 if n == 1 else max(round(n * factor), 1))
