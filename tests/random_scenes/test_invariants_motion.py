"""A superposed turn: of contact alone to 1e-9, and of scenes; green where it is right, red under planted faults."""

from __future__ import annotations

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "contact"))

from contact_scenes import ask, curved, flat, push

import mechanical_fmu.system
from contact.messages import Floats, Register, Tractions
from random_scenes.by_hand_frame import disc, heat, pressed
from random_scenes.declared import value_at
from random_scenes.invariants_motion import TURNING, apart, felt
from random_scenes.story import COMPLETED, Story, told
from random_scenes.turning import continued, followed, rotation

EXACT = 1e-9
SLIP = 2.0e-5  # m, what the slave moved along before
FLAT, CURVED = "flat", "curved"


def rubbed(kind: str, mu: float) -> tuple[Register, Floats, Floats, Tractions]:
    """A pressed pair that has slipped, where it was before, where it is, and its forces with their history."""
    register, x = flat(5, 7, gap=-1.0e-4) if kind == FLAT else curved(24, 31, gap=0.0)
    if kind == CURVED:
        x[:25, 0] += 0.06
    register = replace(register, passes=replace(register.passes, mu=np.array([mu])))
    before = x.copy()
    before[np.unique(register.edges[register.edge_surface == 0])] -= [SLIP, 0.0]
    return register, before, x, push(register, x, x_before=before)


@pytest.mark.parametrize("kind", [FLAT, CURVED])
@pytest.mark.parametrize("degrees", [1.0, 30.0, 90.0])
def test_what_faces_what_turns_along(kind: str, degrees: float) -> None:
    register, _, x, _ = rubbed(kind, 0.0)
    there, here = ask(register, x @ rotation(np.radians(degrees)).T), ask(register, x)
    for name in ("pair", "slave_edge", "master_edge"):
        np.testing.assert_array_equal(getattr(there, name), getattr(here, name))
    for name in ("xi_s", "xi_m", "gap", "area", "area_m", "node_covered"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), rtol=0.0, atol=EXACT)


@pytest.mark.parametrize("kind", [FLAT, CURVED])
@pytest.mark.parametrize("degrees", [1.0, 30.0, 90.0])
def test_friction_in_a_turned_frame_is_the_same(kind: str, degrees: float) -> None:
    """Both places and the one before turned: nothing but another frame."""
    register, before, x, here = rubbed(kind, 0.3)
    R = rotation(np.radians(degrees))
    there = push(register, x @ R.T, x_before=before @ R.T)
    assert np.abs(here.shear).max() > 0.0
    agrees(there, here, R)


def agrees(there: Tractions, here: Tractions, R: Floats) -> None:
    force, pressure = np.abs(here.force).max(), np.abs(here.t_N).max()
    np.testing.assert_allclose(there.force, here.force @ R.T, rtol=0.0, atol=EXACT * force)
    np.testing.assert_allclose(there.t_N, here.t_N, rtol=0.0, atol=EXACT * pressure)
    np.testing.assert_allclose(there.shear, here.shear, rtol=0.0, atol=EXACT * pressure)
    np.testing.assert_allclose(there.E_friction, here.E_friction, rtol=0.0, atol=EXACT * pressure * SLIP)


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("kind", [FLAT, CURVED])
@pytest.mark.parametrize("degrees", [1.0, 30.0, 90.0])
def test_contact_feels_nothing_of_a_turn(kind: str, mu: float, degrees: float) -> None:
    """Both sides turned since the place before: pressures and shear along the surface stay, and nothing rubs."""
    register, _, x, first = rubbed(kind, mu)
    R = rotation(np.radians(degrees))
    here, there = (push(register, at, x_before=x, mobilised=first.mobilised, mobilised_at=first.mobilised_at)
                   for at in (x, x @ R.T))
    agrees(there, here, R)


# Scenes


@cache
def story_of(mu: float, scheme: str = "staggered") -> Story:
    story = told(pressed(mu).edited(coupling__scheme=scheme))
    assert story.outcome == COMPLETED, story.message
    return story


@pytest.mark.slow
def test_a_scene_feels_nothing_of_a_turn() -> None:
    story = story_of(0.0)
    assert TURNING.applies(story.scene)
    assert not felt(story.scene, story, 9)


def test_a_pressure_that_does_not_follow_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    right, first = mechanical_fmu.system.pressure_forces, {}

    def wrong(x: Any, *more: Any) -> Any:
        return right(first.setdefault(len(x), x.copy()), *more)

    monkeypatch.setattr(mechanical_fmu.system, "pressure_forces", wrong)
    story = told(pressed(0.0).edited(coupling__windows=[{"until": 4.0, "size": 2.0}]))
    found = felt(story.scene, story, 9)
    assert found
    assert found[0].size > 1.0e3


ENFORCED: dict[str, dict[str, Any]] = {
    "penalty": {}, "uzawa": {"augmented": {"tolerance": 1.0e-9, "method": "uzawa"}},
    "semi_smooth": {"augmented": {"tolerance": 1.0e-9, "method": "semi_smooth"}}, "nodes": {"form": "nodes"},
    "two passes": {"two_pass": True}}


# A quarter turn in one window is cut where all pressures are found at once, and where single nodes press: it has other
# windows then, and is not compared.
@pytest.mark.slow
@pytest.mark.parametrize(("windows", "enforced"), [(n, e) for n in (1, 9) for e in ENFORCED
                                                   if (n, e) not in ((1, "penalty"), (1, "semi_smooth"), (1, "nodes"))])
def test_a_scene_with_friction_feels_nothing_of_a_turn(windows: int, enforced: str) -> None:
    """Where the half cuts the window of the turn too."""
    story = rubbed_story(enforced)
    assert np.abs(story.extra["mechanical.contact.t_T"][-1]).max() > 0.05 * np.abs(story.t_N[-1]).max()
    still, turned = (told(scene) for scene in continued(story.scene, story, windows)[:2])
    assert still.outcome == turned.outcome == COMPLETED
    np.testing.assert_array_equal(still.t, turned.t)
    assert max(size for _, size in apart(story.scene, still, turned, windows)) <= 1.0


@cache
def rubbed_story(enforced: str) -> Story:
    """The scene with friction, enforced so; multipliers settle to less than is looked at."""
    story = told(pressed(0.3).edited(**{f"contact__flat__{key}": value for key, value in ENFORCED[enforced].items()}))
    assert story.outcome == COMPLETED, story.message
    return story


@pytest.mark.slow
@pytest.mark.parametrize("windows", [1, 9])
def test_a_scene_whose_heat_sees_the_middle_feels_nothing_of_a_turn(windows: int) -> None:
    """On the chord: 1.7 and 0.019 K of 114 K (0.17 K in three windows)."""
    story = story_of(0.0, "iterated")
    assert not felt(story.scene, story, windows)


def test_what_has_a_direction_is_left_out() -> None:
    assert not TURNING.applies(disc())
    assert not TURNING.applies(heat())
    assert not TURNING.applies(pressed().edited(mechanical__elastic__boundary__0__u_x=None))


def test_a_vector_is_followed_round() -> None:
    signals = ({"t": [0.0, 1.0, 1.0, 2.0], "value": [0.0, 1.0, 3.0, 3.0]}, 2.0)
    x, y = followed(signals, 2.0, [(3.0, np.pi / 2)])
    assert [value_at(x, t) for t in (0.5, 1.0, 2.0, 3.0)] == pytest.approx([0.5, 3.0, 3.0, -2.0])
    assert [value_at(y, t) for t in (0.5, 1.0, 2.0, 3.0)] == pytest.approx([2.0, 2.0, 2.0, 3.0])
    assert value_at(x, 1.0, -1) == 1.0
    x, y = followed((0.0, 0.0), 2.0, [(3.0, np.pi / 2)], np.array([1.0, 0.0]))
    assert (value_at(x, 3.0), value_at(y, 3.0)) == pytest.approx((-1.0, 1.0))
