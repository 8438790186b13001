"""`slideline verify-half ROLE=KIND --scenario FILE`: a half in a scene that uses another one."""

from __future__ import annotations

from pathlib import Path

import pytest

from contact.half.model import load_directory
from coupler.cli.verifying import fmu_of
from coupler.errors import ScenarioError
from coupler.fmu.description import read_description

BARS = Path(__file__).parents[2] / "scenarios" / "heated_bars.yaml"


def test_a_half_is_put_into_the_scene(tmp_path: Path) -> None:
    found = fmu_of("thermal=lumped", BARS, tmp_path / "half")
    _, model = load_directory(tmp_path / "half")
    assert model["half"] == "lumped"
    assert "lumped" in read_description(found.fmu.with_suffix("")).identifier
    assert found.scene is not None
    assert len(found.scene.interface.nodes) == 69


def test_an_fmu_is_put_into_the_scene(tmp_path: Path) -> None:
    built = fmu_of("mechanical=rigid", BARS, tmp_path / "half").fmu
    ready = tmp_path / "ready.fmu"
    ready.write_bytes(built.read_bytes())
    found = fmu_of(f"mechanical={ready}", BARS, tmp_path / "again")
    assert found.fmu == ready
    assert found.scene is not None


@pytest.mark.parametrize(("half", "scenario", "said"), [
    ("thermal=lumped", None, "there is no scene to put this half into"),
    ("thermal=nothing", BARS, "there is no thermal half of kind 'nothing'"),
    ("thermal=no.fmu", BARS, "there is no FMU"),
    ("ccx", BARS, "Say its role: thermal=ccx or mechanical=ccx, with --scenario"),
    ("lump", None, "did you mean 'lumped'")])
def test_what_cannot_be_put_there_is_one_error(half: str, scenario: Path | None, said: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as found:
        fmu_of(half, scenario, tmp_path / "half")
    assert said.lower() in str(found.value).lower()
