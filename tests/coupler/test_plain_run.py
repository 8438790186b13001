"""A plain `slideline run` names every broken half of the tests before it runs, and runs those that are right.

A run checks a half in a child. Most of the halves in Python are checked in this process instead, by the row that
names them alone: a child imports and loads for as long as it checks, and each row runs the half for some steps.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import zipfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from contact.half import build_fmu
from coupler import Results, load_scenario
from coupler.cli.cli import app
from coupler.errors import HalfError
from coupler.fmu.bounds import BorderScene
from coupler.fmu.fmi import load_half
from coupler.fmu.launch import build_halves
from coupler.trust.checks import Check, TrustVerdict
from coupler.verify import behaviour, verdicts
from coupler.verify.behaviour import checks_of
from coupler.verify.border import Finding
from coupler.verify.conformance import verify_fmu

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "foreign_fmu"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "contact" / "halves"))
from broken_halves import CASES, FREE, SCENE
from make import make_wall
from test_c_halves import ALL_AT_20, WRONG, made

HERE = Path(__file__).resolve().parent
HALVES = HERE.parent / "contact" / "halves"
NO_COMPILER = "" if shutil.which("cc") and sys.platform == "linux" else "the half in C needs a C compiler (cc)"
ROWS = {"not a number": "takes substeps"}  # which an FMU of ours discards itself
IN_CHILD = ("runs away", "hidden state", "wrong sign of pressure", "expands by half")
IN_C = {f"{name} (in C)": case for name, case in WRONG.items()}


def refused(scene: Path, role: str, fmu: Path, folder: Path, *sets: str) -> str:
    """What a plain run says of a half, which it does not run."""
    words = [word for text in sets for word in ("--set", text)]
    with pytest.raises(HalfError) as said:
        CliRunner().invoke(app, ["run", str(scene), "-o", str(folder / "run.h5"), "-q", "--swap", f"{role}={fmu}",
                                 *words], catch_exceptions=False)
    assert not (folder / "run.h5").exists()
    text = str(said.value)
    assert text.startswith("nothing was run, for the interface specification is violated (")
    return text


@pytest.fixture(scope="module")
def wrongs(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Path]:
    """(scene, role) -> the FMU of our half in a scene, wrapped; the case it is goes into its model.json."""
    found = {}
    for scene, text in (("pressed", SCENE), ("free", FREE)):
        folder = tmp_path_factory.mktemp(scene)
        (folder / "s.yaml").write_text(text)
        scenario = load_scenario(folder / "s.yaml")
        for role, package in (("thermal", "thermal_fmu"), ("mechanical", "mechanical_fmu")):
            scenario.write_half(role, folder / role)
            model = json.loads((folder / role / "model.json").read_text())
            (folder / role / "model.json").write_text(json.dumps(model | {"case": "ignores h" if role == "thermal"
                                                                          else "millimetres"}))
            found[scene, role] = build_fmu(folder / role, folder / f"{role}.fmu", package="broken_half",
                                           load="broken_half.model:load", uses=(package,))
    return found


def wrong(base: Path, case: str, out: Path) -> Path:
    """The FMU of a case: that of another one, with its name."""
    with zipfile.ZipFile(base) as archive, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "resources/model.json":
                content = json.dumps(json.loads(content) | {"case": case}).encode()
            new.writestr(name, content)
    return out


def test_all_36_are_here() -> None:
    assert len(CASES) + len(IN_C) == 36


def checked_here(fmu: Path, scratch: Path, h: float, scene: BorderScene, limit: float, *, reads: frozenset[str] | None,
                 most: float, reference: Path | None, why_none: str, last: str) -> Iterator[Finding]:
    """Check as coupler.verify.child does, in this process.  last : the row after which nothing more is checked."""
    own = None if reference is None else partial(load_half, reference, None, "own")
    for finding in verify_fmu(fmu, scratch, h, scene, reads=reads, reference=own, why_none=why_none):
        yield finding
        if finding.check == last:
            return


@pytest.mark.few(
    "below absolute zero", "ignores h", "random after step 8", "displacements", "pressures that pull",
    "counts its substeps", "writes half of its state", "heat in millijoules", "cells renumbered",
    "takes kelvin for Celsius", "strains without a cause", "hears another order", "gaps in millimetres")
@pytest.mark.parametrize("name", CASES)
def test_a_plain_run_names_it(name: str, wrongs: dict[tuple[str, str], Path], tmp_path: Path,
                              monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), str(HALVES)]))
    case = CASES[name]
    row = ROWS.get(name, case.check)
    if name not in IN_CHILD:
        monkeypatch.setattr(verdicts, "findings_of", partial(checked_here, last=row))
        monkeypatch.setattr(behaviour, "checks_of", lambda role: {n: c for n, c in checks_of(role).items() if n == row})
    base = wrongs[case.scene, case.role]
    scene = base.parent / "s.yaml"
    said = refused(scene, case.role, wrong(base, name, tmp_path / "wrong.fmu"), tmp_path)
    # Row, reason, remedy.
    assert re.search(re.escape(f"{case.role} half {tmp_path / 'wrong.fmu'}: {row}: ")
                     + r".+\. \S.+", said)
    assert re.search(case.cause, said)


# Each in one version of FMI here, and by `verify-half` in the other (test_c_halves.py): the checks are the same.
@pytest.mark.few("crashes-3", "displacements-2")
@pytest.mark.parametrize(("name", "fmi"), [(name, 2 + k % 2) for k, name in enumerate(WRONG)])
def test_a_plain_run_names_it_in_c(name: str, fmi: int, tmp_path: Path) -> None:
    if NO_COMPILER:
        pytest.skip(NO_COMPILER)
    case, scene = WRONG[name], tmp_path / "s.yaml"
    scene.write_text(SCENE)
    fmu = made(case, load_scenario(scene, overrides=ALL_AT_20), tmp_path / "half", fmi)
    role = "mechanical" if case.scale else "thermal"
    sets = [f"{key}={json.dumps(value)}" for key, value in ALL_AT_20.items()]
    # On a busy machine others may stand still for so long, too.
    sets += [f"coupling.deadlines.{role}=5"] if name == "hangs" else []
    said = refused(scene, role, fmu, tmp_path, "mechanical.half=rigid" if role == "thermal" else "thermal.half=lumped",
                   *sets)
    assert f"{role} half {fmu}: {case.check}: " in said
    assert case.says in said


# Halves that are right: of other packages, of C, and one of ours by its path.

@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The three halves of docs/write_a_half.md, as its reader installs them, and a cache of their own."""
    page = (HERE.parents[1] / "docs" / "write_a_half.md").read_text(encoding="utf-8")
    for name, text in re.findall(r"<!-- file: (swap_halves/\w+\.py) -->\n```python\n(.*?)^```$", page, re.M | re.S):
        path = tmp_path / "site" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    info = tmp_path / "site" / "swap_halves-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: swap-halves\nVersion: 0.1\n")
    points = [f"{name} = swap_halves.{name}_build" for name in ("skfem", "ngsolve", "felupe")]
    (info / "entry_points.txt").write_text("\n".join(["[slideline.halves]", *points]))
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "site"))
    monkeypatch.setenv("SLIDELINE_CACHE", str(tmp_path / "cache"))


def run_twice(folder: Path, swap: str, *sets: str, monkeypatch: pytest.MonkeyPatch) -> Results:
    """Run a half that is right two times; it is checked in the first, and known in the second."""
    checked: list[Path] = []
    findings_of = verdicts.findings_of

    def counted(fmu: Path, *more: Any, **named: Any) -> Any:
        checked.append(fmu)
        return findings_of(fmu, *more, **named)

    monkeypatch.setattr(verdicts, "findings_of", counted)
    (folder / "s.yaml").write_text(SCENE)
    words = ["run", str(folder / "s.yaml"), "-o", str(folder / "run.h5"), "--swap", swap,
             *(word for text in ("coupling.end=3", "coupling.windows=[{until: 3, size: 1}]", *sets)
               for word in ("--set", text))]
    told = []
    for _ in range(2):
        done = CliRunner().invoke(app, words, catch_exceptions=False)
        assert done.exit_code in (0, 4), done.output  # three windows are few for a trust table
        told.append(done.stderr)
    assert len(checked) == 1
    assert "meets the interface specification" in told[0]
    assert "interface specification" not in told[1]
    return Results(folder / "run.h5")


def row_of(results: Results) -> Check:
    return next(check for check in results.trust if check.name == verdicts.ROW)


@pytest.mark.slow
@pytest.mark.parametrize(("swap", "sets", "left"), [
    # A run of docs/write_a_half.md checks this one, too.
    ("thermal=skfem", (), ()), ("thermal=ngsolve", (), ()),
    ("mechanical=felupe", (), ("expands freely",))])
def test_a_half_of_another_package_is_checked_once(swap: str, sets: tuple[str, ...], left: tuple[str, ...],
                                                   installed: None, tmp_path: Path,
                                                   monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("swap_halves." + swap.partition("=")[2] + "_volume")
    row = row_of(run_twice(tmp_path, swap, *sets, monkeypatch=monkeypatch))
    assert row.verdict is TrustVerdict.HOLDS
    assert all(name in row.what.partition("not checked: ")[2] for name in left)


@pytest.mark.few("3")
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_half_in_c_is_checked_once(fmi: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes neither heat nor a scene, and its row says what was not checked."""
    if NO_COMPILER:
        pytest.skip(NO_COMPILER)
    monkeypatch.setenv("SLIDELINE_CACHE", str(tmp_path / "cache"))
    (tmp_path / "s.yaml").write_text(SCENE)
    interface = load_scenario(tmp_path / "s.yaml").interface
    wall = make_wall(tmp_path / "wall", len(interface.nodes), len(interface.pair_nodes), 293.15, fmi=fmi)
    sets = ("bodies.upper.T0=20", "thermal.boundary=[]", "mechanical.half=rigid")
    row = row_of(run_twice(tmp_path, f"thermal={wall}", *sets, monkeypatch=monkeypatch))
    assert row.verdict is TrustVerdict.HOLDS
    assert "heat warms a body (it takes no E_M)" in row.what


@pytest.mark.slow
def test_a_rod_by_its_path_is_checked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SLIDELINE_CACHE", str(tmp_path / "cache"))
    (tmp_path / "s.yaml").write_text(SCENE)
    rod = load_scenario(tmp_path / "s.yaml", overrides={"thermal.half": "rod"})
    (tmp_path / "fmus").mkdir()
    build_halves(rod, tmp_path / "fmus")
    assert row_of(run_twice(tmp_path, f"thermal={tmp_path / 'fmus' / 'thermal.fmu'}",
                            monkeypatch=monkeypatch)).verdict is TrustVerdict.HOLDS
