"""Control: windows of their own size, what is put back leaves no trace, when a run stops."""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from coupler.control.accept import MAX_TRIES, Attempt, unsolvable
from coupler.control.loop import propose, step, windows
from coupler.control.state import ControlState, first
from coupler.errors import CouplingError
from coupler.scenario.options import Adaptive, ErrorTolerances, OnCycle, Scheme, Tolerance
from coupler.scenario.rule_model import Retry, Rule, Stop, Test, When
from coupler.schemes.schedule import Schedule
from coupler.schemes.state import Settings, Span, Verdict, wanted_outputs
from coupler.schemes.sweep import thermal_first

sys.path.insert(0, str(Path(__file__).parent))
from adaptive_run import END, EXACT_E8, SIZES, ledger_of, plan_to, tries
from coupled_run import start
from fake_halves import gap_of, lumped, shrinking

TIGHT = ErrorTolerances(temperature=Tolerance(atol=1e-3, rtol=0.0), gap=Tolerance(atol=1e-3, rtol=0.0),
                        heat=Tolerance(atol=1e9, rtol=0.0), displacement=Tolerance(atol=1e-3, rtol=0.0))


@pytest.mark.parametrize("scheme", [Scheme.EXTRAPOLATED, Scheme.ITERATED, Scheme.AUTO])
def test_windows_find_their_size_and_keep_the_tolerance(scheme: Scheme) -> None:
    found = tries(plan_to(scheme=scheme, adaptive=replace(SIZES, tolerance=TIGHT)))
    taken = [w for w in found if w.accepted]
    assert abs(float(taken[-1].solved.state.now.T[0]) - EXACT_E8) < 2e-3
    sizes = [w.H for w in taken]
    assert max(sizes) > 3 * sizes[0]
    assert ledger_of(found).imbalance < 1e-10
    assert all(w.error is None or w.error.error <= 1.0 for w in taken)
    assert all(w.reason for w in found)


def test_a_window_whose_error_is_too_large_is_put_back_and_shorter_ones_follow() -> None:
    found = tries(plan_to(adaptive=Adaptive(10.0, 1e-6, END, TIGHT), scheme=Scheme.EXTRAPOLATED))
    bad = [k for k, w in enumerate(found) if w.solved.verdict is Verdict.ERROR]
    assert bad
    for k in bad:
        assert found[k + 1].t == found[k].t
        assert found[k + 1].H < found[k].H
        assert found[k].solved.state is not found[k].after.state
        assert "times its tolerance" in found[k].solved.message
        assert "tried again after: error of" in found[k + 1].reason
    assert ledger_of(found).imbalance < 1e-10


def test_an_error_at_the_least_window_is_taken_and_told() -> None:
    found = tries(plan_to(adaptive=Adaptive(1.0, 1.0, 1.0, TIGHT), scheme=Scheme.STAGGERED))
    told = [w for w in found if w.solved.verdict is Verdict.ERROR]
    assert told
    assert all(w.accepted and "at its least" in w.solved.message for w in told)
    assert len(found) == 20


def test_a_window_of_one_tick_is_taken_as_it_is() -> None:
    """An event may ask for it; it has no halves."""
    plan, halves = plan_to(), wanted_outputs(lumped(840.0), shrinking(840.0))
    before = first(start(840.0, gap_of(840.0)), plan)
    done = step(halves, replace(before, control=replace(before.control, aim=1)), plan)
    assert done.accepted
    assert done.after.control.tick == 1


def test_kinks_and_the_end_are_met_without_crumbs() -> None:
    kinks = (0.31, 7.3, 7.3000001, 12.5, 19.999)
    found = tries(plan_to(kinks=kinks))
    ends = [w.t + w.H for w in found if w.accepted]
    assert {*kinks, END} <= set(ends)
    sizes = [w.H for w in found if w.accepted]
    stops = [0.0, *kinks, END]
    for w in found:
        piece = next(b - a for a, b in pairwise(stops) if a <= w.t < b)
        assert min(SIZES.first, piece) * (2 / 3 - 1e-9) <= w.H
    assert max(sizes) > 1.0
    first_after = [w for w in found if w.t in kinks]
    assert all(min(SIZES.first * 4 / 3, 1.0) + 1e-9 >= w.H for w in first_after)
    assert all(w.after.state.past in ((), w.after.state.past) and w.before.fresh for w in first_after)


@pytest.mark.parametrize("size", [0.013, 0.1, 0.333, 0.61, 0.9, 1.0, 1.4, 3.0])
def test_a_rest_is_joined_or_shared(size: float) -> None:
    """None is shorter than two thirds, or longer than four thirds, of what was wanted."""
    plan = plan_to(1.0)
    control = ControlState(plan.settings, size=size)
    sizes = []
    while control.tick < plan.last:
        k1 = propose(plan, control).k1
        sizes.append(plan.schedule.clock.seconds(k1) - plan.schedule.clock.seconds(control.tick))
        control = replace(control, tick=k1)
    assert sum(sizes) == pytest.approx(1.0, abs=1e-9)
    wanted = min(size, 1.0)
    assert min(sizes) > 2 / 3 * wanted * (1 - 1e-6)
    assert max(sizes) < 4 / 3 * wanted * (1 + 1e-6)


def test_after_a_window_was_put_back_a_rest_is_not_stretched_to_it_again() -> None:
    plan = plan_to(1.0)
    control = ControlState(plan.settings, size=0.8, below=plan.last)
    assert propose(plan, control).k1 <= plan.last // 2 + 1


def test_a_cap_and_a_factor_shorten_windows_of_a_schedule_and_a_factor_joins_them() -> None:
    clock = plan_to(8.0).schedule.clock
    bounds = tuple(clock.ticks(t) for t in range(9))
    plan = replace(plan_to(8.0, adaptive=None), schedule=Schedule(clock, bounds, frozenset({bounds[4]}), frozenset()))

    def ends(settings: Settings) -> list[float]:
        control, found = ControlState(settings), [0.0]
        while control.tick < plan.last:
            control = replace(control, tick=propose(plan, control).k1)
            found.append(clock.seconds(control.tick))
        return found

    assert ends(plan.settings) == list(range(9))
    assert ends(replace(plan.settings, window_cap=0.5)) == pytest.approx([k / 2 for k in range(17)])
    assert ends(replace(plan.settings, window_factor=0.25)) == pytest.approx([k / 4 for k in range(33)])
    assert ends(replace(plan.settings, window_factor=3.0)) == [0.0, 3.0, 4.0, 7.0, 8.0]


@pytest.mark.parametrize("scheme", [Scheme.STAGGERED, Scheme.EXTRAPOLATED, Scheme.ITERATED])
def test_what_is_put_back_leaves_no_trace(scheme: Scheme) -> None:
    """The windows that were taken, given as a schedule, come to the same bits."""
    plan = plan_to(adaptive=None, scheme=scheme, rules=(Rule("late", When(all=(Test("t", above=7.0),)),
                                                             (Retry(0.3, least=0.1),)),))
    found = tries(replace(plan, schedule=_every(plan.schedule, 1.0)), lumped(840.0, h_max=0.7),
                  shrinking(840.0, heat=1e4))
    verdicts = {w.solved.verdict for w in found}
    assert verdicts == {Verdict.ACCEPTED, Verdict.THERMAL_DISCARD, Verdict.RULE}
    ticks = (0, *(w.span.k1 for w in found if w.accepted))
    plain = tries(replace(plan, rules=(), schedule=replace(plan.schedule, bounds=ticks)),
                  mechanical=shrinking(840.0, heat=1e4))
    assert len(plain) == len(ticks) - 1
    kept = [w for w in found if w.accepted]
    assert [w.solved.state.now.T[0] for w in kept] == [w.solved.state.now.T[0] for w in plain]
    assert kept[-1].solved.state.accounts["E_M"].made == plain[-1].solved.state.accounts["E_M"].made
    assert ledger_of(found).terms == ledger_of(plain).terms
    assert ledger_of(found).imbalance < 1e-10


def _every(schedule: Schedule, size: float) -> Schedule:
    n = round(schedule.clock.end / size)
    return replace(schedule, bounds=tuple(schedule.clock.ticks(k * size) for k in range(n + 1)))


def test_a_run_stops_when_it_is_steady_but_not_before_a_kink() -> None:
    for kinks, stops in (((), True), ((499.0,), False)):
        found = tries(plan_to(500.0, kinks, steady=1e-4))
        last = found[-1]
        assert (last.t + last.H < 490.0) is stops
        assert "steady" in last.after.control.stop
        rates = [abs(float(w.solved.state.now.T[0] - w.solved.state.past[0].T[0])) / w.H
                 for w in found if w.accepted and w.solved.state.past]
        assert not stops or (max(rates[-2:]) < 1e-4 <= rates[-3])


def test_a_rule_stops_the_run() -> None:
    found = tries(plan_to(rules=(Rule("enough", When(all=(Test("t", above=3.0),)), (Stop("that will do"),)),)))
    assert found[-1].accepted
    assert "that will do" in found[-1].after.control.stop
    assert 3.0 < found[-1].t + found[-1].H < END


def test_a_window_that_is_put_back_for_ever_is_an_error() -> None:
    plan = plan_to(rules=(Rule("never", do=(Retry(0.9),)),))
    with pytest.raises(CouplingError, match=r"rule 'never'"):
        tries(plan)
    assert MAX_TRIES < 100


def test_a_discard_at_the_least_window_is_an_error() -> None:
    with pytest.raises(CouplingError, match=r"at its least.*Shorter windows do not help"):
        tries(plan_to(adaptive=Adaptive(1.0, 0.5, END)), lumped(840.0, h_max=0.1))


def test_who_follows_a_motion_is_not_told_to_follow_it() -> None:
    rest, moves = (cast(Attempt, SimpleNamespace(plan=plan_to(inertia=on))) for on in (False, True))
    assert "follow the motion with inertia" in str(unsolvable(rest, Verdict.MECHANICAL_DISCARD))
    assert "with inertia" not in str(unsolvable(moves, Verdict.MECHANICAL_DISCARD))
    assert "smaller `penalty`" in str(unsolvable(moves, Verdict.MECHANICAL_DISCARD))
    assert unsolvable(moves, Verdict.THERMAL_DISCARD) == unsolvable(rest, Verdict.THERMAL_DISCARD)
    assert unsolvable(moves, Verdict.ERROR) is None


@pytest.mark.parametrize("then", list(OnCycle))
def test_a_two_cycle_is_told_iterated_or_cut(then: OnCycle) -> None:
    """E4 at 1.2 times its limit, staggered."""
    end = 40 * 1.2 * 10.2449
    plan = plan_to(end, adaptive=None, scheme=Scheme.STAGGERED, on_cycle=then)
    found = tries(replace(plan, schedule=_every(plan.schedule, end / 40)), lumped(840.0, "backward_euler"))
    noted = [w for w in found if any("go up and down" in n for n in w.notes)]
    assert noted
    swing = np.ptp([float(w.solved.state.now.T[0]) for w in found if w.accepted][-4:])
    assert bool(swing > 1.0) is (then is OnCycle.NOTE)
    if then is OnCycle.CUT:
        assert noted[0].solved.verdict is Verdict.CYCLE
    if then is OnCycle.ITERATE:
        assert any(w.solved.scheme is Scheme.ITERATED for w in found)


def test_inputs_of_settings_reach_the_half_that_has_them() -> None:
    thermal, mechanical = lumped(840.0), shrinking(840.0)
    plan = plan_to(1.0)
    at = first(start(840.0, gap_of(840.0)), plan)
    assert at.control.settings.inputs == {}
    thermal.blocks = {**thermal.blocks, "load.x": replace(thermal.blocks["E_M"], name="load.x", shape=())}
    halves = replace(wanted_outputs(thermal, mechanical), inputs={"thermal": {"load.x": 1.2, "load.y": 3.0}})
    thermal_first(halves, at.state, Span(plan.schedule.clock, 0, plan.last, plan.substeps), None)
    assert float(thermal.inputs["load.x"]) == 1.2
    assert "load.y" not in thermal.inputs
    assert "load.x" not in mechanical.inputs


def test_the_loop_is_a_chain_of_what_was_remembered() -> None:
    """A run that goes on from what is remembered after a window is the same run."""
    plan = plan_to(5.0, kinks=(2.0,))
    whole = tries(plan)
    again = list(windows(wanted_outputs(lumped(840.0), shrinking(840.0)), start(840.0, gap_of(840.0)), plan))
    assert [w.span.k1 for w in whole] == [w.span.k1 for w in again]
    assert [w.after.control.number for w in whole if w.accepted] == list(range(1, 1 + sum(w.accepted for w in whole)))
