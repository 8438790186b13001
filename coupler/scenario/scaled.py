"""A scenario's windows and meshes, longer and finer by a factor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from coupler.scenario.document import Key

Tree = Mapping[str, Any]  # a scenario's values, as the file has them


def windows_times(tree: Tree, factor: float) -> dict[Key, Any]:
    """Every fixed window `factor` times as long, none longer than its range; {} where windows find their own size."""
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
