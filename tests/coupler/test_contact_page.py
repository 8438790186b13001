"""docs/contact.md: every YAML block is a scenario, every key of contact is in one, every picture is there."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from contact.problem.pairs import Augmented, ContactForm, ContactPair, Friction
from coupler.scenario import load_scenario
from mechanical_fmu.problem import parse_elastic

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
sys.path.insert(0, str(Path(__file__).parent))
from contact_runs import PAGE
from page_blocks import keys_in, written
from thermal_page import scenes

TEXT = PAGE.read_text(encoding="utf-8")
SCENES = scenes(PAGE)
PARTS = (ContactPair, Friction, Augmented)
ELSEWHERE = {"conduction", "radiation", "clearance"}  # said in thermal.md; the contrary of `interference`


@pytest.mark.parametrize("name", SCENES)
def test_every_block_is_a_scenario(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(written(SCENES[name], tmp_path))
    assert parse_elastic(scenario.interface, scenario.models["mechanical"])


def test_every_key_of_contact_is_in_a_block() -> None:
    used = set(keys_in([scene["contact"] for scene in SCENES.values()]))
    known = {key for part in PARTS for key in part.model_fields}
    assert known - used == ELSEWHERE
    assert all(f"`form: {form.value}`" in TEXT for form in ContactForm)


def test_every_block_is_named_and_every_picture_is_there() -> None:
    assert TEXT.count("```yaml") == len(SCENES)
    pictures = re.findall(r"\]\((images/[^)]*)\)", TEXT)
    assert len(pictures) == len(set(pictures)) == 8
    for picture in pictures:
        assert (PAGE.parent / picture).is_file(), picture


def test_links_lead_somewhere() -> None:
    for page, heading in re.findall(r"\]\((\w*\.?m?d?)#([^)]*)\)", TEXT):
        text = (PAGE.parent / page).read_text(encoding="utf-8") if page else TEXT
        known = {re.sub(r"[^a-z0-9 -]", "", h.lower()).replace(" ", "-") for h in re.findall(r"^## (.*)$", text, re.M)}
        assert heading in known, f"{page}#{heading}"
