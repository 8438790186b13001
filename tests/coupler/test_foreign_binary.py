"""An FMU of another tool runs in a process of its own: one that ends its process does not end the run with code 0."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from coupler import load_scenario
from coupler.errors import HalfError
from coupler.fmu import launch
from coupler.fmu.launch import build_half, is_foreign
from coupler.running.run import run

sys.path.insert(0, str(Path(__file__).parent.parent / "contact"))
from toy_halves import HALVES, environment

BARS = Path(__file__).resolve().parents[2] / "scenarios/heated_bars.yaml"
AT_273 = {"bodies.hot.T0": 273.15, "bodies.cold.T0": 273.15}


def toy_of_the_bars(folder: Path, tool: str, **model: object) -> Path:
    """A toy thermal half on the mesh of the heated bars, as if `tool` had made it."""
    load_scenario(BARS, overrides=AT_273).write_half("thermal", folder)
    (folder / "model.json").write_text(json.dumps({"half": "toy", "rate": 0.1, "h_max": 1e9, **model}))
    fmu, out = folder / "toy.fmu", folder / "foreign.fmu"
    subprocess.run([sys.executable, "-P", "-m", "toy_half.build", str(folder), str(fmu)], check=True, timeout=240,
                   env=environment())
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                content = content.replace(b"(Slideline)", tool.encode())
            new.writestr(name, content)
    return out


def test_ours_are_known_by_their_tool(tmp_path: Path) -> None:
    scene = load_scenario(BARS)
    assert not is_foreign(build_half(scene.write_half("thermal", tmp_path / "own"), tmp_path / "own"))
    assert is_foreign(build_half(str(toy_of_the_bars(tmp_path / "foreign", "by another")), tmp_path))


def test_one_that_behaves_runs_to_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And nothing of it is loaded into this process."""
    monkeypatch.setenv("PYTHONPATH", str(HALVES))

    def loaded(*_: object) -> None:
        raise AssertionError("it was loaded into the coupler's own process")

    monkeypatch.setattr(launch, "load_half", loaded)
    fmu = toy_of_the_bars(tmp_path, "by another")
    scene = load_scenario(BARS, overrides={**AT_273, "thermal.half": str(fmu)})
    assert run(scene, tmp_path / "run.h5", until=5.0).t[-1] >= 5.0


# The last one: where it fails it takes pytest with it, and that ends with 0.

@pytest.mark.slow
def test_one_that_ends_its_process_with_0_fails_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(HALVES))
    fmu = toy_of_the_bars(tmp_path, "by another", ends="exit")
    scene = load_scenario(BARS, overrides={**AT_273, "thermal.half": str(fmu)})
    with pytest.raises(HalfError, match=r"thermal.*process ended with code 0"):
        run(scene, tmp_path / "run.h5")
