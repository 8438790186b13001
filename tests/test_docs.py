"""What README.md and docs/ say holds: examples run, YAML is understood, links lead somewhere, options exist.

A fenced block under `<!-- run -->` is executed, all blocks of a page in one folder that has the scenarios: lines that
begin with `slideline`, or Python, in one namespace.  A block under `<!-- file: NAME -->` is written there under its
name; a `pyproject.toml` counts as installed.  A block under `<!-- says -->` is what the run blocks since the last such
block print, `...` standing for anything.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import os
import re
import shlex
import shutil
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from contact.problem.material import Material
from coupler import load_scenario
from coupler.cli import cli
from coupler.scenario.document import document_from
from coupler.scenario.quantities import with_plain_numbers
from coupler.scenario.schema import ScenarioFile

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md")),
         *sorted((ROOT / "docs/scenes").glob("*.md")),
         ROOT / "benchmarks/README.md"]

FENCE = re.compile(r"(?:^<!-- (?P<mark>[^\n]*?) -->\n)?^```(?P<kind>\w*)\n(?P<text>.*?)^```$", re.M | re.S)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
COMMAND = re.compile(r"\bslideline ([a-z][a-z-]*)((?:(?!\bslideline\b)[^`\n|#])*)")
OPTION = re.compile(r"(?<![\w-])--?[a-z][a-z-]*")
ROOM = re.compile(r"^\| `(?P<folder>[a-z_/]+/)` \| (?P<what>.*) \|$", re.M)
PATH = re.compile(r"`((?:contact|coupler|thermal_fmu|mechanical_fmu|tests|scenarios|benchmarks|docs)/[\w./-]+\.\w+)`")


@dataclass(frozen=True)
class Block:
    """A fenced block.  mark : the comment above it, or "".  line : 1-based, of its fence."""

    page: str
    line: int
    mark: str
    kind: str
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def blocks(page: Path) -> Iterator[Block]:
    """The fenced blocks of a page, in order."""
    text = page.read_text(encoding="utf-8")
    for match in FENCE.finditer(text):
        line = text.count("\n", 0, match.start("text"))
        yield Block(page.name, line, match["mark"] or "", match["kind"], match["text"])


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return FENCE.sub("", page.read_text(encoding="utf-8"))


ALL = [block for page in PAGES for block in blocks(page)]
RUN = [page for page in PAGES if any(block.mark == "run" for block in blocks(page))]


def in_words(block: Block, names: dict[str, Any]) -> str:
    """Run a block as a reader would; all it prints.  names : what the page's Python has defined so far."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        if block.kind == "python":
            exec(compile(block.text, str(block), "exec"), names)
        else:
            for line in block.text.replace("\\\n", " ").splitlines():
                command = shlex.split(line, comments=True)
                assert command[:1] == ["slideline"], f"{block}: only `slideline` is run here, not {line!r}"
                sys.argv = command
                with pytest.raises(SystemExit) as ended:
                    cli.main()
                forget_loaded(Path.cwd())
                # Two runs that a page compares may differ, and a half may fail: the page says what the verdict is.
                fine = (0, None, 5) if command[1] == "compare" or "--compare" in command else (0, None)
                fine = (0, None, 1) if command[1] == "verify-half" else fine
                assert ended.value.code in fine, f"{block}: {line}\n{said.getvalue()}"
    return said.getvalue()


def forget_loaded(folder: Path) -> None:
    """Unload the modules of a folder: to a reader each command is a process of its own."""
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None) or "").startswith(str(folder)):
            del sys.modules[name]


def assert_says(block: Block, said: str) -> None:
    """Every line of the block is a line of what was said, in this order."""
    at = 0
    for line in block.text.splitlines():
        found = re.compile("^ *" + ".*".join(map(re.escape, line.strip().split("..."))) + "$", re.M).search(said, at)
        assert found, f"{block} quotes {line.strip()!r}; what was said is\n{said}"
        at = found.end()


def write(path: Path, text: str) -> None:
    """Write a file; of a pyproject.toml also what installing it leaves: its entry points."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    importlib.invalidate_caches()
    if path.name != "pyproject.toml":
        return
    project = tomllib.loads(text)["project"]
    info = path.parent / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    groups = ([f"[{group}]", *(f"{name} = {module}" for name, module in points.items())]
              for group, points in project["entry-points"].items())
    write(info / "entry_points.txt", "\n".join(line for group in groups for line in group))
    write(info / "METADATA", f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")


@pytest.mark.few("tutorial.md")
@pytest.mark.parametrize("page", RUN, ids=lambda page: page.name)
def test_examples_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(ROOT / "scenarios", tmp_path / "scenarios")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, (str(tmp_path), os.environ.get("PYTHONPATH")))))
    monkeypatch.setattr(sys, "argv", list(sys.argv))
    names: dict[str, Any] = {"__name__": "example"}
    said = ""
    for block in blocks(page):
        if block.mark.startswith("file: "):
            write(tmp_path / block.mark.removeprefix("file: "), block.text)
        elif block.mark == "run":
            said += in_words(block, names)
        elif block.mark == "says":
            assert_says(block, said)
            said = ""


@pytest.mark.parametrize("block", [b for b in ALL if b.kind == "python"], ids=str)
def test_python_is_python(block: Block) -> None:
    compile(block.text, str(block), "exec")


@pytest.mark.parametrize("block", [b for b in ALL if b.kind == "yaml"], ids=str)
def test_yaml_is_understood(block: Block, tmp_path: Path) -> None:
    document = document_from(Path(str(block)), block.text)
    # A fragment may leave out the unit its file has for temperatures.
    units = document.tree.get("units", {"temperature": "degC"})
    tree = with_plain_numbers(replace(document, tree={"units": units, **document.tree})).tree
    if tree.get("slideline") and not block.mark:
        path = tmp_path / "s.yaml"
        path.write_text(block.text, encoding="utf-8")
        load_scenario(path)
    fields = {**Material.model_fields, **ScenarioFile.model_fields}
    assert tree
    assert set(tree) <= set(fields)
    for key, value in tree.items():
        try:
            TypeAdapter(fields[key].annotation).validate_python(value)
        except ValidationError as exc:
            # A fragment may leave out what the rest of its file says, and nothing else.
            wrong = [(key, *e["loc"], e["msg"]) for e in exc.errors() if e["type"] != "missing"]
            assert not wrong, f"{block}: {wrong}"


def slug(heading: str) -> str:
    """The anchor of a heading."""
    words = re.sub(r"[^\w\- ]", "", re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").lower())
    return words.strip().replace(" ", "-")


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CHANGELOG.md"], ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        there = (page.parent / name).resolve() if name else page
        assert there.is_file(), f"{page.name}: {target}"
        if anchor:
            headings = re.findall(r"^#+ (.+)$", prose(there), re.M)
            assert anchor in map(slug, headings), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_named_are_there(page: Path) -> None:
    gone = [path for path in PATH.findall(page.read_text(encoding="utf-8")) if not (ROOT / path).is_file()]
    assert not gone


def test_a_room_of_the_design_has_the_files_it_names() -> None:
    rooms = list(ROOM.finditer(prose(ROOT / "docs/design.md")))
    gone = [room["folder"] + name for room in rooms for name in re.findall(r"`(\w+\.py)`", room["what"])
            if not (ROOT / room["folder"] / name).is_file()]
    assert not gone
    packages = ("contact", "thermal_fmu", "mechanical_fmu", "coupler")
    folders = {f"{path.parent.relative_to(ROOT)}/" for name in packages for path in (ROOT / name).rglob("*.py")}
    assert {room["folder"] for room in rooms} == folders


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_options_exist(page: Path) -> None:
    for verb, rest in COMMAND.findall(_commands(page)):
        assert verb in cli.VERBS, f"{page.name}: slideline {verb}"
        known = {name for option in cli.verb(verb).params for name in option.opts} | {"--help"}
        unknown = set(OPTION.findall(rest)) - known
        assert not unknown, f"{page.name}: slideline {verb} has no {sorted(unknown)}"


def made_pages() -> Any:
    """The script that makes the pages of scenes and cases."""
    found = importlib.util.spec_from_file_location("scenes", ROOT / "docs/site/scenes.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    sys.modules["scenes"] = module
    found.loader.exec_module(module)
    return module


def test_pages_of_scenes_and_cases_are_those_of_the_script() -> None:
    made = made_pages().pages()
    stale = [path.name for path, text in made.items() if not path.is_file() or path.read_text("utf-8") != text]
    assert not stale, "run docs/site/scenes.py"
    assert {path for path in made if path.parent.name == "scenes"} == set((ROOT / "docs/scenes").glob("*.md"))
    assert {path.stem for path in (ROOT / "scenarios").glob("*.yaml")} <= {path.stem for path in made}


def test_every_case_has_a_test_that_reads_it() -> None:
    made = made_pages()
    assert not [case.name for case in made.CASES if not made.tests_of(case.code)]


def test_every_page_is_on_the_site() -> None:
    site = (ROOT / "docs/site/mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:")[2]
    docs = ROOT / "docs"
    pages = [str(page.relative_to(docs)) for page in (*docs.glob("*.md"), *docs.glob("scenes/*.md"))]
    missing = [name for name in pages if f" {name}\n" not in site]
    assert not missing, f"docs/site/mkdocs.yml, nav: {missing}"


def _commands(page: Path) -> str:
    """All code of a page, a piece a line."""
    pieces = [b.text.replace("\\\n", " ") for b in blocks(page) if b.kind != "python"]
    return "\n".join([*pieces, *re.findall(r"`([^`\n]+)`", prose(page))])
