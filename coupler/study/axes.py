"""Axes of a grid: short names for what a study varies most, and any key that `--set` knows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from coupler.errors import ScenarioError
from coupler.scenario.document import Key, dotted
from coupler.scenario.options import Scheme
from coupler.scenario.quantity import did_you_mean
from coupler.scenario.scaled import Tree, cells_times, windows_times
from coupler.scenario.schema_tolerance import ErrorTolerances

Sets = dict[str, Any]  # dotted key -> value

# Along these a curve of the chart runs: from coarse and cheap to fine and dear.
ALONG = ("windows", "tolerance")
PLAIN = {"scheme": "coupling.scheme", "half": "mechanical.half", "thermal": "thermal.half"}


def sets_of(axis: str, value: Any, tree: Tree) -> Sets:
    """What an axis puts into a scenario.

    windows, tolerance, mesh : factors on those of the scenario; substeps : of both halves.  tree : the scenario with
    the axes before this one applied.  Raises ScenarioError naming the axis and the value.
    """
    if axis in FACTORS:
        return FACTORS[axis](axis, _factor(axis, value), tree)
    if axis == "substeps":
        return {f"coupling.substeps.{role}": value for role in ("thermal", "mechanical")}
    if axis == "scheme" and value not in (known := [s.value for s in Scheme]):
        raise ScenarioError("no such scheme", key=f"grid {axis}", value=value, remedy=did_you_mean(str(value), known))
    key = PLAIN.get(axis, axis)
    root = key.split(".")[0]
    if "." not in key or root == "study":
        known = [*FACTORS, "substeps", *PLAIN]
        raise ScenarioError("not an axis of a study", key=f"grid {axis}",
                            remedy=f"{did_you_mean(axis, known)} Or a dotted key of the scenario: thermal.method.")
    return {key: value}


def _factor(axis: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf:
        raise ScenarioError(f"{axis} is a factor on what the scenario says, a number greater than zero",
                            key=f"grid {axis}", value=value, remedy="2: twice as large, 0.5: half as large.")
    return float(value)


def _windows(axis: str, factor: float, tree: Tree) -> Sets:
    """Every fixed window `factor` times as long; none longer than its range."""
    if not (scaled := windows_times(tree, factor)):
        raise ScenarioError("the scenario has no fixed windows to make longer or shorter", key=f"grid {axis}",
                            value=factor, remedy="Windows that find their own size go with the axis `tolerance`.")
    return _dotted(scaled)


def _tolerance(axis: str, factor: float, tree: Tree) -> Sets:
    """Every tolerance of windows that find their own size, those left to their defaults too."""
    adaptive = tree.get("coupling", {}).get("adaptive")
    if not isinstance(adaptive, dict):
        raise ScenarioError("the scenario has no windows that find their own size", key=f"grid {axis}", value=factor,
                            remedy="Give coupling.adaptive in the grid too; fixed windows go with the axis `windows`.")
    given = ErrorTolerances.model_validate(adaptive.get("tolerance", {}))
    return {f"coupling.adaptive.tolerance.{quantity}": {name: factor * size for name, size in of.items()}
            for quantity, of in given.model_dump().items()}


def _mesh(axis: str, factor: float, tree: Tree) -> Sets:
    """`factor` times as many cells along every edge."""
    for name, body in tree.get("bodies", {}).items():
        if body.get("mesh", {}).get("rectangle") is None:
            raise ScenarioError(f"the mesh of {name!r} is a file, which cannot be refined", key=f"grid {axis}",
                                value=factor, remedy=f"Give the files: bodies.{name}.mesh.file.path: [a, b].")
    return _dotted(cells_times(tree, factor))


def _dotted(values: Mapping[Key, Any]) -> Sets:
    return {dotted(key): value for key, value in values.items()}


FACTORS: dict[str, Callable[[str, float, Tree], Sets]] = {"windows": _windows, "tolerance": _tolerance, "mesh": _mesh}
