"""The scheme auto: what it costs and how near it comes, where it iterates, what it measures and forgets."""

from __future__ import annotations

import math
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.codec import decode, encode, kinds_of
from coupler.control import auto
from coupler.control.auto import (
    LOOSE,
    MAX_GAIN,
    MIN_COUPLING_GAIN,
    Memory,
    choose,
    forgotten,
    learn,
    open_gaps,
    runs_away,
    stable_window,
)
from coupler.scenario.options import Acceleration, Iteration, Scheme, Seen, Tolerance, Tolerances
from coupler.schemes.ledger import MOVED
from coupler.schemes.levels import DAMPED, Level, alternating_gain
from coupler.schemes.state import IterationHistory, Solved, Verdict, Work

sys.path.insert(0, str(Path(__file__).parent))
from coupled_run import couple, start
from fake_halves import A_LAG, B_LAG, T_IN, X_OUT, FakeHalf, blocks_of, echo, gap_of, lumped, shrinking, table

EXPECTED = tomllib.loads((Path(__file__).resolve().parents[1] / "expected.toml").read_text(encoding="utf-8"))
E4, E8 = EXPECTED["E4"], EXPECTED["E8"]
AITKEN = Iteration(acceleration=Acceleration.AITKEN)


def run(end: float, n: int, scheme: Scheme = Scheme.AUTO, T0: float = 840.0, method: str = "midpoint", **more):
    return couple((lumped(T0, method), shrinking(T0)), start(T0, gap_of(T0)), (end, n), scheme, how=AITKEN, **more)


def pairs(tried) -> int:
    """Half-solve pairs, those of windows that only measured and of windows put back too."""
    return sum(w.solved.work.thermal_solves for w in tried)


def schemes(tried) -> list[Scheme]:
    return [w.solved.scheme for w in tried]


@pytest.mark.few("0.001-midpoint", "0.3-backward_euler")
@pytest.mark.parametrize("method", ["backward_euler", "midpoint"])
@pytest.mark.parametrize("off", [1e-3, 0.3])
def test_far_inside_the_limit_a_window_costs_about_one_solve_of_each_half(method, off):
    """E4 off its rest by a share of 400 to 933 K; windows of .1 and .3 of the limit of the lagged gap, to 200 s."""
    spent = []
    for share in (0.1, 0.3):
        H = share * E4["dt_c"][method]
        n = math.ceil(200.0 / H)
        state, tried = run(n * H, n, T0=E4["T"] - off * 533.0, method=method)
        assert float(state.now.T[0]) == pytest.approx(E4["T"], abs=1e-5)
        spent.append(pairs(tried) / n)
    assert max(spent) <= 1.3


def test_at_equal_error_it_costs_less_than_half_of_aitken_in_every_window():
    """E8 to 20 s: Aitken needs 2.5 times the pairs for the error auto has in windows of 1/2 s."""
    state, tried = run(20.0, 40)
    error = abs(float(state.now.T[0]) - E8["T"])
    assert error < 3e-5
    iterated, all_tried = run(20.0, 64, Scheme.ITERATED)
    assert abs(float(iterated.now.T[0]) - E8["T"]) > error
    assert pairs(all_tried) > 2.5 * pairs(tried)


@pytest.mark.parametrize("n", [10, 14, 20])
def test_a_short_run_pays_its_first_measurement_once(n):
    assert pairs(run(20.0, n)[1]) <= 1.3 * n


@pytest.mark.parametrize("factor", [1.0, 3.0, 10.0, 30.0])
def test_beyond_the_limit_it_iterates_and_is_right(factor):
    state, tried = run(factor * E4["dt_c"]["backward_euler"] * 20, 20, method="backward_euler")
    assert float(state.now.T[0]) == pytest.approx(E4["T"], abs=1e-3)
    assert set(schemes(tried)) == {Scheme.ITERATED}
    assert "too much for windows solved once" in tried[-1].reason
    assert not any(w.notes for w in tried)


def test_what_it_measures_is_the_contraction_and_tells_the_stable_window():
    """E4 at rest but for .01 K, midpoint: rho = (b H/2)/(1 + a H/2)."""
    H = 0.5
    _, tried = run(4 * H, 4, T0=E4["T"] + 0.01)
    memory = tried[0].after.control.choice
    rho = (B_LAG * H / 2) / (1 + A_LAG * H / 2)
    assert memory.rho == pytest.approx(rho, rel=1e-3)
    assert (memory.H, memory.driven) == (pytest.approx(H), False)
    assert stable_window(memory) == pytest.approx(H * MAX_GAIN / rho, rel=1e-3)
    assert f"contraction {rho:.2g}, stable up to {H * MAX_GAIN / rho:.2g} s" in tried[1].reason


def test_what_does_not_contract_at_all_is_stable_in_windows_of_any_size():
    choice = choose(Memory(rho=0.0, H=1.0, rest=64), at_two(), 1.0)
    assert choice.reason == "contraction 0, stable in windows of any size"


def test_it_measures_anew_after_a_kink_and_less_and_less_often():
    _, tried = run(100.0, 200, kinks=[50.0])
    measured = [w.number for w in tried if w.solved.scheme is Scheme.ITERATED and w.solved.work.thermal_solves > 1]
    assert 0 in measured
    assert 100 in measured
    apart = np.diff([k for k in measured if k < 100])
    assert all(apart[1:] >= apart[:-1])
    assert "not known yet" in tried[100].reason


def test_at_rest_a_window_costs_one_solve():
    atol = {"temperature": 1e-8, "gap": 1e-10, "pressure": 1.0, "solid_fraction": 1e-8}
    tight = AITKEN.changed(tolerance=Tolerances(**{name: Tolerance(atol=a, rtol=1e-8) for name, a in atol.items()}))
    halves = (lumped(840.0), shrinking(840.0))
    _, tried = couple(halves, start(840.0, gap_of(840.0)), (400.0, 400), Scheme.AUTO, how=tight)
    assert pairs(tried[200:]) == 200
    assert max(w.solved.work.thermal_solves for w in tried) < 10
    resting = replace(tried[-1].after.control.choice, since=1e9)
    assert choose(resting, tried[-1].after.state, 1.0).loose == LOOSE


def test_what_hardly_moves_needs_no_measuring():
    """E4 comes to rest within 40 s: a window at rest counts for nothing towards the next measurement."""
    _, tried = run(400.0, 400, T0=E4["T"] - 5.0)
    since = [w.after.control.choice.since for w in tried]
    assert since[-1] - since[100] < 1e-3
    assert sum(s is Scheme.ITERATED for s in schemes(tried)) <= 4


def test_one_way_it_iterates_once_and_then_never_needs_to():
    """x does not depend on T: the contraction is 0, and what it measures costs two pairs."""
    moves = FakeHalf("moves", blocks_of(T_IN, X_OUT), lambda s, i, t, h: (s, {"x": np.array([[0.0, 1e-5 * (t + h)]])}),
                     np.zeros(1))
    _, tried = couple((lumped(840.0), moves), start(840.0, 0.0), (20.0, 40), Scheme.AUTO)
    assert tried[5].after.control.choice.rho == 0.0
    assert pairs(tried) <= 40 + 5


def test_what_drives_itself_on_is_followed_by_windows_solved_once():
    """T = 900 + 3 (x - 900), x = T: iterates end on the other side of the unstable rest, 900."""
    halves = (table(lambda x: 900.0 + 3.0 * (x - 900.0)), echo())
    away = couple(halves, start(901.0, 901.0), (5.0, 5), Scheme.STAGGERED)[0]
    assert float(away.now.T[0]) == pytest.approx(900.0 + 3.0**5)
    state, tried = couple(halves, start(901.0, 901.0), (5.0, 5), Scheme.AUTO)
    assert float(state.now.T[0]) == pytest.approx(900.0 + 3.0**5)
    assert set(schemes(tried)) == {Scheme.STAGGERED}
    assert tried[0].solved.work.thermal_solves >= 3
    assert runs_away(IterationHistory((), (), 1.5, (1.5, 1.4, -0.1)))
    assert not runs_away(IterationHistory((), (), 1.5, (1.5, -0.4, 1.4)))
    assert not runs_away(IterationHistory((), (), 0.7, (0.7,)))
    assert "drives itself on" in tried[1].reason


def solved(scheme: Scheme, T: float, history: IterationHistory | None = None, touching: int = 0) -> Solved:
    """A window of 1 s that ends at T, with so many pair nodes under pressure."""
    end = replace(start(T, 0.0).now, t=3.0, t_N=np.repeat([-1.0, 0.0], [touching, 20 - touching]) if touching else
                  np.zeros(0))
    return Solved(Verdict.ACCEPTED, "", replace(start(T, 0.0), now=end), (), Work(), {}, history, scheme=scheme)


def at_two() -> object:
    """T = 900 at t = 2 and for two windows of 1 s before."""
    levels = [replace(start(900.0, 0.0).now, t=t) for t in (2.0, 1.0, 0.0)]
    return replace(start(900.0, 0.0), now=levels[0], past=tuple(levels[1:]))


def test_misses_that_turn_round_are_measured_and_then_believed_more_than_rho():
    memory, state = Memory(rho=0.1, H=1.0, rest=64), at_two()
    for sign in (1.0, -1.0, 1.0, -1.0):
        assert choose(memory, state, 1.0).scheme is Scheme.EXTRAPOLATED
        memory = learn(memory, state, solved(Scheme.EXTRAPOLATED, 900.0 + sign), 1.0)
    assert "measured again" in choose(memory, state, 1.0).reason
    small = learn(memory, state, solved(Scheme.ITERATED, 900.0, IterationHistory((), (), 0.1, (-0.1,))), 1.0)
    assert (small.wary, choose(small, state, 1.0).scheme) == (1.0, Scheme.ITERATED)
    assert choose(small, state, 0.4).scheme is Scheme.EXTRAPOLATED
    # What the exchange can hardly feed back is solved once, on the steadiest way that is left.
    tiny = choose(replace(small, rho=0.04), state, 1.0)
    assert tiny.scheme is Scheme.EXTRAPOLATED
    assert 0.04 * alternating_gain([2.0, 1.0, 0.0], 3.0, tiny.extrapolation) <= MIN_COUPLING_GAIN * (1.0 + 1e-12)
    large = learn(memory, state, solved(Scheme.ITERATED, 900.0, IterationHistory((), (), 0.4, (-0.4,))), 1.0)
    assert (large.wary, choose(large, state, 1.0).scheme) == (0.0, Scheme.EXTRAPOLATED)
    rising = replace(state, past=tuple(replace(level, T=level.T - 10.0 * i) for i, level in enumerate(state.past, 1)))
    beside = Memory(rho=0.1, H=1.0, rest=64)
    for sign in (1.0, -1.0, 1.0, -1.0):
        beside = learn(beside, rising, solved(Scheme.EXTRAPOLATED, 910.0 + sign), 1.0)
    assert beside.turns == 0
    quick = Memory(rho=0.1, H=1.0)
    for miss in (1.0, -0.5, 0.25):
        quick = learn(quick, state, solved(Scheme.EXTRAPOLATED, 900.0 + miss), 1.0)
    assert quick.turns == 0


def test_a_gap_of_round_off_is_none():
    """Two bodies as drawn beside each other, 100 mm wide: nodes of a surface lie 1e-17 m off the other."""
    gaps = np.array([1.4e-17, 0.0, 2e-3, 1e-9])
    level = Level(0.0, np.zeros(4), np.diag([0.1, 0.1]), np.zeros(4), gaps, np.ones(4))
    assert open_gaps(level) == pytest.approx(1.0 / 2e-3**2 + 1.0 / 1e-7**2)


@pytest.mark.parametrize("of", [1.0, 1e-5])
def test_misses_count_in_scenes_of_small_differences_too(of):
    """Differences of 100 K, or 1 mK, and misses of 1 K, or 10 uK."""
    def with_differences(level, T):
        return replace(level, T=np.array([300.0 + of * T, 300.0 + of * 100.0]))
    state, memory = at_two(), Memory(rho=0.1, H=1.0, rest=64)
    state = replace(state, now=with_differences(state.now, 0.0),
                    past=tuple(with_differences(level, 0.0) for level in state.past))
    for sign in (1.0, -1.0, 1.0, -1.0):
        window = solved(Scheme.EXTRAPOLATED, 300.0)
        window = replace(window, state=replace(window.state, now=with_differences(window.state.now, sign)))
        memory = learn(memory, state, window, 1.0)
    assert "measured again" in choose(memory, state, 1.0).reason


def test_what_turns_round_without_the_exchange_does_not_make_auto_wary():
    memory, state = Memory(rho=0.004, H=1.0, rest=64), at_two()
    for sign in (1.0, -1.0, 1.0, -1.0):
        memory = learn(memory, state, solved(Scheme.EXTRAPOLATED, 900.0 + sign), 1.0)
    assert choose(memory, state, 1.0).scheme is Scheme.EXTRAPOLATED
    for sign in (1.0, -1.0, 1.0):
        memory = learn(memory, state, solved(Scheme.EXTRAPOLATED, 900.0 + sign), 1.0)
    assert "measured again" in choose(memory, state, 1.0).reason
    memory = learn(memory, state, solved(Scheme.ITERATED, 900.0, IterationHistory((), (), 0.004, (-0.004,))), 1.0)
    assert (memory.wary, choose(memory, state, 1.0).scheme) == (0.0, Scheme.EXTRAPOLATED)


def test_rho_is_asked_for_where_it_is_not_known():
    state = at_two()
    known = Memory(rho=0.1, H=1.0)
    assert choose(known, state, 1.9).scheme is Scheme.EXTRAPOLATED
    # As H^2 beyond twice the window: .1 * 2.4^2 > .55, .005 * 9^2 < .55.
    assert "in windows of 1 s only" in choose(known, state, 2.4).reason
    assert choose(replace(known, rho=0.005), state, 9.0).scheme is Scheme.EXTRAPOLATED
    assert choose(known, replace(state, past=()), 1.0).scheme is Scheme.ITERATED
    assert choose(forgotten(known), state, 1.0).scheme is Scheme.ITERATED
    assert choose(replace(known, rho=0.6), state, 1.0).scheme is Scheme.ITERATED
    assert choose(replace(known, rho=0.5), state, 1.0).extrapolation == DAMPED
    bare = replace(state, **{"now": replace(state.now, t_N=np.zeros(20)),
                             "past": tuple(replace(level, t_N=np.zeros(20)) for level in state.past)})
    touched = learn(known, bare, solved(Scheme.EXTRAPOLATED, 900.0, touching=1), 1.0)
    assert math.isnan(touched.rho)
    slid = learn(replace(known, touching=20), bare, solved(Scheme.EXTRAPOLATED, 900.0, touching=19), 1.0)
    assert slid.rho == 0.1


def test_rho_that_lets_x_only_be_held_is_measured_again_soon():
    """Where it has become smaller since x may be extrapolated; where it is small already nothing is gained."""
    state, held = at_two(), Memory(rho=0.3, H=1.0, rest=64, since=8.0)
    assert "measured again" in choose(held, state, 1.0).reason
    assert choose(replace(held, since=7.0), state, 1.0).extrapolation < 0.0
    assert choose(replace(held, rho=0.1), state, 1.0).scheme is Scheme.EXTRAPOLATED
    assert "measured again" in choose(replace(held, rho=0.1, since=64.0), state, 1.0).reason


def test_rho_is_forgotten_where_open_gaps_feed_back_much_more_or_less_and_measured_where_a_window_was_put_back():
    """Heat across a gap changes with it by 1/gap^2: 3 um in place of 4 feed back 1.8 times as much, 1 um 16 times."""
    def over(gap: float, **more: object):
        one = solved(Scheme.EXTRAPOLATED, 900.0)
        now = replace(one.state.now, gap=np.array([gap, np.inf, 1e-9]), covered=np.array([1.0, 1.0, 0.0]))
        return replace(one, state=replace(one.state, now=now), **more)

    state, known = at_two(), Memory(rho=0.1, H=1.0, gaps=1.0 / 4e-6**2)
    assert learn(known, state, over(3e-6), 1.0).rho == 0.1
    for gap in (1e-6, 16e-6):
        assert math.isnan(learn(known, state, over(gap), 1.0).rho)
    measured = over(1e-6, scheme=Scheme.ITERATED, history=IterationHistory((), (), 0.2, (-0.2,)))
    memory = learn(known, state, measured, 1.0)
    assert memory.gaps == pytest.approx(1e12)
    assert learn(memory, state, over(1e-6), 1.0).rho == 0.2
    assert choose(known, state, 1.0).scheme is Scheme.EXTRAPOLATED
    assert "measured again" in choose(auto.rejected(known), state, 1.0).reason


def test_a_front_that_has_just_begun_is_not_held_where_it_is():
    """With one level behind and rho too large for the line through it."""
    memory, two = Memory(rho=0.3, H=1.0, since=0.0, rest=1), at_two()
    now, before = (replace(level, f_s=np.array([f])) for level, f in ((two.now, 0.5), (two.past[0], 0.0)))
    assert choose(memory, replace(two, now=now, past=(before,)), 1.0).scheme is Scheme.ITERATED
    assert choose(memory, replace(two, now=now, past=(before, two.past[1])), 1.0).scheme is Scheme.EXTRAPOLATED
    assert choose(memory, replace(two, now=now, past=(replace(now, t=1.0),)), 1.0).scheme is Scheme.EXTRAPOLATED
    line = choose(replace(memory, rho=0.1), replace(two, now=now, past=(before,)), 1.0)
    assert (line.scheme, line.extrapolation) == (Scheme.EXTRAPOLATED, 0.0)


def test_where_rho_grows_it_is_measured_before_it_is_too_large():
    history = IterationHistory((), (), 0.2, (-0.2,))
    memory = learn(Memory(rho=0.1, H=1.0, since=4.0, rest=32), at_two(), solved(Scheme.ITERATED, 901.0, history), 1.0)
    assert memory.growth == pytest.approx(math.log(2.0) / 5)
    assert memory.rest == int(0.5 * math.log(MAX_GAIN / 0.2) / memory.growth)
    seen_at_end = learn(Memory(), at_two(), solved(Scheme.ITERATED, 900.0, history), 1.0, Seen.END)
    assert seen_at_end.rho == 0.1


def test_ratios_that_agree_are_believed_and_a_single_one_only_half():
    def told(*ratios: float) -> float:
        history = IterationHistory((), (), max(abs(r) for r in ratios), ratios)
        return learn(Memory(rho=0.3, H=1.0), at_two(), solved(Scheme.ITERATED, 900.0, history), 1.0).rho

    assert told(-0.9, -0.645, -0.644) == 0.644
    assert told(-0.9, -0.5, -0.4) == 0.9
    assert (told(-0.4), told(-0.02)) == (0.4, 0.15)


def test_one_small_ratio_does_not_tell_what_drives_itself_on():
    """It may be of a miss that the exchange has nothing to do with: 0.01 after 0.3 that turned round."""
    def told(ratio: float, driven: bool) -> bool:
        history = IterationHistory((), (), abs(ratio), (ratio,))
        return learn(Memory(rho=0.3, H=1.0, driven=driven), at_two(), solved(Scheme.ITERATED, 900.0, history),
                     1.0).driven

    assert [told(0.01, False), told(-0.01, True)] == [False, True]
    assert [told(0.3, False), told(-0.3, True)] == [True, False]


def test_what_drives_itself_on_is_followed_in_windows_like_those_it_was_measured_in():
    """In windows three times as long rho is only reckoned, nine times as large: those are iterated to measure it."""
    memory = Memory(rho=0.3, H=1.0, driven=True, rest=64)
    assert choose(memory, at_two(), 2.0).scheme is Scheme.STAGGERED
    assert choose(memory, at_two(), 3.0).scheme is Scheme.ITERATED


def test_heat_of_squeezing_comes_in_its_own_window_where_two_iterates_agree():
    """Windows solved once hand it over a window late, of first order; errors must be known for it to be worth it."""
    state = at_two()
    memory = Memory(rho=0.01, H=1.0, squeezed=0.1)
    assert choose(memory, state, 1.0, weighs=True).scheme is Scheme.ITERATED
    assert choose(memory, state, 1.0).scheme is Scheme.EXTRAPOLATED
    assert choose(replace(memory, squeezed=0.01), state, 1.0, weighs=True).scheme is Scheme.EXTRAPOLATED
    assert choose(replace(memory, rho=0.2), state, 1.0, weighs=True).scheme is Scheme.EXTRAPOLATED
    # 1 J made where nodes took up and gave off 4 J; friction is handed over ahead and counts for nothing.
    now = replace(state, now=replace(state.now, t=state.now.t + 2.0), past=(state.now, *state.past), accounts={
        "E_M": replace(state.accounts["E_M"], power=np.array([0.25, -0.25])),
        "contact.E_friction": replace(state.accounts["E_M"], power=np.array([9.0]))})
    window = replace(solved(Scheme.EXTRAPOLATED, 900.0), state=now, terms=({MOVED: 4.0},))
    assert learn(Memory(rho=0.01, H=1.0), state, window, 2.0).squeezed == 0.25


def test_the_last_window_of_friction_hands_over_what_it_makes():
    """Handed ahead, heat that then is not made is never taken back: 0.117 of 3510 J of two blocks (two_pass)."""
    state, memory = at_two(), Memory(rho=0.01, H=1.0)
    made = replace(state, accounts={"contact.E_friction": replace(state.accounts["E_M"], power=np.array([9.0]))})
    assert choose(memory, made, 1.0, breaks=True).scheme is Scheme.ITERATED
    assert choose(memory, made, 1.0).scheme is Scheme.EXTRAPOLATED
    assert choose(memory, state, 1.0, breaks=True).scheme is Scheme.EXTRAPOLATED
    driven = replace(memory, rho=1.0, driven=True, rest=1)
    assert choose(driven, made, 1.0, breaks=True).scheme is not Scheme.ITERATED


def test_entropy_is_frozen_where_heat_of_squeezing_acts_back_and_halves_can():
    state, memory = at_two(), Memory(rho=0.1, H=1.0)
    made = replace(state, accounts={"E_M": replace(state.accounts["E_M"], made=1.0)})
    assert choose(memory, made, 1.0, freezes=True).scheme is Scheme.ADIABATIC
    assert choose(memory, made, 1.0).scheme is Scheme.EXTRAPOLATED
    assert choose(memory, state, 1.0, freezes=True).scheme is Scheme.EXTRAPOLATED
    assert choose(replace(memory, rho=0.45), made, 1.0, freezes=True).scheme is Scheme.EXTRAPOLATED
    # Three iterates of second order do without the split's first.
    assert choose(replace(memory, rho=0.05), made, 1.0, freezes=True).scheme is Scheme.EXTRAPOLATED
    frozen = replace(state, accounts={**state.accounts, "E_S": replace(state.accounts["E_M"], made=1.0)})
    assert choose(memory, frozen, 1.0, freezes=True).scheme is Scheme.ADIABATIC


def test_the_memory_goes_through_a_checkpoint():
    _, tried = run(20.0, 20)
    memory = tried[-1].after.control.choice
    back = decode(encode(memory), kinds_of([Memory]))
    assert encode(back) == encode(memory)
    assert choose(back, tried[-1].after.state, 1.0) == choose(memory, tried[-1].after.state, 1.0)
    assert auto.loosened(AITKEN, LOOSE).LEAST == 2
