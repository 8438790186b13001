"""A pair that opens and closes without end, because its conductance jumps at touch: its law is joined, and told."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

from coupler import Results, Run, load_scenario, run
from coupler.control.flutter import JOIN, SHARE, TURNS, Memory, Torn, after, stuck, turned_by
from coupler.running.resume import resume
from coupler.scenario.options import Scheme
from coupler.schemes.state import Settings

# A rod of steel, hot where it is held: its free end meets a cold wall, is cooled there, shrinks, opens, grows again.
NEVER_RESTS: dict[str, Any] = {
    "slideline": 2, "units": {"temperature": "degC"}, "geometry": "plane",
    "materials": {"steel": {"rho": 7800, "c": 480, "k": 60, "E": 2.1e11, "nu": 0.3, "alpha": 1.2e-5, "T_ref": 20},
                  "cold": {"rho": 2700, "c": 900, "k": 210, "E": 7.0e10, "nu": 0.33, "alpha": 0, "T_ref": 20}},
    "bodies": {"rod": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.1, 0.02], "cells": [8, 1]}},
                       "material": "steel", "T0": 20},
               "wall": {"mesh": {"rectangle": {"origin": [0.10006, 0], "size": [0.01, 0.02], "cells": [2, 1]}},
                        "material": "cold", "T0": 20}},
    "contact": {"face": {"slave": "rod.right", "master": "wall.left", "gap_max": 1.0e-3,
                         "conduction": {"closed": {"law": "constant", "h": 5000}, "open": None}}},
    "thermal": {"half": "rod", "boundary": [{"on": "rod.left", "temperature": {"t": [0, 1], "value": [20, 90]}},
                                            {"on": "wall.right", "temperature": 20}]},
    "mechanical": {"half": "rod", "rod": {"held": {"rod": {"left": 0}, "wall": {"right": 0}}}},
    "coupling": {"end": 600},
    "probes": {"tip": {"T": {"mean": "rod.right"}}}}
GAS = {"law": "gas", "k_g": 0.03, "g_m": 3.0e-5}  # 1000 W/m2K at no gap


def scene(folder: Path, **conduction: Any) -> Path:
    path = folder / "scene.yaml"
    pair = NEVER_RESTS["contact"]["face"]
    doc = NEVER_RESTS | {"contact": {"face": pair | {"conduction": pair["conduction"] | conduction}}}
    YAML(typ="safe").dump(doc, path)
    return path


def tip(results: Results) -> np.ndarray:
    t, T = results.probe("tip")
    return np.interp([300.0, 450.0, 600.0], t, T)


@pytest.fixture(scope="module")
def rested(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Results]:
    folder = tmp_path_factory.mktemp("flutter")
    path = scene(folder)
    return path, run(load_scenario(path), folder / "run.h5")


def test_a_pair_that_flutters_at_a_law_that_jumps_comes_to_rest(rested: tuple[Path, Results], tmp_path: Path) -> None:
    """As with a law that joins in the file: the rod stays at the wall, and conducts what lets it stay."""
    results = rested[1]
    told = [note for note in results.notes if "opens and closes without end" in note]
    assert len(told) == 1
    assert told[0].startswith("pair face opens and closes without end at t = ")
    assert "from 0 to 5000 W/m2K" in told[0]
    assert "fades within a gap of 1e-07 m" in told[0]
    assert len(results.t) < 400
    pressed = {"law": "table", "x": [0, 1.0e5], "h": [0, 5000]}
    other = run(load_scenario(scene(tmp_path, closed=pressed)), tmp_path / "run.h5")
    # A gap of 1e-7 m of 0.1 m that grows by 7e-4 of itself for 60 K is 0.08 K.
    assert tip(results) == pytest.approx(tip(other), abs=0.3)


def test_in_listed_windows_too_it_comes_to_rest(rested: tuple[Path, Results], tmp_path: Path) -> None:
    """Where nobody looks for events: iterates that do not agree as the rod is about to touch say it."""
    listed = {"coupling.scheme": "iterated", "coupling.windows": [{"until": 600, "size": 5}]}
    results = run(load_scenario(scene(tmp_path), listed), tmp_path / "run.h5")
    assert sum("without end" in note for note in results.notes) == 1
    assert tip(results) == pytest.approx(tip(rested[1]), abs=0.05)


@pytest.mark.slow
def test_a_pair_that_cools_twenty_times_as_fast_comes_to_rest(tmp_path: Path) -> None:
    with Run(load_scenario(scene(tmp_path, closed={"law": "constant", "h": 1.0e5})), tmp_path / "run.h5") as r:
        told = [note for progress in itertools.islice(r.windows(), 500) for note in progress.notes]
        assert r.state.now.t == 600.0
    assert sum("without end" in note for note in told) == 1


def test_laws_stay_joined_where_a_run_goes_on(rested: tuple[Path, Results], tmp_path: Path) -> None:
    path, results = rested
    joined = next(note for note in results.notes if "without end" in note)
    with Run(load_scenario(path), tmp_path / "run.h5") as first:
        for progress in first.windows():
            if any("without end" in note for note in progress.notes):
                break
    # From the very window after which they are joined.
    again = resume(tmp_path / "run.h5")
    assert [note for note in again.notes if "without end" in note] == [joined]
    np.testing.assert_array_equal(again.probe("tip")[1], results.probe("tip")[1])


def test_with_laws_that_join_it_comes_to_rest(tmp_path: Path) -> None:
    joined = {"law": "power", "h0": 1000, "h1": 5000, "p0": 1.0e6, "exponent": 0.95}
    with Run(load_scenario(scene(tmp_path, closed=joined, open=GAS)), tmp_path / "run.h5") as r:
        told = [note for progress in r.windows() for note in progress.notes]
        assert r.state.now.t == 600.0
    assert not [note for note in told if "without end" in note]


SETTINGS = Settings(Scheme.ITERATED, {})
TORN = Torn({"torn": (0.0, 5000.0)}, 1e-7, 100.0)
NAMES = ("pair torn", "pair joined", "contact")


def told(turned: list[float], joins: bool = True) -> tuple[Memory, Settings]:
    memory, settings = Memory(), SETTINGS
    for t in turned:
        memory, settings = after(memory, settings, TORN, NAMES, (t, t, t), joins)
    return memory, settings


@pytest.mark.fast
@pytest.mark.parametrize(("pressure", "told"), [({}, True), ({"face": 1.0e5}, False)])
def test_a_run_tells_a_pair_that_touches_and_is_never_pressed(pressure: dict[str, float], told: bool,
                                                              tmp_path: Path) -> None:
    """The wall warms by what crosses the face, and not at all without a pressure."""
    at = {"bodies.wall.mesh.rectangle.origin": [0.1, 0], "mechanical": {"half": "rigid", "rigid": {
        "pressure": pressure}}, "coupling": {"end": 20, "windows": [{"until": 20, "size": 5}]},
        "thermal.boundary": [{"on": "rod.left", "temperature": 90}]}
    results = run(load_scenario(scene(tmp_path), at), tmp_path / "run.h5")
    assert any("lay against each other, but nothing ever pressed" in note for note in results.notes) is told
    assert (results.ledger["stored.wall"] == 0.0) is told


def test_only_pairs_whose_law_jumps_and_that_turn_soon_are_joined() -> None:
    memory, settings = told([0.9 * k * SHARE * 100.0 / TURNS for k in range(3 * TURNS)])
    assert len(memory.notes) == 1
    assert settings.inputs == {"thermal": {JOIN: 1e-7}}
    memory, settings = told([1.2 * k * SHARE * 100.0 / (TURNS - 1) for k in range(3 * TURNS)])
    assert (memory.notes, settings) == ((), SETTINGS)


@pytest.mark.fast
def test_a_pair_that_stays_is_not_counted() -> None:
    memory, settings = told([1.0] * 3 * TURNS)
    assert (memory.notes, settings) == ((), SETTINGS)


@pytest.mark.fast
def test_a_pair_that_touches_and_parts_within_each_window_has_turned() -> None:
    assert turned_by(3.0, (1,), (1.0, 2.0, -1.0)) == (1.0, 3.0, -1.0)
    assert turned_by(3.0, (), (1.0, 2.0, -1.0)) == (1.0, 2.0, -1.0)


@pytest.mark.fast
def test_a_half_that_cannot_join_laws_is_told_of() -> None:
    memory, settings = told([1e-3 * k for k in range(TURNS)], joins=False)
    assert "in place of a constant `closed`, `{law: table, x: [0, P], h: [0, 5000]}`" in memory.notes[0]
    assert settings == SETTINGS


@pytest.mark.fast
def test_iterates_that_do_not_agree_just_after_touch_join_laws() -> None:
    memory, settings = told([50.0])
    assert stuck(memory, settings, TORN, 50.0 + 2.0 * SHARE * 100.0, joins=True)[1] == SETTINGS
    memory, settings = stuck(memory, settings, TORN, 50.0, joins=True)
    assert settings.inputs == {"thermal": {JOIN: 1e-7}}
    assert memory.notes[0].startswith("pair torn opens and closes without end at t = 50 s")
    assert stuck(memory, settings, TORN, 50.0, joins=True) == (memory, settings)
