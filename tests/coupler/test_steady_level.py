"""Steady temperatures that mechanics act on: iterated windows see x of their end, and are exact at any size."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from start_scenes import STEEL, edited, loaded, solved

from coupler.scenario.options import Scheme, Seen

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


def test_what_steady_temperatures_need_is_set_unless_stated(tmp_path: Path) -> None:
    """x of the end, more iterates than where a shorter window helps, and no scheme that holds x."""
    def told(name: str, **values: Any) -> tuple[Seen, int, Scheme]:
        coupling = loaded(tmp_path, edited(GROWS, **values), name).coupling
        return coupling.iteration.level, coupling.iteration.max_iterations, coupling.scheme

    assert told("a", coupling__scheme="auto") == (Seen.END, 100, Scheme.ITERATED)
    assert told("b", coupling__iteration={"level": "middle", "max_iterations": 7}) == (Seen.MIDDLE, 7, Scheme.ITERATED)
    assert told("c", coupling__scheme="extrapolated") == (Seen.END, 100, Scheme.EXTRAPOLATED)
    assert told("d", thermal__method="sdirk2", coupling__scheme="auto") == (Seen.MIDDLE, 30, Scheme.AUTO)


def test_windows_of_any_size_end_in_the_same_temperatures(tmp_path: Path) -> None:
    """With x of the middle of each they lag by half a window: 4.4 K here."""
    long, short = (solved(tmp_path, edited(GROWS, coupling__windows=[{"until": 200.0, "size": size}]), f"w{size}")
                   for size in (20, 4))
    (t, T), (t_fine, T_fine) = long.probe("tip"), short.probe("tip")
    assert np.abs(T - np.interp(t, t_fine, T_fine)).max() < 1e-3


# It comes to touch a wall to which it conducts the better the harder it is pressed, from no pressure on.
TOUCHES = edited(GROWS, bodies__wall__mesh__rectangle__origin=[0.1003, 0], contact__face__conduction={
    "closed": {"law": "power", "h0": 100, "h1": 3000, "p0": 1.0e6, "exponent": 0.9},
    "open": {"law": "gas", "k_g": 0.03, "g_m": 3.0e-4}}, probes__p={"p": {"mean": "bar.right"}})


@pytest.mark.slow
def test_a_touch_that_multiplies_by_thousands_is_passed_and_told_as_right(tmp_path: Path) -> None:
    """By default it stood still at the touch, in windows of 1e-7 s, and where it did not was told 12 % off."""
    found = solved(tmp_path, {**TOUCHES, "coupling": {"end": 200.0}}, "found")
    assert len(found.windows.t) < 150
    assert found.windows.iterations.max() > 5
    even = solved(tmp_path, {**TOUCHES, "coupling": {"end": 200.0, "windows": [{"until": 200.0, "size": 5.0}]}}, "even")
    for name in ("tip", "p"):
        (t, v), (t_even, v_even) = found.probe(name), even.probe(name)
        both = np.intersect1d(t, t_even)
        assert both.tolist() == [0.0, 100.0, 200.0]
        assert np.abs(v[np.isin(t, both)] - v_even[np.isin(t_even, both)]).max() < 1e-3 * np.ptp(v)
        for results in (found, even):
            told = results.probe_errors[name]
            assert told.error < 0.01 * told.range
