"""`slideline run`: a half that breaks the specification in a way that no step shows is not run, or not in silence."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from coupler import Results, load_scenario
from coupler.cli.cli import app
from coupler.errors import HalfError
from coupler.trust.checks import TrustVerdict
from coupler.verify.verdicts import ROW

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "foreign_fmu"))
from broken_halves import SCENE
from make import make_wall

pytestmark = pytest.mark.skipif(shutil.which("cc") is None or sys.platform != "linux",
                                reason="the half in C needs a C compiler (cc), which is not here")
ALL_AT_20 = ("bodies.lower.T0=20", "bodies.upper.T0=20", "thermal.boundary=[]", "coupling.end=3",
             "coupling.windows=[{until: 3, size: 1}]", "mechanical.half=rigid")


def words(folder: Path, *wrong: str, unit: str = "K") -> list[str]:
    """A run of the scene with a wall in C as its thermal half.  wrong : what is wrong with it."""
    scene = folder / "s.yaml"
    scene.write_text(SCENE)
    interface = load_scenario(scene).interface
    T_start = {"K": 293.15, "degC": 20.0}[unit]
    wall = make_wall(folder / "wall", len(interface.nodes), len(interface.pair_nodes), T_start, *wrong, unit=unit)
    sets = [word for text in ALL_AT_20 for word in ("--set", text)]
    return ["run", str(scene), "-o", str(folder / "run.h5"), "-q", "--swap", f"thermal={wall}", *sets]


@pytest.mark.few("KEEPS_TIME-time passes-times0")
@pytest.mark.parametrize("times", [[[]], [[], ["--verify"]]])
@pytest.mark.parametrize(("wrong", "check"), [("HIDDEN", "same inputs, same bits"), ("KEEPS_TIME", "time passes")])
def test_what_no_step_shows_is_named_before_the_run(wrong: str, check: str, times: list[list[str]],
                                                    tmp_path: Path) -> None:
    run = words(tmp_path, wrong)
    for more in times:
        with pytest.raises(HalfError, match=f"(?s)nothing was run.*thermal half .*fmu: {check}: "):
            CliRunner().invoke(app, [*run, *more], catch_exceptions=False)
        assert not (tmp_path / "run.h5").exists()
    done = CliRunner().invoke(app, [*run, "--no-verify"])
    results = Results(tmp_path / "run.h5")
    assert results.outcome == "completed", "no step shows it"
    # It says so on its page, in its notes and in its table.
    assert "thermal half wall.fmu: not checked: left out (--no-verify)" in done.stdout
    assert [(c.verdict, c.what) for c in results.trust if c.name == ROW] == [
        (TrustVerdict.UNCHECKED, "thermal half wall.fmu: not checked: left out (--no-verify)")]


@pytest.mark.slow
def test_the_command_ends_with_1_and_one_error(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-m", "coupler.cli", *words(tmp_path, "KEEPS_TIME")], capture_output=True,
                          text=True, timeout=300, check=False)
    assert done.returncode == 1
    first, *rows = done.stderr.splitlines()
    assert first.startswith("error: nothing was run, for the interface specification is violated (")
    assert "time passes" in first
    assert rows
    assert all(row.startswith("thermal half ") for row in rows)
    assert "Traceback" not in done.stderr


@pytest.mark.slow
def test_a_half_that_is_right_is_checked_once_anew_if_asked_and_ours_never(tmp_path: Path) -> None:
    run = [word for word in words(tmp_path, unit="degC") if word != "-q"]
    told = []
    for more in (["--verify"], [], ["--verify", "-q"]):
        done = CliRunner().invoke(app, [*run, *more])
        assert done.exit_code == 0, done.output
        told.append(done.stderr)
    assert "mechanical half" not in "".join(told)
    assert ["meets the interface specification" in text for text in told] == [True, False, True]
    assert "checking the thermal half wall.fmu against the interface specification, once" in told[0]
    (row,) = (c for c in Results(tmp_path / "run.h5").trust if c.name == ROW)
    assert row.verdict is TrustVerdict.HOLDS
    assert "heat warms a body (it takes no E_M)" in row.what


@pytest.mark.slow
def test_a_run_that_goes_on_keeps_what_is_known_of_its_half(tmp_path: Path) -> None:
    run = words(tmp_path)
    assert CliRunner().invoke(app, [*run, "--until", "1"]).exit_code == 0
    assert Results(tmp_path / "run.h5").outcome == "stopped"
    done = CliRunner().invoke(app, ["resume", str(tmp_path / "run.h5"), "-q"])
    assert done.exit_code == 0, done.output
    (row,) = (c for c in Results(tmp_path / "run.h5").trust if c.name == ROW)
    assert row.verdict is TrustVerdict.HOLDS
