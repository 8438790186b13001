"""Laws of sign and balance: green on what is right, red under a planted fault."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import thermal_fmu.boundary
from random_scenes.by_hand import HELD, corner, plate, two_blocks
from random_scenes.direct_half import DirectHalf
from random_scenes.invariants_signs import COULOMB, DISSIPATION, ENTROPY_RISES, FORCES, HEATS, INVARIANTS, PRESSURE
from random_scenes.planted import pairs_otherwise, told_otherwise
from random_scenes.scene import Scene
from random_scenes.story import told

RNG = np.random.default_rng(0)
BLOCKS = two_blocks(gap=1e-5)


def rubbing(*, push: float = -2e-4, **pair: object) -> Scene:
    """The upper block is pressed on, then rubbed there and back; both flow."""
    boundary = [{"on": "lower.bottom", **HELD}, {"on": "upper.top", "u_y": {"t": [0, 2], "value": [0, push]},
                                                "u_x": {"t": [0, 2, 4, 6, 8], "value": [0, 0, -3e-4, 3e-4, -1e-4]}}]
    return two_blocks(pair={"friction": {"mu": 0.3}, "augmented": None, **pair}, mechanical__elastic__boundary=boundary,
                      materials__steel__plastic={"s_y": 4e8})


def loaded(geometry: str) -> Scene:
    """Every kind of load at once, one with a jump."""
    scene = two_blocks()
    boundary = [*scene.doc["mechanical"]["elastic"]["boundary"], {"on": "upper.left", "pressure": 1e6},
                {"on": "upper.right", "t_y": -1e6, "t_x": {"t": [0, 4, 4, 8], "value": [0, 3e6, 2e6, 2e6]}},
                {"at": "lower.top_right", "f_x": 1e4}, {"body": "upper", "b_x": 1e7}]
    return scene.edited(geometry=geometry, mechanical__elastic__boundary=boundary,
                        mechanical__elastic__gravity={"x": 5e3, "y": -1e4})


SCENES = {"blocks": BLOCKS, "rubbing": rubbing(), "augmented": rubbing(push=-5e-5, augmented={}),
          "loaded": loaded("plane"), "loaded about an axis": loaded("axisymmetric"), "corner": corner(1e-4)}


@pytest.mark.few("rubbing")
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_right_scenes_keep_all_signs_and_sums(scene):
    story = told(scene)
    assert story.outcome == "completed", story.message
    assert story.t_N.min() < 0.0
    laws = [law for law in INVARIANTS if law.applies(scene)]
    assert len(laws) >= 5
    assert not [f.what for law in laws for f in law.check(scene, story, RNG)]


def otherwise(monkeypatch, name, change):
    """An output of a half, changed wherever it is read."""
    right = DirectHalf.read

    def wrong(half, names, finite=True):
        return {n: change(v) if n == name else v for n, v in right(half, names, finite).items()}

    monkeypatch.setattr(DirectHalf, "read", wrong)


def test_contact_that_pulls_is_found():
    story = told(BLOCKS)
    levels = (*story.levels[:-1], replace(story.levels[-1], t_N=story.levels[-1].t_N + 1e9))
    assert not PRESSURE.check(BLOCKS, story, RNG)
    assert PRESSURE.check(BLOCKS, replace(story, levels=levels), RNG)


def test_more_friction_than_coulomb_allows_is_found(monkeypatch):
    scene = rubbing()
    pairs_otherwise(monkeypatch, mu=1.5)
    found = COULOMB.check(scene, told(scene), RNG)
    assert len(found) == 1
    assert found[0].size > 1e3


def test_friction_and_flow_that_cool_are_found(monkeypatch):
    scene = rubbing()
    right = told(scene)
    assert np.array(right.extra["mechanical.E_M"]).max() > 0.0
    otherwise(monkeypatch, "contact.E_friction", lambda v: -v)
    otherwise(monkeypatch, "E_M", lambda v: -v)
    monkeypatch.setattr(thermal_fmu.boundary, "demand_limits", lambda *_: None)
    found = DISSIPATION.check(scene, told(scene), RNG)
    assert len(found) == 2


def test_a_load_that_nobody_stated_is_found(monkeypatch):
    told_otherwise(monkeypatch, "mechanical", lambda model: model["boundary"].append({"on": "upper.left", "t_x": 1e5}))
    found = FORCES.check(BLOCKS, told(BLOCKS), RNG)
    assert len(found) == 1


def test_a_body_with_another_mass_is_found(monkeypatch):
    def heavier(model):
        model["materials"]["steel"]["rho"] *= 1.001

    told_otherwise(monkeypatch, "thermal", heavier)
    assert len(HEATS.check(BLOCKS, told(BLOCKS), RNG)) == 2


def test_a_heat_balance_that_does_not_close_is_found():
    scene = plate({"on": "plate.left", "flux": 1e4}, size=5.0, end=20.0)
    story = told(scene)
    assert not HEATS.check(scene, story, RNG)
    assert len(HEATS.check(scene, replace(story, imbalance=1e-6), RNG)) == 1


def test_heat_that_flows_from_cold_to_hot_is_found(monkeypatch):
    def backwards(group, factor, T):
        flow, slope, averaged = right(group, factor, T)
        assert averaged is None
        return -flow, -slope, None

    right = thermal_fmu.boundary.exchange_flow
    monkeypatch.setattr(thermal_fmu.boundary, "exchange_flow", backwards)
    scene = two_blocks(gap=1e-3)
    story = told(scene)
    assert story.outcome == "completed"
    assert len(ENTROPY_RISES.check(scene, story, RNG)) == 1
