"""Spare solves in fixed windows: which windows are looked at, what that finds, and that the run does not notice."""

from __future__ import annotations

import json
import sys
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario, run
from coupler.control import spare
from coupler.control.plan import Plan
from coupler.running.resume import resume
from coupler.running.run import Run
from coupler.scenario import Scenario
from coupler.scenario.load import scenario_from
from coupler.scenario.options import Adaptive, Scheme, WindowRange
from coupler.schemes.accounts import EnergyAccount
from coupler.schemes.levels import Level
from coupler.schemes.schedule import schedule
from coupler.schemes.state import CoupledState
from coupler.trust.in_time.course import after, begun
from coupler.trust.in_time.errors import NAME

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fresh_scenes import Doc, column, seizing_rod, two_rods, two_sided_rod

SHIPPED = Path(__file__).resolve().parents[2] / "scenarios"


def scene(doc: Doc) -> Scenario:
    return scenario_from(json.dumps(doc), Path("scene.yaml"), {})


def ran(doc: Doc, out: Path) -> Results:
    return run(scene(doc), out / "run.h5")


def bound(results: Results, probe: str) -> float:
    """The estimated error of a probe over its range."""
    told = results.probe_errors[probe]
    return told.error / told.range


def verdict(results: Results) -> str:
    return next(c.verdict.value for c in results.trust if c.name == NAME)


# What a run says of itself

@pytest.mark.slow
def test_two_rods_in_windows_of_half_a_second_are_not_to_be_trusted(tmp_path):
    """T2 swings between 20.3 and 48.9 K above 300 K; in windows of 0.5 s it is off by up to 64 % of that."""
    long = ran(two_rods(0.5), tmp_path)
    low = long.probe("T2")[1][long.t > 30.0].min() - 300.0
    assert abs(low - 20.33) > 5.0, "it is wrong"
    assert verdict(long) == "broken"
    assert "probe T2 may be off by" in next(c.sentence for c in long.broken if c.name == NAME)


@pytest.mark.few("extrapolated-0.5-0.317")
@pytest.mark.parametrize(("scheme", "size", "off"), [
    ("staggered", 0.5, 0.930), ("staggered", 0.25, 0.514), ("extrapolated", 0.5, 0.317), ("extrapolated", 0.25, 0.123)])
def test_two_rods_stopped_while_they_begin_to_swing_are_told_as_wrong_as_they_are(tmp_path, scheme, size, off):
    """T2 is off by so much of its range, against windows of 0.005 s; 0.03 to 0.17 were told of those of 0.5 s."""
    told = bound(ran(two_rods(size, 15.0, scheme), tmp_path), "T2")
    assert off / 3.0 < told < 3.0 * off


@pytest.mark.slow
def test_two_rods_in_short_windows_are_right_and_told_so(tmp_path):
    short = ran(two_rods(0.05), tmp_path)
    late = short.probe("T2")[1][short.t > 45.0] - 300.0
    assert late.min() == pytest.approx(20.33, abs=0.6)
    assert late.max() == pytest.approx(48.86, abs=0.6)
    assert not short.broken


@pytest.mark.few("staggered-1.0-0.1126", "iterated-5.0-0.119")
@pytest.mark.parametrize(("scheme", "size", "off"), [
    ("staggered", 1.0, 0.1126), ("staggered", 2.0, 0.336), ("staggered", 5.0, 0.567), ("extrapolated", 5.0, 0.567),
    ("iterated", 5.0, 0.119)])
def test_a_run_of_few_windows_is_told_how_wrong_it_is(tmp_path, scheme, size, off):
    """The gap that feeds back: off by so much of its range, against windows of 0.02 s.

    0.26, 0.27, 0.19 and 0.02 were told of windows of 2 and 5 s, and all of these passed.
    """
    s = load_scenario(SHIPPED / "lumped_gap.yaml", overrides={
        "coupling.scheme": scheme, "coupling.windows": [{"until": 20, "size": size}]})
    results = run(s, tmp_path / "run.h5")
    assert off / 3.0 < bound(results, "T") < 3.2 * off
    assert verdict(results) in (("broken",) if off > 0.3 else ("noted", "broken"))


@pytest.mark.few("casting_1d-2.0-0.0-rod.right-0.728")
@pytest.mark.parametrize(("file", "to", "size", "probe", "off"), [
    ("sealed_container_fire", 2400.0, 30.0, "lid.edge.T", 15.0),
    ("sealed_container_fire", 2400.0, 15.0, "lid.edge.T", 5.9),
    ("casting_1d", 2.0, 0.0, "rod.right", 0.728)])
def test_what_switches_inside_a_window_is_told_as_wrong_as_it_is(tmp_path, file, to, size, probe, off):
    """A lid that lifts, and a front that passes nodes: off by so many K, against short windows.

    110, 47 and 5.0 K were told, with what was measured in the window of a switch carried on to others.
    """
    sets = {"coupling.end": to, **({"coupling.windows": [{"until": to, "size": size}]} if size else {})}
    results = run(load_scenario(SHIPPED / f"{file}.yaml", overrides=sets), tmp_path / "run.h5")
    assert off / 3.0 < results.probe_errors[probe].error < 3.0 * off


@pytest.mark.few("0.15")
@pytest.mark.parametrize("size", [0.10, 0.15])
def test_cycles_of_three_and_seven_windows_are_told_by_their_errors(tmp_path, size):
    assert verdict(ran(two_sided_rod(size, 40 * size), tmp_path)) == "broken"


@pytest.mark.slow
def test_the_seizing_rod_and_the_column_are_told_as_good_as_they_are(tmp_path):
    """Friction heat that comes a window late is late once.  T is off by 2.07 % after the first window, against windows
    of a quarter of the size (0.1 % was told, from the third window alone).
    """
    rod = ran(seizing_rod(), tmp_path)
    assert rod.probe("p")[1][-1] == pytest.approx(8.132e6, rel=0.06)
    assert bound(rod, "p") < 0.1
    assert 0.0207 / 3.0 < bound(rod, "T") < 4.0 * 0.0207
    assert bound(ran(column(), tmp_path), "T1") < 0.03


# The run does not notice

@pytest.fixture(scope="module")
def looked_at(tmp_path_factory):
    return ran(two_rods(0.25, 15.0), tmp_path_factory.mktemp("looked_at"))


def test_a_run_that_is_looked_at_is_the_same_to_the_bit(looked_at, tmp_path, monkeypatch):
    doc = two_rods(0.25, 15.0)
    assert looked_at.totals["looks"]["windows"] >= 2
    monkeypatch.setattr(spare, "wanted", lambda *args, **more: False)
    monkeypatch.setattr(spare, "asks_gain", lambda *args: False)
    alone = ran(doc, tmp_path)
    assert alone.totals["looks"]["windows"] == 0
    for name in doc["probes"]:
        assert np.array_equal(alone.probe(name)[1], looked_at.probe(name)[1])
    assert np.array_equal(alone.windows["solves"], looked_at.windows["solves"])
    assert alone.conditions
    for name in alone.conditions:
        assert np.array_equal(alone.condition(name)[1], looked_at.condition(name)[1]), name


def test_a_run_that_was_stopped_looks_at_the_same_windows(looked_at, tmp_path):
    out = tmp_path / "stopped.h5"
    with Run(scene(two_rods(0.25, 15.0)), out) as r:
        for w in r.windows():
            if w.number == 9:
                break
    resumed = resume(out)
    assert resumed.totals["probe_errors"] == looked_at.totals["probe_errors"]
    assert resumed.totals["looks"] == looked_at.totals["looks"]


# When it looks

def looks(bends: np.ndarray, switches: Collection[int] = (), adaptive: Adaptive | None = None) -> list[int]:
    """The windows looked at in a run of one probe.

    bends : its second difference in each window.  switches : windows in which contact closes or opens.
    """
    n = len(bends)
    values = np.concatenate([[0.0], np.cumsum(np.cumsum(bends))])
    plan = Plan(schedule(float(n), [WindowRange(float(n), 1.0, 1.0)], ()), Scheme.STAGGERED,
                {"thermal": 1, "mechanical": 1}, adaptive=adaptive,
                watched=lambda level: np.array([values[round(level.t)]]))
    now = Level(0.0, np.empty(0), np.empty((0, 2)), np.empty(0), np.empty(0), np.empty(0))
    memory, found = spare.first(plan, CoupledState(now, (), 0, {})), []
    for k in range(n):
        memory, seen = spare.after(memory, float(k + 1), values[k + 1: k + 2], 2, k in switches)
        if spare.wanted(memory, seen, k, plan, last=k == n - 1):
            memory = spare.spent(memory, replace(seen, solves=4), k)
            found.append(k)
    return found


@pytest.mark.few("20-2", "400-4", "1000-6")
@pytest.mark.parametrize(("windows", "most"), [(20, 2), (120, 3), (400, 4), (1000, 6), (4000, 14)])
def test_looks_are_few_and_all_over_the_run(windows, most):
    found = looks(np.ones(windows))
    assert 1 <= len(found) <= most
    assert len(found) * spare.LOOK <= max(0.05 * windows, spare.AT_FIRST + spare.LOOK)
    if windows >= 400:
        assert max(np.diff(found)) < 0.75 * windows


def test_what_begins_to_bend_is_looked_at_before_its_turn():
    calm = (-1.0) ** np.arange(200)
    bends = calm.copy()
    bends[40:50] *= 50.0
    assert 40 not in looks(calm)
    assert 40 in looks(bends)


def test_looks_take_a_twentieth_of_the_run_however_it_bends():
    """Every second window bends by all of the range: 23 looks, 92 half-solves of 800, before there was a bound."""
    found = looks(np.array([1.0, *([0.0, -2.0, 0.0, 2.0] * 100)[:399]]))
    assert 5 <= len(found) <= 0.05 * 800 / 4
    assert sum(k > 200 for k in found) >= 2, "some of it is kept for what comes"


def test_what_bends_most_at_a_switch_is_looked_at_whatever_that_costs():
    """The budget of 40 windows is spent on the first two, in which nothing moves; then contact closes, and opens."""
    bends = np.zeros(40)
    bends[[3, 5, 30]] = [1.0, 50.0, -500.0]
    assert looks(bends) == [0, 1, 3, 4]
    assert looks(bends, {3, 5, 30}) == [0, 1, 3, 5, 30]
    bends[31:39] = 500.0 * (-1.0) ** np.arange(8)
    assert looks(bends, range(30, 39)) == [0, 1, 3, 4, 30], "twice as much each time"


def test_the_window_after_one_in_which_something_began_is_looked_at():
    """In that one it began somewhere inside; the next tells how it goes on, once each time."""
    bends = np.zeros(400)
    bends[100:] = 0.1
    bends[100] = 5.0
    assert [k for k in looks(bends) if 90 < k < 110] == [100, 101]
    bends[100:110] = 5.0 * 3.0 ** np.arange(10)
    found = looks(bends)
    assert {100, 101} <= set(found)
    assert len(found) <= 0.05 * 400 / 2.0


def test_smooth_windows_are_looked_at_wherever_contact_switched_before():
    bends = np.ones(1000)
    bends[[10, 11, 12]] = [100.0, -1000.0, 1e4]
    without, found = looks(np.ones(1000)), looks(bends, {10, 11, 12})
    assert {10, 11, 12} <= set(found)
    assert len([k for k in found if k > 12]) >= len([k for k in without if k > 12])


def test_what_grows_until_the_run_ends_is_looked_at_in_its_last_window():
    """Twice as much in every window: what the first looks tell of it is nothing, and the budget is spent."""
    grows = np.concatenate([[1.0, 1.0], np.full(40, 1.3).cumprod()])
    assert looks(grows)[-1] == 41
    falls = 0.8 ** np.arange(42)
    assert 41 not in looks(falls)
    assert 41 not in looks(np.concatenate([[1.0, 1e-7], np.full(39, 1e-7), [2e-7]])), "what adds up to nothing"


def test_what_sets_in_within_an_adaptive_window_is_looked_at():
    """Yield, say: nothing of windows before tells how far off that is.  Others are measured as they find their size."""
    bends = np.concatenate([np.full(10, 0.01), [-1.0], np.zeros(9)])
    own = Adaptive(1.0, 1e-3, 1.0)
    assert looks(bends, adaptive=own) == [10]
    assert looks(np.full(20, 0.01), adaptive=own) == []


def test_what_is_not_resolved_may_be_looked_at_more():
    wave = np.sin(2.0 * np.pi * np.arange(401) / 10.0)
    found = looks(np.diff(wave, 2, prepend=0.0))
    assert 0.05 * 800 < 4 * len(found) <= (0.05 + spare.UNRESOLVED) * 800


def test_one_or_two_windows_are_looked_at_all_the_same():
    assert looks(np.ones(1)) == [0]
    assert looks(np.ones(2)) == [0]


def test_a_window_after_a_switch_of_contact_is_one_at_a_switch():
    """The slope before it is that of before the switch."""
    memory, found = spare.Memory(begun(0.0, np.zeros(1))), []
    for k, switches in enumerate((False, True, False, False)):
        memory, seen = spare.after(memory, k + 1.0, np.ones(1), 2, switches)
        found.append(seen.switch)
    assert found == [False, True, True, False]


# The course of the probes

def test_second_differences_are_those_of_a_parabola_whatever_the_windows():
    course = begun(0.0, np.array([0.0]))
    for t in (1.0, 1.5, 3.5, 4.0):
        course, second = after(course, t, np.array([3.0 * t * t]))
    assert second == pytest.approx([6.0 * 0.5**2])
    assert course.range == pytest.approx([48.0])


def test_a_probe_that_is_no_number_stays_where_it_was():
    course = begun(0.0, np.array([np.nan]))
    course, second = after(course, 1.0, np.array([np.nan]))
    assert course.values == second == 0.0
    course, _ = after(course, 2.0, np.array([5.0]))
    course, _ = after(course, 3.0, np.array([np.nan]))
    assert course.values == 5.0


@pytest.mark.parametrize(("scheme", "friction", "plastic"), [
    (Scheme.STAGGERED, 3.0, 7.0), (Scheme.PARALLEL, 3.0, 7.0), (Scheme.EXTRAPOLATED, 1.0, 7.0)])
def test_a_window_in_one_is_given_the_late_heat_that_its_halves_deliver(scheme, friction, plastic):
    """What is carried and what half of the window makes at the power of before; not of what is handed over ahead."""
    accounts = {"contact.E_friction": EnergyAccount(np.array([1.0]), power=np.array([2.0])),
                "E_M": EnergyAccount(np.array([5.0]), power=np.array([2.0])), "E_S": EnergyAccount(np.array([0.0]))}
    state = CoupledState(Level(0.0, *(np.zeros(0) for _ in range(5))), (), 0, accounts)
    found = spare.as_whole(state, scheme, 2.0)
    assert found is not None
    carried = {n: float(a.carry[0]) for n, a in found.accounts.items()}
    assert carried == {"contact.E_friction": friction, "E_M": plastic, "E_S": 0.0}
    idle = replace(state, accounts={"E_S": EnergyAccount(np.array([0.0]))})
    assert spare.as_whole(idle, scheme, 2.0) is None


@pytest.mark.parametrize("scheme", [Scheme.ITERATED, Scheme.MECHANICAL_FIRST])
def test_a_window_in_one_that_delivers_its_own_heat_is_solved_as_it_is(scheme):
    """Friction heat that is carried past it is kept back for later times, by the window and by its halves alike.

    Taken for late heat, it was handed over half a time too much: a billet that is upset with friction took windows of
    0.2 ms (1741 of them to 0.32 of 1 s), and takes 89 for all of it.
    """
    kept = np.array([1.0])
    accounts = {"contact.E_friction": EnergyAccount(kept, power=np.array([2.0]), late=kept, at_end=True)}
    state = CoupledState(Level(0.0, *(np.zeros(0) for _ in range(5))), (), 0, accounts)
    assert spare.as_whole(state, scheme, 2.0) is None
