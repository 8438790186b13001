"""Compiled code is made anew when any file it was compiled from changes."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from contact.compiled import inner, one_of, stamp

ROOT = Path(__file__).parents[2]
# A kernel of contact/ that calls another file's, which has a constant of a third.
FURTHER = """
from contact.further import further
print(further(2.0))
"""
# One of the mechanical half, which takes seconds to compile.
FLOW = """
import numpy as np
from mechanical_fmu.laws.catalogue import POINT, flow_stress
p = np.zeros(1, POINT)
p["yield_stress"], p["hardening_modulus"] = 3.0, 19.0
print(flow_stress(p[0], np.empty(0), 0.0)[0])
"""
SOURCES = {"deepest": "SHARE = 3.0\n",
           "deeper": "from contact.compiled import kernel\nfrom contact.deepest import SHARE\n\n\n"
                     "@kernel\ndef deeper(x: float) -> float:\n    return SHARE * x\n",
           "further": "from contact.compiled import kernel\nfrom contact.deeper import deeper\n\n\n"
                      "@kernel\ndef further(x: float) -> float:\n    return deeper(x)\n"}


@pytest.mark.few("further")
@pytest.mark.parametrize(("ask", "file", "old", "new", "answers"), [
    (FURTHER, "contact/deepest.py", "3.0", "7.0", [6.0, 14.0]),
    (FLOW, "mechanical_fmu/laws/hardening.py", "return p.yield_stress + ", "return p.yield_stress + 16.0 + ",
     [3.0, 19.0])], ids=["further", "flow"])
def test_a_change_of_a_constant_in_another_file_is_seen(tmp_path, ask, file, old, new, answers):
    for package in ("mechanical_fmu", "contact"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    for name, source in SOURCES.items():
        (tmp_path / f"contact/{name}.py").write_text(source, encoding="utf-8")
    # Python itself takes a file of the same size and second for the same.
    env = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "numba"),
           "PYTHONDONTWRITEBYTECODE": "1"}

    def answer():
        # -c would put the working directory first on the path.
        done = subprocess.run([sys.executable, "-c", ask], env=env, cwd=tmp_path, capture_output=True, text=True,
                              check=True)
        return float(done.stdout)

    assert answer() == answers[0]
    changed = tmp_path / file
    changed.write_text(changed.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    assert answer() == answers[1]


def test_a_class_of_an_argument_may_be_renamed(tmp_path):
    (tmp_path / "p").mkdir()
    room = "from typing import NamedTuple\n\n\nclass Room(NamedTuple):\n    size: float\n"
    use = ("from contact.compiled import kernel\nfrom p import rooms\n\n\n@kernel\ndef double(room):\n"
           "    return 2.0 * room.size\n\n\nprint(double(rooms.Room(3.0)))\n")
    env = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}", "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    for name in ("Room", "Hall"):
        (tmp_path / "p/rooms.py").write_text(room.replace("Room", name), encoding="utf-8")
        (tmp_path / "p/use.py").write_text(use.replace("Room", name), encoding="utf-8")
        done = subprocess.run([sys.executable, "-c", "import p.use"], env=env, cwd=tmp_path, capture_output=True,
                              text=True, check=False)
        assert done.stdout.split() == ["6.0"], done.stderr


def test_processes_that_need_a_function_at_once_compile_it_once(tmp_path):
    (tmp_path / "p").mkdir()
    (tmp_path / "p/use.py").write_text(
        "import numpy as np\nfrom contact.compiled import kernel\n\n\n@kernel\ndef total(x):\n"
        "    return x[1:].sum()\n\n\nprint('ready', flush=True)\ninput()\n"
        "print(total(np.array([3.0, 1.0, 2.0])), sum(total.stats.cache_misses.values()))\n", encoding="utf-8")
    env = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}", "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    three = [subprocess.Popen([sys.executable, "-c", "import p.use"], env=env, cwd=tmp_path, stdin=subprocess.PIPE,
                              stdout=subprocess.PIPE, text=True) for _ in range(3)]
    assert [process.stdout.readline() for process in three] == ["ready\n"] * 3
    for process in three:
        process.stdin.write("\n")
        process.stdin.flush()
    said = [process.communicate()[0].split() for process in three]
    assert sorted(said) == [["3.0", "0"], ["3.0", "0"], ["3.0", "1"]]


@inner
def doubled(x, y):
    return 2.0 * x + y


@inner
def squared(x, y):
    return x * x + y


@inner
def opposite(x, y):
    return -x + y


def test_one_of_several_functions_is_called_by_its_number():
    chosen = one_of((doubled, squared, opposite))
    assert [chosen(i, 3.0, 0.5) for i in range(4)] == [6.5, 9.5, -2.5, -2.5]
    assert one_of((squared,))(0, 3.0, 0.5) == 9.5


def test_a_file_that_nothing_imports_changes_no_stamp(tmp_path):
    for name, text in (("a", "from p.b import x\n"), ("b", "x = 1\n"), ("c", "x = 2\n")):
        (tmp_path / "p").mkdir(exist_ok=True)
        (tmp_path / f"p/{name}.py").write_text(text, encoding="utf-8")
    before = stamp(tmp_path / "p/a.py", tmp_path)
    copy = shutil.copytree(tmp_path, tmp_path / "copy")
    (copy / "p/c.py").write_text("x = 3\n", encoding="utf-8")
    assert stamp(copy / "p/a.py", copy) == before
    other = shutil.copytree(tmp_path / "p", tmp_path / "other/p").parent
    (other / "p/b.py").write_text("x = 3\n", encoding="utf-8")
    assert stamp(other / "p/a.py", other) != before
