"""Iterates that no window makes agree, as of bodies with friction that have two equilibria and take them by turns."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest

from coupler.control.loop import step, windows
from coupler.control.state import first
from coupler.errors import CouplingError
from coupler.scenario.options import Iteration, OnMax
from coupler.schemes.state import Halves, Verdict, wanted_outputs

sys.path.insert(0, str(Path(__file__).parent))
from adaptive_run import EXACT_E8, plan_to
from coupled_run import start
from fake_halves import gap_of, lumped, shrinking


def flipping(size: float) -> Halves:
    """Case E8 with a gap that is `size` [m] wider or narrower by turns, each time it is asked for."""
    half, turns = shrinking(840.0), cycle((size, -size))
    rule = half.rule

    def flips(state, inputs, t, h):
        x, out = rule(state, inputs, t, h)
        return x, out | {"x": out["x"] + np.array([[0.0, next(turns)]])}

    half.rule = flips
    return wanted_outputs(lumped(840.0), half)


def test_a_window_whose_iterates_differ_by_less_than_its_tolerance_is_taken_and_told() -> None:
    tried = list(windows(flipping(1e-8), start(840.0, gap_of(840.0)), plan_to()))
    end = tried[-1].solved.state.now
    assert end.t == pytest.approx(20.0)
    assert float(end.T[0]) == pytest.approx(EXACT_E8, abs=0.05)
    forced = [w for w in tried if w.accepted and w.solved.verdict is Verdict.MAX_ITERATIONS]
    assert forced
    assert all(w.solved.anyway and w.error is not None and w.error.error <= 1.0 for w in forced)
    assert len(tried) <= 60


def test_who_wants_none_of_it_says_so() -> None:
    """Also after a window that was taken so, as in a run that is resumed."""
    halves, plan = flipping(1e-8), plan_to(iteration=Iteration(on_max=OnMax.STOP))
    before = first(start(840.0, gap_of(840.0)), plan)
    with pytest.raises(CouplingError, match="says to stop"):
        step(halves, replace(before, control=replace(before.control, unconverged=True)), plan)
