"""A pair that opens and closes without end, because its conductance jumps at touch, is told of, with the reason."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from coupler import Results, Run, load_scenario
from coupler.running.flutter import SHARE, TURNS, FlutterNotes

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
    "coupling": {"end": 600}}
GAS = {"law": "gas", "k_g": 0.03, "g_m": 3.0e-5}  # 1000 W/m2K at no gap


def scene(folder: Path, **conduction: Any) -> Path:
    path = folder / "scene.yaml"
    pair = NEVER_RESTS["contact"]["face"]
    doc = NEVER_RESTS | {"contact": {"face": pair | {"conduction": pair["conduction"] | conduction}}}
    YAML(typ="safe").dump(doc, path)
    return path


@pytest.mark.slow
def test_a_pair_that_flutters_at_a_law_that_jumps_is_told_once(tmp_path: Path) -> None:
    """After 45 ms and 1600 tries beyond the touch, of 600 s.

    On the way the search for an event leaves a window of one tick of the clock; the run once failed at it.
    """
    told: list[str] = []
    with Run(load_scenario(scene(tmp_path)), tmp_path / "run.h5") as r:
        for progress in itertools.islice(r.windows(), 2500):
            told += [note for note in progress.notes if "opened and closed" in note]
            if told:
                break
    assert len(told) == 1
    assert told[0].startswith("pair face opened")
    assert "from 0 to 5000 W/m2K" in told[0]
    assert told[0] in Results(tmp_path / "run.h5").notes


def test_with_laws_that_join_it_comes_to_rest(tmp_path: Path) -> None:
    joined = {"law": "power", "h0": 1000, "h1": 5000, "p0": 1.0e6, "exponent": 0.95}
    with Run(load_scenario(scene(tmp_path, closed=joined, open=GAS)), tmp_path / "run.h5") as r:
        told = [note for progress in r.windows() for note in progress.notes]
        assert r.state.now.t == 600.0
    assert not [note for note in told if "opened and closed" in note]


@pytest.mark.fast
def test_only_pairs_whose_law_jumps_and_that_turn_soon_are_told_of() -> None:
    names = ("pair torn", "pair joined", "contact")

    def told(pause: float) -> list[str]:
        notes = FlutterNotes({"torn": (0.0, 5000.0)}, 100.0)
        return [note for k in range(3 * TURNS) for note in notes.after(names, (k * pause, k * pause, k * pause))]

    assert len(told(0.9 * SHARE * 100.0 / TURNS)) == 1
    assert not told(1.2 * SHARE * 100.0 / (TURNS - 1))


@pytest.mark.fast
def test_a_pair_that_stays_is_not_counted() -> None:
    notes = FlutterNotes({"torn": (0.0, 5000.0)}, 100.0)
    assert not [note for _ in range(3 * TURNS) for note in notes.after(("pair torn",), (1.0,))]
