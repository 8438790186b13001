"""The scenes whose numbers tests/same_numbers.py compares: found, and run through the installed command line alone.

They are the scenarios, the demo, the templates, the scenes of pages (blocks marked `scene: NAME`) and the runs in their
examples (blocks marked `run`, with the files and FMUs that they need).
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
from ruamel.yaml import YAML

LIMIT = 1800.0  # s a command may take
FENCE = re.compile(r"(?:^<!-- (?P<mark>[^\n]*?) -->\n)?^```\w*\n(?P<text>.*?)^```$", re.M | re.S)
Done = subprocess.CompletedProcess[str]
Blocks = Sequence[tuple[str, str]]


class UsageError(Exception):
    """What is wrong with what was asked."""


@dataclass(frozen=True)
class Scene:
    """One run to be compared.  file : its scenario.  options : of the command line, --set and --swap with values.

    cwd : where commands run; halves and FMUs that an example of a page makes are found there.
    """

    name: str
    file: Path
    cwd: Path
    options: tuple[str, ...] = ()

    def do(self, verb: str, out: Path, *way: object, **env: str) -> Done:
        """Build or run it into a folder, and keep there what is compared."""
        where = out if verb == "build" else out / "run.h5"
        file = self.file.relative_to(self.cwd)
        done = slideline(verb, file, *self.options, *way, "-o", where, cwd=self.cwd, **env)
        for left in [path for path in out.iterdir() if path.is_file() and path.suffix not in (".h5", ".vtkhdf")]:
            if left.suffix == ".fmu":
                _unzip_told(left)
            left.unlink()  # an FMU; the journal and the checkpoint of a run that was stopped
        return done


def slideline(*words: object, cwd: Path, **env: str) -> Done:
    """Run a command of the code that is installed for this Python."""
    script = Path(sys.executable).with_name("slideline")
    command = [str(script)] if script.is_file() else [sys.executable, "-m", "coupler.cli"]
    path = os.pathsep.join(filter(None, (str(cwd), os.environ.get("PYTHONPATH"))))
    try:
        return subprocess.run([*command, *map(str, words)], cwd=cwd, env={**os.environ, "PYTHONPATH": path, **env},
                              capture_output=True, text=True, stdin=subprocess.DEVNULL, timeout=LIMIT, check=False)
    except subprocess.TimeoutExpired:
        return Done(command, 124, "", f"not done within {LIMIT:g} s")


def needed(*words: object, cwd: Path) -> str:
    """What a command says that must not fail."""
    done = slideline(*words, cwd=cwd)
    if done.returncode:
        raise UsageError(f"slideline {' '.join(map(str, words))} ended with {done.returncode}:\n{done.stderr}")
    return done.stdout


def scenes(inputs: Path, scenarios: Path, docs: Path, only: Sequence[str]) -> Iterator[Scene]:
    """Every scene there is, its files written to `inputs`.  only : names; what takes long is not made for others."""
    copy = Path(shutil.copytree(scenarios, inputs / "scenarios"))
    yield from (Scene(path.stem, path, inputs) for path in sorted(copy.glob("*.yaml")))
    if not only or "demo" in only:
        yield _demo(inputs)
    listed = needed("init", "--list", cwd=inputs).partition("templates:\n")[2].partition("\nmaterials")[0]
    for name in re.findall(r"^  (\w+) ", listed, re.M):
        if not only or f"template.{name}" in only:
            needed("init", name, "-o", f"{name}.yaml", cwd=inputs)
        yield Scene(f"template.{name}", inputs / f"{name}.yaml", inputs)
    for page in sorted(docs.glob("*.md")):
        found = blocks(page.read_text(encoding="utf-8"))
        yield from page_scenes(page.stem, found, inputs / "docs")
        if any(mark == "run" for mark, _ in found):
            make = not only or any(name.startswith(f"{page.stem}.") for name in only)
            if make:
                shutil.copytree(copy, inputs / page.stem / "scenarios")
            yield from page_runs(page.stem, found, inputs / page.stem, make=make)


def _demo(inputs: Path) -> Scene:
    """What the demo ran, by `run`: it has no --processes."""
    needed("demo", "demo", cwd=inputs)
    with h5py.File(inputs / "demo/run.h5") as f:
        changed = json.loads(f.attrs["header"])["scenario"]["overrides"]
    sets = (word for key, value in changed.items() for word in ("--set", f"{key}={value}"))
    return Scene("demo", next((inputs / "demo").glob("*.yaml")), inputs, tuple(sets))


def blocks(page: str) -> Blocks:
    """The fenced blocks of a page, each with the comment above it, or with ""."""
    return [(match["mark"] or "", match["text"]) for match in FENCE.finditer(page)]


def page_scenes(page: str, found: Blocks, folder: Path) -> Iterator[Scene]:
    """The scenes of a page, `PAGE.NAME`: each block merged into the one called base."""
    yaml = YAML(typ="safe")
    trees = {mark.removeprefix("scene: "): yaml.load(text) for mark, text in found if mark.startswith("scene: ")}
    for name, tree in trees.items():
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{page}.{name}.yaml"
        yaml.dump(merged(trees["base"], tree), path)
        yield Scene(path.stem, path, folder)


def merged(base: Any, change: Any) -> Any:
    """base with a change put in: mappings key by key, anything else replaced."""
    if not (isinstance(base, Mapping) and isinstance(change, Mapping)):
        return change
    return {**base, **{key: merged(base.get(key), value) for key, value in change.items()}}


def page_runs(page: str, found: Blocks, cwd: Path, *, make: bool) -> Iterator[Scene]:
    """The runs in a page's examples, `PAGE.OUT`.  make : write its files and build its FMUs."""
    for mark, text in found:
        if mark.startswith("file: ") and make:
            write_example(cwd / mark.removeprefix("file: "), text)
        for words in _commands(text) if mark == "run" else ():
            if words[0] == "build" and make:
                needed(*words, cwd=cwd)
            elif words[0] == "run":
                parser = argparse.ArgumentParser()
                parser.add_argument("-o", "--out", type=Path, default="run.h5")
                given, rest = parser.parse_known_args(words[2:])
                options = tuple(word for word in rest if word != "--report")
                yield Scene(f"{page}.{given.out.stem}", cwd / words[1], cwd, options)


def _commands(text: str) -> Iterable[list[str]]:
    """The words behind `slideline` of every line that begins with it."""
    lines = (shlex.split(line, comments=True) for line in text.replace("\\\n", " ").splitlines()
             if line.startswith("slideline "))
    return (words[1:] for words in lines)


def write_example(path: Path, text: str) -> None:
    """Write a file of a page; of a pyproject.toml also the entry points that installing it leaves."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    if path.name == "pyproject.toml":
        project = tomllib.loads(text)["project"]
        info = path.parent / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
        points = [line for group, points in project["entry-points"].items()
                  for line in (f"[{group}]", *(f"{name} = {module}" for name, module in points.items()))]
        write_example(info / "entry_points.txt", "\n".join(points))
        write_example(info / "METADATA", f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: 0\n")


def _unzip_told(fmu: Path) -> None:
    """Keep of an FMU what its half was told."""
    with zipfile.ZipFile(fmu) as archive:
        for name in {"resources/interface.h5", "resources/model.json"} & set(archive.namelist()):
            target = fmu.with_suffix("") / Path(name).name
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(archive.read(name))
