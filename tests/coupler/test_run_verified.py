"""`slideline run --verify`: a half that breaks the specification in a way that no step shows is not run."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from coupler import Results, load_scenario
from coupler.cli.cli import app
from coupler.errors import HalfError

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "foreign_fmu"))
from broken_halves import SCENE
from make import make_wall

pytestmark = pytest.mark.skipif(shutil.which("cc") is None or sys.platform != "linux",
                                reason="the half in C needs a C compiler (cc), which is not here")
ALL_AT_20 = ("bodies.lower.T0=20", "bodies.upper.T0=20", "thermal.boundary=[]", "coupling.end=3",
             "coupling.windows=[{until: 3, size: 1}]", "mechanical.half=rigid")


def words(folder: Path, *wrong: str) -> list[str]:
    """A run of the scene with a wall in C as its thermal half.  wrong : what is wrong with it."""
    scene = folder / "s.yaml"
    scene.write_text(SCENE)
    interface = load_scenario(scene).interface
    wall = make_wall(folder / "wall", len(interface.nodes), len(interface.pair_nodes), 293.15, *wrong)
    sets = [word for text in ALL_AT_20 for word in ("--set", text)]
    return ["run", str(scene), "-o", str(folder / "run.h5"), "-q", "--swap", f"thermal={wall}", *sets]


@pytest.mark.parametrize(("wrong", "check"), [("HIDDEN", "same inputs, same bits"), ("KEEPS_TIME", "time passes")])
def test_what_no_step_shows_is_named_before_the_run(wrong: str, check: str, tmp_path: Path) -> None:
    run = words(tmp_path, wrong)
    with pytest.raises(HalfError, match=f"(?s)nothing was run.*thermal half .*fmu: {check}: "):
        CliRunner().invoke(app, [*run, "--verify"], catch_exceptions=False)
    assert not (tmp_path / "run.h5").exists()
    CliRunner().invoke(app, run)
    assert Results(tmp_path / "run.h5").outcome == "completed", "no step shows it"


def test_a_half_that_is_right_is_run_and_ours_are_not_checked(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, [*words(tmp_path), "--verify"])
    assert done.exit_code == 0, done.output
    assert "thermal half: " in done.stderr
    assert "meets the interface specification" in done.stderr
    assert "mechanical half: " not in done.stderr
    assert (tmp_path / "run.h5").exists()
