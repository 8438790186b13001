"""A load driven so that a monitor holds a target, on what a superplastic bulge does (row B14)."""

from __future__ import annotations

import math
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from coupler.rules.drive import begun, driven
from coupler.scenario.rule_model import Drive, Rule

sys.path.insert(0, str(Path(__file__).parent))
from fake_halves import T_IN, X_OUT, FakeHalf, blocks_of
from ruled_run import heating, ruled, scalar

ROOT = Path(__file__).resolve().parents[2]
B14 = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))["B14"]
K, TARGET, A, S0 = B14["K"], B14["rate"], 0.05, 2e-3  # Pa s^m, 1/s, half-width and thickness of the sheet [m]
PRESS = 1e4  # Pa, the pressure of load.press = 1
PLANE = 2.0 / math.sqrt(3.0)  # plane strain: rate_e = PLANE rate_11, s_11 = PLANE s_e


def radius(strain: float) -> float:
    """Of an arc over 2 a that is exp(strain) times as long: arc/chord = angle/sin(angle)."""
    angle = brentq(lambda q: math.log(q / math.sin(q)) - strain, 1e-5, 0.9 * math.pi)
    return A / math.sin(angle)


def bulge(m: float, strain0: float = 1e-5) -> FakeHalf:
    """p R / s = PLANE K rate_e^m, s = s0 exp(-strain_11), a step in pieces; tells the increment of strain_e."""

    def rule(state, inputs, t, h):
        strain = float(state[0])
        for _ in range(10):
            stretch = strain / PLANE
            stress = PRESS * float(inputs["load.press"]) * radius(stretch) / (S0 * math.exp(-stretch))
            strain += (stress / PLANE / K) ** (1.0 / m) * h / 10
        return np.array([strain]), {"x": np.zeros((1, 2)), "max_strain_increment": np.array(strain - float(state[0]))}

    return FakeHalf("bulge", blocks_of(T_IN, X_OUT, scalar("load.press", "input"),
                                       scalar("max_strain_increment", "output")), rule, np.array([strain0]))


def rates(m: float, drive: Drive, time: tuple[float, int]) -> list[tuple[float, float, float]]:
    """(t, measured strain rate, load in the window) of every window."""
    tried = ruled([Rule("hold the strain rate", drive=drive)], (heating(lambda t: 0.0), half := bulge(m)), time)
    assert half.state[0] < 0.4
    loads = [1.0] + [w.after.control.settings.inputs["mechanical"]["load.press"] for w in tried]
    return [(w.t + w.H, w.solved.monitors["mechanical.max_strain_increment"] / w.H, load)
            for w, load in zip(tried, loads, strict=False)]


def hold(gain: float = math.nan, rate: float = math.inf, most: float = math.inf) -> Drive:
    return Drive("mechanical", "load.press", "mechanical.max_strain_rate", TARGET, 1.0, 1e-3, most, log=True,
                 gain=gain, rate=rate)


def test_b14_measured_strain_rate_is_held() -> None:
    """The load is ninety times too small at first; p is compared at the row's strains, which the run reaches later."""
    told = rates(B14["m"], hold(), (310.0, 310))
    caught_up = next(t for t, rate, _ in told if abs(rate / TARGET - 1.0) < B14["rate_held_within"])
    assert caught_up < 12.0
    assert max(abs(rate / TARGET - 1.0) for t, rate, _ in told if t > 20.0) < B14["rate_held_within"]
    assert max(abs(rate / TARGET - 1.0) for t, rate, _ in told if t > 50.0) < 1e-3
    strain, p = np.cumsum([rate for _, rate, _ in told]), [PRESS * load for *_, load in told]
    assert np.interp([TARGET * t for t in B14["t"]], strain, p) == pytest.approx(B14["p"], rel=B14["tolerance"])
    assert max(p) == pytest.approx(B14["peak_p"], rel=B14["tolerance"])


@pytest.mark.few("0.2", "1.0")
@pytest.mark.parametrize("m", [0.2, 0.3, 0.7, 1.0])
def test_a_measured_gain_serves_any_exponent(m: float) -> None:
    told = rates(m, hold(), (300.0, 300))
    assert max(abs(rate / TARGET - 1.0) for t, rate, _ in told if t > 60.0) < 0.05


@pytest.mark.parametrize("gain", [0.2, 0.35, 0.6])
def test_a_given_gain_need_not_be_exact(gain: float) -> None:
    """Stable below 4/3 of the exponent, .667 here."""
    told = rates(0.5, hold(gain), (200.0, 200))
    assert max(abs(rate / TARGET - 1.0) for t, rate, _ in told if t > 60.0) < 0.05


def plain(law: Callable[[float, int], float], drive: Drive, windows: int = 60) -> list[tuple[float, float]]:
    """(measured, load) of windows of 1 s in which law(load, number) is measured."""
    known, told = begun(drive), []
    for n in range(windows):
        measured = law(known.value, n)
        told.append((measured, known.value))
        known = driven(drive, known, measured, 1.0)
    return told


def test_a_drift_leaves_no_lag() -> None:
    """The load must grow by 2 % in every window; a gain on the difference alone would stay 2 %/gain behind."""
    told = plain(lambda load, n: TARGET * (load * 0.98**n) ** 2, hold(0.3))
    assert told[-1][0] == pytest.approx(TARGET, rel=1e-6)
    assert told[-1][1] == pytest.approx(0.98**-59, rel=1e-6)


def test_a_monitor_that_is_slow_to_answer() -> None:
    """T' = (600 load - T)/50 s: without a lag the load swings for ever, with one of 5 s T is at 900 K in 40 s."""
    def last(lag: float) -> list[float]:
        T, known, told = 600.0, begun(drive := replace(hold(most=5.0), monitor="T", target=900.0, lag=lag)), []
        for _ in range(80):
            T += (600.0 * known.value - T) * (1.0 - math.exp(-1.0 / 50.0))
            told.append(T)
            known = driven(drive, known, T, 1.0)
        return told[40:]
    assert last(5.0) == pytest.approx([900.0] * 40, abs=1.0)
    assert np.ptp(last(0.0)) > 50.0


def test_the_load_keeps_its_bounds_and_catches_up_again() -> None:
    """Bounded while ten times too little comes of it; free again, it is at the target within a few windows."""
    told = plain(lambda load, n: TARGET * load * (0.1 if n < 20 else 1.0), hold(1.0, most=3.0), 40)
    assert max(load for _, load in told) == 3.0
    assert told[19][1] == 3.0
    assert [m / TARGET for m, _ in told[26:]] == pytest.approx([1.0] * 14, abs=0.05)


def test_the_load_changes_no_faster_than_allowed() -> None:
    told = plain(lambda load, n: TARGET * load * 0.1, hold(1.0, rate=0.05))
    steps = np.diff(np.log([load for _, load in told]))
    assert np.abs(steps).max() <= 0.05 * (1 + 1e-12)
    assert told[-1][0] == pytest.approx(TARGET, rel=1e-3)


def test_nothing_moves_yet() -> None:
    """Below a threshold the monitor is 0, which has no logarithm: the load goes up, at most twice a window."""
    told = plain(lambda load, n: TARGET * (load - 5.0) if load > 5.0 else 0.0, hold())
    assert [load for _, load in told[:4]] == pytest.approx([1.0, 2.0, 4.0, 8.0])
    assert told[-1][0] == pytest.approx(TARGET, rel=0.01)


def test_a_linear_drive_may_pass_zero() -> None:
    """bc.heat so that a change of temperature holds a negative target."""
    drive = Drive("thermal", "bc.heat", "thermal.max_dT", -2.0, 0.0, -100.0, 100.0, log=False, gain=4.0)
    told = plain(lambda load, n: load / 5.0 + 1.0, drive)
    assert told[-1] == (pytest.approx(-2.0), pytest.approx(-15.0))


def test_a_linear_drive_may_turn_a_monitor_down() -> None:
    """A ram that presses from above: its force grows where the load falls, so its gain is below 0."""
    drive = Drive("mechanical", "bc.ram", "mechanical.force", 1e5, 0.0, -1.0, 0.0, log=False, gain=-2.0e-9)
    told = plain(lambda load, n: max(-5e8 * (load + 1e-5), 0.0), drive)
    assert told[-1] == (pytest.approx(1e5), pytest.approx(-2.1e-4))


def test_a_monitor_that_is_not_known_leaves_the_load_alone() -> None:
    tried = ruled([Rule("hold", drive=hold())], (heating(), FakeHalf("mute", blocks_of(T_IN, X_OUT, scalar(
        "load.press", "input")), lambda s, i, t, h: (s, {"x": np.zeros((1, 2))}), np.zeros(1))), (3.0, 3))
    assert tried[-1].after.control.settings.inputs == {"mechanical": {"load.press": 1.0}}
    assert not any(w.fired for w in tried)
