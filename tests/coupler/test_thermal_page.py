"""docs/thermal.md: every YAML block is a scenario that loads, every thermal key is in one, every picture is there."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic import BaseModel

from contact.problem.boundary import RadiationGap
from contact.problem.curves import FieldSum, Phases, Term
from contact.problem.material import Axes, Latent
from contact.problem.pairs import Conduction, NearRadiation
from contact.problem.thermal import Convection, FilmGap, InnerSteps, Method, Radiation, ThermalBoundary
from coupler.scenario import load_scenario
from coupler.scenario.schema import Thermal

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
sys.path.insert(0, str(Path(__file__).parent))
from page_blocks import keys_in, written
from thermal_page import PAGE, scenes

TEXT = PAGE.read_text(encoding="utf-8")
SCENES = scenes()
PARTS = (FieldSum, Term, Axes, Latent, Phases, Conduction, InnerSteps, Convection, FilmGap, NearRadiation, Radiation,
         RadiationGap, Thermal, ThermalBoundary)
# Said in scenario.md and starts.md.
ELSEWHERE = {"half", "bind", "replay", "options", "ignore", "tolerance", "at", "body", "name", "T_s", "T_l",
             "closed_factor", "halves", "across", "meshes"}


@pytest.mark.parametrize("name", SCENES)
def test_every_block_is_a_scenario(name: str, tmp_path: Path) -> None:
    assert load_scenario(written(SCENES[name], tmp_path)).notes == ()


def test_every_thermal_key_is_in_a_block() -> None:
    used = set(keys_in(SCENES))
    known = {key for part in PARTS for key in _fields(part)}
    assert known - used == ELSEWHERE - used
    methods = {scene["thermal"].get("method", "midpoint") for scene in SCENES.values()}
    assert all(f"`{m.value}`" in TEXT for m in Method)
    assert {"theta", "steady", "midpoint"} <= methods


def _fields(part: type[BaseModel]) -> Iterator[str]:
    yield from part.model_fields


def test_every_block_is_named_and_every_picture_is_there() -> None:
    assert TEXT.count("```yaml") == len(SCENES)
    pictures = re.findall(r"\]\((images/[^)]*)\)", TEXT)
    assert len(pictures) == len(set(pictures)) >= 12
    for picture in pictures:
        assert (PAGE.parent / picture).is_file(), picture


def test_links_inside_the_page_lead_somewhere() -> None:
    headings = {re.sub(r"[^a-z0-9 -]", "", h.lower()).replace(" ", "-") for h in re.findall(r"^## (.*)$", TEXT, re.M)}
    assert set(re.findall(r"\]\(#([^)]*)\)", TEXT)) <= headings
