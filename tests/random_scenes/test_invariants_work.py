"""The same bits by every way of running a scene: quiet on what is right, loud where a way loses something."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from coupler.running.run import Run
from random_scenes import invariants_work as work
from random_scenes.scene import Scene
from random_scenes.small import adaptive, pressed
from random_scenes.story import told


def found(scene: Scene) -> list[str]:
    story = told(scene)
    assert story.outcome == "completed", story.message
    return [f.what for f in work.SAME_BITS.check(scene, story, np.random.default_rng(0))]


@pytest.mark.slow
def test_fmus_bytes_processes_and_resumed_runs_have_the_same_bits():
    short = adaptive().edited(coupling__scheme="auto", coupling__end=5)
    assert found(short) == []


@pytest.mark.slow
def test_what_a_resumed_run_forgets_is_found(monkeypatch):
    """And a bit of T that is another without FMUs."""
    right = Run._continue_from

    def forgets(self, since, halves):
        right(self, since, halves)
        state = self._at.state
        self._at = type(self._at)(type(state)(state.now, (), state.events, state.accounts, {}, ()), self._at.control)

    monkeypatch.setattr(Run, "_continue_from", forgets)
    monkeypatch.setattr(work, "processes", lambda scene, folder: work.made(scene, folder))
    scene = pressed().edited(coupling__scheme="extrapolated")
    story = told(scene)
    level = story.levels[-1]
    level.T[0] = np.nextafter(level.T[0], 0.0)
    texts = [f.what for f in work.SAME_BITS.check(scene, story, np.random.default_rng(0))]
    assert len(texts) == 2
    assert "without FMUs T at t = 20 s differs" in texts[0]
    assert "and resumed" in texts[1]


def test_few_scenes_are_run_by_fmus():
    drawn = [work.SAME_BITS.applies(pressed().edited(title=f"scene {k}")) for k in range(400)]
    assert 4 <= sum(drawn) <= 36
