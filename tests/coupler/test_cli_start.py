"""How the command line starts: a verb loads what it needs, and what solves nothing compiles nothing."""

from __future__ import annotations

import inspect
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from coupler.cli.cli import VERBS
from coupler.init.shipped import shipped_scenarios

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import Case, write_run

LOADED = """
import sys
from coupler.cli.cli import start
sys.argv = ["slideline", *sys.argv[1:]]
try:
    start()
except SystemExit as end:
    assert not end.code, end.code
print("LOADED", *sorted(sys.modules))
"""


def loaded(tmp_path: Path, *arguments: str) -> set[str]:
    """The modules that a process of the command line has loaded at its end."""
    done = subprocess.run([sys.executable, "-c", LOADED, *arguments], cwd=tmp_path, capture_output=True, text=True,
                          check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.rpartition("LOADED")[2].split())


@pytest.mark.parametrize("verb", VERBS)
def test_the_sentence_of_a_verb_is_its_own(verb: str) -> None:
    module, _, function = VERBS[verb].home.partition(":")
    told = " ".join((inspect.getdoc(getattr(import_module(module), function)) or "").split())
    assert f"{told} ".startswith(f"{VERBS[verb].about} ")
    assert VERBS[verb].about.endswith(".")


def test_help_loads_no_solver(tmp_path: Path) -> None:
    assert not loaded(tmp_path, "--help") & {"numpy", "scipy", "numba", "h5py", "coupler.scenario", "matplotlib"}


@pytest.mark.few("aluminium_can")
@pytest.mark.parametrize("name", ["sliding_blocks", "aluminium_can", "hot_upsetting"])
def test_a_look_at_a_scene_compiles_nothing(tmp_path: Path, name: str) -> None:
    modules = loaded(tmp_path, "check", str(shipped_scenarios() / f"{name}.yaml"))
    assert "contact.facing" in modules  # it has looked at contact
    assert modules.isdisjoint({"numba", "zenoh", "matplotlib"})


@pytest.mark.parametrize("arguments", [("status", "run.h5"), ("report", "run.h5"), ("compare", "run.h5", "run.h5"),
                                       ("list",), ("cache",)])
def test_a_look_at_results_reads_no_scenario(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    """A third to a half of a second for nothing: what reads a scenario, and scipy and scikit-fem with it."""
    write_run(tmp_path / "run.h5", Case(windows=4))
    assert loaded(tmp_path, *arguments).isdisjoint({"coupler.scenario.load", "coupler.scenario.schema", "skfem"})
