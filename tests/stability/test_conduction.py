"""E5: two bars, one given the temperature of the joint and one the heat flow; what plain iteration does, and a cure."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler.scenario.options import Acceleration, OnMax, Scheme, Seen

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from boundary import bisected, contraction
from cases import CASES, DAMPED, e5_limit, joined, skin
from conduction_halves import ALUMINIUM, STEEL, ratio, together
from coupled_run import couple

E5 = tomllib.loads((Path(__file__).resolve().parents[1] / "expected.toml").read_text(encoding="utf-8"))["E5"]
WAYS = [(True, "aluminium"), (False, "steel")]


@pytest.mark.parametrize(("aluminium_first", "name"), WAYS, ids=lambda v: v if isinstance(v, str) else "")
@pytest.mark.parametrize("i", range(3))
def test_contraction_of_plain_iteration(aluminium_first, name, i):
    case = replace(CASES["E5"], make=lambda d: joined(d, aluminium_first))
    assert contraction(case, E5["dt"][i], Seen.END) == pytest.approx(E5[name][i], abs=6e-4)


@pytest.mark.parametrize(("aluminium_first", "name"), WAYS, ids=lambda v: v if isinstance(v, str) else "")
@pytest.mark.parametrize("dt", E5["dt"])
def test_the_best_relaxation_is_there_at_once(aluminium_first, name, dt):
    bars = (ALUMINIUM, STEEL) if aluminium_first else (STEEL, ALUMINIUM)
    how = DAMPED.changed(acceleration=Acceleration.CONSTANT, relaxation=1.0 / (1.0 + ratio(*bars, dt)))
    halves, state = joined(0.3, aluminium_first)
    _, tried = couple(halves, state, (dt, 1), Scheme.ITERATED, how=how)
    # The last iterate only sees that the one before was right.
    assert len(tried[0].solved.history.misfits) - 1 <= E5["iterations"]


def test_the_step_from_which_on_plain_iteration_fails():
    found = bisected(lambda dt: contraction(CASES["E5"], dt, Seen.END) > 1.0, 1e-3, 1e-1)
    assert found == pytest.approx(e5_limit(), rel=0.02)


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_it_fails_there_in_a_run_too(share):
    how = DAMPED.changed(acceleration=Acceleration.NONE, max_iterations=40, on_max=OnMax.ACCEPT)
    halves, state = joined(0.3)
    _, tried = couple(halves, state, (share * e5_limit(), 1), Scheme.ITERATED, how=how)
    left = [m["temperature"] for m in tried[0].solved.history.misfits]
    assert (left[-1] < left[1]) == (share < 1.0)


def test_accelerated_both_bars_come_to_what_one_system_gives():
    """One window of 1 s: both systems added at the joint."""
    dt = 1.0
    halves, state = joined(0.3)
    final, _ = couple(halves, state, (dt, 1), Scheme.ITERATED, how=DAMPED)
    warm = np.concatenate([skin(0.3), skin(0.3)[-2::-1]])
    M, K = together(ALUMINIUM, STEEL)
    exact = np.linalg.solve(M / dt + K, M @ warm / dt)[ALUMINIUM.n - 1]
    assert final.now.T[0] - 1000.0 == pytest.approx(exact, abs=1e-6)
