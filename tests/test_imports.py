"""Imports point one way (docs/design.md): read from the source, so that a lazy import counts too.

A module named in a text, as `"coupler.fmu.host"` or `"thermal_fmu.half:load"`, counts as imported.
"""

from __future__ import annotations

import ast
import importlib.util
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("contact", "thermal_fmu", "mechanical_fmu", "coupler")
MAY_IMPORT = {"contact": set(), "thermal_fmu": {"contact"}, "mechanical_fmu": {"contact"}, "coupler": {"contact"}}
ONLY_IN = {"fmpy": {"coupler/fmu/library.py"}, "zenoh": {"contact/rpc/zenoh_session.py"}}
COMES_WITH = {"pydantic_core": "pydantic"}  # whose dependency it is for good
BELOW_SCENARIO = {"contact/problem", "coupler/scenario", "coupler", "contact", "contact/half", "contact/rpc"}
MODULE = re.compile(r"[a-z_]\w*(\.[a-z_]\w*)+(?=:\w+$|$)")

_spec = importlib.util.spec_from_file_location("rooms", ROOT / "docs/site/rooms.py")
assert _spec
assert _spec.loader
picture = importlib.util.module_from_spec(_spec)
sys.modules["rooms"] = picture
_spec.loader.exec_module(picture)
ENTRIES = {name for name, room in picture.ROOMS.items() if room.entry}

Graph = Mapping[str, set[str]]


def stated(node: ast.AST) -> Iterator[str]:
    """Everything an import statement imports, `a.b.c` for `from a.b import c` too; nothing of another node."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        assert not node.level, f"{ast.unparse(node)}: imports are absolute"
        yield from (f"{node.module}.{alias.name}" for alias in node.names)


@cache
def read(path: Path, text: str) -> tuple[frozenset[str], frozenset[str]]:
    """What a file of this text imports by statement, and what else of it names a module."""
    by_statement: set[str] = set()
    by_text: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        by_statement.update(stated(node))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and (found := MODULE.match(node.value)):
            by_text.add(found[0])
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in (
                "import_module", "__import__"):
            by_text.update(a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str))
    return frozenset(by_statement), frozenset(by_text)


def named(path: Path) -> frozenset[str]:
    """Everything a file imports, by statement or by a text that names a module."""
    return frozenset.union(*read(path, path.read_text(encoding="utf-8")))


def imported(path: Path) -> set[str]:
    """Top names of everything a file imports; a text counts where it is passed to import_module or names a package."""
    return {name.split(".")[0] for name in named(path)}


def sources(package: str, root: Path = ROOT) -> list[Path]:
    return sorted((root / package).rglob("*.py"))


def files_graph(root: Path = ROOT, packages: tuple[str, ...] = PACKAGES) -> Graph:
    """File -> the files of the packages that it imports.  An `__init__` counts where it is named, not where passed."""
    paths = [path for package in packages for path in sources(package, root)]
    file_of = {".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"):
               path.relative_to(root).as_posix() for path in paths}
    graph = {}
    for path in paths:
        found = {file_of.get(name) or file_of.get(name.rpartition(".")[0]) for name in named(path)}
        file = path.relative_to(root).as_posix()
        graph[file] = {other for other in found if other is not None} - {file}
    return graph


def room_of(file: str) -> str:
    """The folder of a file; an entry file stands by itself."""
    return file if file in ENTRIES else file.rpartition("/")[0]


def rooms_graph(files: Graph) -> Graph:
    """Room -> the rooms that its files import."""
    rooms: dict[str, set[str]] = {room_of(file): set() for file in files}
    for file, others in files.items():
        rooms[room_of(file)] |= {room_of(other) for other in others} - {room_of(file)}
    return rooms


def circle(graph: Graph) -> list[str]:
    """One circle of a graph, its first node again at its end, or []."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as exc:
        return exc.args[1]
    return []


def reached(graph: Graph, start: str) -> set[str]:
    """What can be reached from a node, itself left out."""
    found: set[str] = set()
    ahead = [start]
    while ahead:
        new = graph.get(ahead.pop(), set()) - found
        found |= new
        ahead += new
    return found - {start}


@cache
def our_files() -> Graph:
    """The graph of all files here, which takes seconds to read: not while tests are collected."""
    return files_graph()


@cache
def our_rooms() -> Graph:
    return rooms_graph(our_files())


DRAWN = {name: {to for source, to in picture.ARROWS if source == name} for name in picture.ROOMS}


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_import_one_way(package):
    assert sources(package), f"{package} has no sources where this test looks"
    wrong = {str(path.relative_to(ROOT)): sorted(bad) for path in sources(package)
             if (bad := {other.split("/")[0] for other in our_files()[path.relative_to(ROOT).as_posix()]}
                 - {package} - MAY_IMPORT[package])}
    assert not wrong


@pytest.mark.parametrize("library", ONLY_IN)
def test_one_file_knows_a_border_library(library):
    users = {str(p.relative_to(ROOT)) for package in PACKAGES for p in sources(package) if library in imported(p)}
    assert users == ONLY_IN[library]


def test_files_import_in_no_circle():
    assert circle(our_files()) == []


def test_folders_import_in_no_circle():
    assert circle(our_rooms()) == []


def test_the_scenario_knows_no_run():
    assert reached(our_rooms(), "coupler/scenario") <= BELOW_SCENARIO


def undeclared(root: Path, *folders: str) -> set[str]:
    """Libraries that files below folders import and that pyproject.toml does not name, other than for the site."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [names for extra, names in project["optional-dependencies"].items() if extra != "docs"]
    declared = {plain(re.split(r"[^\w.-]", text)[0]) for names in [project["dependencies"], *extras] for text in names}
    own = {part for path in root.rglob("*.py") for part in (path.stem, *path.relative_to(root).parts[:-1])}
    users = {name.split(".")[0] for folder in folders for path in sources(folder, root)
             for name in read(path, path.read_text(encoding="utf-8"))[0]} - own - set(sys.stdlib_module_names)
    makers = packages_distributions()
    return {name for name in users
            if not declared & {plain(maker) for maker in [COMES_WITH.get(name, name), *makers.get(name, ())]}}


def plain(name: str) -> str:
    return name.lower().replace("_", "-")


def test_every_library_that_is_imported_is_declared():
    """One that happens to be installed for another one's sake is missing on the next machine."""
    assert undeclared(ROOT, *PACKAGES, "tests") == set()


def test_a_library_that_nobody_declared_is_found(tmp_path):
    (tmp_path / "p").mkdir()
    (tmp_path / "p/a.py").write_text("import json\nimport numpy as np\nimport p.b\nfrom yaml import safe_load\n")
    assert undeclared(tmp_path, "p") == {"yaml"}


@pytest.mark.parametrize("entry", sorted(ENTRIES))
def test_nothing_within_imports_an_entry_file(entry):
    assert [file for file, others in our_files().items() if entry in others] == []


def test_every_room_is_drawn_and_no_other():
    assert set(picture.ROOMS) == set(our_rooms()), "docs/site/rooms.py: ROOMS"


@pytest.mark.parametrize("arrow", picture.ARROWS, ids=" to ".join)
def test_an_arrow_is_an_import_and_leads_down(arrow):
    source, target = arrow
    assert target in our_rooms()[source], "docs/site/rooms.py: no file of the one room imports from the other"
    assert picture.left_top(picture.ROOMS[source])[1] < picture.left_top(picture.ROOMS[target])[1]


@pytest.mark.parametrize("room", sorted(picture.ROOMS))
def test_every_import_follows_arrows_down(room):
    wrong = [f"{file} imports {other}" for file, others in our_files().items() for other in others
             if room_of(file) == room and room_of(other) not in {room, *reached(DRAWN, room)}]
    assert not wrong, "it goes upwards, or an arrow is missing in docs/site/rooms.py"


def test_the_picture_is_the_one_of_its_script():
    assert picture.PICTURE.read_text(encoding="utf-8") == picture.svg(), "run python docs/site/rooms.py"


def planted(root: Path, **texts: str) -> Graph:
    """The graph of a package of files; `a__b="..."` is p/a/b.py."""
    for name, text in texts.items():
        path = root / "p" / (name.replace("__", "/") + ".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return files_graph(root, ("p",))


def test_a_circle_of_files_is_found(tmp_path):
    lazy = planted(tmp_path, a="import p.b", b="from p import c", c="def f():\n    from p.a import x\n")
    assert sorted(circle(lazy)[1:]) == ["p/a.py", "p/b.py", "p/c.py"]
    assert circle(planted(tmp_path, c="")) == []
    assert circle(planted(tmp_path, c="import_module('p.a')"))
    assert circle(planted(tmp_path, c="LOADS = {'a': 'p.a:load'}"))


def test_a_circle_of_folders_is_found(tmp_path):
    files = planted(tmp_path, one__a="import p.two.a", one__b="", two__a="", two__b="from p.one.b import x")
    assert circle(files) == []
    assert sorted(circle(rooms_graph(files))[1:]) == ["p/one", "p/two"]
    assert circle(rooms_graph(planted(tmp_path, two__b="import p.two.a"))) == []


def test_the_reader_of_imports_sees_every_form(tmp_path):
    source = tmp_path / "x.py"
    source.write_text("def f():\n from thermal_fmu.half import A\n import_module('zenoh')\n import fmpy.x as y\n"
                      "LOAD = 'contact.half.slave:HalfSlave'\nfield = 'T of contact.half.slave'\n")
    assert imported(source) == {"thermal_fmu", "zenoh", "fmpy", "contact"}
    assert set(named(source)) == {"thermal_fmu.half.A", "zenoh", "fmpy.x", "contact.half.slave"}
