"""`slideline verify-half` in a process of its own: a half that hangs, crashes or ends it is a row of the table."""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from coupler.cli.cli import app
from coupler.errors import HalfError
from coupler.fmu.description import with_description
from coupler.init.shipped import shipped_scenarios
from coupler.scenario import load_scenario
from coupler.verify.behaviour import checks_of
from coupler.verify.border import CheckVerdict
from coupler.verify.child import ALIVE, findings_of
from coupler.verify.verdicts import border_of

sys.path.insert(0, str(Path(__file__).parent.parent / "contact"))
from toy_halves import HALVES, build


@pytest.fixture(autouse=True)
def toys_are_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(HALVES))


@pytest.mark.few("crash-its process was ended by signal 11, asked to step from ")
@pytest.mark.parametrize(("ends", "says"), [
    ("exit", "its process ended with code 0, asked to step from "),
    ("crash", "its process was ended by signal 11, asked to step from "),
    ("hang", "it gave no answer for 10 s, asked to step from ")])
def test_a_half_that_does_not_come_back_is_a_row_with_what_it_was_asked(ends: str, says: str, tmp_path: Path) -> None:
    fmu = build(tmp_path / "half", ends=ends)
    (tmp_path / "scratch").mkdir()
    started = time.monotonic()
    findings = list(findings_of(fmu, tmp_path / "scratch", 1.0, limit=10.0))
    assert findings[-1].check == ALIVE
    assert findings[-1].verdict is CheckVerdict.FAIL
    assert findings[-1].reason.startswith(says)
    assert findings[-1].remedy
    assert any(f.check == "role" and f.verdict is CheckVerdict.PASS for f in findings), "what came before it stays"
    assert time.monotonic() - started < 120.0


def test_what_there_is_no_time_for_is_a_row_that_was_not_made(tmp_path: Path) -> None:
    """A half that takes long is not checked for hours before a run: what is left is told, and no failure."""
    fmu = build(tmp_path / "half", ends="hang")
    (tmp_path / "scratch").mkdir()
    found = {f.check: f for f in findings_of(fmu, tmp_path / "scratch", 1.0, most=20.0)}
    assert [f for f in found.values() if f.verdict is CheckVerdict.FAIL] == []
    assert found["role"].verdict is CheckVerdict.PASS
    left = {"takes substeps", *checks_of("thermal")}
    assert {check for check, f in found.items() if "there was no time for it" in f.reason} == left
    assert all(found[check].verdict is CheckVerdict.NOT_APPLICABLE for check in left)


@pytest.mark.slow
def test_the_command_ends_with_1_where_a_half_ends_the_process_with_0(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["verify-half", str(build(tmp_path / "half", ends="exit"))])
    assert done.exit_code == 1, done.output
    assert "violates the interface specification" in done.output


def test_the_child_finds_what_this_process_finds(tmp_path: Path) -> None:
    fmu = build(tmp_path / "half", leak=1e-9)
    (tmp_path / "scratch").mkdir()
    findings = {f.check: f for f in findings_of(fmu, tmp_path / "scratch", 1.0)}
    assert findings["save and restore to the bit"].verdict is CheckVerdict.FAIL
    assert "gives another T" in findings["save and restore to the bit"].reason
    assert findings["starts as the scene"].verdict is CheckVerdict.NOT_APPLICABLE


def test_it_is_told_the_scene(tmp_path: Path) -> None:
    """A toy of four nodes is not the half of the heated bars."""
    scene = load_scenario(shipped_scenarios() / "heated_bars.yaml")
    (tmp_path / "scratch").mkdir()
    border = border_of(scene, "thermal")
    findings = {f.check: f for f in findings_of(build(tmp_path / "half"), tmp_path / "scratch", 1.0, border)}
    assert findings["starts as the scene"].verdict is CheckVerdict.FAIL
    assert "was built for another scene (mesh.hash is " in findings["starts as the scene"].reason
    assert [check for check, f in findings.items() if f.verdict is CheckVerdict.FAIL] == ["starts as the scene"]
    assert findings["answers to a gap"].verdict is CheckVerdict.NOT_APPLICABLE


@pytest.mark.slow
def test_one_of_other_rows_that_says_no_mesh_is_told_by_its_rows(tmp_path: Path) -> None:
    """And nothing else is asked of it, which would need arrays of the scene."""
    scene = load_scenario(shipped_scenarios() / "heated_bars.yaml")
    (tmp_path / "scratch").mkdir()
    mute = with_description(build(tmp_path / "half"), lambda xml: re.sub(
        rb'name="(mesh.hash|surfaces.hash|geometry)"', rb'name="no.\1"', xml), tmp_path / "mute.fmu")
    findings = {f.check: f for f in findings_of(mute, tmp_path / "scratch", 1.0, border_of(scene, "thermal"))}
    assert "has shape (4, 2), but the scene has 69 rows" in findings["starts as the scene"].reason
    assert [check for check, f in findings.items() if f.verdict is CheckVerdict.FAIL] == ["starts as the scene"]
    assert "it is not a half of this scene" in findings["numbers that can be"].reason


def test_what_is_no_fmu_is_an_error_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "no.fmu").write_text("text")
    (tmp_path / "scratch").mkdir()
    with pytest.raises(HalfError, match="cannot be unpacked"):
        list(findings_of(tmp_path / "no.fmu", tmp_path / "scratch", 1.0))
