"""The half `replay`: what a run recorded, in the place of either half."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from coupler import Results, load_scenario, run
from coupler.errors import ScenarioError
from coupler.running.resume import resume

sys.path.insert(0, str(Path(__file__).parent))
from foreign_scenes import TEXT
from scenario_text import ROOT

pytestmark = pytest.mark.usefixtures("unlooked")

PROBES = """
output: {fields: {every: 1}, checkpoint: null}
probes: {T: {T: {max: lower.top}}, p: {p: {max: lower.top}}}
"""
RUB: dict[str, Any] = {"coupling.end": 3, "coupling.scheme": "extrapolated", "coupling.windows": [
    {"until": 3, "size": 0.5}], "bodies.bar.mesh.rectangle.cells": [12, 2], "bodies.block.mesh.rectangle.cells": [
    3, 2], "output.checkpoint": None, "output.fields.every": 1}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The scene, and run.h5 with a frame a window."""
    path = tmp_path_factory.mktemp("replay")
    (path / "s.yaml").write_text(TEXT + PROBES)
    run(load_scenario(path / "s.yaml"), out=path / "run.h5")
    return path


def swapped(role: str, source: str = "run.h5", **more: Any) -> dict[str, Any]:
    return {f"{role}.half": "replay", f"{role}.replay.from": source, **more}


@pytest.mark.parametrize("role", ["thermal", "mechanical"])
def test_a_run_that_plays_its_own_record_is_that_run(folder: Path, role: str) -> None:
    """A frame a window, staggered: what the other half is told is what it was told, to the bit."""
    own = Results(folder / "run.h5")
    played = run(load_scenario(folder / "s.yaml", overrides=swapped(role)), out=folder / f"{role}.h5")
    assert played.outcome == "completed"
    assert played.t == pytest.approx(own.t, abs=0.0)
    for name in ("T", "p"):
        assert np.ptp(own.probe(name)[1]) > 0.0
        assert (played.probe(name)[1] == own.probe(name)[1]).all()
    for field in ("thermal.T", "mechanical.u"):
        assert (played.field(field)[1] == own.field(field)[1]).all()
    assert any(n.startswith(f"the {role} half plays run.h5") for n in played.notes)


def test_it_is_found_beside_the_scenario_and_its_content_is_the_scenarios(folder: Path) -> None:
    s = load_scenario(folder / "s.yaml", overrides=swapped("mechanical"))
    assert s.hash != load_scenario(folder / "s.yaml", overrides={"mechanical.half": "rigid"}).hash
    source = dict(s.starts["mechanical"].source)
    assert source["from"] == "run.h5"
    assert len(str(source["sha256"])) == 64


def refusal(folder: Path, overrides: dict[str, Any]) -> ScenarioError:
    with pytest.raises(ScenarioError) as raised:
        load_scenario(folder / "s.yaml", overrides=overrides)
    return raised.value


@pytest.mark.parametrize(("more", "text"), [
    ({"bodies.upper.mesh.rectangle.cells": [6, 3]}, "its mesh is not that of this one"),
    ({"contact.joint.gap_max": 0.001}, "its contact pairs are not those of this one"),
    ({"coupling.end": 4, "coupling.windows": [{"until": 4, "size": 1}]}, "ends at 3 s, this scenario at 4 s"),
    ({"mechanical.replay.from": "none.h5"}, "there is no file"),
    ({"mechanical.replay.from": "s.yaml"}, "cannot be read as results"),
])
def test_a_run_of_another_scene_is_refused(folder: Path, more: dict[str, Any], text: str) -> None:
    error = refusal(folder, {**swapped("mechanical"), **more})
    assert text in error.message
    assert error.key == "mechanical.replay.from"
    assert error.remedy


@pytest.mark.parametrize("totals", ["[]", '{"made": [1]}', '{"made": {"E_M": "x"}}'])
def test_totals_of_another_form_are_told(folder: Path, totals: str) -> None:
    shutil.copy(folder / "run.h5", folder / "odd.h5")
    with h5py.File(folder / "odd.h5", "r+") as f:
        f.attrs["totals"] = totals
    error = refusal(folder, swapped("mechanical", "odd.h5"))
    assert "totals" in error.message
    assert error.key == "mechanical.replay.from"


def test_a_probe_of_a_force_that_no_record_has_is_told_in_the_words_of_the_scenario(folder: Path) -> None:
    text = (folder / "s.yaml").read_text().replace("probes: {", "probes: {F: {'heat.pair.joint[1]': value}, ")
    (folder / "forces.yaml").write_text(text)
    with pytest.raises(ScenarioError, match="half does not tell heat") as raised:
        run(load_scenario(folder / "forces.yaml", overrides=swapped("thermal")), out=folder / "forces.h5")
    assert "condition." not in str(raised.value)
    assert "leave this probe out" in raised.value.remedy


def test_without_a_run_it_is_told_where_one_is_named(folder: Path) -> None:
    error = refusal(folder, {"thermal.half": "replay"})
    assert "needs a run to play" in error.message
    assert "--set thermal.replay.from=run.h5" in error.remedy


@pytest.fixture(scope="module")
def rubbing(tmp_path_factory) -> Callable[..., Path]:
    """A run of a block that rubs, with a frame every so many windows; the scene is beside it."""
    path = tmp_path_factory.mktemp("rub")
    (path / "s.yaml").write_text((ROOT / "scenarios/rubbing_block.yaml").read_text())

    def recorded(**more: Any) -> Path:
        out = path / f"run{len(list(path.glob('run*.h5')))}.h5"
        run(load_scenario(path / "s.yaml", overrides=RUB | {k.replace("__", "."): v for k, v in more.items()}), out=out)
        return out

    return recorded


@pytest.mark.slow
def test_heat_of_friction_is_played_where_frames_tell_all_of_it(rubbing) -> None:
    """Every joule that was made arrives once, and the bar warms as it did."""
    path = rubbing()
    own = Results(path)
    made = own.totals["made"]["contact.E_friction"]
    assert made > 100.0
    played = run(load_scenario(path.parent / "s.yaml", overrides=RUB | swapped("mechanical", path.name)),
                 out=path.with_name("played.h5"))
    assert played.totals["made"]["contact.E_friction"] == pytest.approx(made, rel=1e-12)
    assert played.probe("bar.T")[1] == pytest.approx(own.probe("bar.T")[1], abs=1e-9)
    assert np.ptp(own.probe("bar.T")[1]) > 0.3  # K


def test_what_is_too_coarse_in_time_is_told_and_no_heat_is_made_of_a_part_of_it(rubbing) -> None:
    """Every other window: frames then tell of the heat of every other window alone."""
    path = rubbing(output__fields__every=2)
    s = load_scenario(path.parent / "s.yaml", overrides=RUB | swapped("mechanical", path.name))
    note = next(n for n in s.notes if n.startswith("the mechanical half plays"))
    assert "4 frames to 3 s, up to 1 s apart, of its 6 windows: it is too coarse" in note
    assert "of contact.E_friction that it made are not played" in note
    assert "contact.E_friction" not in s.recordings["mechanical"].recording.outputs
    assert "x " in note.partition("off by about")[2]


@pytest.mark.slow
def test_in_a_process_of_its_own_and_resumed_it_plays_the_same(folder: Path) -> None:
    own = Results(folder / "run.h5").probe("T")[1]
    scenario = load_scenario(folder / "s.yaml", overrides=swapped("mechanical", **{"output.checkpoint": 0}))
    assert (run(scenario, out=folder / "apart.h5", processes=True).probe("T")[1] == own).all()
    run(scenario, out=folder / "part.h5", until=1.0)
    assert (resume(folder / "part.h5").probe("T")[1] == own).all()
