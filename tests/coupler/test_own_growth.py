"""Steady states that bodies would leave by themselves: a row of the trust table."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coupler import Results, run
from coupler.scenario.load import scenario_from
from coupler.trust.checks import TrustVerdict
from coupler.trust.in_time.steady import NAME

L, K, UNIT = 0.1, 10.0, 1e-5  # the gap in units of 10 um; Bi = 1/(eps + gap)


def rod(tmp_path: Path, ends: tuple[float, float], gap: float, growth: float, eps: float,
        start: float = 0.0) -> Results:
    """A rod from 0 to L before a wall; temperatures of its left end and the wall over 100 K above 300 K.

    growth : by how much the gap closes where the mean of the rod rises by 1.  start : of its tip, linear from 0.
    """
    out = tmp_path / "run.h5"
    left, wall = (300.0 + 100.0 * T for T in ends)
    doc = {
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"m": {"rho": 6000, "c": 500, "k": K, "alpha": growth * UNIT / (L * 100.0), "E": 1e9,
                            "T_ref": 300},
                      "w": {"rho": 6000, "c": 500, "k": 1000, "alpha": 0, "E": 1e13, "T_ref": 300}},
        "bodies": {
            "rod": {"mesh": {"rectangle": {"origin": [0, 0], "size": [L, 0.01], "cells": [10, 1]}},
                    "material": "m", "T0": {"terms": [{"t": 300}, {"x": {"polynomial": [0, 100.0 * start / L]}}]}},
            "wall": {"mesh": {"rectangle": {"origin": [L + gap * UNIT, 0], "size": [0.01, 0.01], "cells": [1, 1]}},
                     "material": "w", "T0": wall}},
        "contact": {"face": {"slave": "rod.right", "master": "wall.left", "gap_max": 0.002, "conduction": {
            "closed": {"law": "constant", "h": K / L / eps},
            "open": {"law": "gas", "k_g": K / L * UNIT, "g_m": eps * UNIT}}}},
        "thermal": {"method": "steady", "boundary": [{"on": "rod.left", "temperature": left},
                                                     {"body": "wall", "temperature": wall}]},
        "mechanical": {"half": "rod", "rod": {"held": {"rod": {"left": 0}, "wall": {"right": 0}}}},
        "coupling": {"end": 1, "windows": [{"until": 1, "size": 1}]},
        "probes": {"tip": {"T": "rod.right.centre"}}}
    run(scenario_from(json.dumps(doc), tmp_path / "rod.yaml", {}), out)
    return Results(out)


def told(results: Results) -> tuple[float, float, TrustVerdict]:
    """The tip's temperature as above, and the row."""
    row = next(check for check in results.trust if check.name == NAME)
    return (float(results.probe("tip")[1][-1]) - 300.0) / 100.0, row.number, row.verdict


def test_a_rod_between_two_states_that_last_would_leave(tmp_path):
    """T_L = 1/(1 + eps + g) before a wall at 1, and g = 4 - 6 T_L: a disturbance comes out 6 T_L^2 times as large.

    The rod conducts as long as it is, up to 0.3 % longer than drawn; the closed form takes L.
    """
    results = rod(tmp_path, (0.0, 1.0), 4.0, 12.0, 0.1, start=0.54)
    tip, growth, verdict = told(results)
    assert tip == pytest.approx(0.5431730, abs=2e-4)
    assert growth == pytest.approx(6.0 * tip**2, rel=5e-3)
    assert verdict is TrustVerdict.BROKEN


def test_a_gap_that_opens_by_heat_lasts_however_strongly_it_answers(tmp_path):
    """A hot rod before a cold wall: T_L = (eps + g)/(1 + eps + g), g = 10.5 - 20 T_L, which turns against it."""
    tip, growth, verdict = told(rod(tmp_path, (1.0, 0.0), 30.5, 40.0, 0.05))
    assert tip == pytest.approx(0.48113569, abs=2e-4)
    assert growth == pytest.approx(-20.0 * (1.0 - tip) ** 2, rel=5e-3)
    assert verdict is TrustVerdict.HOLDS


@pytest.mark.slow
def test_a_rod_that_grows_less_stays(tmp_path):
    tip, growth, verdict = told(rod(tmp_path, (0.0, 1.0), 4.0, 6.0, 0.1))
    assert tip == pytest.approx(1.0 / (1.1 + 4.0 - 3.0 * tip), abs=2e-4)
    assert growth == pytest.approx(3.0 * tip**2, rel=5e-3)
    assert verdict is TrustVerdict.HOLDS
