"""What a half of another package does not read of its scene is an error, unless the scenario lets it leave it out."""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Mapping
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from coupler import load_scenario
from coupler.errors import ScenarioError
from coupler.scenario.understood import covers, declared_by, declared_in, words_of

sys.path.insert(0, str(Path(__file__).parent))
from foreign_scenes import install_mine
from scenario_text import GOOD

THERMAL = "boundary.temperature boundary.convection.h boundary.convection.T materials pairs.conduction"


@pytest.fixture
def kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Installs a half `mine` whose builder declares a text; None: declares nothing."""
    monkeypatch.syspath_prepend(str(tmp_path))

    def install(text: str | None) -> None:
        package = tmp_path / "mine_half"
        package.mkdir(exist_ok=True)
        (package / "__init__.py").write_text("raise RuntimeError('the coupler imported a half')\n")
        (package / "build.py").write_text("" if text is None else f"UNDERSTANDS = {text!r}\n")
        install_mine(monkeypatch)
    return install


def load(folder: Path, overrides: Mapping[str, Any]):
    (folder / "s.yaml").write_text(GOOD)
    return load_scenario(folder / "s.yaml", overrides={"thermal.half": "mine", **overrides})


def test_each_condition_that_would_be_left_out_is_named_where_it_stands(kind, tmp_path):
    kind(THERMAL)
    with pytest.raises(ScenarioError) as told:
        load(tmp_path, {})
    text = str(told.value)
    assert "thermal.boundary.1.flux: the half would leave this out: it does not understand boundary.flux" in text
    assert "thermal: {ignore: [boundary.flux]}" in text
    assert "thermal.boundary.2.convection.gap.d_cut" in text
    assert "boundary.convection.h" not in text
    assert "materials" not in text


def test_what_the_scenario_lets_it_leave_out_is_no_error(kind, tmp_path):
    kind(THERMAL)
    scene = load(tmp_path, {"thermal.ignore": ["boundary.flux", "boundary.convection.gap"]})
    assert scene.foreign == {"thermal": True, "mechanical": False}
    assert not any("does not say what it reads" in note for note in scene.notes)


def test_a_word_of_ignore_that_means_nothing_is_an_error(kind, tmp_path):
    kind(THERMAL + " boundary")
    with pytest.raises(ScenarioError, match=r"thermal\.ignore.*there is no condition 'boundry\.flux'.*boundary"):
        load(tmp_path, {"thermal.ignore": ["boundry.flux"]})


def test_a_half_that_understands_all_of_it_is_told_all_of_it(kind, tmp_path):
    kind("boundary, materials, pairs, bodies")
    load(tmp_path, {})


def test_a_half_that_declares_nothing_is_told_as_one(kind, tmp_path):
    kind(None)
    notes = load(tmp_path, {}).notes
    assert any("the thermal half mine does not say what it reads of a scene (UNDERSTANDS" in note for note in notes)


def test_a_mechanical_half_is_asked_for_what_mechanics_states(kind, tmp_path):
    kind("boundary.u_x boundary.u_y materials.E materials.nu")
    with pytest.raises(ScenarioError) as told:
        load(tmp_path, {"thermal.half": "thermal", "mechanical.half": "mine",
                        "mechanical.elastic.gravity": {"y": -9.81}})
    text = str(told.value)
    assert "materials.steel.alpha: the half would leave this out: it does not understand materials.alpha" in text
    assert "mechanical.elastic.gravity.y" in text
    assert "materials.rho" not in text, "that is for the thermal half"
    assert "u_x" not in text


def test_an_fmu_declares_it_in_its_description(tmp_path):
    def fmu(inside: str) -> Path:
        with zipfile.ZipFile(tmp_path / "half.fmu", "w") as archive:
            archive.writestr("modelDescription.xml", f"<fmiModelDescription><ModelVariables>{inside}"
                             "</ModelVariables></fmiModelDescription>")
        return tmp_path / "half.fmu"

    said = '<ScalarVariable name="understands" valueReference="1">\n<String start="boundary.flux materials"/>'
    assert declared_in(fmu(f"{said}</ScalarVariable>")) == {"boundary.flux", "materials"}
    said = '<String name="understands" valueReference="1" causality="output"><Start value="boundary.flux materials"/>'
    assert declared_in(fmu(f"{said}</String>")) == {"boundary.flux", "materials"}  # FMI 3.0
    assert declared_in(fmu("")) is None
    assert declared_in(tmp_path / "none.fmu") is None


def test_a_path_stands_for_all_below_it_and_for_nothing_beside_it():
    assert covers({"boundary.convection"}, "boundary.convection.gap.d_cut")
    assert not covers({"boundary.convection.h"}, "boundary.convection.h_factor")
    assert not covers({"boundary.convection.h"}, "boundary.convection")
    assert words_of("a.b,\n c") == {"a.b", "c"}


def test_the_constant_is_found_without_loading_the_package(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "loud_half").mkdir()
    (tmp_path / "loud_half/__init__.py").write_text("UNDERSTANDS = 'x'\nraise RuntimeError('loaded')\n")
    assert declared_by(EntryPoint("loud", "loud_half", "g")) == {"x"}
    assert declared_by(EntryPoint("gone", "gone_half.build", "g")) is None
