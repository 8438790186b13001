"""The error of a window: measured in two halves and carried on, against the same window solved in 64 sub-windows."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from adaptive_run import plan_to, tries
from coupled_run import start
from fake_halves import G_M, K_G, T_IN, T_S, T_W, X_OUT, C, FakeHalf, G, blocks_of, gap_of, lumped, shrinking
from scipy.integrate import solve_ivp
from true_error import ONE, windows

from coupler.control import error_estimate, spare, unannounced
from coupler.control.error_estimate import Measured, Memory
from coupler.control.loop import Tried
from coupler.control.loop import windows as run_windows
from coupler.control.plan import Plan
from coupler.control.solve_window import SavedStates, SolveOptions, doubled, halved, solve_once
from coupler.fmu.half import Block
from coupler.scenario.options import Adaptive, ErrorTolerances, Iteration, Scheme, Tolerance, WindowRange
from coupler.schemes.accounts import EnergyAccount
from coupler.schemes.levels import Level
from coupler.schemes.schedule import Clock, schedule
from coupler.schemes.state import CoupledState, Settings, Solved, Span, Verdict, Work, wanted_outputs

E8 = 831.7186022526  # K, of E4 from 840 K after 20 s


def honesty(scheme: Scheme, H: float, n: int, method: str = "midpoint") -> tuple[float, float, float]:
    """Shares of windows, of which every second is looked at: within a factor of 3; understated by more; measured."""
    halves = wanted_outputs(lumped(840.0, method), shrinking(840.0))
    plan = schedule(n * H, [WindowRange(n * H, H, H)], ())
    found = list(windows(halves, start(840.0, gap_of(840.0)), plan, scheme, 2))
    pairs = [(w.estimated["temperature"], w.true["temperature"], w.floor) for w in found]
    good = [e >= t / 3 and (e <= 3 * t or t < 10 * floor) for e, t, floor in pairs]
    return (float(np.mean(good)), float(np.mean([e < t / 3 for e, t, _ in pairs])),
            float(np.mean([w.measured for w in found])))


@pytest.mark.few(
    "Scheme.STAGGERED-0.5-20-midpoint-0.4", "Scheme.EXTRAPOLATED-2.22186-24-midpoint-1.0",
    "Scheme.ITERATED-30.734699999999997-14-backward_euler-1.0")
@pytest.mark.parametrize(("scheme", "H", "n", "method", "most"), [
    (Scheme.EXTRAPOLATED, 0.5, 30, "midpoint", 0.4), (Scheme.ITERATED, 1.0, 20, "midpoint", 0.4),
    # Stiff: here windows in halves decay so differently from whole ones that nearly all are measured.
    (Scheme.EXTRAPOLATED, 0.3 * 7.4062, 24, "midpoint", 1.0), (Scheme.ITERATED, 3 * 10.2449, 14, "backward_euler", 1.0),
    (Scheme.STAGGERED, 0.5, 20, "midpoint", 0.4)])
def test_it_is_within_a_factor_of_three(scheme: Scheme, H: float, n: int, method: str, most: float) -> None:
    good, low, measured = honesty(scheme, H, n, method)
    assert good >= 0.8
    assert low <= 0.1
    assert measured <= most


def window(scheme: Scheme = Scheme.EXTRAPOLATED, H: float = 1.0) -> tuple[CoupledState, Solved, Work]:
    """E4's first window from 840 K in two halves: its start, its outcome, the work of two windows of half the size."""
    halves = wanted_outputs(lumped(840.0), shrinking(840.0))
    state, clock, way = start(840.0, gap_of(840.0)), Clock(H), SolveOptions(scheme, Settings(scheme, ONE))
    span = Span(clock, 0, 2**40, ONE)
    with SavedStates(halves, 0.0, 1) as saved:
        whole = solve_once(halves, state, span, way, saved)
        both = doubled(halves, state, span, way, saved, whole)
        saved.roll_back("")
        work, at = Work(), state
        for piece in halved(span):
            part = solve_once(halves, at, piece, way, saved)
            work, at = work.plus(part.work), part.state
    assert both.state.now.T.tobytes() == at.now.T.tobytes()
    assert both.whole is not None
    assert both.whole.state.now.T.tobytes() == whole.state.now.T.tobytes()
    return state, both, work.plus(whole.work)


def test_a_window_in_two_halves_is_told_as_one() -> None:
    state, both, work = window()
    assert both.state.past == (state.now,)
    assert both.state.now.t == 1.0
    assert len(both.terms) == 2
    assert (both.work.thermal_solves, both.work.mechanical_solves) == (work.thermal_solves, work.mechanical_solves) == (
        3, 3)


def test_a_window_of_one_tick_has_no_halves() -> None:
    with pytest.raises(ValueError, match="one tick"):
        halved(Span(Clock(1.0), 7, 8, ONE))


def test_what_is_kept_has_a_quarter_of_the_error_of_the_window_in_one() -> None:
    state, both, _ = window()
    found = error_estimate.estimate(Memory(), state, both, ErrorTolerances(), Iteration())
    assert found is not None
    assert both.whole is not None
    apart = abs(float(both.state.now.T[0] - both.whole.state.now.T[0]))
    assert found.errors["temperature"] == pytest.approx(1.5 / 4 * apart, rel=1e-12)
    assert found.size == pytest.approx(4 * found.error, rel=1e-12)
    for n, share in found.shares.items():
        assert found.splitting[n] + found.own[n] == pytest.approx(share, rel=1e-12)
    assert found.words.startswith("error of temperature is ")


def closing(speed: float, H: float) -> tuple[FakeHalf, CoupledState, float]:
    """A gap that falls steadily to zero in a window of H [s]: the half that moves it, the start, T at its end [K].

    The lumped body at its end: C dT/dt = G (T_s - T) - k_g (T - T_w)/(g_m + speed (H - t)).
    """
    def rule(state, inputs, t, h):
        gap = speed * (H - t - h)
        return state, {"x": np.array([[0.0, gap]]), "contact.gap": np.array([gap]), "contact.covered": np.ones(1)}

    outputs = (X_OUT, *(Block(f"contact.{n}", (1,), "m", "output", "Real") for n in ("gap", "covered")))
    at, before = (replace(start(840.0, 0.0).now, t=t, x=np.array([[0.0, speed * (H - t)]]), t_N=np.zeros(1),
                          gap=np.array([speed * (H - t)]), covered=np.ones(1)) for t in (0.0, -H))
    exact = solve_ivp(lambda t, T: (G * (T_S - T) - K_G * (T - T_W) / (G_M + speed * (H - t))) / C, (0.0, H), [840.0],
                      method="LSODA", rtol=1e-10).y[0, -1]
    return (FakeHalf("closing", blocks_of(T_IN, *outputs), rule, np.zeros(1)),
            CoupledState(at, (before,), 0, {"E_M": EnergyAccount(np.zeros(1))}), float(exact))


@pytest.mark.parametrize("layers", [20.0, 100.0, 500.0])
def test_in_a_window_in_which_a_gap_closes_its_halves_are_taken_to_be_no_better(layers: float) -> None:
    """Its width at the start in layers of gas: heat goes with log(layers), of which few windows see anything."""
    H = 1.0
    half, state, exact = closing(layers * G_M / H, H)
    halves = wanted_outputs(lumped(840.0), half)
    way = SolveOptions(Scheme.EXTRAPOLATED, Settings(Scheme.EXTRAPOLATED, ONE))
    span = Span(Clock(H), 0, 2**40, ONE)
    with SavedStates(halves, 0.0, 1) as saved:
        whole = solve_once(halves, state, span, way, saved)
        known = known_of(Measured(RATIOS, H, 16, 16))
        assert error_estimate.wanted(known, state, span, Scheme.EXTRAPOLATED, whole.state.now)
        both = doubled(halves, state, span, way, saved, whole)
        saved.roll_back("")
    found = error_estimate.estimate(known, state, both, ErrorTolerances(), Iteration())
    assert found is not None
    true = abs(float(both.state.now.T[0]) - exact)
    assert found.size == found.error
    assert true / 3.0 < found.errors["temperature"] < 3.0 * true


def level(t: float, T: float, gap: tuple[float, float] = (1.0, 1.0), covered: float = 1.0) -> Level:
    return Level(t, np.array([T, 900.0]), np.array([[0.0, T / 1000]]), np.zeros(2), np.array(gap),
                 np.array([1.0, covered]))


def solved_at(now: Level, past: tuple[Level, ...], heat: float = 0.0, scheme: Scheme = Scheme.EXTRAPOLATED,
              friction: float = 0.0) -> Solved:
    state = CoupledState(now, past, 0, {"E_M": EnergyAccount(np.zeros(1))})
    terms = {"heat.gap.slave": heat, "heat.friction.slave": friction}
    return Solved(Verdict.ACCEPTED, "", state, (terms,), Work(), {}, scheme=scheme)


def told(memory: Memory, levels: list[Level], heat: float = 0.0, scheme: Scheme = Scheme.EXTRAPOLATED,
         friction: float = 0.0) -> error_estimate.Estimate:
    """levels : newest first."""
    before = solved_at(levels[1], tuple(levels[2:])).state
    found = error_estimate.estimate(memory, before, solved_at(levels[0], tuple(levels[1:4]), heat, scheme, friction),
                              ErrorTolerances(temperature=Tolerance(atol=1.0, rtol=0.0)), Iteration())
    assert found is not None
    return found


RATIOS = {"temperature": 0.5, "gap": 0.5, "heat": 0.5, "displacement": 0.5}
X = Scheme.EXTRAPOLATED


def known_of(measured: Measured, rate: float = math.nan, scheme: Scheme = X) -> Memory:
    return Memory({scheme.value: measured}, rate)


def ratio_of(H: float, rate: float = math.nan, scheme: Scheme = X) -> Memory:
    """Ratios of one half, of windows of H [s]."""
    return known_of(Measured(RATIOS, H), rate, scheme)


def test_between_measurements_it_goes_with_the_second_difference() -> None:
    """T = t^2: H^2 T'' = 2 H^2, whatever the windows before; a window grown twice has twice the ratio."""
    levels = [level(t, t * t) for t in (6.0, 4.0, 3.0, 1.0)]
    assert told(ratio_of(2.0), levels).errors["temperature"] == pytest.approx(0.5 * 8.0)
    assert told(ratio_of(1.0), levels).errors["temperature"] == pytest.approx(2 * 0.5 * 8.0)
    # One that has shrunk keeps its ratio: a stiff part would not shrink with it.
    assert told(ratio_of(4.0), levels).errors["temperature"] == pytest.approx(0.5 * 8.0)
    # A scheme of first order makes an error of H^2.
    first = told(ratio_of(1.0, scheme=Scheme.STAGGERED), levels, scheme=Scheme.STAGGERED)
    assert first.errors["temperature"] == pytest.approx(0.5 * 8.0)


def test_heat_is_judged_by_how_its_rate_changes() -> None:
    levels = [level(t, 900.0) for t in (4.0, 2.0, 0.0)]
    found = told(ratio_of(2.0, rate=10.0), levels, heat=26.0)  # 13 W after 10 W
    assert found.errors["heat"] == pytest.approx(0.5 * 3.0 * 2.0)
    assert found.shares["heat"] == pytest.approx(3.0 / (1e-3 + 1e-2 * 26.0))


def test_heat_that_crosses_is_held_against_what_is_rubbed_there_too() -> None:
    """1 J of 26 that cross where 1000 J are rubbed is little: nearly all of them go into the bodies on their own."""
    levels = [level(t, 900.0) for t in (4.0, 2.0, 0.0)]
    found, rubbed = (told(ratio_of(2.0, rate=10.0), levels, heat=26.0, friction=J) for J in (0.0, 1000.0))
    assert rubbed.errors["heat"] == found.errors["heat"]
    assert rubbed.shares["heat"] == pytest.approx(3.0 / (1e-3 + 1e-2 * 1026.0))


def test_what_windows_before_carried_counts_half_as_much_with_every_window() -> None:
    """Heat that jumps is as wrong in the shortest window as in a long one; its tolerance must not vanish with it."""
    levels, memory = [level(t, 900.0) for t in (4.0, 2.0, 0.0)], ratio_of(2.0, rate=10.0)
    for heat, scale in ((800.0, 800.0), (26.0, 400.0), (26.0, 200.0)):
        end = solved_at(levels[0], tuple(levels[1:]), heat)
        assert told(memory, levels, heat).shares["heat"] == pytest.approx(
            told(memory, levels, heat).errors["heat"] / (1e-3 + 1e-2 * scale))
        memory = error_estimate.after(memory, solved_at(levels[1], (levels[2],)).state, end, None)
        memory = replace(error_estimate.forgotten(memory), by=ratio_of(2.0).by, rate=10.0)


def test_gaps_that_begin_or_end_are_no_error() -> None:
    gaps = ((1e-3, 1e-3), (2e-3, 0.1), (3e-3, 0.1))
    levels = [level(t, 900.0, gap, float(gap[1] < 0.1)) for t, gap in zip((3.0, 2.0, 1.0), gaps, strict=True)]
    assert told(ratio_of(1.0), levels).errors["gap"] == pytest.approx(0.0, abs=1e-15)
    faced = [replace(v, covered=np.ones(2)) for v in levels]
    assert told(ratio_of(1.0), faced).errors["gap"] > 0.04


def test_without_a_measurement_nothing_is_known() -> None:
    levels = [level(t, t) for t in (2.0, 1.0)]
    assert error_estimate.estimate(Memory(), solved_at(levels[1], ()).state, solved_at(levels[0], (levels[1],)),
                             ErrorTolerances(), Iteration()) is None


def test_when_it_is_measured_again() -> None:
    clock, scheme = Clock(16.0), Scheme.EXTRAPOLATED
    state = solved_at(level(0.0, 900.0), (level(-1.0, 901.0),)).state

    def asked(memory: Memory, H: int, at: CoupledState = state, by: Scheme = scheme) -> bool:
        return error_estimate.wanted(memory, at, Span(clock, 0, H * 2**36, ONE), by, at.now)

    measured = Measured(RATIOS, 2.0, 3, 4)
    known = known_of(measured)
    assert not asked(known, 2)
    assert not asked(known, 4)
    assert asked(known, 6)
    assert asked(known_of(replace(measured, H=6.0)), 2)
    assert asked(known_of(replace(measured, left=0)), 2)
    assert asked(known, 2, by=Scheme.ITERATED)
    assert asked(Memory(), 2)
    assert asked(known, 2, at=replace(state, past=()))


@pytest.mark.parametrize(("before", "now", "measured"), [
    ((0.0, 1.0), (0.5, 1.0), True), ((1.0, 1.0), (1.0, 0.9), True), ((0.0, 1.0), (0.0, 1.0), False)])
def test_while_a_front_moves_every_window_is_measured(before, now, measured: bool) -> None:
    """However well ratios agreed: the next node that begins or ends to freeze is announced by none of them."""
    levels = [replace(level(t, 900.0), f_s=np.array(f)) for t, f in ((0.0, now), (-1.0, before))]
    memory = known_of(Measured(RATIOS, 2.0, 16, 16))
    at = solved_at(levels[0], (levels[1],)).state
    assert error_estimate.wanted(memory, at, Span(Clock(16.0), 0, 2**37, ONE), Scheme.EXTRAPOLATED, at.now) is measured


def measured_after(known: Measured, ratios: Sequence[float], t: Sequence[float] = (3.0, 2.0, 1.0)) -> list[Measured]:
    """What is known of a scheme after windows measured with these ratios, each like the one that ends at t[0] [s]."""
    levels = [level(v, 900.0 + v * v) for v in t]
    before, solved = solved_at(levels[1], tuple(levels[2:])).state, solved_at(levels[0], tuple(levels[1:]))
    found, memory, out = told(ratio_of(1.0), levels), known_of(known), []
    for ratio in ratios:
        memory = error_estimate.after(memory, before, solved, replace(found, ratios=dict.fromkeys(RATIOS, ratio)))
        out.append(memory.of(X))
    return out


def test_ratios_that_agree_make_the_next_measurement_wait() -> None:
    def pauses(ratio: float, known: Measured) -> list[int]:
        out = measured_after(known, [ratio] * 6)
        assert all(m.left == m.pause for m in out)
        return [m.pause for m in out]

    assert pauses(0.6, Measured(RATIOS, 1.0)) == [1, 2, 4, 8, 16, 16]
    assert pauses(0.9, Measured(RATIOS, 1.0)) == [0, 1, 2, 4, 8, 16]
    # What was told was too much: that is on the safe side, and looked at again soon where it was far too much.
    assert pauses(0.3, Measured(RATIOS, 1.0, pause=4))[0] == 8
    assert pauses(0.2, Measured(RATIOS, 1.0, pause=4))[0] == 3
    levels = [level(t, 900.0 + t * t) for t in (3.0, 2.0, 1.0)]
    before, solved = solved_at(levels[1], (levels[2],)).state, solved_at(levels[0], tuple(levels[1:]))
    passed = error_estimate.after(known_of(Measured(RATIOS, 1.0, 3)), before, solved, told(ratio_of(1.0), levels))
    assert passed.of(X).left == 2
    assert error_estimate.forgotten(passed) == Memory(changed=passed.changed)


def test_every_scheme_has_ratios_of_its_own() -> None:
    """A window that was iterated to measure the contraction leaves what is known of those before it."""
    levels = [level(t, 900.0 + t * t) for t in (3.0, 2.0, 1.0)]
    before, solved = solved_at(levels[1], (levels[2],)).state, solved_at(levels[0], tuple(levels[1:]),
                                                                         scheme=Scheme.ITERATED)
    known = Measured(RATIOS, 1.0, 3, 4)
    after = error_estimate.after(known_of(known), before, solved, replace(
        told(ratio_of(1.0), levels), ratios=dict.fromkeys(RATIOS, 0.1)))
    assert after.of(X) == replace(known, left=2)
    assert after.of(Scheme.ITERATED).ratios == pytest.approx(dict.fromkeys(RATIOS, 0.1))
    assert not error_estimate.wanted(after, before, Span(Clock(16.0), 2 * 2**36, 3 * 2**36, ONE), X, before.now)


def test_a_window_longer_by_what_has_become_slower_is_no_worse() -> None:
    """T = log t in windows that grow with t: third differences over second ones stay, and so does the ratio."""
    early, late = ([level(t0 * 1.2**k, 900.0 + 50.0 * math.log(t0 * 1.2**k)) for k in (3, 2, 1, 0)]
                   for t0 in (1.0, 4.0))
    before, solved = solved_at(early[1], tuple(early[2:])).state, solved_at(early[0], tuple(early[1:]))
    known = error_estimate.after(Memory(), before, solved, replace(told(ratio_of(1.0), early), ratios=RATIOS))
    H = late[0].t - late[1].t
    assert pytest.approx(4.0 * known.of(X).H) == H
    assert told(known, late).errors["temperature"] == pytest.approx(told(ratio_of(H), late).errors["temperature"])
    # Where it has become no slower, a window four times as long is four times as bad for its bend.
    fast = known_of(replace(known.of(X), bend=math.nan))
    assert told(fast, late).errors["temperature"] == pytest.approx(4.0 * told(known, late).errors["temperature"])


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3])
def test_a_gap_closes_in_a_scene_of_any_size(size: float) -> None:
    """10 um of bodies of 100 mm, 10 pm of 100 nm; a nanometre, or a hundredth of an atom, closes nothing."""
    def at(t: float, gap: float) -> Level:
        made = level(t, 900.0, (size * 1e-3, size * gap))
        return replace(made, x=size * np.array([[0.0, 0.0], [0.1, 0.0]]))
    assert unannounced.gap_closes(at(0.0, 1e-5), at(1.0, 1e-7))
    assert not unannounced.gap_closes(at(0.0, 1e-9), at(1.0, 1e-11))


@pytest.mark.parametrize(("covered", "closes"), [(1.0, True), (0.5, False)])
def test_nodes_at_the_end_of_a_surface_close_no_gap(covered: float, closes: bool) -> None:
    start, end = (level(t, 900.0, (1e-3, g), covered) for t, g in ((0.0, 1e-4), (1.0, 1e-6)))
    assert unannounced.gap_closes(start, end) is closes


def adaptive(scheme: Scheme, tolerance: float) -> tuple[float, list]:
    """E8 in windows that find their own size: the error at the end [K], and every window tried."""
    plan = Plan(schedule(20.0, [WindowRange(20.0, 20.0, 20.0)], ()), scheme, ONE, adaptive=Adaptive(
        2.0, 1e-3, 20.0, ErrorTolerances(temperature=Tolerance(atol=tolerance, rtol=0.0))))
    halves = wanted_outputs(lumped(840.0), shrinking(840.0))
    tried = list(run_windows(halves, start(840.0, gap_of(840.0)), plan))
    return abs(float(tried[-1].solved.state.now.T[0]) - E8), tried


@pytest.mark.parametrize("scheme", [Scheme.EXTRAPOLATED, Scheme.ITERATED])
def test_windows_find_their_size(scheme: Scheme) -> None:
    coarse, few = adaptive(scheme, 0.1)
    fine, many = adaptive(scheme, 0.01)
    assert fine < coarse < 0.1
    assert len(few) < len(many) < 60
    sizes = [w.H for w in many if w.accepted]
    assert max(sizes[:-1]) > 4 * min(sizes[:-1])
    assert not many[0].accepted
    assert many[0].solved.verdict is Verdict.ERROR
    assert many[1].H < 0.7 * many[0].H
    assert all(w.error is not None and w.error.error <= 1.0 for w in many if w.accepted)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", [Scheme.STAGGERED, Scheme.EXTRAPOLATED])
def test_heat_that_comes_late_is_no_error_of_every_window(scheme, monkeypatch):
    """Heat made at one power: windows need be a sixth in number.  The solve it takes is counted, once there is heat."""
    def taken() -> list[Tried]:
        plan = plan_to(200.0, scheme=scheme)
        return [w for w in tries(plan, mechanical=shrinking(840.0, heat=1e3)) if w.accepted]

    found = taken()
    assert [w.solved.work.thermal_solves for w in found[:2]] == [3, 4]
    assert [w.solved.work.mechanical_solves for w in found[:2]] == [3, 4]
    monkeypatch.setattr(spare, "as_whole", lambda *args: None)
    assert len(taken()) > 4 * len(found)


@pytest.mark.parametrize("scheme", [Scheme.PARALLEL, Scheme.MECHANICAL_FIRST])
def test_x_that_comes_late_is_no_error_of_every_window(scheme: Scheme) -> None:
    """Mechanics that see the T of the start are late by a window, once: 200 windows for 1280, T as right."""
    def taken(scheme: Scheme) -> list[Tried]:
        return [w for w in tries(plan_to(200.0, scheme=scheme), mechanical=shrinking(840.0)) if w.accepted]

    found, same = taken(scheme), taken(Scheme.ITERATED)
    assert len(found) < 6 * len(same)
    T, other = (w[-1].solved.state.now.T for w in (found, same))
    assert np.abs(T - other).max() < 0.01
