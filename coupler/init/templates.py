"""The templates: files of coupler/templates, each a whole scenario with a comment at its head."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from coupler.errors import ScenarioError
from coupler.scenario.document import Document, did_you_mean, document_from, dotted, read_document
from coupler.scenario.edits import cells_times

FOLDER = Path(__file__).resolve().parent.parent / "templates"


@dataclass(frozen=True)
class Template:
    """A scenario to begin with.  path : its file.  name : by which it is asked for, the file's without its ending."""

    path: Path

    @property
    def name(self) -> str:
        return self.path.stem

    @cached_property
    def document(self) -> Document:
        """Its content.  Raises ScenarioError where the installation is damaged."""
        return read_document(self.path)

    @property
    def about(self) -> str:
        """What it is: the first line of its head."""
        return self.document.text.partition("\n")[0].lstrip("# ")

    def text_for(self, file: str) -> str:
        """Its text with the new file's name in the commands of its head."""
        return self.document.text.replace(self.path.name, file)

    def document_for(self, path: Path) -> Document:
        """What stands in a copy of it at `path`."""
        return document_from(path, self.text_for(path.name))


def templates(folder: Path = FOLDER) -> Mapping[str, Template]:
    """All templates by name.  Raises ScenarioError where the installation has none."""
    found = {path.stem: Template(path) for path in sorted(folder.glob("*.yaml"))}
    if not found:
        raise ScenarioError("the templates that belong to this installation are missing", file=str(folder),
                            remedy="Install slideline again")
    return found


def template_named(name: str) -> Template:
    """The template of a name.  Raises ScenarioError with the nearest one."""
    known = templates()
    if name not in known:
        raise ScenarioError("there is no such template", key="TEMPLATE", value=name,
                            remedy=did_you_mean(name, known))
    return known[name]


# Named materials for new scenarios: room temperature, each number with its source (materials.yaml).

FILE = Path(__file__).resolve().parent / "materials.yaml"


@dataclass(frozen=True)
class Material:
    """about : what it is.  source : where its numbers are from.  values : rho, k, c, E, nu, alpha, SI, at 300 K."""

    name: str
    about: str
    source: str
    values: Mapping[str, float]


@cache
def library() -> Mapping[str, Material]:
    """All named materials."""
    tree = read_document(FILE).tree
    sources = tree["sources"]
    return {name: Material(name, entry["about"], "; ".join(sources[key] for key in entry["from"]),
                           {key: entry[key] for key in ("rho", "k", "c", "E", "nu", "alpha")})
            for name, entry in tree["materials"].items()}


def material_named(name: str, key: str) -> Material:
    """The material of a name; key : whose it was to be.  Raises ScenarioError with the nearest one."""
    if name not in library():
        raise ScenarioError("there is no such material", key=key, value=name,
                            remedy=f"{did_you_mean(name, library())} Others are written by hand: docs/scenario.md")
    return library()[name]


def exchangeable(tree: Mapping[str, Any]) -> list[str]:
    """Materials of a scenario that a named one may stand for: those that are plain numbers, without flow or melting."""
    plain = {"rho", "k", "c", "E", "nu", "alpha", "T_ref"}
    return [name for name, values in tree["materials"].items()
            # fault: init: a metal that melts may be exchanged -> if all(True or isinstance(v, int | float) for v in
            #   values.values())] | coupler/test_init
            if set(values) <= plain and all(isinstance(v, int | float) for v in values.values())]


def put_in_place(values: Mapping[str, Any], material: Material) -> dict[str, float]:
    """The named material's numbers for the keys that stand in the scenario's.

    Without T_ref a body does not expand (alpha is 0 on purpose), and that stays.
    """
    return {key: value for key, value in material.values.items()
            # fault: init: a body that was not to expand does -> if key in values and True} | coupler/test_init
            if key in values and (key != "alpha" or "T_ref" in values)}


# What was chosen for a new scenario, and the values it puts in place of the template's.

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
