"""Every scheme of the table: of which order it is in each quantity that crosses, and that its error is estimated so."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "stability"))
from cases import bar
from coupled_run import couple, start
from fake_halves import G_M, K_G, T_S, T_W, C, FakeHalf, G, blocks_of, gap_of, lumped
from true_error import ONE, TIGHT, fine, true_errors

from coupler.control import error_estimate
from coupler.control.auto import CANDIDATES, schemes_under
from coupler.control.solve_window import SavedStates, SolveOptions, doubled, solve_once
from coupler.fmu.half import Block
from coupler.record.tables import WINDOW_FIELDS
from coupler.scenario.options import ErrorTolerances, Scheme, Seen, WindowRange
from coupler.schemes.accounts import EnergyAccount
from coupler.schemes.schedule import schedule
from coupler.schemes.scheme import CouplingScheme
from coupler.schemes.schemes import SCHEMES, scheme_of
from coupler.schemes.state import CoupledState, Halves, Settings, Span, wanted_outputs

THEORY = (Path(__file__).resolve().parents[2] / "docs" / "theory.md").read_text(encoding="utf-8").splitlines()
ROWS = [pytest.param(s, level, id=f"{s.name.value}-{level.value}") for s in SCHEMES for level in s.exchange]
UNIT = 7.4062  # [s] the longest stable window of the stagger with the midpoint rule (case E4)
T_0 = 840.0
END = 4.0


def rate(t: float) -> float:
    """Heat that the mechanical half makes [W]."""
    return 2e5 * (1.0 + t / 10.0)


def energy(t0: float, t1: float) -> float:
    """The same from t0 to t1 [s], in J."""
    return (t1 - t0) * rate(0.5 * (t0 + t1))


def body() -> FakeHalf:
    """The lumped body of case E4 that also takes E_S, a jump of its temperature at the start of a step."""
    half = lumped(T_0)
    step = half.rule

    def rule(state, inputs, t, h):
        return step(state + float(np.sum(inputs.get("E_S", 0.0))) / C, inputs, t, h)

    half.rule = rule
    half.blocks = {**half.blocks, "E_S": Block("E_S", (1,), "J", "input", "Real")}
    return half


def wall(gap: Callable[[float, float], float], heats: bool) -> FakeHalf:
    """x[0, 1] = gap(t, T) at the end of a step; makes heat as E_M, at frozen entropy as E_S."""

    def rule(state, inputs, t, h):
        x = np.array([[0.0, gap(t + h, float(inputs["T"][0]))]])
        made, none = np.array([energy(t, t + h) if heats else 0.0]), np.zeros(1)
        frozen = float(inputs.get("control.mode", 0.0)) == 1.0
        return x, {"x": x, "E_M": none if frozen else made, "E_S": made if frozen else none}

    blocks = blocks_of(Block("T", (1,), "K", "input", "Real"), Block("x", (1, 2), "m", "output", "Real"),
                       Block("E_M", (1,), "J", "output", "Real"), Block("E_S", (1,), "J", "output", "Real"),
                       Block("control.mode", (), "", "input", "Integer"))
    return FakeHalf("wall", blocks, rule, np.array([[0.0, gap(0.0, T_0)]]))


# Problem -> gap(t, T) [m], whether heat is made.
PROBLEMS = {
    "geometry": (lambda t, T: gap_of(T_0) * (1.0 + 0.2 * t), False),  # moves by itself
    "temperature": (lambda t, T: 1.0 + gap_of(T), False),  # moves with T, too far away to be felt
    "heat": (lambda t, T: 1.0, True),
    "all": (lambda t, T: gap_of(T), False),
    "all, with heat": (lambda t, T: gap_of(T), True),
}


def halves(problem: str) -> tuple[FakeHalf, FakeHalf]:
    return body(), wall(*PROBLEMS[problem])


def first(problem: str) -> CoupledState:
    at = start(T_0, PROBLEMS[problem][0](0.0, T_0))
    return replace(at, accounts={n: EnergyAccount(np.zeros(1)) for n in ("E_M", "E_S")})


@cache
def exact(problem: str) -> float:
    """T [K] at the end; x [m] of the problem of the temperature."""
    gap, heats = PROBLEMS[problem]

    def slope(t, T):
        return (G * (T_S - T) - K_G / (max(gap(t, T[0]), 0.0) + G_M) * (T - T_W) + heats * rate(t)) / C

    T = float(solve_ivp(slope, (0.0, END), [T_0], method="DOP853", rtol=1e-12, atol=1e-9).y[0, -1])
    return gap(END, T) if problem == "temperature" else T


def order(problem: str, scheme: CouplingScheme, level: Seen) -> float:
    """log2 of the error in windows of 1/40 s over that in windows half as long."""
    errors = []
    for n in (160, 320):
        end, _ = couple(halves(problem), first(problem), (END, n), scheme.name, how=TIGHT.changed(level=level))
        found = float(end.now.x[0, 1]) if problem == "temperature" else float(end.now.T[0])
        errors.append(abs(found - exact(problem)))
    return math.log2(errors[0] / errors[1])


@pytest.mark.few(
    "staggered-middle-heat", "extrapolated-middle-geometry", "extrapolated-middle-heat", "mechanical_first-middle-heat",
    "parallel-middle-temperature", "iterated-middle-temperature", "iterated-end-geometry", "adiabatic-middle-heat")
@pytest.mark.parametrize("quantity", ["geometry", "temperature", "heat"])
@pytest.mark.parametrize(("scheme", "level"), ROWS)
def test_each_quantity_is_of_the_order_that_the_table_tells(scheme, level, quantity):
    assert order(quantity, scheme, level) == pytest.approx(getattr(scheme.exchange_at(level), quantity).order, abs=0.1)


@pytest.mark.few("extrapolated-middle-False", "iterated-middle-False")
@pytest.mark.parametrize("heats", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("scheme", "level"), ROWS)
def test_a_run_is_of_the_least_of_them(scheme, level, heats):
    told = scheme.exchange_at(level).order(heats)
    assert order("all, with heat" if heats else "all", scheme, level) == pytest.approx(told, abs=0.1)


def honesty(problem: str, scheme: CouplingScheme, level: Seen, H: float) -> list[float]:
    return ratios(wanted_outputs(*halves(problem)), first(problem), scheme, level, H)


def ratios(pair: Halves, state: CoupledState, scheme: CouplingScheme, level: Seen, H: float) -> list[float]:
    """Estimated over true error of T in eight windows; each is solved in two halves too, whose answer is kept."""
    how = TIGHT.changed(level=level)
    options, found = SolveOptions(scheme.name, Settings(scheme.name, ONE, how)), []
    plan = schedule(8 * H, [WindowRange(8 * H, H, H)], ())
    for k0, k1 in pairwise(plan.bounds):
        span = Span(plan.clock, k0, k1, ONE)
        right = fine(pair, state, span)
        with SavedStates(pair, state.now.t, 1) as saved:
            solved = doubled(pair, state, span, options, saved, solve_once(pair, state, span, options, saved))
        told = error_estimate.estimate(error_estimate.Memory(), state, solved, ErrorTolerances(), how)
        found.append(told.errors["temperature"] / true_errors(solved, right, ("temperature",))["temperature"])
        state = solved.state
    return found


@pytest.mark.few("staggered-middle-0.3", "extrapolated-middle-0.3", "iterated-middle-0.3", "adiabatic-middle-0.3")
@pytest.mark.parametrize("share", [pytest.param(0.05, marks=pytest.mark.slow), 0.3])
@pytest.mark.parametrize(("scheme", "level"), ROWS)
def test_the_estimated_error_is_the_true_one_within_a_factor_of_two(scheme, level, share):
    """Of T, in windows of a share of the longest stable one; the first two begin with levels of other schemes."""
    assert 0.5 < np.median(honesty("all", scheme, level, share * UNIT)[2:]) < 2.0


@pytest.mark.few("along_heat-0.1")
@pytest.mark.parametrize("share", [0.1])
@pytest.mark.parametrize("scheme", [s for s in SCHEMES if s.exchange_at(Seen.MIDDLE).order(True)
                                    < s.exchange_at(Seen.MIDDLE).order(False)], ids=lambda s: s.name.value)
def test_heat_that_comes_a_window_late_is_seen_by_the_estimate(scheme, share):
    assert 0.5 < np.median(honesty("all, with heat", scheme, Seen.MIDDLE, share * UNIT)[2:]) < 2.0


@pytest.mark.few("0.1")
@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
def test_the_error_of_the_adiabatic_split_of_a_moving_bar(share):
    """Case E1, where all that acts back is the heat of squeezing."""
    (thermal, mechanical), state = bar(1e-3)
    found = ratios(wanted_outputs(thermal, mechanical), state, scheme_of(Scheme.ADIABATIC), Seen.MIDDLE, share * 1.4706)
    assert 0.5 < np.median(found[2:]) < 2.0


def test_the_table_has_every_name_but_auto():
    assert sorted(s.name.value for s in SCHEMES) == sorted(s.value for s in Scheme if s is not Scheme.AUTO)
    with pytest.raises(KeyError):
        scheme_of(Scheme.AUTO)
    assert {s.name for s in schemes_under(Scheme.AUTO)} == set(CANDIDATES)
    assert [s.name for s in schemes_under(Scheme.PARALLEL)] == [Scheme.PARALLEL]


def test_records_have_room_for_every_name():
    room = int(dict(WINDOW_FIELDS)["scheme"].removeprefix("S"))
    assert max(len(s.value) for s in Scheme) <= room


@pytest.mark.parametrize(("scheme", "level"), ROWS)
def test_the_page_tells_what_the_table_tells(scheme, level):
    """A row of docs/theory.md: the name, three columns in words, the three orders."""
    name = f"`{scheme.name.value}`" + (", `level: end`" if level is Seen.END else "")
    rows = [[cell.strip() for cell in line.strip("| ").split("|")] for line in THEORY if line.startswith(f"| {name} ")]
    told, = ([cell.partition(";")[0] for cell in row[4:]] for row in rows if len(row) == 7)
    e = scheme.exchange_at(level)
    assert told == [str(q.order) for q in (e.geometry, e.temperature, e.heat)]
