"""Laws of rest: green on what is right, red under a planted fault."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import thermal_fmu.boundary
from random_scenes.by_hand import corner, plate, two_blocks
from random_scenes.invariants_rest import FREE, REST
from random_scenes.planted import told_otherwise
from random_scenes.story import told

RNG = np.random.default_rng(0)
WARM = plate({"on": "plate.left", "convection": {"h": 200, "T": 500}}, {"on": "plate.top", "flux": 1e4},
             {"on": "plate.right", "radiation": {"emissivity": 0.5, "T": 700}}, size=5.0, end=20.0, T0=400)
APART = two_blocks(gap=1e-3)


@pytest.mark.few("corner")
@pytest.mark.parametrize("scene", [WARM, two_blocks(), APART, corner(1e-5)], ids=["plate", "touch", "apart", "corner"])
def test_nothing_driven_nothing_moves(scene):
    story = told(scene)
    assert story.outcome == "completed", story.message
    assert np.ptp(story.T) > 10.0  # as drawn it is driven
    assert not REST.check(scene, story, RNG)


def test_a_film_that_heats_from_nothing_is_found(monkeypatch):
    right = thermal_fmu.boundary.film_flow
    monkeypatch.setattr(thermal_fmu.boundary, "film_flow", lambda f, h, Te, T: right(f, h, Te, T - 1e-3))
    found = REST.check(WARM, told(WARM), RNG)
    assert [f.what.split()[1] for f in found] == ["temperature"]


def test_a_body_that_grows_at_its_own_temperature_is_found(monkeypatch):
    def hotter(model):
        for material in model["materials"].values():
            material["T_ref"] -= 1e-3

    told_otherwise(monkeypatch, "mechanical", hotter)
    found = REST.check(APART, told(APART), RNG)
    assert {f.what.split()[1] for f in found} == {"place", "stress"}


@pytest.mark.slow
def test_a_body_that_hangs_free_has_no_stress():
    scene = two_blocks(gap=1e-3, push=-5e-4)
    assert FREE.applies(scene)
    assert not FREE.check(scene, told(scene), RNG)
    pressed = two_blocks(gap=1e-4, push=-5e-4)
    assert not FREE.check(pressed, told(pressed), RNG)


def test_stress_of_a_load_that_nobody_stated_is_found(monkeypatch):
    scene = two_blocks(gap=1e-3, push=-5e-4)
    told_otherwise(monkeypatch, "mechanical", lambda model: model["boundary"].append({"on": "upper.left", "t_x": 1e5}))
    found = FREE.check(scene, told(scene), RNG)
    assert len(found) == 1
    assert "pulls upper" in found[0].what
