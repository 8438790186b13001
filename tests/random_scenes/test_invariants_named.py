"""Heat and force by name: green on what is right, red under a planted fault."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import thermal_fmu.step
from mechanical_fmu.named_forces import NamedForces
from random_scenes.by_hand import HELD, corner, plate, two_blocks
from random_scenes.draw import scene_of
from random_scenes.invariants_named import NAMED
from random_scenes.story import told

RNG = np.random.default_rng(0)
PLATE = plate({"on": "plate.left", "temperature": 500}, {"on": "plate.bottom", "temperature": 400},
              {"on": "plate.right", "convection": {"h": 300, "T": 280}},
              {"on": "plate.top", "radiation": {"emissivity": 0.5, "T": 900}},
              {"on": "plate.right", "flux": 2e4}, size=2.0, end=8.0, method="sdirk2")
RUBBING = two_blocks(
    pair={"friction": {"mu": 0.3}},
    mechanical__elastic__boundary=[{"on": "lower.bottom", **HELD}, {"on": "upper.right", "pressure": 1e6}, {
        "on": "upper.top", "u_y": {"t": [0, 2], "value": [0, -2e-4]}, "u_x": {"t": [0, 2, 8], "value": [0, 0, 3e-4]}}],
    thermal__boundary=[{"on": "upper.top", "temperature": 600}], bodies__lower__Q_T=1e6)
SCENES = {"plate": PLATE, "rubbing": RUBBING, "corner": corner(1e-4),
          "iterated": RUBBING.edited(coupling__scheme="iterated", coupling__substeps={"thermal": 3, "mechanical": 1})}
SEEDS = range(3000, 3006)


@pytest.mark.few("plate")
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_right_scenes_add_up_by_name(scene):
    story = told(scene)
    assert story.outcome == "completed", story.message
    assert not [f.what for f in NAMED.check(scene, story, RNG)]


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_drawn_scenes_add_up_by_name(seed):
    """Not one of the laws that are drawn: another one there would draw other laws for the seeds that are fixed."""
    scene = scene_of(seed)
    story = told(scene)
    if story.outcome == "completed":
        assert not [f.what for f in NAMED.check(scene, story, RNG)]


def test_heat_that_is_told_a_little_wrong_is_seen(monkeypatch):
    right = thermal_fmu.step.through_prescribed
    monkeypatch.setattr(thermal_fmu.step, "through_prescribed", lambda t, o, n: 1.0001 * right(t, o, n))
    found = NAMED.check(PLATE, told(PLATE), RNG)
    assert len(found) == 2  # neither what is stored nor the mechanism
    assert found[0].size > 100.0


def test_a_force_without_its_load_is_seen(monkeypatch):
    right = NamedForces.outputs
    monkeypatch.setattr(NamedForces, "outputs", lambda self, at: right(self, replace(at, held=1.001 * at.held)))
    found = NAMED.check(RUBBING, told(RUBBING), RNG)
    assert [f for f in found if "supports of lower" in f.what]
