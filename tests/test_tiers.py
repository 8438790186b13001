"""The tiers of the tests: the files of `-m fast` are there, it runs them and nothing else; long files come first."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parent
_spec = importlib.util.spec_from_file_location("tiers", TESTS / "conftest.py")
assert _spec
assert _spec.loader
tiers = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(tiers)


def test_the_fast_files_are_there_and_named_once():
    assert [path for path in sorted(tiers.FAST_FILES) if not path.is_file()] == []
    assert len(tiers.FAST_FILES) == sum(len(names.split()) for names in tiers.FAST.values())


def test_the_long_files_are_there_and_named_once():
    assert [path for path in tiers.LONG_FILES if not path.is_file()] == []
    assert len(tiers.LONG_FILES) == len(set(tiers.LONG_FILES))


def test_long_files_come_first_then_those_with_many_tests_each_in_one_piece():
    class Item:
        def __init__(self, path: Path, number: int) -> None:
            self.path, self.number = path, number

        def get_closest_marker(self, name: str) -> None:
            assert name == "slow"

        def add_marker(self, name: str) -> None:
            assert self.path in tiers.FAST_FILES

    few, many, *_ = sorted(tiers.FAST_FILES)
    last, first = tiers.LONG_FILES[1], tiers.LONG_FILES[0]
    items = [Item(path, k) for path, n in ((few, 2), (last, 1), (many, 3), (first, 1)) for k in range(n)]
    tiers.pytest_collection_modifyitems(items)
    assert [(item.path, item.number) for item in items] == [
        (first, 0), (last, 0), (many, 0), (many, 1), (many, 2), (few, 0), (few, 1)]


def test_what_is_slow_in_a_fast_file_is_not_fast():
    class Item:
        def __init__(self, *marks: str) -> None:
            self.path, self.marks = min(tiers.FAST_FILES), list(marks)

        def get_closest_marker(self, name: str) -> str | None:
            return name if name in self.marks else None

        def add_marker(self, name: str) -> None:
            self.marks.append(name)

    items = [Item(), Item("slow")]
    tiers.pytest_collection_modifyitems(items)
    assert [item.marks for item in items] == [["fast"], ["slow"]]


def test_few_leaves_the_other_cases_to_slow():
    class Case:
        def __init__(self, name: str, *few: str) -> None:
            self.name, self.marks, self.few = name, [], few

        def get_closest_marker(self, name: str) -> pytest.Mark | None:
            return pytest.Mark(name, self.few, {}, _ispytest=True) if self.few and name == "few" else None

        def add_marker(self, name: str) -> None:
            self.marks.append(name)

    some = [Case(f"test_a[{name}]", "b", "x[0]") for name in ("a", "b", "x[0]")]
    tiers.keep_few(some)
    assert [case.marks for case in some] == [["slow"], [], []]
    alone = Case("test_a")
    tiers.keep_few([alone])
    assert alone.marks == []
    with pytest.raises(pytest.Collector.CollectError, match=r"few names \['c'\] of \['a', 'b'\]"):
        tiers.keep_few([Case("test_a[a]", "a", "c"), Case("test_a[b]", "a", "c")])


def test_fast_runs_the_files_of_the_list_alone():
    folder = TESTS / "stability"  # the fewest of all
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "--collect-only", "-m", "fast", str(folder)]
    done = subprocess.run(command, cwd=TESTS.parent, capture_output=True, text=True, check=False)
    files = {(TESTS.parent / line.partition("::")[0]).resolve() for line in done.stdout.splitlines() if "::" in line}
    assert files == {path for path in tiers.FAST_FILES if path.parent == folder}
