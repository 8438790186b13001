"""The picture of a scene before it runs: every place where something acts has its number and its words."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from coupler import load_scenario
from coupler.errors import ScenarioError
from coupler.report.scene import acting, scene_figure, write_scene

sys.path.insert(0, str(Path(__file__).parent))
from foreign_scenes import scenes

SCENARIOS = sorted((Path(__file__).resolve().parents[2] / "scenarios").glob("*.yaml"))
BLOCKS = next(path for path in SCENARIOS if path.stem == "sliding_blocks")

pytestmark = pytest.mark.fast


def words_of(figure):
    return "\n".join(text.get_text() for text in figure.texts)


@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_condition_of_a_scenario_is_told_and_every_place_found(path):
    scenario = load_scenario(path)
    places = acting(scenario)
    told = words_of(scene_figure(scenario))
    own = scenario.resolved["mechanical"].get(scenario.mechanical_half) or {}
    entries = [*(scenario.resolved["thermal"].get("boundary") or ()), *(own.get("boundary") or ())]
    assert sum(len(place.words) for place in places) >= len(entries)
    for entry in entries:
        where = str(entry.get("on", entry.get("at", entry.get("body", ""))))
        assert any(place.where == where and place.at is not None for place in places), where
    for name in (*scenario.interface.bodies, *(p.name for p in scenario.interface.pairs)):
        assert name in told


def test_numbers_stand_outside_their_bodies_on_their_own_surfaces():
    scenario = load_scenario(BLOCKS)
    ax = scene_figure(scenario).axes[0]
    numbers = {text.get_text(): text for text in ax.texts if text.get_text().isdigit()}
    foot = next(k for k, place in enumerate(acting(scenario), 1) if place.where == "lower.bottom")
    x, y = numbers[str(foot)].get_position()
    assert y < 0.0 < x < 0.0762
    assert np.allclose(numbers[str(foot)].xy, (0.0381, 0.0), atol=0.0016)


def test_what_acts_is_told_in_the_words_of_the_file():
    told = words_of(scene_figure(load_scenario(BLOCKS)))
    for words in ("upper.top: temperature 1000", "u_y stroke", "temperatures in °C", "gap_max 0.1 m"):
        assert words in told


def test_the_pressure_of_rigid_bodies_is_told_where_it_acts():
    told = words_of(scene_figure(load_scenario(BLOCKS.with_name("heated_bars.yaml"))))
    assert "cold.bottom: pressure of interface 1e+06" in told


def test_numbers_do_not_cover_the_names_of_bodies():
    """What moves a body as a whole stood on its name."""
    figure = scene_figure(load_scenario(BLOCKS, overrides={"mechanical.half": "rigid"}))
    renderer = FigureCanvasAgg(figure).get_renderer()
    texts = {text.get_text(): text.get_window_extent(renderer) for text in figure.axes[0].texts}
    numbers = [box for text, box in texts.items() if text.isdigit()]
    assert len(numbers) == 6
    for name in ("lower", "upper"):
        assert not any(box.overlaps(texts[name]) for box in numbers), name


def test_one_cell_is_no_cells():
    told = words_of(scene_figure(load_scenario(BLOCKS.with_name("lumped_gap.yaml"))))
    assert "1 cell\n" in told
    assert "1 cells" not in told


@pytest.mark.parametrize("half", ["mine", "my.fmu"])
def test_what_a_half_of_another_package_is_told_is_there_too(tmp_path, monkeypatch, half):
    """It is told the conditions of `elastic`; so its picture has them."""
    own, other = scenes(tmp_path, "mechanical", monkeypatch)
    if half.endswith(".fmu"):
        (tmp_path / half).write_bytes(b"")
        other = load_scenario(tmp_path / "s.yaml", overrides={"mechanical.half": half})
    assert other.mechanical_half.endswith(half)
    assert [(p.where, p.words) for p in acting(other)] == [(p.where, p.words) for p in acting(own)]
    assert any(p.where == "upper.top" and any("u_y" in words for words in p.words) for p in acting(other))


def test_a_picture_of_no_known_kind_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match=r"ends in \.png, \.svg or \.pdf"):
        write_scene(load_scenario(BLOCKS), tmp_path / "scene.txt")
    with pytest.raises(ScenarioError, match="cannot be written"):
        write_scene(load_scenario(BLOCKS), tmp_path / "nowhere" / "scene.png")


@pytest.mark.few(".svg")
@pytest.mark.parametrize("kind", [".png", ".svg", ".pdf"])
def test_pictures_are_written(tmp_path, kind):
    written = write_scene(load_scenario(BLOCKS), tmp_path / f"scene{kind}")
    assert written.stat().st_size > 5000
