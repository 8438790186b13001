"""Power of friction that is handed over before it is made: along its line, in windows of any sizes, where it may be."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))

from fake_halves import FakeHalf

from coupler.control.auto import Memory, choose, learn
from coupler.control.contact_status import pressed
from coupler.fmu.half import Block
from coupler.running.setup import accounts_of
from coupler.scenario.options import Iteration, Scheme, WindowRange
from coupler.schemes.accounts import EnergyAccount, Foreseen
from coupler.schemes.levels import Level, largest_trend
from coupler.schemes.schedule import schedule
from coupler.schemes.scheme import WindowTask
from coupler.schemes.schemes import solve_extrapolated
from coupler.schemes.state import CoupledState, IterationHistory, Solved, Span, Verdict, Work, wanted_outputs

SIZES = (1.0, 0.5, 2.0, 2.0, 0.3, 1.7, 0.9)
SURFACE = Block("contact.E_friction", (2,), "J", "input", "Real")


def made(t: float, H: float, steps: int, at_end: bool) -> float:
    """Heat of power 1 + 3 t [W] in a window of so many steps, by the power in or at the end of each [J]."""
    h = H / steps
    return sum(h * (1.0 + 3.0 * (t + h * (k + (1.0 if at_end else 0.5)))) for k in range(steps))


@pytest.mark.parametrize(("steps", "at_end"), [(1, False), (1, True), (2, False)])
def test_power_on_a_line_is_handed_over_in_time_whatever_the_windows(steps: int, at_end: bool) -> None:
    """From the third window on each is handed what it makes by the trapezoidal rule, however its size changes."""
    account, t = EnergyAccount(np.zeros(1), at_end=at_end), 0.0
    for i, H in enumerate(SIZES):
        due = account.due(Foreseen(H, 1.0))
        if i > 2:
            late = 0.0 if account.late is None else float(account.late[0])
            assert float(account.carry[0]) == pytest.approx(late, abs=1e-12)
            assert float(due[0]) == pytest.approx(H * (1.0 + 3.0 * (t + 0.5 * H)), rel=1e-12)
        account = account.deliver(due, account.late)
        account = account.make(np.array([made(t, H, steps, at_end)]), H, H / steps, fresh=i == 0)
        t += H


def test_held_power_is_late_by_another_amount_in_every_window_of_another_size() -> None:
    """What the trend is for: with power held what is late goes with H^2, and each change of H is a jolt of heat."""
    account, t, carried = EnergyAccount(np.zeros(1)), 0.0, []
    for i, H in enumerate((1.0, 1.0, 1.0, 2.0, 2.0, 1.0)):
        account = account.deliver(account.due(Foreseen(H)), None).make(np.array([made(t, H, 1, False)]), H, H, i == 0)
        carried.append(float(account.carry[0]))
        t += H
    assert carried[2:] == pytest.approx([3.0, 9.0, 12.0, 4.5])


def test_where_nothing_is_known_of_the_window_before_power_is_held() -> None:
    account = EnergyAccount(np.zeros(1)).make(np.array([2.0]), 1.0, 1.0, fresh=True)
    assert account.slope is None
    assert account.deliver(account.carry, None).due(Foreseen(3.0, 1.0)) == pytest.approx(6.0)


def test_the_scheme_extrapolates_power_as_far_as_geometry() -> None:
    """Power of 1 W in a window of 1 s, of 2 W in the next: 3 W along the line, 2 W held, 2.5 W in between."""
    def handed(extrapolation: float) -> float:
        got: list[float] = []

        def takes(state, inputs, t, h):
            got.append(float(np.sum(inputs["contact.E_friction"])))
            return state, {"T": np.array([300.0])}

        def rubs(state, inputs, t, h):
            return state, {"x": np.zeros((1, 2)), "contact.E_friction": np.full(2, 0.5 * (t + 1.0))}

        thermal = FakeHalf("takes", {b.name: b for b in (
            Block("T", (1,), "K", "output", "Real"), Block("x", (1, 2), "m", "input", "Real"), SURFACE)}, takes,
                           np.zeros(1))
        mechanical = FakeHalf("rubs", {b.name: b for b in (
            Block("T", (1,), "K", "input", "Real"), Block("x", (1, 2), "m", "output", "Real"),
            replace(SURFACE, causality="output"))}, rubs, np.zeros(1))
        return scheme_run(thermal, mechanical, extrapolation, got)

    assert [handed(e) for e in (1.0, 0.5, 0.0, -1.0)] == pytest.approx([3.0, 2.5, 2.0, 2.0])


def scheme_run(thermal: FakeHalf, mechanical: FakeHalf, extrapolation: float, got: list[float]) -> float:
    """What the third window of 1 s is handed beyond what is carried [J]."""
    now = Level(0.0, np.array([300.0]), np.zeros((1, 2)), np.zeros(0), np.zeros(0), np.zeros(0))
    halves, carry = wanted_outputs(thermal, mechanical), 0.0
    state, plan = CoupledState(now, (), 0, accounts_of(mechanical, 1)), schedule(3.0, [WindowRange(3.0, 1.0, 1.0)], ())
    for k0, k1 in pairwise(plan.bounds):
        carry = float(state.accounts["contact.E_friction"].carry.sum())
        span = Span(plan.clock, k0, k1, {"thermal": 1, "mechanical": 1})
        state = solve_extrapolated(WindowTask(halves, state, span, Iteration(), lambda why: None, extrapolation)).state
    return got[-1] - carry


def test_the_trend_is_no_longer_than_what_alternates_allows() -> None:
    """In windows of one size (2 + 2 trend) is seen of what iterates feel 1/2 of: 4 and 8 times."""
    even = [2.0, 1.0, 0.0]
    assert largest_trend(even, 3.0, 8.0) == pytest.approx(1.0)
    assert largest_trend(even, 3.0, 6.0) == pytest.approx(0.5)
    assert largest_trend(even, 3.0, 3.9) == 0.0
    assert largest_trend(even, 3.0, math.inf) == 1.0
    assert largest_trend(even, 2.4, 6.5) == 0.0
    for end in (2.7, 3.0, 4.5):
        trend = largest_trend(even, end, 6.5)
        assert alternates(trend, end - 2.0) == pytest.approx(6.5)


def alternates(trend: float, r: float) -> float:
    """Heat handed over in a window r times the last one of 1 s, where power is 1, -1, 1 at the ends of windows, over
    half of its size, what iterates feel."""
    account = EnergyAccount(np.zeros(1), at_end=True)
    for k in range(60):
        account = account.deliver(handed(account, 1.0, trend), account.late)
        account = account.make(np.array([(-1.0) ** k]), 1.0, 1.0, fresh=k == 0)
    return abs(float(handed(account, r, trend)[0])) / (0.5 * r)


def handed(account: EnergyAccount, H: float, trend: float) -> np.ndarray:
    """As `due`, also where it is below 0: a constant power keeps all of it above."""
    much = 1e6
    assert account.power is None or account.slope is not None or account.late is None
    lifted = replace(account, power=None if account.power is None else account.power + much)
    return lifted.due(Foreseen(H, trend)) - (0.0 if account.power is None else H * much)


def at(t_N: tuple[float, ...] = (), power: float = 0.0) -> CoupledState:
    """T = 900 at t = 2 and for two windows of 1 s before."""
    levels = [Level(t, np.array([900.0]), np.zeros((1, 2)), np.array(t_N), np.zeros(len(t_N)), np.zeros(len(t_N)))
              for t in (2.0, 1.0, 0.0)]
    account = EnergyAccount(np.zeros(1), made=power, power=np.array([power]))
    return CoupledState(levels[0], tuple(levels[1:]), 0, {"contact.E_friction": account})


def test_auto_extrapolates_no_further_than_power_of_friction_allows() -> None:
    """With rho 0.08 an alternation may be seen 5 times: 3.5 is the parabola of x, and of power 8."""
    known = Memory(rho=0.08, H=1.0)
    assert choose(known, at(), 1.0).extrapolation == 1.0
    assert choose(known, at(power=1.0), 1.0).extrapolation == pytest.approx(largest_trend([2.0, 1.0, 0.0], 3.0, 5.0))
    assert choose(replace(known, rho=0.05), at(power=1.0), 1.0).extrapolation == pytest.approx(1.0)
    assert choose(replace(known, rho=0.3), at(power=1.0), 1.0).extrapolation == choose(
        replace(known, rho=0.3), at(), 1.0).extrapolation < 0.0


def test_what_touches_is_counted_in_nodes() -> None:
    """Two nodes under pressure and one without are two, whatever number of quadrature points lie between them."""
    assert pressed(at((-1.0, -2.0, 0.0)).now) == 2
    known = Memory(rho=0.1, H=1.0, touching=2)
    once = Solved(Verdict.ACCEPTED, "", at((-1.0, -2.0)), (), Work(), {"touching": 4.0}, scheme=Scheme.EXTRAPOLATED)
    assert learn(known, at((-1.0, -2.0)), once, 1.0).rho == 0.1
    assert math.isnan(learn(known, at((-1.0, -2.0)), replace(once, state=at((-1.0, 0.0))), 1.0).rho)


def test_rho_of_halves_is_told_of_the_whole_window() -> None:
    """Twice of what it is in half of it, its most.  Told of half a window, one that grows was four times unknown."""
    halves = Solved(Verdict.ACCEPTED, "", at(), (), Work(), {}, IterationHistory((), (), 0.1, (-0.1,)),
                    scheme=Scheme.ITERATED)
    found = learn(Memory(), at(), replace(halves, whole=halves), 1.0)
    assert (found.rho, found.H) == (0.2, 1.0)
    found = learn(Memory(), at(), halves, 1.0)
    assert (found.rho, found.H) == (0.1, 1.0)
