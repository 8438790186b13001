"""What a run does where its windows ring: the answer is right, or it is said that it is not; by every scheme."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import Results, run
from coupler.control.gain import Gain
from coupler.control.instability import holds_up_to, iterates, way_out
from coupler.control.loop import Plan, Tried, windows
from coupler.errors import CouplingError
from coupler.scenario.load import scenario_from
from coupler.scenario.options import Iteration, OnUnstable, Scheme, Seen, WindowRange
from coupler.schemes.schedule import schedule
from coupler.schemes.scheme import OfLevels
from coupler.schemes.schemes import SCHEMES, scheme_of
from coupler.schemes.state import wanted_outputs
from coupler.trust.checks import TrustVerdict
from coupler.trust.in_time import errors, stability

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "stability"))

from cases import CASES, Case
from fresh_scenes import Doc, column, rectangle, two_sided_rod

ONE = {"thermal": 1, "mechanical": 1}
HELD = scheme_of(Scheme.STAGGERED).exchange_at(Seen.MIDDLE)


# What one mode does, and which way out is the cheapest

def of(rho: float, R: float, rho_h: float = 0.0) -> Gain:
    """Of a staggered window of 1 s."""
    return Gain(1.0, rho, R, OfLevels((1.0,)), rho_h=rho_h)


def test_a_window_just_beyond_its_limit_is_cut_and_one_far_beyond_iterated():
    near, far = of(0.9, 0.7), of(60.0, 0.02)
    assert near.m == pytest.approx(-1.1)
    way = way_out(near, Scheme.STAGGERED, Seen.MIDDLE, OnUnstable.AUTO)
    assert way is not None
    assert way.level is None
    assert near.in_windows(way.share).m > -0.5
    way = way_out(far, Scheme.STAGGERED, Seen.MIDDLE, OnUnstable.AUTO)
    assert way is not None
    assert way.level is Seen.END, "given the middle, a disturbance of so long a window comes back with the other sign"
    assert far.by(scheme_of(Scheme.ITERATED).exchange_at(Seen.MIDDLE)).m < -0.9


def test_what_is_asked_for_is_kept_to():
    far = of(3.0, 0.2)
    cut = way_out(far, Scheme.STAGGERED, Seen.MIDDLE, OnUnstable.CUT)
    iterate = way_out(of(0.9, 0.7), Scheme.STAGGERED, Seen.MIDDLE, OnUnstable.ITERATE)
    assert cut is not None
    assert cut.level is None
    assert iterate is not None
    assert iterate.level is Seen.MIDDLE


def test_heat_that_comes_a_window_late_has_no_stable_window_and_is_iterated():
    """Mechanics that make more heat than 1 K stores, delta 1.28: smaller windows are no better."""
    late = of(1.28, 1.0, 1.28)
    assert late.m == pytest.approx(-1.28)
    assert late.limit == 0.0
    assert way_out(late, Scheme.STAGGERED, Seen.MIDDLE, OnUnstable.CUT) is None
    way = way_out(late, Scheme.STAGGERED, Seen.MIDDLE, OnUnstable.AUTO)
    assert way is not None
    assert way.level is Seen.MIDDLE
    # What the thermal half forgets over 64 windows it does not feel either; all shorter ones than this are no better.
    forgets = of(1.28, 0.5, 1.28)
    assert forgets.in_windows(64.0).m > -1.0 > forgets.m
    assert forgets.limit == 0.0


def test_a_limit_is_found_in_shorter_windows_and_in_longer_ones():
    """Backward Euler, b 1 and a 0.1: 2/(b - a)."""
    for H in (0.1, 1.0, 5.0, 30.0):
        found = Gain(H, 0.5 * H / (1 + 0.1 * H), 1 / (1 + 0.1 * H), OfLevels((1.0,)))
        assert found.limit == pytest.approx(2 / 0.9, rel=0.01)


def test_only_an_exchange_that_turns_against_what_changed_is_changed():
    own = of(-0.1, -0.9)
    assert own.m < -0.5
    assert not own.rings
    assert of(0.4, 0.2).rings


@pytest.mark.parametrize("rho", [0.5, 3.0, 50.0])
def test_where_iterating_may_end_the_scheme_before_does_not_ring(rho):
    known = of(rho, 0.3)
    contraction = holds_up_to(known, Seen.MIDDLE)
    assert replace(known, rho=contraction).m == pytest.approx(-0.45, abs=0.01)
    assert holds_up_to(known, Seen.END) == pytest.approx(2 * contraction)


def test_every_scheme_tells_what_it_is_given():
    """A field that does not change is given as it is, and makes no heat."""
    for scheme in SCHEMES:
        for level in Seen:
            exchange = scheme.exchange_at(level)
            geometry, heat = exchange.geometry_of((1.5, -0.5)), exchange.heat_of
            assert sum(geometry.past) + geometry.end == pytest.approx(1.0)
            assert sum(heat.past) + heat.end == pytest.approx(0.0)


# Cases of one mode and of many, beyond their limits, under the real coupler

def tried_in(case: Case, scheme: Scheme, share: float, on: OnUnstable, n: int = 60) -> list[Tried]:
    halves, state = case.make(0.1)
    H = share * case.unit
    plan = Plan(schedule(n * H, [WindowRange(n * H, H, H)], ()), scheme, ONE, case.how, on_unstable=on,
                watched=case.watch)
    return list(windows(wanted_outputs(*halves), state, plan))


def trusted(tried: list[Tried], case: Case) -> bool:
    """Whether neither its errors nor its exchange speak against a run."""
    state = case.make(0.1)[1]
    values = case.watch(state.now)
    log, exchange = errors.begun(values), stability.StabilityLog()
    for w in tried:
        if w.mended is not None:
            exchange = stability.mended(exchange, w.mended, w.t + w.H, w.H)
        if w.looked is not None:
            log = errors.watched(log, w.looked, w.t + w.H)
            exchange = stability.watched(exchange, w.looked, w.t + w.H, w.H)
    checks = (errors.check(log, {str(k): "K" for k in range(len(values))}, adaptive=False),
              stability.check(exchange, log.looked))
    return all(c.verdict is not TrustVerdict.BROKEN for c in checks)


SOLVED_ONCE = [Scheme.STAGGERED, Scheme.EXTRAPOLATED, Scheme.PARALLEL]


@pytest.mark.few(
    "E4-Scheme.STAGGERED-1.2", "E4-Scheme.EXTRAPOLATED-10.0", "E4-Scheme.PARALLEL-100.0", "E3c-Scheme.STAGGERED-100.0",
    "E3c-Scheme.EXTRAPOLATED-1.2", "E3c-Scheme.PARALLEL-10.0")
@pytest.mark.parametrize("share", [0.1, 1.0, 1.2, 10.0, 100.0,
                                   *(pytest.param(s, marks=pytest.mark.slow) for s in (0.3, 3.0, 30.0))])
@pytest.mark.parametrize("scheme", SOLVED_ONCE)
@pytest.mark.parametrize("name", ["E3c", "E4"])
def test_in_windows_of_any_size_the_answer_is_right_or_not_to_be_trusted(name, scheme, share):
    """Backward Euler; right: at rest at the end, to 1 % of the way, where the run is long enough for it."""
    case = replace(CASES[name], how=Iteration())
    tried = tried_in(case, scheme, share, OnUnstable.AUTO)
    now = case.watch(tried[-1].solved.state.now)
    begun, rest = case.watch(case.make(0.1)[1].now), case.watch(case.make(0.0)[1].now)
    right = float(np.abs(now - rest).max()) < 0.01 * float(np.abs(begun - rest).max())
    if share >= 1.0:
        assert right or not trusted(tried, case)
    if share >= 3.0:
        assert right, "it can be mended, so it is"


@pytest.mark.parametrize("name", ["E3c", "E4"])
def test_left_alone_the_same_windows_go_wrong(name):
    tried = tried_in(CASES[name], Scheme.STAGGERED, 3.0, OnUnstable.WARN)
    rest = CASES[name].watch(CASES[name].make(0.0)[1].now)
    assert float(np.abs(CASES[name].watch(tried[-1].solved.state.now) - rest).max()) > 1e-3
    assert not trusted(tried, CASES[name])
    assert any("unstable exchange" in note for w in tried for note in w.notes)


def test_back_from_iterating_where_the_first_scheme_holds_again():
    """Its guess of the cost of iterating is about what it takes."""
    tried = tried_in(CASES["E4"], Scheme.STAGGERED, 3.0, OnUnstable.ITERATE)
    k = next(k for k, w in enumerate(tried) if w.mended)
    assert not tried[k].accepted
    assert tried[k + 1].t == tried[k].t
    assert tried[k + 1].solved.scheme is Scheme.ITERATED
    took = np.mean([len(w.solved.history.misfits) for w in tried[k + 1: k + 6] if w.solved.history])
    assert 0.5 < took / iterates(of(1.5, 0.5)) < 2.0


def test_a_run_may_end_there():
    with pytest.raises(CouplingError, match=r"windows up to about .* s are stable; coupling.on_unstable says to stop"):
        tried_in(CASES["E4"], Scheme.STAGGERED, 3.0, OnUnstable.STOP)


# Scenes

def ran(doc: Doc, out: Path) -> Results:
    out.mkdir(exist_ok=True)
    return run(scenario_from(json.dumps(doc), Path("scene.yaml"), {}), out / "run.h5")


def squeezed_bar(size: float, windows: int, scheme: str, **coupling: Any) -> Doc:
    """A bar at rest, thermoelastic, delta 1.5, its end made 0.316 K warmer: by 1.5 K of strain for each of its own."""
    doc = column(size, windows * size, scheme)
    T0 = 1.5 / 3.16227766e-3**2
    doc["materials"]["m"]["T_ref"] = T0
    doc["bodies"]["bar"] = {"mesh": rectangle(0, 0, 1, 0.04, 25), "material": "m", "T0": T0}
    doc["thermal"]["boundary"][0]["temperature"] = T0 + 0.316227766
    del doc["mechanical"]["elastic"]["dynamics"]
    doc["probes"] = {"T1": {"T": {"at": [0.5, 0.02], "body": "bar"}}}
    doc["coupling"] |= coupling
    return doc


@pytest.mark.slow
def test_an_explicit_default_that_ran_away_is_right(tmp_path):
    """It reached -157 K of a way of 0.3 K in 30 windows; smaller windows are worse."""
    alone = ran(squeezed_bar(0.02, 30, "staggered", on_unstable="warn"), tmp_path / "alone")
    assert abs(alone.probe("T1")[1][-1] - 150000.0) > 100.0
    assert alone.broken
    right = ran(squeezed_bar(0.02, 30, "iterated"), tmp_path / "right").probe("T1")[1]
    mended = ran(squeezed_bar(0.02, 30, "staggered"), tmp_path / "mended")
    assert mended.probe("T1")[1][-1] == pytest.approx(right[-1], abs=0.003 * 0.316)
    assert not mended.broken
    told = next(c for c in mended.trust if c.name == stability.NAME)
    assert told.verdict is TrustVerdict.NOTED
    assert "no window is stable; windows are iterated from here on" in told.sentence


@pytest.mark.few("10.0")
@pytest.mark.parametrize("size", [0.02, 0.1, 0.15, 0.3, 1.0, 10.0])
def test_the_rod_that_conducts_by_gap_and_pressure_comes_to_rest(tmp_path, size):
    """Cycles of period 3 and 7 in windows of 0.15 and 0.1 s, for ever; at rest the gap is 0.90984e-6 m."""
    found = ran(two_sided_rod(size, max(40 * size, 2.0)), tmp_path)
    assert found.probe("gap")[1][-1] == pytest.approx(0.90984e-6, rel=0.01)
    assert found.probe("TL")[1][-1] == pytest.approx(348.975, abs=0.05)
    if size in (0.1, 0.15):
        assert stability.NAME in {c.name for c in found.broken}, "windows went wrong before it was seen"


@pytest.mark.slow
def test_a_cycle_is_found_wherever_in_it_a_measurement_falls(tmp_path):
    """Of the windows of a cycle of three one feeds back by rho 1.05, the others by 0 and 0.04: shut, and wide open."""
    found = ran(two_sided_rod(0.15, 20.0), tmp_path)
    assert found.probe("gap")[1][-1] == pytest.approx(0.90984e-6, rel=0.01)
    assert stability.NAME in {c.name for c in found.broken}
