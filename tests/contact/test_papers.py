"""What an FMU of ours carries for a master of others: times, version, license, a page, and what it needs."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import packages_distributions, version
from pathlib import Path
from xml.etree import ElementTree

import pytest

from contact.half.papers import imported, installed, origin_of
from coupler import load_scenario
from coupler.fmu.launch import build_halves

ROOT = Path(__file__).resolve().parents[2]
BARS = ROOT / "scenarios/heated_bars.yaml"
PAGE = ROOT / "docs/other_masters.md"
ROLES = ("thermal", "mechanical")


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("fmus")
    return dict(zip(ROLES, build_halves(load_scenario(BARS), folder), strict=True))


def inside(fmu: Path, name: str) -> str:
    with zipfile.ZipFile(fmu) as archive:
        return archive.read(name).decode()


@pytest.mark.few("thermal")
@pytest.mark.parametrize("role", ROLES)
def test_the_description_says_times_version_and_license_and_is_valid(fmus: dict[str, Path], role: str) -> None:
    """heated_bars runs to 2000 s, from windows of 1 s."""
    root = ElementTree.fromstring(inside(fmus[role], "modelDescription.xml"))
    assert root.get("version") == version("slideline")
    assert root.get("license") == "BSD-3-Clause"
    experiment = root.find("DefaultExperiment")
    assert experiment is not None
    told = {k: float(v) for k, v in experiment.attrib.items()}
    assert told == {"startTime": 0.0, "stopTime": 2000.0, "stepSize": 1.0}
    said = subprocess.run([sys.executable, "-c", "import sys; from fmpy.validation import validate_fmu; "
                           "print(validate_fmu(sys.argv[1]))", str(fmus[role])], capture_output=True, text=True,
                          check=True, timeout=120)
    assert said.stdout.strip() == "[]"


@pytest.mark.parametrize("role", ROLES)
def test_what_it_needs_is_told_and_is_what_is_installed(fmus: dict[str, Path], role: str) -> None:
    needs = dict(line.split("==") for line in inside(fmus[role], "resources/requirements.txt").splitlines())
    assert {"numpy", "scipy", "numba", "h5py", "pydantic", "msgpack"} <= needs.keys()
    assert not needs.keys() & {"slideline", "pythonfmu", "fmpy", "typer"}  # it travels, or is the coupler's
    assert needs["numpy"] == version("numpy")


@pytest.mark.parametrize("role", ROLES)
def test_its_page_names_every_block(fmus: dict[str, Path], role: str) -> None:
    text = inside(fmus[role], "documentation/index.html")
    ElementTree.fromstring(text.replace("<!DOCTYPE html>", "").replace('<meta charset="utf-8">', ""))
    xml = inside(fmus[role], "modelDescription.xml")
    names = {re.sub(r"\[[\d,]+\]$", "", n) for n in re.findall(r'<ScalarVariable name="([^"]*)"', xml)}
    assert names == {re.sub(r"\[.*", "", n) for n in re.findall(r"<tr><td><code>([^<]*)</code>", text)}
    assert "fmi2Discard" in text


def test_of_a_package_that_is_not_installed_nothing_is_said() -> None:
    assert origin_of("nobody_has_this").version == ""
    assert origin_of("numpy").version == version("numpy")


@pytest.mark.skipif(shutil.which("cc") is None or sys.platform != "linux", reason="needs a C compiler")
def test_the_c_host_of_the_page_runs_the_thermal_half(fmus: dict[str, Path], tmp_path: Path) -> None:
    """As docs/other_masters.md says: libpython and the packages are the host's to bring."""
    source = re.search(r"<!-- file: host.c -->\n```c\n(.*?)```", PAGE.read_text(), re.S)
    assert source
    (tmp_path / "host.c").write_text(source[1])
    subprocess.run(["cc", "host.c", "-ldl", "-o", "host"], cwd=tmp_path, check=True, timeout=60)
    with zipfile.ZipFile(fmus["thermal"]) as archive:
        archive.extractall(tmp_path / "fmu")
    root = ElementTree.parse(tmp_path / "fmu/modelDescription.xml").getroot()
    identifier, first = root.find("CoSimulation").get("modelIdentifier"), root.find(".//ScalarVariable[@name='T[1]']")
    library = subprocess.run([sys.executable, "-c", "import sysconfig as s; print(s.get_config_var('LIBDIR') + '/' + "
                              "s.get_config_var('INSTSONAME'))"], capture_output=True, text=True, check=True)
    if not Path(library.stdout.strip()).is_file():
        pytest.skip("this Python has no shared library")
    packages = [p for p in sys.path if "site-packages" in p]
    done = subprocess.run(
        [str(tmp_path / "host"), str(tmp_path / f"fmu/binaries/linux64/{identifier}.so"), root.get("guid"),
         (tmp_path / "fmu/resources").as_uri(), first.get("valueReference"), "10"],
        capture_output=True, text=True, timeout=300, check=False, env=os.environ | {
            "LD_PRELOAD": library.stdout.strip(), "PYTHONPATH": os.pathsep.join(packages),
            "PYTHONHOME": sys.base_prefix,
            # The sources that the FMU brings lie in a new place, where numba has nothing: 20 s to compile.
            "NUMBA_DISABLE_JIT": "1"})
    assert done.returncode == 0, done.stderr
    courses = [float(line.split()[1]) for line in done.stdout.splitlines()]
    assert len(courses) == 10
    assert courses[-1] == pytest.approx(500.0)  # the foot of the hot bar is held at 500 K, and starts at 300 K


def test_what_sources_import_is_found_without_parsing_them() -> None:
    """Of every source here; no name is missed, and what is too much is no package."""
    here = installed()
    for path in (p for name in ("contact", "thermal_fmu", "mechanical_fmu", "coupler", "tests/swap_halves")
                 for p in (ROOT / name).rglob("*.py")):
        source, names = path.read_text(encoding="utf-8"), set()
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Import):
                names |= {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                names.add(node.module.partition(".")[0])
        found = imported(source)
        assert names <= found, path
        assert not {n for n in found - names if n in here}, path


def test_forms_of_imports() -> None:
    source = """
import numpy as np, scipy.sparse  # both
if True:
    from h5py import (
        File)
from . import near
from .near import by
import_no = 1
"""
    assert imported(source) == {"numpy", "scipy", "h5py"}


def test_what_is_installed_is_what_the_standard_library_says() -> None:
    theirs = {name: set(of) for name, of in packages_distributions().items() if name.isidentifier()}
    assert {name: set(installed().get(name, ())) for name in theirs} == theirs


def test_what_is_installed_while_the_program_runs_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    assert "late_half" not in installed()
    info = tmp_path / "late_half-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: late-half\nVersion: 1.0\n")
    (info / "top_level.txt").write_text("late_half\n")
    assert installed()["late_half"] == ["late-half"]


@pytest.mark.few("thermal_fmu.half")
@pytest.mark.parametrize("half", ["thermal_fmu.half", "mechanical_fmu.elastic_half"])
def test_what_few_scenes_need_is_imported_by_those(half: str) -> None:
    """Curves through tables take 0.15 s to import, in each process and each build."""
    said = subprocess.run([sys.executable, "-c", f"import sys, {half}; print(*sys.modules)"], capture_output=True,
                          text=True, check=True, timeout=120).stdout.split()
    assert "scipy.sparse" in said
    assert not {"scipy.interpolate", "scipy.optimize", "matplotlib"} & set(said)


@pytest.mark.few("coupler.verify.child", "contact.half.volume")
@pytest.mark.parametrize("module", ["contact.half.slave", "contact.half.volume", "coupler.verify.child"])
def test_who_compiles_nothing_imports_no_compiler(module: str) -> None:
    """numba takes 0.3 s to import: each process of another package's half, and each that checks one."""
    said = subprocess.run([sys.executable, "-c", f"import sys, {module}; print(*sys.modules)"], capture_output=True,
                          text=True, check=True, timeout=120).stdout.split()
    assert module in said
    assert not {"numba", "llvmlite"} & set(said)
