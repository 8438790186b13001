"""The estimated error of the probes, from the windows that were looked at."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from coupler.record.observe import ProbeReader
from coupler.trust.checks import TrustVerdict, amount
from coupler.trust.in_time import errors
from coupler.trust.in_time.errors import ErrorLog, Looked

K = {"a": "K", "b": "K"}


def log_of(rows: list[tuple[list[float], list[float], list[float]]]) -> ErrorLog:
    """rows : values, second differences and errors (or nothing) of each window."""
    log = errors.begun(np.zeros(len(rows[0][0])))
    for k, (values, second, error) in enumerate(rows):
        log = errors.watched(log, Looked(np.array(values), np.array(second), np.array(error), solves=4), k + 1.0)
    return log


def test_windows_not_looked_at_have_the_ratio_of_those_that_were():
    log = log_of([([10.0], [1.0], []), ([20.0], [1.1], [0.11]), ([30.0], [1.3], []), ([40.0], [1.2], [0.12])])
    assert errors.estimated(log) == pytest.approx([0.46])
    assert errors.table(log, {"a": "K"}) == {"a": errors.ProbeError(pytest.approx(0.46), 40.0, "K")}
    assert errors.check(log, {"a": "K"}, False).number == pytest.approx(0.0115)


def test_windows_solved_in_one_have_the_errors_of_windows_in_one():
    """In adaptive windows what is measured is kept in halves, a quarter as wrong as those of which nothing is known."""
    log = errors.begun(np.zeros(1))
    for k in range(4):
        looked = {"error": np.array([0.1]), "in_one": np.array([0.4])} if k == 0 else {}
        log = errors.watched(log, Looked(np.array([10.0 * (k + 1)]), np.array([1.0]), **looked), k + 1.0)
    assert errors.estimated(log) == pytest.approx([0.1 + 3 * 0.4])


def test_the_window_in_which_a_body_touches_tells_nothing_of_those_in_which_it_slides():
    calm = [([0.2 * k], [0.02], []) for k in range(3, 53)]
    log = log_of([([0.2], [0.02], [0.001]), ([0.4], [40.0], [16.0]), *calm])
    assert errors.estimated(log) == pytest.approx([16.001 + 50 * 0.001])


def test_an_error_larger_than_its_bend_is_a_jump_inside_and_is_not_carried_on():
    log = log_of([([1.0], [0.1], [5.0]), ([2.0], [0.1], [])])
    assert errors.estimated(log) == pytest.approx([5.0 + errors.MOST * 0.1])
    twice = log_of([([1.0], [0.1], [0.2]), ([2.0], [0.1], [0.2]), ([3.0], [0.1], [])])
    assert errors.estimated(twice) == pytest.approx([0.6]), "what is seen twice is no jump"


def test_what_solvers_leave_of_a_probe_that_stays_is_no_error_of_windows():
    """A shrink fit in which nothing changes: a pressure of 42 MPa that moves by 0.4 Pa."""
    log = errors.begun(np.array([42.3e6]))
    for k in range(8):
        seen = Looked(np.array([42.3e6 + 0.2 * (-1) ** k]), np.array([0.4]), np.array([0.4]))
        log = errors.watched(log, seen, k + 1.0)
    found = errors.check(log, {"p": "Pa"}, False)
    assert found.verdict is not TrustVerdict.BROKEN
    moves = errors.watched(log, Looked(np.array([42.3e6 + 1e4]), np.array([1e4]), np.array([6e3])), 9.0)
    assert errors.check(moves, {"p": "Pa"}, False).verdict is TrustVerdict.BROKEN


@pytest.mark.parametrize(("unit", "verdict"), [("Pa", "holds"), ("N m", "broken")])
def test_a_pressure_that_stays_is_held_against_what_it_settles_to(unit, verdict):
    """A shaft that turns in its hub: 28.7 MPa, which move by 260 Pa and are off by an estimated 85 Pa."""
    seen = Looked(np.array([28.7368e6 + 260.0]), np.array([260.0]), np.array([85.0]))
    log = errors.watched(errors.begun(np.array([28.7368e6])), seen, 1.0)
    assert errors.check(log, {"p": unit}, False).verdict == verdict


@pytest.mark.parametrize("of", [1.0, 1e-3, 1e-6])
def test_small_differences_of_temperature_are_held_against_their_own_range(of):
    """A probe that goes from 300 K to 350 K and may be off by 25 K, or by 0.025 K of 0.05 K, or by 25 uK of 50 uK."""
    seen = Looked(np.array([300.0 + 50.0 * of]), np.array([50.0 * of]), np.array([25.0 * of]))
    found = errors.check(errors.watched(errors.begun(np.array([300.0])), seen, 1.0), {"T": "K"}, False)
    assert (found.verdict, found.number) == (TrustVerdict.BROKEN, pytest.approx(0.5, rel=1e-5))


def test_a_look_may_find_a_pressure_where_there_was_none():
    """Mechanics first: nothing presses in a window of which halves press with 600 MPa."""
    log = errors.watched(errors.begun(np.zeros(2)), Looked(np.zeros(2), np.zeros(2), np.array([6e8, 0.0])), 1.0)
    assert log.worst == np.inf
    assert log.t == 1.0
    assert errors.watched(errors.begun(np.zeros(1)), Looked(np.zeros(1), np.zeros(1), np.zeros(1)), 1.0).worst == 0.0


def at_switches(looked: int, count: int) -> ErrorLog:
    """A window that bends by 1, then `count` at a switch of contact that bend by 2, then 20 that bend by 1 again.

    looked : how many of `count` are looked at: an error of 0.3 each; of the first 0.01.
    """
    log = errors.begun(np.zeros(1))
    for k in range(count + 21):
        error = np.array([0.01]) if not k else np.array([0.3]) if k <= looked else np.empty(0)
        switch = 0 < k <= count
        seen = Looked(np.array([10.0 * (k + 1)]), np.array([2.0 if switch else 1.0]), error, switch=switch)
        log = errors.watched(log, seen, k + 1.0)
    return log


def test_a_look_at_a_switch_of_contact_is_taken_for_no_other_window():
    assert errors.estimated(at_switches(1, 1)) == pytest.approx([0.3 + 21 * 0.01])


def test_a_switch_that_was_not_looked_at_may_be_half_a_window_off():
    assert errors.estimated(at_switches(0, 3)) == pytest.approx([3 * errors.AT_SWITCH + 24 * 0.01])


def test_switches_are_as_wrong_as_those_that_were_looked_at():
    log = at_switches(1, 3)
    assert errors.estimated(log) == pytest.approx([0.3 + 2 * 0.15 + 23 * 0.01])


def test_what_bends_all_the_time_does_not_bend_for_a_switch():
    """A probe that bends by 1 in all of 20 windows, 5 of them at a switch of contact; a smooth one is looked at."""
    log = errors.begun(np.zeros(1))
    for k in range(20):
        seen = Looked(np.array([10.0 * (k + 1)]), np.array([1.0]), np.array([0.01] if k == 1 else []),
                      switch=10 <= k < 15)
        log = errors.watched(log, seen, k + 1.0)
    assert errors.estimated(log) == pytest.approx([20 * 0.01])


def test_where_every_look_met_a_switch_the_others_are_not_taken_for_right():
    log = errors.begun(np.zeros(1))
    for k in range(20):
        seen = Looked(np.array([10.0 * (k + 1)]), np.array([1.0]), np.array([0.02] if not k else []), switch=not k)
        log = errors.watched(log, seen, k + 1.0)
    assert errors.estimated(log) == pytest.approx([20 * 0.02])


def jumping(fresh: bool = False) -> np.ndarray:
    """The error of a probe that bends by 0.1 a window and once, in the middle of 21 windows, by 5.

    Its velocity is that of a way of 10 a window; the first is looked at: 0.001.  fresh : the jump is one of the data.
    """
    log = errors.begun(np.zeros(1))
    for k in range(21):
        seen = Looked(np.array([10.0 * (k + 1)]), np.array([5.0 if k == 10 else 0.1]),
                      np.array([0.001]) if not k else np.empty(0))
        log = errors.watched(log, seen, k + 1.0, fresh=fresh and k == 10)
    return errors.estimated(log)


def test_what_jumps_inside_a_window_errs_by_its_instant_and_not_for_long():
    assert jumping() == pytest.approx([11 * 0.001 + 0.5 * 4.9], rel=1e-3)
    assert jumping(fresh=True) == pytest.approx([20 * 0.001 + 5.0 * 0.001], rel=1e-3)


def test_longer_windows_bend_more_and_jump_not():
    """A parabola in windows each of twice the size: it bends four times as much in each."""
    log = errors.begun(np.zeros(1))
    t = 0.0
    for k in range(8):
        H = 2.0**k
        t += H
        log = errors.watched(log, Looked(np.array([t * t]), np.array([2.1 * H * H]),
                                         np.array([0.21]) if not k else np.empty(0)), t)
        assert log.jumps == 0.0


def test_a_probe_that_goes_straight_errs_with_its_change():
    """Heat that comes a window late moves a ramp by its change in a window, and bends nothing."""
    log = log_of([([1.0], [1e-9], [0.05]), ([2.0], [1e-9], []), ([3.0], [1e-9], [])])
    assert errors.estimated(log) == pytest.approx([0.15])


def settling(kink: int = -1) -> ErrorLog:
    """A probe that comes to rest, each step 0.9 of the one before, looked at in all of 60 windows: 0.01 each."""
    log, value = errors.begun(np.zeros(1)), 0.0
    for k in range(60):
        value += 0.9**k
        seen = Looked(np.array([value]), np.array([0.1]), np.array([0.01]))
        log = errors.watched(log, seen, k + 1.0, fresh=k == kink)
    return log


def test_errors_die_out_as_the_probes_come_to_rest():
    assert errors.estimated(settling()) == pytest.approx([0.01 * (1.0 - 0.9**60) / 0.1])


def test_past_a_kink_nothing_is_forgotten():
    """That a load stays from now on slows the probe, and says nothing of what dies out."""
    before = 0.01 * (1.0 - 0.9**30) / 0.1
    assert errors.estimated(settling(30)) == pytest.approx([before + 0.01])


def test_a_probe_that_turns_round_forgets_little():
    """Its velocity is 0 there, and what it did wrong is not."""
    log = errors.begun(np.zeros(1))
    for k, value in enumerate((1.0, 2.0, 2.0)):
        log = errors.watched(log, Looked(np.array([value]), np.array([0.5]), np.array([0.1])), k + 1.0)
    assert errors.estimated(log) == pytest.approx([0.2 * np.exp(-1.0 / errors.PATIENCE) + 0.1])


def test_a_probe_that_hardly_moves_is_held_against_the_others():
    log = log_of([([100.0, 0.1], [0.0, 0.0], [1.0, 0.02])])
    assert errors.scales(log, list(K.values())) == pytest.approx([100.0, 1.0])
    check = errors.check(log, K, False)
    assert check.number == pytest.approx(0.02)
    assert check.verdict == "holds"


@pytest.mark.parametrize(("value", "unit", "text"), [
    (1283.0, "Pa", "1.28 kPa"), (2.5e8, "Pa", "250 MPa"), (12.0, "Pa", "12 Pa"), (-4.1e6, "W/m2", "-4.1 MW/m2"),
    (2.4e-5, "m", "0.024 mm"), (76.2, "m", "76.2 m"), (73.7, "K", "73.7 K"),
])
def test_amounts_are_told_with_the_prefix_of_their_size(value, unit, text):
    assert amount(value, unit) == text


@pytest.mark.parametrize(("error", "verdict"), [(4.0, "holds"), (20.0, "noted"), (40.0, "broken")])
def test_verdicts(error, verdict):
    check = errors.check(log_of([([100.0], [50.0], [error])]), {"a": "K"}, False)
    assert check.verdict == verdict
    if verdict != "holds":
        assert f"probe a may be off by {error:.3g} % of its range ({error:.3g} K)" in check.sentence
        assert check.t == 1.0


def test_where_nothing_was_looked_at_nothing_is_said():
    log = log_of([([1.0], [1.0], [])])
    assert errors.check(log, {"a": "K"}, False).verdict == "not checked"
    assert errors.table(log, {"a": "K"}) == {}


class Told(ProbeReader):
    """Probes of a scene with one pair that looks 6 mm far, whose values are given."""

    def __init__(self, quantities: list[str], values: list[float]) -> None:
        self._probes: Any = {f"{k}": SimpleNamespace(quantity=q, of_a_step="") for k, q in enumerate(quantities)}
        self._interface: Any = SimpleNamespace(pairs=[SimpleNamespace(gap_max=0.006)])
        self._values = np.array(values)

    def values(self, level: Any, look: Any = None) -> Any:
        return self._values


def test_a_gap_of_a_node_that_faces_nothing_tells_of_no_error():
    """Its gap is told as gap_max, whole, and may be anything in the same window solved as two."""
    none: Any = None
    np.testing.assert_array_equal(Told(["gap", "gap", "u_x"], [0.006, 0.0012, 0.006]).measurable(none),
                                  [np.nan, 0.0012, 0.006])
