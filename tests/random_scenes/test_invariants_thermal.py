"""Laws of temperature: green on what is right, red under a planted fault."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import thermal_fmu.boundary
from random_scenes.by_hand import plate, two_blocks
from random_scenes.invariants_thermal import MAXIMUM, WITHIN, beyond_data, is_m_matrix
from random_scenes.story import told

FILM = {"on": "plate.left", "convection": {"h": 200, "T": 500}}
HOT = {"on": "plate.right", "temperature": 800}
STEP = 0.01**2 * 7800 * 480 / 45  # [s], h^2/a of the plate's cells of 10 mm
RANGE = (300.0, 800.0)


@pytest.mark.parametrize(("method", "cells"), [
    ("backward_euler", (4, 4)), ("backward_euler", (3, 4)), ("midpoint", (4, 4))])
def test_a_plate_stays_within_its_data(method, cells):
    scene = plate(FILM, HOT, size=0.5 * STEP, end=10 * STEP, method=method, cells=cells)
    story = told(scene)
    assert story.outcome == "completed", story.message
    assert not beyond_data(story, "as drawn")


def test_blocks_that_meet_stay_within_their_data():
    story = told(two_blocks(gap=1e-5, size=2.0, end=16.0, thermal__method="backward_euler"))
    assert story.outcome == "completed"
    assert story.t_N.min() < 0.0
    assert not beyond_data(story, "as drawn")


def test_a_film_that_aims_too_high_is_found(monkeypatch):
    right = thermal_fmu.boundary.film_flow
    monkeypatch.setattr(thermal_fmu.boundary, "film_flow", lambda f, h, Te, T: right(f, h, Te, T - 2.0))
    scene = plate({"on": "plate.left", "convection": {"h": 2000, "T": 500}}, size=20 * STEP, end=400 * STEP)
    found = beyond_data(told(scene), "as drawn")
    assert len(found) == 1
    assert "above all its data (300 to 500 K)" in found[0].what
    assert found[0].size > 1e3


def test_a_plate_stays_within_its_data_in_windows_of_any_length():
    scene = plate(FILM, HOT, size=STEP, end=4 * STEP)
    story = told(scene)
    for seed in range(3):
        assert not MAXIMUM.check(scene, story, np.random.default_rng(seed))


@pytest.mark.few("maximum principle")
@pytest.mark.parametrize("law", [WITHIN, MAXIMUM], ids=str)
def test_both_laws_find_a_film_that_aims_too_high(law, monkeypatch):
    right = thermal_fmu.boundary.film_flow
    scene = plate({"on": "plate.left", "convection": {"h": 2000, "T": 500}}, size=20 * STEP, end=400 * STEP)
    seed = next(k for k in range(100) if 2.0 < np.random.default_rng(k).uniform(-4.0, 4.0) < 3.0)  # hundreds of h^2/a
    assert not law.check(scene, told(scene), np.random.default_rng(seed))
    monkeypatch.setattr(thermal_fmu.boundary, "film_flow", lambda f, h, Te, T: right(f, h, Te, T - 2.0))
    assert law.check(scene, told(scene), np.random.default_rng(seed))


def test_which_meshes_keep_the_principle():
    square, flat = (told(plate(HOT, size=STEP, end=STEP, cells=c)) for c in ((4, 4), (2, 8)))
    assert is_m_matrix(square, "plate", RANGE)
    assert not is_m_matrix(flat, "plate", RANGE)
    cut = told(plate(HOT, size=STEP, end=STEP, cells=(2, 8), triangles=True))
    assert is_m_matrix(cut, "plate", RANGE)  # right angles: cotangents of 0 and above
    axes = {"k_1": 100, "k_2": 10, "angle": 40}
    skewed = told(plate(HOT, size=STEP, end=STEP).edited(materials__steel__k=axes))
    assert not is_m_matrix(skewed, "plate", RANGE)
    wet = told(plate({"on": "plate.left", "convection": {"h": 1e6, "T": 500}}, size=STEP, end=STEP))
    assert not is_m_matrix(wet, "plate", RANGE)  # a film so strong that its mass-like matrix outweighs conduction


def test_sources_leave_the_bound_they_do_not_touch():
    heated = plate({"on": "plate.left", "flux": 1e5}, size=STEP, end=10 * STEP)
    assert not beyond_data(told(heated), "as drawn")
    cooled = plate({"on": "plate.left", "flux": -1e5}, {"on": "plate.right", "flux": 1e4}, size=STEP, end=10 * STEP)
    assert not beyond_data(told(cooled), "as drawn")


def test_nothing_is_below_absolute_zero():
    story = told(plate({"on": "plate.left", "flux": -1e6}, size=5 * STEP, end=20 * STEP))
    found = beyond_data(story, "as drawn") if story.outcome == "completed" else []
    assert story.outcome == "failed" or (np.isinf(found[0].size) and "absolute zero" in found[0].what)
