"""Steady temperatures that mechanics act on: iterated windows see x of their end, and are exact at any size."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from start_scenes import STEEL, edited, loaded, solved

from coupler.scenario.options import Seen

# A bar grows with heat towards a cold wall, to which it loses heat across a layer of gas.
GROWS: dict[str, Any] = {
    "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane", "materials": {"steel": STEEL},
    "bodies": {"bar": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.1, 0.01], "cells": [10, 1]}},
                       "material": "steel", "T0": 300.0},
               "wall": {"mesh": {"rectangle": {"origin": [0.1008, 0], "size": [0.02, 0.01], "cells": [2, 1]}},
                        "material": "steel", "T0": 300.0}},
    "contact": {"face": {"slave": "bar.right", "master": "wall.left", "gap_max": 1e-3, "conduction": {
        "closed": {"law": "constant", "h": 1000}, "open": {"law": "gas", "k_g": 0.03, "g_m": 3e-5}}}},
    "thermal": {"half": "thermal", "method": "steady", "boundary": [
        {"on": "bar.left", "temperature": {"t": [0, 100, 200], "value": [300, 700, 400]}},
        {"on": "wall.right", "temperature": 300}]},
    "mechanical": {"half": "rod", "rod": {"held": {"bar": {"left": 0}, "wall": {"right": 0}}}},
    "coupling": {"scheme": "iterated", "end": 200.0, "windows": [{"until": 200.0, "size": 20.0}]},
    "probes": {"tip": {"T": {"mean": "bar.right"}}}}


def test_the_level_is_the_end_unless_stated(tmp_path: Path) -> None:
    def level(name: str, **values: Any) -> Seen:
        return loaded(tmp_path, edited(GROWS, **values), name).coupling.iteration.level

    assert level("a") is Seen.END
    assert level("b", coupling__iteration={"level": "middle"}) is Seen.MIDDLE
    assert level("c", thermal__method="sdirk2") is Seen.MIDDLE


@pytest.mark.usefixtures("unlooked")
def test_windows_of_any_size_end_in_the_same_temperatures(tmp_path: Path) -> None:
    """With x of the middle of each they lag by half a window: 4.4 K here."""
    long, short = (solved(tmp_path, edited(GROWS, coupling__windows=[{"until": 200.0, "size": size}]), f"w{size}")
                   for size in (20, 2))
    (t, T), (t_fine, T_fine) = long.probe("tip"), short.probe("tip")
    assert np.abs(T - np.interp(t, t_fine, T_fine)).max() < 1e-3
