"""`slideline build --fmi 3`: a run of both halves with arrays is the run with scalars, to the bit."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from coupler import load_scenario, run
from coupler.cli import cli
from coupler.fmu.description import read_description, unpack
from coupler.verify.border import CheckVerdict
from coupler.verify.child import findings_of
from coupler.verify.matter import known_scene

pytest.importorskip("pythonfmu3")
sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import ROOT

SHORT = {"coupling.end": 20, "output.fields.every": 1}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The heated bars, and their halves as FMUs of FMI 3.0."""
    path = tmp_path_factory.mktemp("build3")
    shutil.copy(ROOT / "scenarios/heated_bars.yaml", path / "s.yaml")
    done = CliRunner().invoke(cli.app, ["build", str(path / "s.yaml"), "-o", str(path / "fmus"), "--fmi", "3"])
    assert done.exit_code == 0, done.output
    return path


def test_a_run_with_arrays_is_the_run_with_scalars(folder: Path) -> None:
    ours = run(load_scenario(folder / "s.yaml", overrides=SHORT), out=folder / "2.h5")
    paths = {f"{role}.half": f"fmus/{role}.fmu" for role in ("thermal", "mechanical")}
    arrays = run(load_scenario(folder / "s.yaml", overrides=SHORT | paths), out=folder / "3.h5", verify="never")
    assert (ours.outcome, arrays.outcome) == ("completed", "completed")
    assert np.ptp(ours.probe("hot.top")[1]) > 1.0
    for name in ("hot.top", "cold.bottom", "interface.p"):
        for a, b in zip(ours.probe(name), arrays.probe(name), strict=True):
            assert a.tobytes() == b.tobytes()


def test_they_say_what_a_master_needs(folder: Path, tmp_path: Path) -> None:
    from fmpy import read_model_description

    about = read_model_description(str(folder / "fmus/thermal.fmu"))
    assert about.fmiVersion == "3.0"
    assert float(about.defaultExperiment.stopTime) == load_scenario(folder / "s.yaml").coupling.end
    fields = read_description(unpack(folder / "fmus/thermal.fmu", tmp_path / "u")).fields
    assert {name: fields[name].block.on for name in ("T", "contact.t_N")} == {"T": "nodes", "contact.t_N": "pair_nodes"}


@pytest.mark.slow
@pytest.mark.parametrize("role", ["thermal", "mechanical"])
def test_verify_half_finds_nothing(role: str, folder: Path, tmp_path: Path) -> None:
    scenario = load_scenario(folder / "s.yaml")
    border = known_scene(scenario.interface, scenario.models["thermal"], scenario.models["mechanical"])
    found = list(findings_of(folder / f"fmus/{role}.fmu", tmp_path, 1.0, border))
    assert [(f.check, f.reason) for f in found if f.verdict is CheckVerdict.FAIL] == []
    assert sum(f.verdict is CheckVerdict.PASS for f in found) > 15
