"""Faults marked beside the code they change, each of which must turn a test red: `python tests/faults.py [WORD ...]`.

    # fault: NAME -> TEXT | TESTS
    the line of code that becomes TEXT, indented as it is

Comment lines that begin with `#   ` carry a mark on; several marks may stand above one line.  TESTS are pytest
arguments without `tests/` and `.py` (`coupler/test_coupling::test_name`).  A fault is planted in a copy of the packages
and its tests run there.  A fault that none of them notices is a hole in the tests; the command then exits with 1.  A
TEXT that uses a name nothing defines is refused: its NameError turns every test red and proves nothing.
`--list` names the faults.
"""

from __future__ import annotations

import ast
import builtins
import functools
import os
import re
import shutil
import subprocess
import symtable
import sys
import tempfile
from bisect import bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("contact", "thermal_fmu", "mechanical_fmu", "coupler")
MARK, MORE = "# fault: ", "#   "
FUTURE = "from __future__ import annotations\n"
BUILT_IN = frozenset((*dir(builtins), "__file__", "__path__"))
FORM = re.compile(r"(?P<name>.+?) -> (?P<text>.+) \| (?P<tests>.+)")


@dataclass(frozen=True)
class Fault:
    """Line `line` (from 1) of `file` becomes `text`; one of `tests` (pytest arguments) must fail."""

    name: str
    file: str
    line: int
    text: str
    tests: tuple[str, ...]

    def planted(self, source: str) -> str:
        """The source with the fault in it."""
        lines = source.split("\n")
        old = lines[self.line - 1]
        lines[self.line - 1] = old[:len(old) - len(old.lstrip())] + self.text
        return "\n".join(lines)


def test_path(word: str) -> str:
    """`coupler/test_coupling::test_name` as pytest takes it."""
    file, colons, name = word.partition("::")
    return f"tests/{file}.py{colons}{name}"


def marked_in(source: str, file: str) -> Iterator[Fault]:
    """The faults marked in a source.  Raises ValueError for a mark of another form or without a line of code below."""
    lines = source.split("\n")
    for i, first in enumerate(lines):
        if not first.lstrip().startswith(MARK):
            continue
        mark, below = first.strip().removeprefix(MARK), i + 1
        while below < len(lines) and lines[below].lstrip().startswith(MORE):
            mark += " " + lines[below].strip().removeprefix(MORE)
            below += 1
        while below < len(lines) and lines[below].lstrip().startswith("#"):
            below += 1
        found = FORM.fullmatch(mark)
        if found is None:
            raise ValueError(f"{file}:{i + 1}: a mark reads `{MARK}NAME -> TEXT | TESTS`: {mark}")
        if below == len(lines) or not lines[below].strip():
            raise ValueError(f"{file}:{i + 1}: no line of code below the mark: {mark}")
        yield Fault(found["name"], file, below + 1, found["text"], tuple(map(test_path, found["tests"].split())))


def all_faults() -> Iterator[Fault]:
    """The faults of the packages, file by file."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            yield from marked_in(path.read_text(encoding="utf-8"), path.relative_to(ROOT).as_posix())


@functools.cache
def blocks_of(source: str) -> tuple[tuple[int, str], ...]:
    """First line (from 1) and text of each statement of a module, up to the next one.  Raises SyntaxError."""
    lines, starts, end = source.split("\n"), [], 0
    for node in ast.parse(source).body:
        first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", []))])
        if first > end:  # not beside another one on its line
            starts.append(first)
        end = node.end_lineno or first
    return tuple((first, "\n".join(lines[first - 1:after - 1]))
                 for first, after in zip(starts, [*starts[1:], len(lines) + 1], strict=True))


@functools.cache
def names_in(block: str) -> tuple[frozenset[str], frozenset[str]]:
    """The names that statements of a module define in it, and those of it that they use.  Raises SyntaxError."""
    # Every source begins so: what only stands in annotations is not used.
    top = symtable.symtable(f"{FUTURE}{block}", "source", "exec")
    defined = {s.get_name() for s in top.get_symbols() if s.is_assigned() or s.is_imported()}
    used: set[str] = set()
    tables = [top]
    while tables:
        table = tables.pop()
        tables += table.get_children()
        defined |= {s.get_name() for s in table.get_symbols() if s.is_declared_global() and s.is_assigned()}
        used |= {s.get_name() for s in table.get_symbols() if s.is_referenced() and (table is top or s.is_global())}
    return frozenset(defined), frozenset(used)


def undefined_in(blocks: Iterable[str]) -> set[str]:
    """The names that the statements of a module use and neither they nor Python define.  Raises SyntaxError."""
    found = [names_in(block) for block in blocks]
    return set().union(*(used for _, used in found)) - BUILT_IN.union(*(defined for defined, _ in found))


def undefined_by(fault: Fault, source: str) -> list[str]:
    """The names that are undefined only once a fault is in its source.  Raises SyntaxError.

    Only the statement that it is in is read anew: a whole file takes long.
    """
    blocks = blocks_of(source)
    texts = [text for _, text in blocks]
    within = bisect_right(blocks, fault.line, key=lambda block: block[0]) - 1
    first, text = blocks[within]
    planted = replace(fault, line=fault.line - first + 1).planted(text)
    return sorted(undefined_in([*texts[:within], planted, *texts[within + 1:]]) - undefined_in(texts))


def faulty_copy(fault: Fault, target: Path) -> None:
    """Copy the packages to target and plant the fault there.  Raises ValueError where it would be a NameError."""
    source = (ROOT / fault.file).read_text(encoding="utf-8")
    if names := undefined_by(fault, source):
        raise ValueError(f"{fault.file}:{fault.line}: {fault.name}: nothing defines {', '.join(names)}")
    for name in (*PACKAGES, "tests", "scenarios", "docs", "benchmarks"):
        shutil.copytree(ROOT / name, target / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff"):
        shutil.copy(ROOT / name, target)
    (target / fault.file).write_text(fault.planted(source), encoding="utf-8")


def is_noticed(fault: Fault, scratch: Path) -> bool:
    """Whether a test fails on the faulty copy, made in scratch/copy; scratch keeps compiled kernels between calls."""
    target = scratch / "copy"
    shutil.rmtree(target, ignore_errors=True)
    faulty_copy(fault, target)
    env = {**os.environ, "PYTHONPATH": str(target), "SLIDELINE_CACHE": str(target / "cache"),
           "NUMBA_CACHE_DIR": str(scratch / "numba")}
    done = subprocess.run([sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-m", "", "-p", "no:cacheprovider",
                           *fault.tests], cwd=target, env=env, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(f"{fault.name}: pytest ended with {done.returncode}\n{done.stdout}{done.stderr}")
    return done.returncode == 1


def run(faults: Iterable[Fault]) -> int:
    """Run the tests of each fault and print what came of it; 1 where one is not noticed."""
    faults, unnoticed = list(faults), 0
    with tempfile.TemporaryDirectory() as scratch:
        for i, fault in enumerate(faults, 1):
            noticed = is_noticed(fault, Path(scratch))
            unnoticed += not noticed
            print(f"{i}/{len(faults)} {'red' if noticed else 'NOT NOTICED':12} {fault.file}:{fault.line}: {fault.name}",
                  flush=True)
    return 1 if unnoticed else 0


def main(words: list[str]) -> int:
    """Run or list the faults whose name or file contains one of `words` (all where none is given)."""
    only_list = "--list" in words
    words = [word for word in words if word != "--list"]
    chosen = [f for f in all_faults() if not words or any(word in f.name or word in f.file for word in words)]
    if not chosen:
        print("no fault has such a name or file", file=sys.stderr)
        return 1
    if not only_list:
        return run(chosen)
    for fault in chosen:
        print(f"{fault.file}:{fault.line}: {fault.name}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
