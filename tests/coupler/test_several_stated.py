"""What a scenario may say of several halves, and what each is told of the scene."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import ScenarioError, load_scenario
from coupler.cli.options import overrides_of

sys.path.insert(0, str(Path(__file__).parent))
from several_scenes import BLOCKS, THREE, TWO, blocks

pytestmark = pytest.mark.usefixtures("unlooked")


@pytest.mark.parametrize(("changes", "words"), [
    ({"thermal.halves": {"a": {"bodies": ["upper", "middle"]}}}, "no half solves for lower"),
    ({"thermal.halves": {**THREE, "low": {"bodies": ["lower", "middle"]}}}, "body 'middle' is solved for by mid"),
    ({"thermal.halves": {**THREE, "low": {"bodies": ["lover"]}}}, "there is no body 'lover'"),
    ({"thermal.halves": {**THREE, "low": {"bodies": ["lower"], "half": "lumped"}}, "bodies.lower.Q_T": 0},
     "heat crosses it from low (lumped) to mid (thermal)"),
    ({"thermal.halves": {**THREE, "low": {"bodies": ["lower"], "half": "termal"}}}, "no thermal half of kind 'termal'"),
    ({"thermal.halves": {**THREE, "low": {"bodies": ["lower"], "half": "replay"}}}, "cannot be one of several halves"),
    ({"thermal.halves": THREE, "thermal.adaptive": {"tolerance": 1e-3}}, "exchange heat across pair"),
    ({"thermal.halves": TWO, "thermal.across": {"tolerance": 0}}, "thermal.across.tolerance"),
])
def test_what_cannot_be_is_told(tmp_path: Path, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ScenarioError) as told:
        load_scenario(blocks(tmp_path), changes)
    assert words in str(told.value)


def test_inner_steps_go_with_pairs_within_halves(tmp_path: Path) -> None:
    file = blocks(tmp_path, BLOCKS.replace("master: middle.bottom", "master: lower.bottom"))
    halves = {"pair": {"bodies": ["upper", "middle"]}, "alone": {"bodies": ["lower"]}}
    several = load_scenario(file, {"thermal.halves": halves, "thermal.adaptive": {"tolerance": 1e-3}}).several
    assert several is not None
    assert [m.name for m in several.members] == ["thermal.pair", "thermal.alone"]
    assert not any(m.model.get("elsewhere") for m in several.members)


def test_a_half_is_told_its_bodies_and_the_surfaces_that_they_meet(tmp_path: Path) -> None:
    scene = load_scenario(blocks(tmp_path), {"thermal.halves": THREE})
    assert scene.halves == ("thermal.top", "thermal.mid", "thermal.low", "mechanical")
    assert scene.several is not None
    top, mid, low = scene.several.members
    assert top.interface.bodies == ("middle", "upper")
    assert top.model["elsewhere"] == ["middle"]
    assert mid.model["elsewhere"] == ["lower", "upper"]
    # Of the other body the cells at its surface alone: 4 x 4 cells, of which one row is seen.
    assert (~top.solved_cells).sum() == 4
    assert top.interface.pairs == (scene.interface.pairs[1],)
    assert "Q_T" not in mid.model["bodies"]["lower"] or mid.model["bodies"]["lower"]["Q_T"] == 0
    assert [b.get("name") for b in top.model["boundary"]] == ["hot"]
    assert [b.get("name") for b in mid.model["boundary"]] == ["air"]
    for member in (top, mid, low):
        np.testing.assert_array_equal(scene.interface.nodes[member.nodes], member.interface.nodes)
    owned = np.concatenate([m.nodes[m.solved] for m in (top, mid, low)])
    np.testing.assert_array_equal(np.sort(owned), np.arange(len(scene.interface.nodes)))
    cells = np.concatenate([m.cells[m.solved_cells] for m in (top, mid, low)])
    np.testing.assert_array_equal(np.sort(cells), np.arange(len(scene.interface.quads)))


def test_one_of_several_is_swapped_by_its_name() -> None:
    assert overrides_of([], ["thermal.low=ngsolve"]) == {"thermal.halves.low.half": "ngsolve"}
    assert overrides_of([], ["thermal=rod"]) == {"thermal.half": "rod"}
