"""One system of both fields: quiet on what is right, loud where the halves are told something else of each other."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import coupler.schemes.accounts as accounts
import coupler.schemes.iterate as iterate
import coupler.schemes.levels as levels
import coupler.schemes.sweep as sweep
import thermal_fmu.methods as methods
from random_scenes import invariants_monolithic as one_system_laws
from random_scenes.scene import Scene
from random_scenes.small import across_a_film, pressed
from random_scenes.story import told


def found(check, scene: Scene, seed: int = 0) -> list[str]:
    story = told(scene)
    assert story.outcome == "completed", story.message
    return [f.what for f in check(scene, story, np.random.default_rng(seed))]


def at_the_end(scene: Scene) -> Scene:
    return scene.edited(thermal__method="sdirk2", coupling__substeps={"thermal": 2, "mechanical": 3},
                        coupling__iteration={"level": "end"})


@pytest.fixture
def solved(monkeypatch) -> list[float]:
    """Collects how far [K] each window that Newton's method solved is from the coupler's."""
    apart: list[float] = []
    right = one_system_laws.Both.solve

    def solve(self, window, guess, tolerance):
        end = right(self, window, guess, tolerance)
        apart.append(float(np.abs(end.T - guess.T).max()))
        return end

    monkeypatch.setattr(one_system_laws.Both, "solve", solve)
    return apart


@pytest.mark.few("scene2")
@pytest.mark.parametrize("scene", [pressed(), at_the_end(pressed()), across_a_film(), at_the_end(across_a_film())])
def test_iterated_windows_solve_the_one_system(scene, solved):
    assert one_system_laws.ONE_SYSTEM.applies(scene)
    assert found(one_system_laws.check_one_system, scene) == []
    assert len(solved) >= one_system_laws.WINDOWS, "each window was solved from its start"
    assert max(solved) > 0.1, "and its start is not its end"


def turning() -> Scene:
    """A hot block that turns above a film by a quarter of a radian, in two windows."""
    turn = {"about": [0.02, 0.0501], "angle": {"t": [0, 20], "value": [0, 0.25]}}
    return across_a_film().edited(coupling__windows=[{"until": 20, "size": 10}],
                                  mechanical={"half": "rigid", "rigid": {"motion": {"b": {"rotation": turn}}}})


def rubbing() -> Scene:
    """A block that is pressed harder and harder as it slides."""
    boundary = [{"on": "a.bottom", "u_x": 0, "u_y": 0},
                {"on": "b.top", "u_x": {"t": [0, 4, 20], "value": [0, 0, 4e-3]},
                 "u_y": {"t": [0, 4, 20], "value": [0, -1.2e-4, -2e-4]}}]
    return pressed().edited(mechanical__elastic__boundary=boundary)


def straight(monkeypatch):
    monkeypatch.setattr(levels, "carried_along", lambda x, earlier, later, w, bodies: x + w * (later - earlier))


def all_at_once(monkeypatch):
    right = accounts.EnergyAccount.make
    monkeypatch.setattr(accounts.EnergyAccount, "make",
                        lambda self, energy, H, step, fresh: right(self, energy, H, step, True))


@pytest.mark.few("along the chord")
@pytest.mark.parametrize(("scene", "fault"), [(turning(), straight), (rubbing(), all_at_once)],
                         ids=["along the chord", "heat of later times"])
def test_what_windows_hand_over_is_that_of_the_documents(scene, fault, monkeypatch):
    """Bodies that turn go along arcs; friction heat that belongs to later times is kept back."""
    assert found(one_system_laws.check_one_system, scene) == []
    fault(monkeypatch)
    assert any("does not solve the system" in text for text in found(one_system_laws.check_one_system, scene))


def test_geometry_of_another_time_is_found(monkeypatch):
    right = sweep.geometry_at
    monkeypatch.setattr(sweep, "geometry_at", lambda now, slope, t, bodies: right(now, slope, t + 0.5, bodies))
    assert any("does not solve the system" in text for text in found(one_system_laws.check_one_system, across_a_film()))


@pytest.mark.slow
def test_iterating_that_ends_too_early_is_found(monkeypatch):
    right = iterate.misfits
    monkeypatch.setattr(iterate, "misfits", lambda *how: {n: 1e-3 * v for n, v in right(*how).items()})
    assert found(one_system_laws.check_one_system, across_a_film())


@pytest.mark.slow
def test_damped_methods_come_to_rest():
    for seed, scene in enumerate((across_a_film(), at_the_end(across_a_film()))):
        assert one_system_laws.STEADY.applies(scene)
        assert found(one_system_laws.check_steady, scene, seed) == []
    assert not one_system_laws.STEADY.applies(pressed()), "nothing holds its upper body"


@pytest.mark.slow
def test_methods_that_damp_no_more_are_found(monkeypatch):
    for name in ("backward_euler", "sdirk2"):
        nearly_midpoint = (methods.Stage(0.55, 1.0, 0.55),)
        monkeypatch.setitem(methods.METHODS, name, replace(methods.METHODS[name], stages=nearly_midpoint,
                                                           weights=(1.0,)))
    assert found(one_system_laws.check_steady, across_a_film())


def test_from_the_window_on_that_came_to_be_iterated_by_ends_that_is_the_system():
    """Else a right run is told wrong by 1e5 tolerances."""
    run = told(across_a_film())
    said = "window 3 (to t = 62.5 s): ringing: a disturbance decays slowly; windows are iterated from here on"
    assert one_system_laws.seen_at_end_from(run) == np.inf
    assert one_system_laws.seen_at_end_from(replace(run, words=(said,))) == np.inf
    by_ends = replace(run, words=("a note", f"{said}, given x and t_N of their end"))
    assert one_system_laws.seen_at_end_from(by_ends) == pytest.approx(62.5, rel=1e-4)
