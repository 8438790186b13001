"""A half that is an FMU lying ready: named by its path, copied to the cache by content."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from coupler import load_scenario, run
from coupler.errors import HalfError, ScenarioError
from coupler.fmu.launch import build_half, build_halves

BARS = Path(__file__).resolve().parents[2] / "scenarios/heated_bars.yaml"


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The heated bars, with both of their FMUs in a folder beside them."""
    folder = tmp_path_factory.mktemp("scene")
    shutil.copy(BARS, folder)
    build_halves(load_scenario(folder / BARS.name), folder / "fmus")
    return folder / BARS.name


def test_it_gives_the_bits_of_the_half_it_was_built_from(scene: Path, tmp_path: Path) -> None:
    named = run(load_scenario(scene), tmp_path / "named.h5", until=5.0)
    ready = run(load_scenario(scene, overrides={"thermal.half": "fmus/thermal.fmu"}), tmp_path / "ready.h5", until=5.0,
                verify="never")
    for probe in ("hot.top", "cold.bottom"):
        assert np.array_equal(named.probe(probe)[1], ready.probe(probe)[1])


def test_the_scenario_is_another_with_another_fmu(scene: Path, tmp_path: Path) -> None:
    own = tmp_path / scene.name
    shutil.copy(scene, own)
    overrides = {"thermal.half": "half.fmu"}
    hashes = set()
    for role in ("thermal", "mechanical"):
        shutil.copy(scene.parent / f"fmus/{role}.fmu", tmp_path / "half.fmu")
        hashes.add(load_scenario(own, overrides=overrides).hash)
    assert len(hashes) == 2


def test_one_that_is_not_there_is_named_before_anything_runs(scene: Path) -> None:
    with pytest.raises(ScenarioError, match=r"thermal\.half: there is no FMU .*thermo\.fmu.*relative to the scenario"):
        load_scenario(scene, overrides={"thermal.half": "fmus/thermo.fmu"})


def test_one_that_is_in_the_current_folder_is_told_as_the_scenario_has_it(scene: Path, tmp_path: Path,
                                                                           monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    shutil.copy(scene.parent / "fmus/thermal.fmu", tmp_path / "here" / "mine.fmu")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ScenarioError) as refused:
        load_scenario(scene, overrides={"thermal.half": "here/mine.fmu"})
    hint = refused.value.remedy.rpartition(": ")[2]
    assert load_scenario(scene, overrides={"thermal.half": hint}).thermal_half == str(tmp_path / "here" / "mine.fmu")


def test_it_is_copied_once_by_content(scene: Path, tmp_path: Path) -> None:
    fmu, cache = scene.parent / "fmus/thermal.fmu", tmp_path / "cache"
    first = build_half(str(fmu), tmp_path, cache)
    assert first.with_suffix("").joinpath("modelDescription.xml").is_file()
    again = Path(shutil.copy(fmu, tmp_path / "again.fmu"))
    assert build_half(str(again), tmp_path, cache) == first
    assert len(list(cache.iterdir())) == 1


def test_a_file_that_is_no_fmu_is_refused(tmp_path: Path) -> None:
    (tmp_path / "no.fmu").write_text("text")
    with pytest.raises(HalfError, match=r"no\.fmu cannot be unpacked"):
        build_half(str(tmp_path / "no.fmu"), tmp_path, tmp_path / "cache")
    assert not (tmp_path / "cache").exists()
    with pytest.raises(HalfError, match=r"gone\.fmu cannot be read"):
        build_half(str(tmp_path / "gone.fmu"), tmp_path, tmp_path / "cache")


# Checked first, it is refused by its row, as a toy is by default (test_verify_child.py).
@pytest.mark.few("never")
@pytest.mark.parametrize("verify", ["once", "never"])
def test_one_of_another_scene_is_refused(scene: Path, tmp_path: Path, verify: str) -> None:
    finer = {"thermal.half": "fmus/thermal.fmu", "bodies.hot.mesh.rectangle.cells": [3, 10]}
    with pytest.raises(HalfError, match="built for another scene"):
        run(load_scenario(scene, overrides=finer), tmp_path / "run.h5", verify=verify)
