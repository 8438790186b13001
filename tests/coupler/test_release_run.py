"""Runs whose conditions end: windows end there, and rollbacks and the codec change nothing."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, told
from thermal_page import scenes

PAGE = Path(__file__).resolve().parents[2] / "docs" / "elements.md"
LOWERED = scenes(PAGE)["lowered"]
FORCE = 1e6 * 0.05


def test_a_block_that_is_lowered_is_let_go_when_it_touches() -> None:
    story = told(Scene(LOWERED, {}))
    assert story.outcome == COMPLETED, story.message
    touching = story.t_N.min(axis=1) < 0.0
    first = int(np.argmax(touching))
    assert 0 < first < len(touching) - 2
    assert not touching[:first].any()
    np.testing.assert_allclose(story.probes["carried"][first + 1:], FORCE, rtol=1e-6)


@pytest.mark.few("staggered")
@pytest.mark.parametrize("scheme", ["staggered", "iterated"])
def test_the_codec_gives_the_same_bits(scheme: str) -> None:
    one, other = (told(Scene(LOWERED, {}).edited(coupling__scheme=scheme, coupling__link=link))
                  for link in ("direct", "codec"))
    np.testing.assert_array_equal(one.x, other.x)
    np.testing.assert_array_equal(one.t_N, other.t_N)


def test_a_window_ends_where_a_condition_does(tmp_path: Path) -> None:
    scene = Scene(LOWERED, {})
    boundary = [dict(b) for b in LOWERED["mechanical"]["elastic"]["boundary"]]
    boundary[1]["until"] = 0.7
    scenario = scene.edited(mechanical__elastic__boundary=boundary).checked(tmp_path)
    assert scenario.coupling.kinks == (0.7,)
    boundary[1]["until"] = 7.0
    assert scene.edited(mechanical__elastic__boundary=boundary).checked(tmp_path / "later").coupling.kinks == ()
