"""What windows make of a disturbance: the measured number against the limits known in closed form, by every scheme."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler.control import gain
from coupler.control.gain import Gain
from coupler.control.solve_window import SavedStates, SolveOptions, solve_once
from coupler.scenario.options import Iteration, Scheme, Seen
from coupler.schemes.schedule import clock_with_marks
from coupler.schemes.scheme import OfLevels
from coupler.schemes.state import CoupledState, Halves, Settings, Span, wanted_outputs
from coupler.trust.checks import Check
from coupler.trust.in_time.errors import Looked
from coupler.trust.in_time.stability import StabilityLog, check, watched

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "stability"))

from cases import chatter, e3c_limit
from coupled_run import start
from fake_halves import G_M, K_G, T_W, C, G, gap_of, lumped, shrinking

REST = 831.712463
h = K_G / (gap_of(REST) + G_M)
B = h / (gap_of(REST) + G_M) * (REST - T_W) * 3 * 2.5e-5 * 0.03 / C  # 1/s: what the gap adds to
A = (G + h) / C  # 1/s: what the body loses by itself
ONE = {"thermal": 1, "mechanical": 1}


def measured(scheme: Scheme, H: float, method: str, level: Seen = Seen.MIDDLE) -> Gain:
    """Of the fifth window of E4, begun 0.01 K off its rest."""
    halves = wanted_outputs(lumped(REST + 0.01, method), shrinking(REST + 0.01))
    return last_gain(halves, start(REST + 0.01, gap_of(REST + 0.01)), scheme, H, level)


def last_gain(halves: Halves, state: CoupledState, scheme: Scheme, H: float, level: Seen = Seen.MIDDLE) -> Gain:
    """Of the fifth of five windows."""
    clock = clock_with_marks(100 * H, ())
    options = SolveOptions(scheme, Settings(scheme, ONE, Iteration(level=level)))
    bounds = [clock.ticks(k * H) for k in range(7)]
    for k in range(5):
        span = Span(clock, bounds[k], bounds[k + 1], ONE)
        with SavedStates(halves, k * H, k) as saved:
            solved = solve_once(halves, state, span, options, saved)
            if k == 4:
                found = gain.measured(halves, state, span, options, saved, solved)
        state = solved.state
    assert found is not None
    return found


@pytest.mark.parametrize("method", ["backward_euler", "midpoint"])
@pytest.mark.parametrize("H", [5.0, 8.0, 12.0])
def test_both_numbers_are_those_of_the_lumped_gap(method, H):
    theta = 0.5 if method == "midpoint" else 1.0
    found = measured(Scheme.STAGGERED, H, method)
    assert found.rho == pytest.approx(B * H / 2 / (1 + theta * A * H), rel=0.02)
    assert pytest.approx((1 - (1 - theta) * A * H) / (1 + theta * A * H), abs=0.01) == found.R


# The limits of docs/theory.md: method -> the longest stable window [s].
LIMITS = {
    (Scheme.STAGGERED, "backward_euler"): 2 / (B - A), (Scheme.STAGGERED, "midpoint"): 2 / B,
    (Scheme.EXTRAPOLATED, "midpoint"): 1 / B, (Scheme.PARALLEL, "backward_euler"): 1 / (B - A),
    (Scheme.MECHANICAL_FIRST, "backward_euler"): 2 / (B - 2 * A) if B > 2 * A else np.inf,
}


@pytest.mark.parametrize(("scheme", "method"), LIMITS)
def test_a_disturbance_dies_below_the_limit_and_not_above(scheme, method):
    limit = LIMITS[scheme, method]
    if np.isinf(limit):
        assert abs(measured(scheme, 100.0, method).m) < 1.0
        return
    below, above = measured(scheme, 0.95 * limit, method), measured(scheme, 1.05 * limit, method)
    assert -1.0 < below.m < -0.8
    assert above.m < -1.0
    assert below.limit == pytest.approx(limit, rel=0.1)
    assert above.limit == pytest.approx(limit, rel=0.1)


def test_the_stagger_of_e4_has_the_limits_of_the_case_list():
    assert LIMITS[Scheme.STAGGERED, "backward_euler"] == pytest.approx(10.2449, rel=1e-3)
    assert LIMITS[Scheme.STAGGERED, "midpoint"] == pytest.approx(7.4062, rel=1e-3)


@pytest.mark.parametrize("H", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("level", list(Seen))
def test_iterated_windows_are_stable_however_long(H, level):
    found = measured(Scheme.ITERATED, H, "backward_euler", level)
    assert abs(found.m) < 1.0
    if level is Seen.END:
        assert found.m > -0.1


def test_what_drives_itself_on_is_no_fault_of_the_exchange():
    """A body that is warmed the more the warmer it is grows by itself: one root above 1, none that turns round."""
    driven = Gain(1.0, -0.5, 0.9, OfLevels((1.0,)))
    assert driven.m == pytest.approx(1.9)
    assert driven.limit == np.inf


# A rod with forty cells: the answer of the exchange is one direction of many.

@pytest.mark.parametrize(("method", "near"), [("backward_euler", 0.02), ("midpoint", 0.15)])
def test_the_rod_that_chatters_has_its_limit(method, near):
    """E3c: 0.11625 (backward Euler), 0.08936 (midpoint, whose many stiff modes two moments do not hold as well)."""
    limit = e3c_limit(method)
    for share, stable in ((0.85, True), (1.15, False)):
        halves, state = chatter(1e-4, method)
        found = last_gain(wanted_outputs(*halves), state, Scheme.STAGGERED, share * limit)
        assert (found.m > -1.0) is stable, found.m
        assert found.limit == pytest.approx(limit, rel=near)


# The check of the trust table

def judged(*multipliers: float) -> Check:
    log = StabilityLog()
    for k, m in enumerate(multipliers):
        log = watched(log, Looked(np.empty(0), np.empty(0), m=m, limit=0.4), 2.0 * (k + 1), 2.0)
    return check(log, 1)


def test_two_windows_in_which_a_disturbance_grows_condemn_a_run():
    found = judged(0.3, -1.5, -1.2)
    assert found.verdict == "broken"
    assert found.number == 1.2
    assert "unstable exchange" in found.sentence
    assert "windows up to about 0.4 s are stable" in found.sentence
    assert judged(-1.5, 0.3).verdict == "holds", "one alone may be a touch"
    assert judged(-0.7, -0.8).verdict == "noted"
    assert judged(2.0, 3.0).verdict == "holds", "what drives itself on is physics"
    assert check(StabilityLog(), 0).verdict == "not checked"
