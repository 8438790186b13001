"""Schemes that solve each half once: order, limits of stability, what each half sees; and cycles noticed."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler.control.two_cycle import Swing, Watch, note, swung, two_cycles
from coupler.scenario.options import Scheme
from coupler.schemes.levels import Level, geometry_at, predicted
from coupler.schemes.state import Verdict

sys.path.insert(0, str(Path(__file__).parent))
from coupled_run import couple, start
from fake_halves import A_LAG, B_LAG, gap_of, lumped, shrinking

EXPECTED = tomllib.loads((Path(__file__).resolve().parents[1] / "expected.toml").read_text(encoding="utf-8"))
E4, E8 = EXPECTED["E4"], EXPECTED["E8"]


def run(scheme: Scheme, end: float, n: int, T0: float = 840.0, method: str = "midpoint", heat: float = 0.0, **more):
    return couple((lumped(T0, method), shrinking(T0, heat)), start(T0, gap_of(T0)), (end, n), scheme, **more)


def swing(scheme: Scheme, dt: float, method: str, n: int = 200) -> float:
    """The last change of T from window to window [K], from .1 K off the steady state."""
    _, tried = run(scheme, n * dt, n, E4["T"] + 0.1, method)
    a, b = (float(w.solved.state.now.T[0]) for w in tried[-2:])
    return abs(a - b)


@pytest.mark.few("Scheme.STAGGERED-midpoint-0.98", "Scheme.EXTRAPOLATED-midpoint-2.01")
@pytest.mark.parametrize(("scheme", "method", "order"), [
    (Scheme.STAGGERED, "midpoint", E8["order_staggered"]), (Scheme.STAGGERED, "backward_euler", E8["order_staggered"]),
    (Scheme.MECHANICAL_FIRST, "midpoint", 1.0), (Scheme.PARALLEL, "midpoint", 1.0),
    (Scheme.EXTRAPOLATED, "midpoint", E8["order_extrapolated"])])
def test_order_of_the_coupling(scheme, method, order):
    n = E8["n"][-2:] if order != 1.0 else (640, 1280)
    coarse, fine = (abs(float(run(scheme, 20.0, k, method=method)[0].now.T[0]) - E8["T"]) for k in n)
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.03)
    assert fine < (2e-5 if order > 1.5 else 1e-3)


LIMITS = [  # of a small disturbance, see docs/theory.md
    (Scheme.STAGGERED, "backward_euler", E4["dt_c"]["backward_euler"]),
    (Scheme.STAGGERED, "midpoint", E4["dt_c"]["midpoint"]),
    (Scheme.PARALLEL, "backward_euler", 1 / (B_LAG - A_LAG)),
    (Scheme.MECHANICAL_FIRST, "backward_euler", 1 / (B_LAG / 2 - A_LAG)),
    (Scheme.EXTRAPOLATED, "midpoint", 1 / B_LAG),
]


@pytest.mark.few(
    "Scheme.STAGGERED-backward_euler-10.2449", "Scheme.EXTRAPOLATED-midpoint-3.703098339741418",
    "Scheme.MECHANICAL_FIRST-backward_euler-16.612197270258704")
@pytest.mark.parametrize(("scheme", "method", "limit"), LIMITS, ids=lambda v: v if isinstance(v, str) else None)
def test_limits_of_stability_are_where_theory_puts_them(scheme, method, limit):
    assert swing(scheme, 0.95 * limit, method) < 0.02
    assert swing(scheme, 1.05 * limit, method) > 1.0


@pytest.mark.parametrize("method", ["backward_euler", "midpoint"])
def test_below_its_limit_the_lagged_gap_converges_to_the_steady_state(method):
    state, tried = run(Scheme.STAGGERED, 0.8 * E4["dt_c"][method] * 200, 200, method=method)
    assert float(state.now.T[0]) == pytest.approx(E4["T"], abs=1e-6)
    assert float(state.now.x[0, 1]) == pytest.approx(E4["g"], abs=1e-11)
    assert not any(w.notes for w in tried)


@pytest.mark.parametrize(("factor", "cycle"), [(1.2, E4["cycle_at_1_2"]), (10.0, E4["cycle_at_10"])])
def test_beyond_its_limit_it_cycles_and_that_is_noticed(factor, cycle):
    _, tried = run(Scheme.STAGGERED, factor * E4["dt_c"]["backward_euler"] * 200, 200, method="backward_euler")
    last = sorted(float(w.solved.state.now.T[0]) for w in tried[-2:])
    assert last == pytest.approx(cycle, abs=2e-3)
    told = [(w.number + 1, text) for w in tried for text in w.notes]
    assert len(told) == 1
    number, text = told[0]
    assert text.startswith(f"windows {number - 3} to {number} (to t = ")
    assert "temperature by" in text
    assert "gap by" in text
    assert "scheme: iterated" in text
    # The same from the recorded exchange.
    levels = [start(840.0, gap_of(840.0)).now, *(w.solved.state.now for w in tried)]
    assert list(two_cycles(levels)) == [(number, ("temperature", "gap"))]


def test_what_swings_slowly_or_dies_is_no_cycle():
    t = np.arange(40.0)
    for T in (np.sin(t * 2 * np.pi / 8), (-0.6) ** t, (-0.7) ** t, (-0.85) ** t, (-0.98) ** t, 1e-8 * (-1) ** t, t):
        levels = [level(float(k), v) for k, v in zip(t, T, strict=True)]
        assert list(two_cycles(levels)) == []
    assert list(two_cycles([level(float(k), (-1) ** k) for k in range(40)])) == [(4, ("temperature",))]


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3])
def test_a_cycle_is_seen_in_a_scene_of_any_size(size):
    """Of 100 mm, or 100 nm, with differences of 100 K or 0.1 mK, and 1 MPa or 1 Pa; smaller ones are none."""
    def levels(share):
        swing = [share * size * (-1.0) ** k for k in range(40)]
        return [Level(float(k), np.array([900.0, 900.0 + 100.0 * size]) + 100.0 * s, size * np.diag([0.1, 0.1]),
                      -1e6 * (size + s) * np.ones(1), 1e-3 * s * np.ones(1), np.ones(1)) for k, s in enumerate(swing)]
    assert list(two_cycles(levels(1e-3))) == [(4, ("temperature", "pressure", "gap"))]
    assert list(two_cycles(levels(1e-6))) == []


def test_what_grows_is_told_a_turn_before_what_settles():
    growing, settling = ([level(float(k), T) for k, T in enumerate(T)] for T in (
        np.cumsum((-1.05) ** np.arange(8.0)), (-1.0) ** np.arange(16.0) * (1.0 + 0.5 ** np.arange(16.0))))
    assert list(two_cycles(growing)) == [(4, ("temperature",))]
    (number, _), = two_cycles(settling)
    assert number <= 10


def level(t: float, T: float) -> Level:
    return Level(t, np.array([900.0 + T]), np.array([[0.0, 0.01 * t]]), np.zeros(1), np.zeros(1), np.zeros(1))


def test_a_temperature_that_rings_alone_is_told_as_such():
    watch = Watch({"temperature": Swing(np.array([3.0]), 4, (1.0,) * 4), "pressure": Swing(np.array([0.0]), 0)})
    assert "the thermal half's own method rings" in note(watch, 9, 4.5)
    assert note(watch, 9, 4.5).startswith("windows 5 to 9 (to t = 4.5 s) go up and down, temperature by 3 K: ")


def test_turns_are_counted_over_opposite_increments_of_lasting_size():
    a, b = np.array([1.0, -2.0]), np.array([-0.9, 1.9])
    assert swung(Swing(a, 2), b, 1e-3).turns == 3
    assert swung(Swing(a, 5, (1.0, 1.1, 1.2, 1.3)), 2.0 * a - 4.0 * a, 1e-3).ratios == (1.1, 1.2, 1.3, 2.0)
    assert swung(Swing(a, 2, (1.0, 1.0)), 0.5 * b, 1e-3).ratios == ()
    assert swung(Swing(a, 2), 0.5 * b, 1e-3).turns == 0
    assert swung(Swing(a, 2), a, 1e-3).turns == 0
    assert swung(Swing(a, 2), np.array([2.0, 1.0]), 1e-3).turns == 0
    assert swung(Swing(1e-6 * a, 2), 1e-6 * b, 1e-3).turns == 0


def seen(scheme: Scheme) -> tuple[list[float], list[float]]:
    """What the halves were given in the second window: x of the thermal, T of the mechanical substeps."""
    x, T = [], []
    thermal, mechanical = lumped(840.0), shrinking(840.0)
    for half, into, name, at in ((thermal, x, "x", (0, 1)), (mechanical, T, "T", 0)):
        half.rule = watched(half.rule, into, name, at)
    couple((thermal, mechanical), start(840.0, gap_of(840.0)), (2.0, 2), scheme, substeps=(2, 2))
    return x[2:], T[2:]


def watched(rule, into: list, name: str, at):
    def told(state, inputs, t, h):
        into.append(float(inputs[name][at]))
        return rule(state, inputs, t, h)

    return told


def test_what_the_halves_see_of_each_other():
    """Second of two windows, two substeps of each half; T_1, T_2 at the ends of the windows, g = gap_of(T)."""
    for scheme in (Scheme.STAGGERED, Scheme.EXTRAPOLATED, Scheme.MECHANICAL_FIRST, Scheme.PARALLEL):
        _, tried = couple((lumped(840.0), shrinking(840.0)), start(840.0, gap_of(840.0)), (2.0, 2), scheme,
                          substeps=(2, 2))
        (x_1, T_1), (x_2, T_2) = ((float(w.solved.state.now.x[0, 1]), float(w.solved.state.now.T[0])) for w in tried)
        x_0 = gap_of(840.0)
        x, T = seen(scheme)
        assert x == pytest.approx({
            Scheme.STAGGERED: [x_1, x_1], Scheme.PARALLEL: [x_1, x_1],
            Scheme.EXTRAPOLATED: [x_1 + 0.25 * (x_1 - x_0), x_1 + 0.75 * (x_1 - x_0)],
            Scheme.MECHANICAL_FIRST: [x_1 + 0.25 * (x_2 - x_1), x_1 + 0.75 * (x_2 - x_1)]}[scheme], rel=1e-12)
        held = scheme in (Scheme.MECHANICAL_FIRST, Scheme.PARALLEL)
        assert ([T_1, T_1] if held else pytest.approx([(T_1 + T_2) / 2, T_2], rel=1e-14)) == T


@pytest.mark.parametrize("scheme", [Scheme.STAGGERED, Scheme.PARALLEL])
def test_heat_of_a_window_is_due_in_the_next(scheme):
    state, tried = run(scheme, 20.0, 5, heat=1e4)
    given = [sum(terms["heat.mechanical"] for terms in w.solved.terms) for w in tried]
    assert given == pytest.approx([0.0, 4e4, 4e4, 4e4, 4e4], rel=1e-10)
    assert state.accounts["E_M"].carry.sum() == pytest.approx(4e4, rel=1e-10)


@pytest.mark.parametrize("scheme", [Scheme.MECHANICAL_FIRST, Scheme.PARALLEL])
def test_a_discard_puts_both_back_whoever_went_first(scheme):
    plain = run(scheme, 16.0, 32)[0].now.T
    for thermal, mechanical, verdict in ((lumped(840.0, h_max=0.6), shrinking(840.0), Verdict.THERMAL_DISCARD),
                                         (lumped(840.0), shrinking(840.0, h_max=0.6), Verdict.MECHANICAL_DISCARD)):
        state, tried = couple((thermal, mechanical), start(840.0, gap_of(840.0)), (16.0, 16), scheme)
        assert [w.solved.verdict for w in tried[:3]] == [verdict, Verdict.ACCEPTED, Verdict.ACCEPTED]
        assert state.now.T.tobytes() == plain.tobytes()


def test_predictions_stay_in_bounds():
    a = replace(level(0.0, 0.0), T=np.array([900.0, 500.0]), t_N=np.array([-3.0]), f_s=np.array([0.2, 0.5]))
    b = replace(a, t=1.0, T=np.array([100.0, 510.0]), t_N=np.array([-1.0]), f_s=np.array([0.7, 0.1]))
    p = predicted(b, a, 2.0)
    assert p.t_N.tolist() == [0.0]
    assert p.f_s is not None
    assert p.f_s.tolist() == [1.0, 0.0]
    assert p.T.tolist() == [100.0, 520.0]
    assert geometry_at(b, (a, b), 3.0)[1].tolist() == [0.0]
    assert predicted(b, None, 2.0).T is b.T
