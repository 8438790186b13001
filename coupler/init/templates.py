"""What comes with an installation: templates of scenarios with their choices, and named materials."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from contact.problem.values import did_you_mean
from coupler.errors import ScenarioError
from coupler.scenario.document import Document, document_from, dotted, read_document
from coupler.scenario.edits import cells_times

# What a new scenario is made of: templates, named materials, and the choices of its user.

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
        """A line on it: the first one of its head."""
        return self.document.text.partition("\n")[0].lstrip("# ")

    def text_for(self, file: str) -> str:
        """Return its text with the new file's name in the commands of its head."""
        return self.document.text.replace(self.path.name, file)

    def document_for(self, path: Path) -> Document:
        """Return the document of a copy at `path`."""
        return document_from(path, self.text_for(path.name))


def templates(folder: Path = FOLDER) -> Mapping[str, Template]:
    """Return all templates by name.  Raises ScenarioError where the installation has none."""
    by_name = {path.stem: Template(path) for path in sorted(folder.glob("*.yaml"))}
    if not by_name:
        raise ScenarioError("the templates that belong to this installation are missing", file=str(folder),
                            remedy="Install slideline again")
    return by_name


def template_named(name: str) -> Template:
    """Return the template of a name.  Raises ScenarioError with the nearest one."""
    by_name = templates()
    if name not in by_name:
        raise ScenarioError("there is no such template", key="TEMPLATE", value=name,
                            remedy=did_you_mean(name, by_name))
    return by_name[name]


# Named materials for new scenarios: room temperature, each number with its source (materials.yaml).

FILE = Path(__file__).resolve().parent / "materials.yaml"


@dataclass(frozen=True)
class LibraryMaterial:
    """A named material.  about : a line on it.  source : of its numbers.

    values : rho, k, c, E, nu, alpha, SI, at 300 K.
    """

    name: str
    about: str
    source: str
    values: Mapping[str, float]


@cache
def library() -> Mapping[str, LibraryMaterial]:
    """Return all named materials."""
    tree = read_document(FILE).tree
    sources = tree["sources"]
    return {name: LibraryMaterial(name, entry["about"], "; ".join(sources[key] for key in entry["from"]),
                           {key: entry[key] for key in ("rho", "k", "c", "E", "nu", "alpha")})
            for name, entry in tree["materials"].items()}


def material_named(name: str, key: str) -> LibraryMaterial:
    """Return the material of a name.  key : of the error.  Raises ScenarioError with the nearest one."""
    if name not in library():
        raise ScenarioError("there is no such material", key=key, value=name,
                            remedy=f"{did_you_mean(name, library())} Others are written by hand: docs/scenario.md")
    return library()[name]


def exchangeable(tree: Mapping[str, Any]) -> list[str]:
    """Return the materials that a named one may replace: those of plain numbers, without flow or melting."""
    plain = {"rho", "k", "c", "E", "nu", "alpha", "T_ref"}
    return [name for name, values in tree["materials"].items()
            # fault: init: a metal that melts may be exchanged -> if all(True or isinstance(v, int | float) for v in
            #   values.values())] | coupler/test_init
            if set(values) <= plain and all(isinstance(v, int | float) for v in values.values())]


def put_in_place(values: Mapping[str, Any], material: LibraryMaterial) -> dict[str, float]:
    """Return the named material's numbers for the keys that the scenario's material has.

    Without T_ref a body does not expand (alpha is 0 on purpose), and that stays.
    """
    return {key: value for key, value in material.values.items()
            # fault: init: a body that was not to expand does -> if key in values and True} | coupler/test_init
            if key in values and (key != "alpha" or "T_ref" in values)}


# The choices for a new scenario, and the values that replace the template's.

@dataclass(frozen=True)
class Choices:
    """The choices for a new scenario.

    title, end [s] : None for the template's.  materials : material of the template -> named one.

    mesh : factor on the cells along every edge.  sets : dotted key -> value, which come last.
    """

    title: str | None = None
    end: float | None = None
    materials: Mapping[str, str] = field(default_factory=dict)
    mesh: float = 1.0
    sets: Mapping[str, Any] = field(default_factory=dict)


def chosen_materials(texts: Iterable[str]) -> dict[str, str]:
    """Read `NAME=KIND` texts: material -> named one.  Raises ScenarioError for another form."""
    chosen = {}
    for text in texts:
        name, equals, kind = text.partition("=")
        if not equals or not name.strip() or not kind.strip():
            raise ScenarioError("a choice of material reads NAME=KIND", key="--material", value=text,
                                remedy="For example --material lower=copper; --list names the materials")
        chosen[name.strip()] = kind.strip()
    return chosen


def named(tree: Mapping[str, Any], choices: Choices) -> dict[str, LibraryMaterial]:
    """Look up the named materials: material of the template -> the library's.  Raises ScenarioError."""
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
    """Return the values that replace the template's, by dotted key.  Raises ScenarioError for a wrong choice."""
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
    """Set the end, and extend the last range of windows to it; ranges beyond an earlier end are cut anyway."""
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
    """Refine all rectangles."""
    if not 0 < factor < math.inf:
        raise ScenarioError("a mesh is so many times as fine, a number above 0", key="--mesh", value=factor,
                            remedy="2 halves the cells' edges, 0.5 doubles them")
    return {dotted(key): cells for key, cells in cells_times(tree, factor).items()}
