"""What was chosen for a new scenario, and the values it puts in place of the template's."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from coupler.errors import ScenarioError
from coupler.init.materials import Material, exchangeable, material_named, put_in_place
from coupler.scenario.document import dotted
from coupler.scenario.quantity import did_you_mean
from coupler.scenario.scaled import cells_times


@dataclass(frozen=True)
class Choices:
    """title, end : None for the template's [s].  materials : material of the template -> named one.

    mesh : so many times as many cells along every edge.  sets : dotted key -> value, which come last.
    """

    title: str | None = None
    end: float | None = None
    materials: Mapping[str, str] = field(default_factory=dict)
    mesh: float = 1.0
    sets: Mapping[str, Any] = field(default_factory=dict)


def chosen_materials(texts: Iterable[str]) -> dict[str, str]:
    """material -> named one, from `NAME=KIND`.  Raises ScenarioError."""
    chosen = {}
    for text in texts:
        name, equals, kind = text.partition("=")
        if not equals or not name.strip() or not kind.strip():
            raise ScenarioError("a choice of material reads NAME=KIND", key="--material", value=text,
                                remedy="For example --material lower=copper; --list names the materials")
        chosen[name.strip()] = kind.strip()
    return chosen


def named(tree: Mapping[str, Any], choices: Choices) -> dict[str, Material]:
    """material of the template -> the library's.  Raises ScenarioError for a name that is not known."""
    may = exchangeable(tree)
    for name in choices.materials:
        if name not in tree["materials"]:
            raise ScenarioError("the template has no such material", key="--material", value=name,
                                remedy=did_you_mean(name, may))
        if name not in may:
            raise ScenarioError("this material melts, flows or changes with temperature; a named one would take that "
                                "away", key="--material", value=name,
                                remedy=f"Change its numbers with --set materials.{name}.KEY=VALUE")
    return {name: material_named(kind, f"--material {name}") for name, kind in choices.materials.items()}


def overrides_of(tree: Mapping[str, Any], choices: Choices) -> dict[str, Any]:
    """Dotted key -> value to put in place of the template's.  Raises ScenarioError."""
    put: dict[str, Any] = {} if choices.title is None else {"title": choices.title}
    if choices.end is not None:
        put |= _ended(tree, choices.end)
    for name, material in named(tree, choices).items():
        put |= {f"materials.{name}.{key}": value
                for key, value in put_in_place(tree["materials"][name], material).items()}
    if choices.mesh != 1.0:
        put |= _meshed(tree, choices.mesh)
    return put | dict(choices.sets)


def _ended(tree: Mapping[str, Any], end: float) -> dict[str, Any]:
    """The end, and the last range of windows drawn out to it; what lies beyond an earlier end is cut off anyway."""
    if not 0 < end < math.inf:
        raise ScenarioError("a scenario ends at a time after 0", key="--end", value=end, remedy="Give seconds")
    end = int(end) if end == int(end) else end  # written as anybody would write it
    put: dict[str, Any] = {"coupling.end": end}
    windows = tree["coupling"].get("windows", [])
    # fault: init: a later end leaves the windows behind -> if False: | coupler/test_init
    if windows and windows[-1]["until"] < end:
        put[f"coupling.windows.{len(windows) - 1}.until"] = end
    return put


def _meshed(tree: Mapping[str, Any], factor: float) -> dict[str, Any]:
    """Cells of all rectangles."""
    if not 0 < factor < math.inf:
        raise ScenarioError("a mesh is so many times as fine, a number above 0", key="--mesh", value=factor,
                            remedy="2 halves the cells' edges, .5 doubles them")
    return {dotted(key): cells for key, cells in cells_times(tree, factor).items()}
