"""Errors that are shifts of time stay: on small fields, and in rods that oscillate for ever."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler import Results, run
from coupler.scenario.load import scenario_from
from coupler.scenario.timing import varies
from coupler.schemes.levels import Level
from coupler.trust.in_time import errors, time_shift
from coupler.trust.in_time.errors import NAME, Looked
from coupler.trust.in_time.time_shift import LEVELS, Shift, ShiftLog, Turning

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fresh_scenes import Doc, two_rods


def at(t: float, *T: float) -> Level:
    none = np.empty(0)
    return Level(t, np.array(T), np.empty((0, 2)), none, none, none)


def wave(t: float) -> Level:
    return at(t, math.sin(t), math.cos(t), 0.5 * math.sin(t + 1.0))


# One window

def test_a_solution_that_is_late_is_told_by_how_much():
    H, late = 0.01, 0.003
    error = wave(1.0 + H + late).T - wave(1.0 + H).T
    assert time_shift.shift(wave(1.0), wave(1.0 + H), error) == pytest.approx(late, rel=0.01)
    assert time_shift.shift(wave(1.0), wave(1.0 + H), -error) == pytest.approx(-late, rel=0.01)


def test_an_error_across_the_velocity_is_no_shift():
    assert time_shift.shift(at(0.0, 0.0, 0.0), at(1.0, 1.0, 0.0), np.array([0.1, 0.2])) == 0.0
    assert time_shift.shift(at(0.0, 0.0, 0.0), at(1.0, 1.0, 0.0), np.array([0.2, 0.1])) == pytest.approx(0.2)
    assert time_shift.shift(at(0.0, 1.0, 1.0), at(1.0, 1.0, 1.0), np.array([0.2, 0.1])) == 0.0, "nothing moves"


def test_how_much_the_velocity_turns_in_a_window():
    seen = time_shift.turning([wave(t) for t in (1.2, 1.1, 1.0, 0.9)])
    assert seen.turn == pytest.approx(0.1, rel=0.2)
    assert not seen.jumps
    assert time_shift.turning([at(1.0, 2.0), at(0.0, 1.0)]) == Turning(time_shift.TURN)
    assert time_shift.turning([at(2.0, 3.0), at(1.0, 3.0), at(0.0, 1.0)]) is None
    assert time_shift.turning([at(2.0, 300.00003), at(1.0, 300.0), at(0.0, 300.0)]) is None, "what solvers leave"


def test_a_front_that_passes_a_node_jumps():
    T = [0.0, 1.0, 2.01, 3.03, 4.55]
    assert time_shift.turning([at(float(k), T[k]) for k in (4, 3, 2, 1)]).jumps
    assert not time_shift.turning([at(float(k), T[k]) for k in (3, 2, 1, 0)]).jumps


@pytest.mark.parametrize(("f_s", "jumps"), [((1.0, 0.0), False), ((1.0, 0.3), True)])
def test_a_front_of_freezing_passes_nodes_all_the_time(f_s, jumps):
    levels = [replace(at(t, t, 2.0 * t), f_s=np.array(f_s)) for t in (3.0, 2.0, 1.0, 0.0)]
    assert time_shift.turning(levels).jumps is jumps
    assert time_shift.turning(levels[:2]).jumps is jumps


# All windows

def swinging(shifts: dict[int, float], windows: int = 400, H: float = 0.1, turn: float = 0.1, order: int = 1,
             apart: tuple[int, ...] = ()) -> ShiftLog:
    """A probe sin t.  shifts : of the windows looked at [s].  apart : windows in which contact switches."""
    log = time_shift.begun(np.zeros(1), 0.0)
    for k in range(windows):
        t = (k + 1) * H
        found = Shift(shifts[k], shifts[k], order) if k in shifts else None
        log = time_shift.watched(log, t, np.array([math.sin(t)]), Turning(turn), found, k in apart)
    return log


def test_a_shift_stays_and_errs_by_how_far_the_probe_goes_in_it():
    looked = dict.fromkeys(range(200), 0.0) | {10: 0.05}
    assert time_shift.estimated(swinging(looked, 200)) == pytest.approx([0.05], rel=0.02)
    assert time_shift.estimated(swinging(looked | {100: -0.05, 10: 0.0}, 200)) == pytest.approx([0.05], rel=0.02)
    back = time_shift.estimated(swinging(looked | {11: -0.05}, 200))
    assert back == pytest.approx([0.05 * math.cos(1.1)], rel=0.1), "for one window"


def test_shifts_to_and_fro_add_up_to_nothing():
    looked = {k: 0.01 * (-1.0) ** k for k in range(200)}
    assert time_shift.estimated(swinging(looked, 200)) == pytest.approx([0.01], rel=0.02)


def test_windows_between_looks_shift_as_those_that_were_looked_at():
    """0.001 s a window: 0.377 s where the probe is fastest last, at 12 pi."""
    assert time_shift.estimated(swinging({200: 0.001})) == pytest.approx([2.0 * math.sin(0.377 / 2.0)], rel=0.01)


def test_a_probe_is_off_by_its_swing_at_most():
    assert time_shift.estimated(swinging({200: 0.03})) == pytest.approx([2.0], rel=0.01)


def test_what_switches_or_jumps_shifts_nothing():
    assert time_shift.estimated(swinging({200: 0.03}, apart=tuple(range(400)))) == [0.0]


@pytest.mark.parametrize(("order", "less"), [(1, 1.0), (2, 0.1)])
def test_of_second_order_windows_that_turn_less_shift_less_for_it(order, less):
    """One window turns by 0.2 and shifts by 0.002, 100 others by 0.02."""
    log = time_shift.begun(np.zeros(1), 0.0)
    for k in range(101):
        found = Shift(0.002, 0.002, order) if not k else None
        log = time_shift.watched(log, k + 1.0, np.array([k + 1.0]), Turning(0.02 if k else 0.2), found, switch=False)
    assert time_shift.estimated(log) == pytest.approx([0.002 + less * 100 * 0.0002])


@pytest.mark.parametrize("windows", [LEVELS - 1, LEVELS + 3, 5 * LEVELS])
def test_long_runs_keep_few_levels_and_their_last(windows):
    log = swinging({}, windows)
    assert len(log.t) <= LEVELS + 2
    assert log.t[-1] == pytest.approx(0.1 * windows)
    steps = np.diff(log.t)[:-1]
    assert steps == pytest.approx(np.full(len(steps), 0.1 * log.every))


def test_what_shifts_is_told_where_the_rest_died_out():
    """A probe that swings; the look at the start found a shift, the rest of it is forgotten in four windows."""
    log = errors.begun(np.zeros(1))
    for k in range(100):
        t = 0.1 * (k + 1)
        looked = {"error": np.array([1e-6]), "shift": Shift(0.2 if k == 3 else 0.0, 0.0, 1)}
        log = errors.watched(log, Looked(np.array([math.sin(t)]), np.array([0.01]), turning=Turning(0.1), **looked), t)
    assert errors.estimated(log) == pytest.approx([0.2], rel=0.02)


def test_what_looks_tell_of_one_scheme_is_of_its_own_windows():
    """A probe that goes straight; the first 50 windows by a scheme that shifts by 0.01, 50 by one that does not."""
    log = time_shift.begun(np.zeros(1), 0.0)
    for k in range(100):
        scheme, found = ("one", 0.01) if k < 50 else ("other", 0.0)
        looked = Shift(found, found, 1) if k in (49, 99) else None
        seen = Turning(0.1, scheme=scheme)
        log = time_shift.watched(log, k + 1.0, np.array([k + 1.0]), seen, looked, switch=False)
    assert time_shift.estimated(log) == pytest.approx([0.5])


def test_data_that_change_with_time_are_seen():
    moving = {"boundary": [{"on": "a.b", "flux": {"t": [0, 1], "value": [0, 1]}}]}
    assert varies(moving)
    assert not varies({"boundary": [{"flux": {"t": [0, 1], "value": [2, 2]}}, {"flux": 3.0}], "k": {"T": [1, 2]}})


# A run

def ran(doc: Doc, out: Path) -> Results:
    return run(scenario_from(json.dumps(doc), Path("scene.yaml"), {}), out / "run.h5")


@pytest.mark.few("staggered-0.1-15.0-0.225-broken")
@pytest.mark.parametrize(("scheme", "size", "end", "off", "verdict"), [
    ("staggered", 0.25, 60.0, 0.538, "broken"), ("extrapolated", 0.25, 60.0, 0.304, "noted"),
    ("staggered", 0.1, 15.0, 0.225, "broken")])
def test_rods_that_oscillate_are_told_as_wrong_as_they_are(tmp_path, scheme, size, end, off, verdict):
    """Against windows of 0.005 s.  0.10, 0.08 and 0.11 of the range of T2 were told."""
    results = ran(two_rods(size, end, scheme), tmp_path)
    told = results.probe_errors["T2"]
    assert off / 3.0 < told.error / told.range < 3.0 * off
    assert next(c.verdict for c in results.trust if c.name == NAME) == verdict
