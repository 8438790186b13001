"""E1: the isothermal split of a thermoelastic bar is stable up to 2/(1 + delta), the adiabatic one at every window."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from coupler.scenario.options import Scheme

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "coupler"))
from bar_halves import DELTA, SHIFT
from boundary import bisected
from cases import bar
from coupled_run import couple

E1 = tomllib.loads((Path(__file__).resolve().parents[1] / "expected.toml").read_text(encoding="utf-8"))["E1"]
UNIT = 1e-3  # so small that T, about 1000, stays above 0


def amplification(scheme: Scheme, dt: float, k: float, sees: str = "held") -> np.ndarray:
    """What one window does to (U, V, Theta, heat carried) of a wave number, column by column, through the coupler."""
    columns, heat = [], "E_S" if scheme is Scheme.ADIABATIC else "E_M"
    for z in UNIT * np.eye(4):
        halves, state = bar(0.0, (k,), sees)
        halves[1].state = z[:3, None]
        halves[0].state = z[2:3]
        state.now.T[:], state.now.x[0, 1] = SHIFT + z[2], z[0]
        state.accounts[heat].carry[:] = z[3]
        end, _ = couple(halves, state, (dt, 1), scheme)
        columns.append([*halves[1].state[:2, 0], end.now.T[0] - SHIFT, end.accounts[heat].carry[0]])
    return np.array(columns).T / UNIT


def radius(dt: float, k: float, sees: str = "held", scheme: Scheme = Scheme.MECHANICAL_FIRST) -> float:
    return float(np.abs(np.linalg.eigvals(amplification(scheme, dt, k, sees))).max())


@pytest.mark.parametrize("k", [0.3, 1.0, 5.0, 20.0])
def test_the_isothermal_split_is_stable_up_to_its_limit_at_every_wave_number(k):
    limit = bisected(lambda dt: radius(dt, k) > 1.0 + 1e-9, 0.5, 5.0, 1e-4)
    assert limit == pytest.approx(E1["limit"], rel=1e-3)
    assert E1["limit"] == pytest.approx(2.0 / (1.0 + DELTA), abs=5e-5)


def test_growth_a_step_beyond_it():
    assert radius(E1["beyond"], 1.0) - 1.0 == pytest.approx(E1["growth"], abs=5e-4)
    assert radius(E1["beyond"], 1.0, scheme=Scheme.ADIABATIC) < 1.0


@pytest.mark.parametrize("scheme", [Scheme.STAGGERED, Scheme.MECHANICAL_FIRST])
def test_the_same_in_a_run_whoever_goes_first(scheme):
    halves, state = bar(1e-3, (1.0,))
    _, tried = couple(halves, state, (E1["beyond"] * 80, 80), scheme)
    swing = [np.abs(w.solved.state.now.x[0, 1]) for w in tried]
    early, late = max(swing[20:40]), max(swing[60:80])
    assert (late / early) ** (1 / 40) - 1.0 == pytest.approx(E1["growth"], abs=0.01)


@pytest.mark.slow
def test_the_adiabatic_split_decays_for_ever():
    halves, state = bar(1e-3, (1.0,))
    n = E1["steps"]
    _, tried = couple(halves, state, (E1["beyond"] * n, n), Scheme.ADIABATIC)
    swing = np.array([np.abs(w.solved.state.now.x[0, 1]) for w in tried])
    assert swing.max() <= 1e-3
    assert swing[200:].max() < 1e-15


@pytest.mark.parametrize("dt", [0.01, 0.05, 0.5, 1.0, 5.0])
def test_temperature_interpolated_over_the_step_is_unstable_at_every_window(dt):
    """Some wave number grows: the shorter the window, the shorter the wave."""
    waves = (1.0, 5.0, 50.0, 200.0)
    assert max(radius(dt, k, sees="interpolated", scheme=Scheme.STAGGERED) for k in waves) > 1.0 + 1e-6
    held = max(radius(dt, k, scheme=Scheme.STAGGERED) for k in waves)
    assert held < 1.0 if dt < E1["limit"] else held > 1.0
