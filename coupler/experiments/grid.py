"""Expands the grid of a study into settings: values of axes, and what they put into the scenario."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from contact.problem.values import did_you_mean
from coupler.errors import ScenarioError
from coupler.scenario.document import Document, Key, dotted, yaml_value
from coupler.scenario.edits import Tree, apply_overrides, cells_times, windows_times
from coupler.scenario.options import ErrorTolerances, Scheme
from coupler.scenario.quantities import with_plain_numbers

# Axes of a grid: short names for what a study varies most, and any key that `--set` takes.

Sets = dict[str, Any]  # dotted key -> value

# Along these a curve of the chart runs: from coarse and cheap to fine and dear.
ALONG = ("windows", "tolerance")
PLAIN = {"scheme": "coupling.scheme", "half": "mechanical.half", "thermal": "thermal.half"}


def sets_of(axis: str, value: Any, tree: Tree) -> Sets:
    """Return what an axis puts into a scenario.

    windows, tolerance, mesh : factors on those of the scenario; substeps : of both halves.  tree : the scenario with
    the axes before this one applied.  Raises ScenarioError naming the axis and the value.
    """
    if axis in FACTORS:
        return FACTORS[axis](axis, _factor(axis, value), tree)
    if axis == "substeps":
        return {f"coupling.substeps.{role}": value for role in ("thermal", "mechanical")}
    if axis == "scheme" and value not in (names := [s.value for s in Scheme]):
        raise ScenarioError("no such scheme", key=f"grid {axis}", value=value, remedy=did_you_mean(str(value), names))
    key = PLAIN.get(axis, axis)
    root = key.split(".")[0]
    if "." not in key or root == "study":
        names = [*FACTORS, "substeps", *PLAIN]
        raise ScenarioError("not an axis of a study", key=f"grid {axis}",
                            remedy=f"{did_you_mean(axis, names)} Or a dotted key of the scenario: thermal.method.")
    return {key: value}


def _factor(axis: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < math.inf:
        raise ScenarioError(f"{axis} is a factor on what the scenario says, a number greater than zero",
                            key=f"grid {axis}", value=value, remedy="2: twice as large, 0.5: half as large.")
    return float(value)


def _windows(axis: str, factor: float, tree: Tree) -> Sets:
    """Make every fixed window `factor` times as long; none longer than its range."""
    if not (scaled := windows_times(tree, factor)):
        raise ScenarioError("the scenario has no fixed windows to make longer or shorter", key=f"grid {axis}",
                            value=factor, remedy="Adaptive windows go with the axis `tolerance`.")
    return _dotted(scaled)


def _tolerance(axis: str, factor: float, tree: Tree) -> Sets:
    """Scale every tolerance of adaptive windows, defaults too: an `atol` that is left out goes with `rtol`."""
    coupling = tree.get("coupling", {})
    adaptive = coupling.get("adaptive", {})
    if "windows" in coupling or not isinstance(adaptive, dict):
        raise ScenarioError("the scenario has no adaptive windows", key=f"grid {axis}", value=factor,
                            remedy="Give coupling.adaptive in the grid too; fixed windows go with the axis `windows`.")
    given = adaptive.get("tolerance", {})
    checked = ErrorTolerances.model_validate(given)
    return {f"coupling.adaptive.tolerance.{quantity}": {
        key: factor * getattr(of, key) for key in ("atol", "rtol") if key == "rtol" or key in given.get(quantity, {})}
        for quantity, of in checked}


def _mesh(axis: str, factor: float, tree: Tree) -> Sets:
    """Mesh with `factor` times as many cells along every edge."""
    for name, body in tree.get("bodies", {}).items():
        if body.get("mesh", {}).get("rectangle") is None:
            raise ScenarioError(f"the mesh of {name!r} is a file, which cannot be refined", key=f"grid {axis}",
                                value=factor, remedy=f"Give the files: bodies.{name}.mesh.file.path: [a, b].")
    return _dotted(cells_times(tree, factor))


def _dotted(values: Mapping[Key, Any]) -> Sets:
    return {dotted(key): value for key, value in values.items()}


FACTORS: dict[str, Callable[[str, float, Tree], Sets]] = {"windows": _windows, "tolerance": _tolerance, "mesh": _mesh}


Grid = Mapping[str, Sequence[Any]]

# A grid of more runs than this is taken for a mistake.
MAX_RUNS = 10_000


@dataclass(frozen=True)
class Setting:
    """A setting of a grid.  at : axis -> value, in the grid's order.  sets : what it puts into the scenario."""

    at: Mapping[str, Any]
    sets: Mapping[str, Any]

    @property
    def label(self) -> str:
        """Its name: `staggered, windows 2`."""
        return ", ".join(_named(axis, value) for axis, value in self.at.items()) or "the scenario as it is"

    @property
    def series(self) -> str:
        """The curve it lies on: all its values but those of ALONG."""
        return ", ".join(_named(a, v) for a, v in self.at.items() if a not in ALONG) or "all"


@dataclass(frozen=True)
class Axis:
    """An axis of a grid: its name and its values."""

    name: str
    values: tuple[Any, ...]


def parse_axis(text: str) -> Axis:
    """Read an axis such as `coupling.scheme=staggered,extrapolated`; values are YAML.  Raises ScenarioError."""
    axis, equals, values = text.partition("=")
    if not equals or not axis.strip() or not values.strip():
        raise ScenarioError("an axis of a grid is AXIS=VALUE,VALUE,...", key="--grid", value=text,
                            remedy="For example --grid scheme=staggered,extrapolated --grid windows=1,2,4")
    return Axis(axis.strip(), tuple(yaml_value(f"[{values}]", f"--grid {axis.strip()}")))


def grid_of(axes: Sequence[Axis]) -> Grid:
    """Make one grid of the axes of a command line.  Raises ScenarioError for an axis given twice."""
    grid: dict[str, tuple[Any, ...]] = {}
    for axis in axes:
        if axis.name in grid:
            raise ScenarioError("this axis is given twice", key=f"--grid {axis.name}",
                                remedy="Give all its values at once.")
        grid[axis.name] = axis.values
    return grid


def settings_of(document: Document, grids: Sequence[Grid]) -> list[Setting]:
    """Return every combination of every grid, each once.  Raises ScenarioError for what the scenario cannot hold."""
    count = sum(_size(grid) for grid in grids)
    if not 0 < count <= MAX_RUNS:
        raise ScenarioError(f"the grid has {count} runs" if count else "there is no grid", key="grid", remedy=(
            f"At most {MAX_RUNS}." if count else "Give --grid AXIS=VALUES, or a `study` in the scenario."))
    settings: dict[str, Setting] = {}
    for grid in grids:
        for values in itertools.product(*grid.values()):
            setting = setting_at(document, dict(zip(grid, values, strict=True)))
            settings.setdefault(json.dumps(setting.at, sort_keys=True), setting)
    return list(settings.values())


def _size(grid: Grid) -> int:
    size = 1 if grid else 0
    for values in grid.values():
        size *= len(values)
    return size


def setting_at(document: Document, at: Mapping[str, Any]) -> Setting:
    """Return the setting of these values; factors are applied last, to what the other axes give.

    Raises ScenarioError for a value that cannot be put into the scenario.
    """
    sets: Sets = {}
    # fault: factors of a grid before what they are factors on -> for axis, value in sorted(at.items(), key=lambda item:
    #   False): | coupler/test_study
    for axis, value in sorted(at.items(), key=lambda item: item[0] in FACTORS):
        own = sets_of(axis, value, document.tree)
        document = with_plain_numbers(apply_overrides(document, own))
        sets |= own
    return Setting(at, sets)


def _named(axis: str, value: Any) -> str:
    if axis in ("scheme", PLAIN["scheme"]):
        return str(value)
    name = axis.removeprefix("coupling.")
    if axis == "coupling.windows" and isinstance(value, list):
        sizes = [r.get("size") for r in value if isinstance(r, Mapping)]
        return f"windows of {sizes[0]} s" if len(value) == len(sizes) == 1 and sizes[0] else f"{len(value)} ranges"
    if isinstance(value, Mapping):
        return f"{name} {{{', '.join(f'{k}: {v}' for k, v in value.items())}}}"
    return f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}"
