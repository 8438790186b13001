"""The two-cycle, act upon: E4 beyond its limit, iterated or halved when that shows, and back; E6 is left alone."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler.control.loop import Plan, Tried, windows
from coupler.control.two_cycle import Swing, Watch, WindowSummary, act
from coupler.scenario.options import OnCycle, Scheme, WindowRange
from coupler.schemes.levels import Level
from coupler.schemes.schedule import schedule
from coupler.schemes.state import Settings, Verdict, wanted_outputs

sys.path.insert(0, str(Path(__file__).parent))
from coupled_run import couple, start
from fake_halves import T_OUT, X_OUT, gap_of, lumped, mass, shrinking

EXPECTED = tomllib.loads((Path(__file__).resolve().parents[1] / "expected.toml").read_text(encoding="utf-8"))
E4 = EXPECTED["E4"]
DT = E4["dt_c"]["backward_euler"]
FIRES_WITHIN = 6  # exchanges
AGAIN = "windows are iterated from here on"


def run(on: OnCycle, *ranges: tuple[float, float], kinks: tuple[float, ...] = (),
        scheme: Scheme = Scheme.STAGGERED, T0: float = 840.0) -> list[Tried]:
    """E4, backward Euler.  ranges : (until, size) in critical windows."""
    end = ranges[-1][0] * DT
    plan = Plan(schedule(end, [WindowRange(u * DT, s * DT, s * DT) for u, s in ranges], kinks), scheme,
                {"thermal": 1, "mechanical": 1}, on_cycle=on)
    return list(windows(wanted_outputs(lumped(T0, "backward_euler"), shrinking(T0)),
                        start(T0, gap_of(T0)), plan))


def told(tried: list[Tried]) -> list[tuple[int, str]]:
    return [(k + 1, text) for k, w in enumerate(tried) for text in w.notes]


def test_it_is_told_within_six_exchanges_and_then_iterated():
    tried = run(OnCycle.ITERATE, (48.0, 1.2))
    (k, text), = told(tried)
    assert k <= FIRES_WITHIN
    assert AGAIN in text
    assert {w.solved.scheme for w in tried[:k]} == {Scheme.STAGGERED}
    assert {w.solved.scheme for w in tried[k:]} == {Scheme.ITERATED}
    assert all(w.accepted for w in tried)
    assert float(tried[-1].solved.state.now.T[0]) == pytest.approx(E4["T"], abs=1e-3)


@pytest.mark.parametrize("T0", [840.0, 849.0, 700.0, 930.0])
def test_it_is_told_within_six_exchanges_from_far_off_too(T0: float):
    """From 849, 700 and 930 K the first two or three windows only come near the steady state."""
    (k, _), = told(run(OnCycle.NOTE, (24.0, 1.2), T0=T0))
    assert k <= FIRES_WITHIN


@pytest.mark.few("930.0-0.98", "700.0-0.9", "831.8-0.5", "840.0-0.98")
@pytest.mark.parametrize("share", [0.5, 0.8, 0.9, 0.98])
@pytest.mark.parametrize("T0", [831.8, 840.0, 849.0, 700.0, 930.0])
def test_below_the_limit_it_only_converges_and_nothing_is_told(share: float, T0: float):
    """At .98 of the limit increments turn round in each window and shrink by 2.4 % in it."""
    assert told(run(OnCycle.NOTE, (60.0 * share, share), T0=T0)) == []


def test_it_is_only_told_where_nothing_else_is_asked_for():
    tried = run(OnCycle.NOTE, (48.0, 1.2))
    assert [k <= FIRES_WITHIN for k, _ in told(tried)] == [True]
    assert {w.solved.scheme for w in tried} == {Scheme.STAGGERED}
    assert sorted(float(w.solved.state.now.T[0]) for w in tried[-2:]) == pytest.approx(E4["cycle_at_1_2"], abs=2e-3)


@pytest.mark.parametrize(("share", "halvings"), [(1.2, 1), (10.0, 4)])
def test_it_is_halved_until_it_ends(share: float, halvings: int):
    tried = run(OnCycle.CUT, (40.0 * share, share))
    back = [w for w in tried if w.solved.verdict is Verdict.CYCLE]
    assert len(back) == halvings
    assert [told([w])[0][1] for w in back] == [w.solved.message for w in back]
    assert f"no window is longer than {share * DT / 2:.3g} s up to the next breakpoint" in back[0].solved.message
    assert pytest.approx(share * DT / 2**halvings) == tried[-1].H
    assert float(tried[-1].solved.state.now.T[0]) == pytest.approx(E4["T"], abs=1e-3)


def test_it_goes_back_where_the_scheme_would_hold():
    tried = run(OnCycle.ITERATE, (7.2, 1.2), (16.0, 0.2))
    (_, _), (back, text) = told(tried)
    assert text.endswith("on with scheme staggered")
    first = next(k for k, w in enumerate(tried) if w.H < 0.5 * DT)
    assert 5 <= back - first <= 6
    assert {w.solved.scheme for w in tried[back:]} == {Scheme.STAGGERED}
    assert float(tried[-1].solved.state.now.T[0]) == pytest.approx(E4["T"], abs=1e-3)


@pytest.mark.parametrize("on", [OnCycle.ITERATE, OnCycle.CUT])
def test_a_kink_ends_it(on: OnCycle):
    kink = 24.0 * DT
    tried = run(on, (40.0, 1.2), kinks=(kink,))
    after = next(w for w in tried if w.t == pytest.approx(kink))
    assert after.solved.scheme is Scheme.STAGGERED
    assert pytest.approx(1.2 * DT, rel=0.05) == after.H


@pytest.mark.few(
    "Scheme.STAGGERED-400", "Scheme.ITERATED-80", "Scheme.EXTRAPOLATED-80", "Scheme.PARALLEL-40",
    "Scheme.MECHANICAL_FIRST-40")
@pytest.mark.parametrize(("scheme", "n"), [(s, n) for s in (
    Scheme.STAGGERED, Scheme.MECHANICAL_FIRST, Scheme.PARALLEL, Scheme.EXTRAPOLATED, Scheme.ITERATED)
    for n in (40, 80, 400)])
def test_two_masses_swing_and_do_not_cycle(scheme: Scheme, n: int):
    """E6, windows of the page's orders (to .4 s in 40 and 80), and four seconds of them."""
    halves = mass("one", 1.0, "x", T_OUT), mass("two", 0.0, "T", X_OUT)
    _, tried = couple(halves, start(1001.0, 0.0), (4.0 if n == 400 else 0.4, n), scheme)
    assert told(tried) == []


def test_halves_that_ring_alone_are_not_iterated_for_it():
    """A thermal half that goes up and down by itself; x does not."""
    halves = lumped(840.0), shrinking(840.0)
    halves[0].rule = lambda s, i, t, h: (-s, {"T": np.array([800.0]) + np.sign(s)})
    halves[1].rule = lambda s, i, t, h: (s, {"x": np.zeros((1, 2))})
    plan = Plan(schedule(20.0, [WindowRange(20.0, 1.0, 1.0)], ()), Scheme.STAGGERED,
                {"thermal": 1, "mechanical": 1}, on_cycle=OnCycle.ITERATE)
    tried = list(windows(wanted_outputs(*halves), replace(start(800.0, 0.0)), plan))
    assert ["the thermal half's own method rings" in text for _, text in told(tried)] == [True]
    assert {w.solved.scheme for w in tried} == {Scheme.STAGGERED}


def test_contact_that_rattles_without_heat_is_told_as_mechanics_and_not_iterated():
    """Gap and pressure are both the mechanical half's: where no temperature goes with them nothing is exchanged."""
    swings = {"temperature": Swing(np.array([0.0]), 0), "gap": Swing(np.array([1e-4]), 4, (1.0,) * 4),
              "pressure": Swing(np.array([1e5]), 4, (1.0,) * 4)}
    settings = Settings(Scheme.STAGGERED, {"thermal": 1, "mechanical": 1})
    done = act(Watch(swings), settings, OnCycle.ITERATE, WindowSummary(9, 4.5, 0.5, True))
    assert done.settings.scheme is Scheme.STAGGERED
    (text,) = done.notes
    assert "bodies or their contact swing by themselves" in text
    assert not any(word in text for word in ("thermal", "sdirk2", "exchange"))


@pytest.mark.parametrize(("covered", "cycling"), [(1e-9, ()), (1.0, ("gap",))])
def test_a_node_that_faces_a_sliver_now_and_then_is_no_cycle(covered: float, cycling: tuple[str, ...]):
    """Beside a falling block's corner a node's gap is that of the block, or gap_max, by rounding."""
    watch, levels = Watch(), []
    for k in range(9):
        gap, part = np.array([0.1 - 1e-3 * k, (0.3, 0.1)[k % 2]]), np.array([1.0, (0.0, covered)[k % 2] if not cycling
                                                                             else covered])
        levels.append(Level(float(k), np.zeros(1), np.zeros((1, 2)), np.zeros(2), gap, part))
        watch = watch.plus(levels[-2], levels[-1]) if k else watch
    assert watch.cycling == cycling
