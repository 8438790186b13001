"""A scene that is turned by its supports feels nothing of it: neither heat, nor contact, nor friction."""

from __future__ import annotations

import copy
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from random_scenes.scene import Scene
from random_scenes.story import COMPLETED, Story, told
from thermal_page import scenes

pytestmark = pytest.mark.usefixtures("unlooked")

PAGE = Path(__file__).resolve().parents[2] / "docs" / "elements.md"
BASE = scenes(PAGE)["base"]
C = np.array([0.05, 0.0])


def scene(angle: float, windows: int, **coupling: Any) -> Scene:
    """That of the page, turned by an angle [rad] in so many windows."""
    doc = copy.deepcopy(BASE)
    doc["signals"]["quarter"]["value"] = [0.0, angle]
    doc["coupling"] = {"end": 2, "windows": [{"until": 1, "size": 0.25}, {"until": 2, "size": 1 / windows}], **coupling}
    doc["probes"] = {}
    return Scene(doc, {})


@cache
def run(angle: float, windows: int, **coupling: Any) -> Story:
    story = told(scene(angle, windows, **coupling))
    assert story.outcome == COMPLETED, story.message
    return story


def turned(x: np.ndarray, angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray((x - C) @ np.array([[c, s], [-s, c]]) + C)


# Each scheme by both angles and in 1, 3 and 9 windows.
@pytest.mark.few("-3.0-3-extrapolated")
@pytest.mark.parametrize(("angle", "windows", "scheme"), [
    (angle, windows, scheme) for i, scheme in enumerate(("staggered", "extrapolated", "mechanical_first", "iterated"))
    for k, angle in enumerate((0.5 * np.pi, -3.0)) for w, windows in enumerate((1, 3, 9))
    if w == 1 or (i + k + w // 2) % 2])
def test_heat_and_contact_do_not_feel_a_turn(angle: float, windows: int, scheme: str) -> None:
    still, story = run(0.0, windows, scheme=scheme), run(angle, windows, scheme=scheme)
    if scheme == "extrapolated":
        # What is carried on through the first window of the turn is the press before it: from there on.
        assert np.abs(story.T[-1] - still.T[-1]).max() <= 1e-2 * np.ptp(still.T[-1])
    else:
        assert np.abs(story.T - still.T).max() <= 1e-6 * np.ptp(still.T)
        assert np.abs(story.t_N - still.t_N).max() <= 1e-6 * np.abs(still.t_N).max()
    assert np.abs(still.t_N[-1]).max() > 1e7
    assert np.abs(story.x[-1] - turned(still.x[-1], angle)).max() <= 1e-8


@pytest.mark.slow
def test_substeps_and_the_codec_change_nothing() -> None:
    more = {"scheme": "iterated", "substeps": {"mechanical": 3, "thermal": 2}}
    plain, coded, still = (told(scene(angle, 3, link=link, **more))
                           for angle, link in ((0.5 * np.pi, "direct"), (0.5 * np.pi, "codec"), (0.0, "direct")))
    assert plain.outcome == COMPLETED, plain.message
    np.testing.assert_array_equal(plain.T, coded.T)
    np.testing.assert_array_equal(plain.x, coded.x)
    assert np.abs(plain.T - still.T).max() <= 1e-6 * np.ptp(still.T)


def test_the_half_rigid_turns_the_scene() -> None:
    turn = {"rotation": {"about": [0.05, 0.0], "angle": "quarter"}}
    doc = dict(scene(0.5 * np.pi, 3, scheme="iterated").doc)
    doc["contact"]["face"].pop("friction")
    motion = {"lower": turn, "upper": turn}
    doc["mechanical"] = {"half": "rigid", "rigid": {"motion": motion, "pressure": {"face": 1e6}}}
    story = told(Scene(doc, {}))
    doc["signals"]["quarter"]["value"] = [0.0, 0.0]
    still = told(Scene(doc, {}))
    assert story.outcome == still.outcome == COMPLETED, (story.message, still.message)
    assert np.abs(story.T - still.T).max() <= 1e-6 * np.ptp(still.T)
