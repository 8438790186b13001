"""A coarse part of the atlas: what auto and accelerated iteration hold, and what a cycle is."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from cases import CASES, bar
from verdict import ADIABATIC, AUTO, FIXED, Outcome, dies_at, judged, trial

WAYS = {way.name: way for way in FIXED}
GOOD = (Outcome.RIGHT, Outcome.ITERATES)
COARSE = [("E3c", 0.3), ("E3c", 10.0), ("E4", 0.3), ("E4", 3.0), ("E4", 100.0), ("E5", 0.3), ("E5", 30.0),
          ("D9", 1.0), ("D13", 3.0)]


@pytest.mark.few("small-E3c-10.0", "large-E4-100.0", "small-D13-3.0")
@pytest.mark.parametrize(("name", "factor"), COARSE)
@pytest.mark.parametrize("disturbance", ["small", "large"])
def test_auto_is_right_where_a_fixed_scheme_is(name, factor, disturbance):
    assert trial(CASES[name], WAYS["iterated, iqn-ils"], factor, disturbance).outcome in GOOD
    assert trial(CASES[name], AUTO, factor, disturbance).outcome in GOOD


def test_beyond_its_limit_the_stagger_cycles_and_smaller_windows_end_it():
    cell = trial(CASES["E4"], WAYS["staggered"], 3.0, "large")
    assert cell.outcome is Outcome.CYCLES
    assert dies_at(CASES["E4"], WAYS["staggered"], 3.0, "large") == pytest.approx(0.75)


def test_plain_iteration_fails_where_it_does_not_contract():
    assert trial(CASES["E4"], WAYS["iterated, none"], 3.0, "large").outcome is Outcome.FAILED


def test_the_adiabatic_split_is_right_where_the_isothermal_one_is_not():
    assert trial(CASES["E1"], ADIABATIC, 3.0, "small").outcome is Outcome.RIGHT
    assert trial(CASES["E1"], WAYS["staggered"], 3.0, "small").outcome is Outcome.CYCLES


def test_auto_freezes_the_entropy_of_a_body_that_feeds_back_more_by_squeezing():
    """E1 with delta .6, in windows of 3 limits: every scheme that solves each half once at given T grows."""
    case = replace(CASES["E1"], unit=2.0 / 1.6, make=lambda d: bar(d, delta=0.6))
    assert trial(case, AUTO, 3.0, "large").outcome is Outcome.RIGHT


def test_verdicts_of_paths():
    """One number that should come from 1 to 0."""
    n, there = np.arange(40.0), np.zeros(1)
    for path, most, outcome in (
            (0.5**n, 3, Outcome.RIGHT), (0.5**n, 16, Outcome.ITERATES), ((-1.0) ** n, 3, Outcome.CYCLES),
            ((-1.2) ** n, 3, Outcome.CYCLES), (1.0 - 0.01 * n, 3, Outcome.WRONG), (0.0 * n + 0.5, 3, Outcome.WRONG),
            (n * np.nan, 3, Outcome.FAILED)):
        assert judged(path[:, None], there, 1.0, most)[0] is outcome
