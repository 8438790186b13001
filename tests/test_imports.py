"""Imports point one way (docs/design.md): read from the source, so that a lazy import counts too."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("contact", "thermal_fmu", "mechanical_fmu", "coupler")
MAY_IMPORT = {"contact": set(), "thermal_fmu": {"contact"}, "mechanical_fmu": {"contact"}, "coupler": {"contact"}}
ONLY_IN = {"fmpy": {"coupler/fmu/fmi.py"}, "zenoh": {"contact/rpc/zenoh_session.py"}}


def imported(path: Path) -> set[str]:
    """Top names of everything a file imports, by statement or by import_module("...")."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in (
                "import_module", "__import__"):
            names |= {a.value for a in node.args if isinstance(a, ast.Constant) and isinstance(a.value, str)}
    return {n.split(".")[0] for n in names}


def sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_import_one_way(package):
    assert sources(package), f"{package} has no sources where this test looks"
    wrong = {str(path.relative_to(ROOT)): sorted(bad) for path in sources(package)
             if (bad := (imported(path) & set(PACKAGES)) - {package} - MAY_IMPORT[package])}
    assert not wrong


@pytest.mark.parametrize("library", ONLY_IN)
def test_one_file_knows_a_border_library(library):
    users = {str(p.relative_to(ROOT)) for package in PACKAGES for p in sources(package) if library in imported(p)}
    assert users == ONLY_IN[library]


def test_the_reader_of_imports_sees_every_form(tmp_path):
    source = tmp_path / "x.py"
    source.write_text("def f():\n from thermal_fmu.half import A\n import_module('zenoh')\n import fmpy.x as y\n")
    assert imported(source) == {"thermal_fmu", "zenoh", "fmpy"}
