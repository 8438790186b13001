"""The scheme adiabatic: what each half is given, where it is stable, and halves that cannot."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler.errors import HalfError
from coupler.fmu.half import Block
from coupler.scenario.options import Scheme
from coupler.schemes.accounts import EnergyAccount
from coupler.schemes.levels import Level
from coupler.schemes.schemes import with_mode
from coupler.schemes.state import CoupledState

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "stability"))
from bar_halves import DELTA, SHIFT, conducting_bar, moving_bar
from coupled_run import couple
from fake_halves import gap_of, lumped, shrinking

STABLE = 2.0 / (1.0 + DELTA)


def bar(k: float, dtau: float, n: int, scheme: Scheme, **more) -> list[float]:
    """E1: size of a mode, set moving by 1e-3, after each of n windows: sqrt((k U)^2 + Theta^2/delta)."""
    wave, U, none = np.array([k]), np.array([1e-3]), np.zeros(1)
    now = Level(0.0, none + SHIFT, np.column_stack([none, U]), np.zeros(0), np.zeros(0), np.zeros(0))
    state = CoupledState(now, (), 0, {n: EnergyAccount(np.zeros(1)) for n in ("E_M", "E_S")})
    _, tried = couple((conducting_bar(wave, none), moving_bar(wave, U, none)), state, (n * dtau, n), scheme, **more)
    ends = [w.solved.state.now for w in tried]
    return [float(np.hypot(k * level.x[0, 1], (level.T[0] - SHIFT) / np.sqrt(DELTA))) for level in ends]


@pytest.mark.few("4.0")
@pytest.mark.parametrize("k", [1.0, 4.0])
def test_the_isothermal_split_grows_where_the_adiabatic_decays(k):
    n = 300
    for dtau, grows in ((0.98 * STABLE, False), (1.02 * STABLE, True)):
        sizes = bar(k, dtau, n, Scheme.STAGGERED)
        assert (max(sizes[-20:]) > max(sizes[:20])) is grows
    for dtau in (STABLE, 5.0, 50.0):
        sizes = bar(k, dtau, n, Scheme.ADIABATIC)
        assert max(sizes[-20:]) < max(sizes[:20])


def test_what_the_halves_are_given():
    """Mechanics: T of the start and mode 1; thermal: all of E_S in its first substep; nothing is carried."""
    wave, U = np.array([2.0]), np.array([1e-3])
    thermal, mechanical = conducting_bar(wave, np.zeros(1)), moving_bar(wave, U, np.zeros(1))
    seen: dict[str, list[float]] = {"T": [], "mode": [], "E_S": []}
    rules = thermal.rule, mechanical.rule
    thermal.rule = lambda s, i, t, h: (seen["E_S"].append(float(i["E_S"][0])), rules[0](s, i, t, h))[1]
    mechanical.rule = lambda s, i, t, h: (seen["T"].append(float(i["T"][0])),
                                          seen["mode"].append(float(i["control.mode"])), rules[1](s, i, t, h))[2]
    now = Level(0.0, np.array([SHIFT]), np.array([[0.0, 1e-3]]), np.zeros(0), np.zeros(0), np.zeros(0))
    state = CoupledState(now, (), 0, {n: EnergyAccount(np.zeros(1)) for n in ("E_M", "E_S")})
    end, tried = couple((thermal, mechanical), state, (0.4, 2), Scheme.ADIABATIC, substeps=(2, 1))
    assert seen["T"] == pytest.approx([SHIFT, float(tried[0].solved.state.now.T[0])], rel=1e-14)
    assert seen["mode"] == [1.0, 1.0]
    assert seen["E_S"][1::2] == [0.0, 0.0]
    assert np.abs(seen["E_S"][::2]).min() > 1e-6
    account = end.accounts["E_S"]
    assert (account.carry.tolist(), account.delivered) == ([0.0], pytest.approx(account.made))
    assert end.accounts["E_M"].made == 0.0


def test_the_mode_goes_back_with_another_scheme():
    mechanical = moving_bar(np.ones(1), np.zeros(1), np.zeros(1))
    given = {"thermal": {"a": 1.0}, "mechanical": {"control.mode": 1.0, "load.p": 2.0}}
    assert with_mode({}, mechanical, False) == {"mechanical": {"control.mode": 0.0}}
    assert with_mode(given, mechanical, False) == given
    assert with_mode({}, mechanical, True) == {"mechanical": {"control.mode": 1.0}}
    assert with_mode(given, shrinking(900.0), True) is given


def test_halves_that_cannot_are_named():
    state = CoupledState(Level(0.0, np.array([840.0]), np.array([[0.0, gap_of(840.0)]]), np.zeros(0),
                               np.zeros(0), np.zeros(0)), (), 0, {"E_M": EnergyAccount(np.zeros(1))})
    with pytest.raises(HalfError, match=r"'shrinking': cannot step at frozen entropy.*mechanical\.elastic\.adiabatic"):
        couple((lumped(840.0), shrinking(840.0)), state, (1.0, 1), Scheme.ADIABATIC)
    able = shrinking(840.0)
    able.blocks = {**able.blocks, "control.mode": Block("control.mode", (), "", "input", "Integer"),
                   "E_S": Block("E_S", (1,), "J", "output", "Real")}
    with pytest.raises(HalfError, match="'lumped': takes no E_S"):
        couple((lumped(840.0), able), state, (1.0, 1), Scheme.ADIABATIC)
    with pytest.raises(HalfError, match="'moving bar': has 2 substeps a window"):
        bar(1.0, 1.0, 1, Scheme.ADIABATIC, substeps=(1, 2))
