"""The public names: pinned, fetched when asked for, enough for a half; and the modules of before, which warn."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from contact.half import moved

ROOT = Path(__file__).resolve().parent.parent
PUBLIC = {
    "contact.half": """
        ContactRefusedError ContactSurfaces Couplings Discard Done Facing Field ForeignMechanical ForeignThermal
        HalfModel History Interface Law Link
        LinkError Load Outputs Pair Property Signal SingularMatrixError Tractions Value Values Variable build_fmu
        build_main factorise field_from gap_factor open_link parse_law property_from read_interface read_problem
        signal_from start_temperatures write_interface""",
    "coupler": """
        CouplingError HalfError Results ResultsError Run Scenario ScenarioError SlidelineError load_scenario run""",
}
# Module of before -> where its names are now.
MOVED = {
    "contact.half.field": "contact.half.functions",
    "contact.half.property": "contact.half.functions",
    "contact.half.signal": "contact.half.functions",
    "contact.half.sparse": "contact.half.linalg",
    "contact.half.surfaces": "contact.half.contact_client",
    "coupler.rules.model": "coupler.scenario.rule_model",
}
# What a half written by the documentation of before imports.
BEFORE = [("contact.half.surfaces", "ContactRefusedError", "contact.half"),
          ("contact.half.surfaces", "ContactSurfaces", "contact.half"),
          ("contact.half.surfaces", "History", "contact.half"),
          ("contact.half.signal", "signal_from", "contact.half"),
          ("contact.half.property", "property_from", "contact.half"),
          ("contact.half.field", "field_from", "contact.half"),
          ("contact.half.sparse", "SingularMatrixError", "contact.half"),
          ("coupler.rules.model", "Retry", "coupler.scenario.rule_model"),
          ("coupler.rules.model", "When", "coupler.scenario.rule_model")]
HALVES = [*sorted((ROOT / "tests/contact/halves/toy_half").glob("*.py")), ROOT / "docs/write_a_half.md"]


@pytest.mark.parametrize("package", PUBLIC)
def test_the_public_names_are_these(package):
    module = importlib.import_module(package)
    assert sorted(module.__all__) == sorted(PUBLIC[package].split())
    assert all(getattr(module, name).__name__ for name in module.__all__ if name not in ("Value", "Values", "Load"))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        module.nothing  # noqa: B018


@pytest.mark.parametrize("package", PUBLIC)
def test_a_public_name_is_fetched_when_asked_for(package):
    says = f"import sys, {package}; print(sorted({{name.split('.')[0] for name in sys.modules}} & {{'numpy', 'h5py'}}))"
    assert subprocess.run([sys.executable, "-c", says], capture_output=True, text=True, check=True).stdout == "[]\n"


def python_of(path: Path) -> str:
    """The Python that a file holds: its own, or of a page the blocks that are files."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        return text
    return "\n".join(re.findall(r"^<!-- file: \S+\.py -->\n```python\n(.*?)^```$", text, re.M | re.S))


@pytest.mark.parametrize("path", HALVES, ids=lambda path: path.name)
def test_a_half_needs_public_names_alone(path):
    imports = [node for node in ast.walk(ast.parse(python_of(path))) if isinstance(node, ast.ImportFrom)]
    ours = [node for node in imports if (node.module or "").split(".")[0] in ("contact", "coupler")]
    assert {node.module for node in ours} <= {"contact.half"}
    assert {alias.name for node in ours for alias in node.names} <= set(PUBLIC["contact.half"].split())
    assert ours or path.name == "__init__.py"


def test_the_modules_of_before_are_these():
    for old in MOVED:
        importlib.import_module(old.rpartition(".")[0])
    assert moved.MOVED == MOVED


@pytest.mark.parametrize("old", MOVED)
def test_a_module_of_before_is_imported_in_every_form(old):
    package, _, name = old.rpartition(".")
    says = (f"import importlib, importlib.util, {old}; from {package} import {name} as module; "
            f"print({old} is module is importlib.import_module({old!r}), importlib.util.find_spec({old!r}).name)")
    told = subprocess.run([sys.executable, "-c", says], capture_output=True, text=True, check=True).stdout
    assert told == f"True {old}\n"
    with pytest.raises(AttributeError, match=f"module '{old}' has no attribute 'nothing'"):
        importlib.import_module(old).nothing  # noqa: B018


@pytest.mark.parametrize(("old", "name", "place"), BEFORE)
def test_a_module_of_before_gives_its_names_and_warns(old, name, place):
    with pytest.warns(DeprecationWarning, match=rf"^{re.escape(old)} has moved: import {name} from {place}$") as said:
        got = getattr(importlib.import_module(old), name)
    assert said[0].filename == __file__
    assert got is getattr(importlib.import_module(place), name)
    assert got is getattr(importlib.import_module(MOVED[old]), name)


def test_the_version_is_one():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = YAML(typ="safe").load(ROOT / "CITATION.cff")
    command = [sys.executable, "-m", "coupler.cli", "--version"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert said == f"slideline {project['version']}\n"
    assert importlib.import_module("coupler").__version__ == project["version"], "run pip install -e ."
    assert (citation["version"], citation["license"]) == (project["version"], project["license"])


@pytest.mark.parametrize("old", MOVED)
def test_a_module_of_before_has_nothing_else(old):
    with pytest.raises(AttributeError, match=f"module '{old}' has no attribute 'nothing'"):
        importlib.import_module(old).nothing  # noqa: B018
