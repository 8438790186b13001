"""From a grid to the runs it stands for."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from coupler.errors import ScenarioError
from coupler.scenario.document import Document
from coupler.scenario.override import apply_overrides
from coupler.scenario.reading import yaml_value
from coupler.study.axes import ALONG, FACTORS, PLAIN, Sets, sets_of

Grid = Mapping[str, Sequence[Any]]

# More runs than this is a slip of the keyboard.
MAX_CELLS = 10_000


@dataclass(frozen=True)
class Cell:
    """One setting.  at : axis -> value, in the order of the grid.  sets : what it puts into the scenario."""

    at: Mapping[str, Any]
    sets: Mapping[str, Any]

    @property
    def label(self) -> str:
        """`staggered, windows 2`."""
        return ", ".join(_said(axis, value) for axis, value in self.at.items()) or "the scenario as it is"

    @property
    def series(self) -> str:
        """The curve it lies on: all its values but those along which a curve runs."""
        return ", ".join(_said(a, v) for a, v in self.at.items() if a not in ALONG) or "all"


def parse_axis(text: str) -> tuple[str, tuple[Any, ...]]:
    """(axis, values) of `coupling.scheme=staggered,extrapolated`; values are YAML.  Raises ScenarioError."""
    axis, equals, values = text.partition("=")
    if not equals or not axis.strip() or not values.strip():
        raise ScenarioError("an axis of a grid is AXIS=VALUE,VALUE,...", key="--grid", value=text,
                            remedy="For example --grid scheme=staggered,extrapolated --grid windows=1,2,4")
    return axis.strip(), tuple(yaml_value(f"[{values}]", f"--grid {axis.strip()}"))


def grid_of(axes: Sequence[tuple[str, tuple[Any, ...]]]) -> Grid:
    """One grid of the axes of a command line.  Raises ScenarioError for an axis given twice."""
    grid: dict[str, tuple[Any, ...]] = {}
    for axis, values in axes:
        if axis in grid:
            raise ScenarioError("this axis is given twice", key=f"--grid {axis}", remedy="Give all its values at once.")
        grid[axis] = values
    return grid


def cells_of(document: Document, grids: Sequence[Grid]) -> list[Cell]:
    """Every combination of every grid, each once.  Raises ScenarioError for what cannot be put into the scenario."""
    count = sum(_size(grid) for grid in grids)
    if not 0 < count <= MAX_CELLS:
        raise ScenarioError(f"the grid has {count} runs" if count else "there is no grid", key="grid", remedy=(
            f"At most {MAX_CELLS}." if count else "Give --grid AXIS=VALUES, or a `study` in the scenario."))
    cells: dict[str, Cell] = {}
    for grid in grids:
        for values in itertools.product(*grid.values()):
            cell = cell_at(document, dict(zip(grid, values, strict=True)))
            cells.setdefault(json.dumps(cell.at, sort_keys=True), cell)
    return list(cells.values())


def _size(grid: Grid) -> int:
    size = 1 if grid else 0
    for values in grid.values():
        size *= len(values)
    return size


def cell_at(document: Document, at: Mapping[str, Any]) -> Cell:
    """The cell of these values.  Factors come last: they are on what the other axes left.  Raises ScenarioError."""
    sets: Sets = {}
    # fault: factors of a grid before what they are factors on -> for axis, value in sorted(at.items(), key=lambda item:
    #   False): | coupler/test_study
    for axis, value in sorted(at.items(), key=lambda item: item[0] in FACTORS):
        found = sets_of(axis, value, document.tree)
        document = apply_overrides(document, found)
        sets |= found
    return Cell(at, sets)


def _said(axis: str, value: Any) -> str:
    if axis in ("scheme", PLAIN["scheme"]):
        return str(value)
    name = axis.removeprefix("coupling.")
    if axis == "coupling.windows" and isinstance(value, list):
        sizes = [r.get("size") for r in value if isinstance(r, Mapping)]
        return f"windows of {sizes[0]} s" if len(value) == len(sizes) == 1 and sizes[0] else f"{len(value)} ranges"
    if isinstance(value, Mapping):
        return f"{name} {{{', '.join(f'{k}: {v}' for k, v in value.items())}}}"
    return f"{name} {value:g}" if isinstance(value, float) else f"{name} {value}"
