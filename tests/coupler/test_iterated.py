"""Iterated windows: order, number of iterates, acceleration, verdicts, rollback, heat (cases E4, E6, E8)."""

from __future__ import annotations

import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario, run
from coupler.cli.console import summary
from coupler.control.loop import Tried
from coupler.errors import CouplingError
from coupler.report.page import render
from coupler.scenario.options import Acceleration, Iteration, OnMax, Scheme, Tolerance, Tolerances
from coupler.schemes.state import CoupledState, Verdict

sys.path.insert(0, str(Path(__file__).parent))
from coupled_run import couple, start
from fake_halves import (
    A_LAG,
    B_LAG,
    E_ALPHA,
    T_IN,
    T_OUT,
    X_OUT,
    FakeHalf,
    echo,
    gap_of,
    lumped,
    mass,
    pressed,
    pressing,
    shrinking,
    table,
)

pytestmark = pytest.mark.usefixtures("unlooked")

ROOT = Path(__file__).resolve().parents[2]
EXPECTED = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))
E4, E6, E8 = (EXPECTED[row] for row in ("E4", "E6", "E8"))
LOOSE = Tolerance(atol=1.0, rtol=1.0)
TIGHT = Tolerances(temperature=Tolerance(atol=E4["aitken_tolerance"], rtol=0.0), gap=LOOSE,
                   pressure=LOOSE, solid_fraction=LOOSE)
HOW = Iteration(acceleration=Acceleration.AITKEN, tolerance=TIGHT)


def iterate(T0: float, end: float, n: int = 1, how: Iteration = HOW, method: str = "midpoint",
            **more: object) -> tuple[CoupledState, list[Tried]]:
    """Case E4 from T0, iterated over n windows."""
    halves = (lumped(T0, method), shrinking(T0))
    return couple(halves, start(T0, gap_of(T0)), (end, n), Scheme.ITERATED, how=how, **more)


def counts(tried: list[Tried]) -> list[int]:
    return [len(w.solved.history.misfits) for w in tried]


@pytest.mark.parametrize("row", E4["aitken_at_10_dt_c"], ids=lambda row: f"{row['T0']:g} K")
@pytest.mark.parametrize("kind", [Acceleration.AITKEN, Acceleration.IQN_ILS])
def test_ten_times_the_limit_of_the_lagged_gap_in_few_iterates(row, kind):
    _, tried = iterate(row["T0"], 10 * E4["dt_c"]["backward_euler"], how=HOW.changed(acceleration=kind),
                       method="backward_euler")
    assert tried[0].solved.verdict is Verdict.ACCEPTED
    assert counts(tried)[0] <= row["most"]
    assert tried[0].solved.history.misfits[-1]["temperature"] <= 1.0


def test_plain_iteration_does_not_converge_there():
    how = HOW.changed(acceleration=Acceleration.NONE, on_max=OnMax.STOP)
    words = r"window 1 at t = 0 s, iteration 30: not converged: after 30 iterations .* multiplies"
    with pytest.raises(CouplingError, match=words) as told:
        iterate(840.0, 10 * E4["dt_c"]["backward_euler"], how=how, method="backward_euler")
    assert told.value.iteration == 30
    assert max(told.value.residuals) > 1e10


def test_one_that_smaller_windows_do_not_help_is_told_to_iterate_on():
    """One iterate is too few in a window of any size."""
    with pytest.raises(CouplingError, match=r"not converged.* Give more iterations \(coupling\.iteration\.max_it"):
        iterate(840.0, 10 * E4["dt_c"]["backward_euler"], how=HOW.changed(max_iterations=1), method="backward_euler")


def test_windows_far_beyond_the_limit_reach_the_steady_state():
    state, tried = iterate(840.0, 10 * E4["dt_c"]["backward_euler"] * 60, 60, method="backward_euler")
    assert float(state.now.T[0]) == pytest.approx(E4["T"], abs=1e-6)
    assert float(state.now.x[0, 1]) == pytest.approx(E4["g"], abs=1e-11)
    assert not any(w.notes for w in tried)
    # At rest the prediction is the answer: one iterate, one solve of each half.
    assert counts(tried)[-1] == 1


@pytest.mark.few("substeps0")
@pytest.mark.parametrize("substeps", [(1, 1), (2, 3)])
def test_iterated_is_second_order_with_the_midpoint_rule(substeps):
    errors = [abs(float(iterate(840.0, 20.0, n, substeps=substeps)[0].now.T[0]) - E8["T"]) for n in E8["n"][-2:]]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(E8["order_iterated"], abs=0.02)
    assert errors[1] < 1e-5


@pytest.mark.slow
def test_two_masses_explicit_first_order_iterated_second():
    def error(n: int, scheme: Scheme) -> float:
        halves = mass("one", 1.0, "x", T_OUT), mass("two", 0.0, "T", X_OUT)
        state, _ = couple(halves, start(1001.0, 0.0), (0.4, n), scheme, how=HOW)
        exact = (np.cos(0.8 * np.pi) + np.cos(2.4 * np.pi)) / 2
        return abs(float(state.now.T[0]) - 1000.0 - exact)

    for scheme, ns, order in ((Scheme.PARALLEL, (800, 1600), E6["order_explicit"]),
                              (Scheme.ITERATED, (40, 80), E6["order_iterated"])):
        coarse, fine = (error(n, scheme) for n in ns)
        assert np.log2(coarse / fine) == pytest.approx(order, abs=0.1)
        assert fine < 0.03


@pytest.mark.parametrize(("method", "theta"), [("midpoint", 0.5), ("backward_euler", 1.0)])
def test_contraction_as_predicted_for_a_small_disturbance(method, theta):
    """x at the middle of the window: (b dt/2)/(1 + theta a dt)."""
    dt = 5.0
    _, tried = iterate(E4["T"] + 1e-3, dt, method=method)
    assert tried[0].solved.history.contraction == pytest.approx(B_LAG * dt / 2 / (1 + theta * A_LAG * dt), rel=2e-3)


def test_a_pressure_law_is_far_stiffer_and_no_tension_is_ever_seen():
    seen: list[float] = []
    tight = Tolerances(temperature=Tolerance(atol=1e-9, rtol=0.0), gap=LOOSE,
                       pressure=Tolerance(atol=10.0, rtol=0.0), solid_fraction=LOOSE)
    for kind, most in ((Acceleration.AITKEN, 12), (Acceleration.IQN_ILS, 12)):
        _, tried = couple((pressed(602.4, seen), pressing()), start(602.4, 0.0, -E_ALPHA * 2.4), (100.0, 1),
                          Scheme.ITERATED, how=Iteration(acceleration=kind, tolerance=tight))
        assert tried[0].solved.verdict is Verdict.ACCEPTED
        assert tried[0].solved.history.contraction > 20
        assert counts(tried)[0] <= most
    assert max(seen) <= 0.0


def test_a_guess_below_absolute_zero_falls_back():
    """H = max(.98 T - 5, 1): the slope seen first points to -250 K; the answer is 1 K."""
    thermal = table(lambda x: max(0.98 * (2 * x - 100.0) - 5.0, 1.0))  # x in the middle: (100 + T)/2
    given: list[float] = []

    def rule(state, inputs, t, h):
        given.append(float(inputs["T"][0]))
        return echo().rule(state, inputs, t, h)

    state, tried = couple((thermal, replace(echo(), rule=rule)), start(100.0, 100.0), (1.0, 1), Scheme.ITERATED,
                          how=HOW.changed(max_iterations=60, relaxation=0.5))
    assert tried[0].solved.verdict is Verdict.ACCEPTED
    assert float(state.now.T[0]) == pytest.approx(1.0, abs=1e-9)
    assert min(given) > 0.0
    assert 0.5 in tried[0].solved.history.factors


def test_one_way_takes_two_iterates_and_not_one_half_solve_more():
    still = replace(shrinking(840.0), rule=lambda s, i, t, h: (s, {"x": np.array([[0.0, 4e-5]])}))
    thermal = lumped(840.0)
    _, tried = couple((thermal, still), start(840.0, 4e-5), (20.0, 1), Scheme.ITERATED, how=Iteration())
    assert counts(tried) == [2]
    assert (tried[0].solved.work.thermal_solves, tried[0].solved.work.mechanical_solves) == (2, 2)
    assert len(thermal.calls) == 2
    assert len(thermal.saved) == 1


@pytest.mark.parametrize("quantity", ["gap", "pressure"])
def test_every_quantity_must_agree(quantity):
    """T alone would pass at once with a floor of 1e3 K; the tight one decides."""
    wide = Tolerances(temperature=Tolerance(atol=1e3, rtol=0.0), gap=LOOSE,
                      pressure=Tolerance(atol=1e9, rtol=0.0), solid_fraction=LOOSE)
    tight = wide.changed(**{quantity: Tolerance(atol={"gap": 1e-12, "pressure": 1e-3}[quantity], rtol=0.0)})
    makes = (lambda: (lumped(840.0), shrinking(840.0))) if quantity == "gap" else (
        lambda: (pressed(602.4, []), pressing()))
    first = start(840.0, gap_of(840.0)) if quantity == "gap" else start(602.4, 0.0, -E_ALPHA * 2.4)
    found = {}
    for tolerance in (wide, tight):
        _, tried = couple(makes(), first, (5.0, 1), Scheme.ITERATED, how=Iteration(tolerance=tolerance))
        found[tolerance] = counts(tried)[0]
        assert max(tried[0].solved.history.misfits[-1].values()) <= 1.0
    assert found[wide] == 2
    assert found[tight] > 3


def test_the_estimate_of_a_gap_left_over_is_honest():
    """The last iterate's x against the converged one: within twice what the misfit told."""
    tolerance = TIGHT.changed(temperature=Tolerance(atol=1e3, rtol=0.0), gap=Tolerance(atol=1e-8, rtol=0.0))
    x = [float(iterate(840.0, 20.0, how=HOW.changed(tolerance=t))[0].now.x[0, 1]) for t in (tolerance, TIGHT)]
    told = iterate(840.0, 20.0, how=HOW.changed(tolerance=tolerance))[1][0].solved.history.misfits[-1]["gap"]
    assert 0.0 < abs(x[0] - x[1]) <= 2 * told * 1e-8


def test_no_iterate_more_than_the_gap_needs():
    """The one before the last is not within the tolerance of the gap, the last is."""
    floor = 1e-8
    wide = TIGHT.changed(temperature=Tolerance(atol=1e3, rtol=0.0), gap=Tolerance(atol=floor, rtol=0.0))
    how = Iteration(acceleration=Acceleration.NONE, max_iterations=60, tolerance=wide)
    exact = float(iterate(840.0, 2.0, how=HOW)[0].now.x[0, 1])
    state, tried = iterate(840.0, 2.0, how=how)
    needed = counts(tried)[0]
    less, _ = iterate(840.0, 2.0, how=how.changed(max_iterations=needed - 1, on_max=OnMax.ACCEPT))
    assert abs(float(less.now.x[0, 1]) - exact) > floor
    assert abs(float(state.now.x[0, 1]) - exact) < 2 * floor


def test_a_window_that_does_not_converge_is_halved_and_leaves_no_trace():
    # At 840 K b is .78 1/s: b dt/2/(1 + a dt/2) is 1.22 in a window of 3.6 s and .65 in one of 1.8 s.
    how = Iteration(acceleration=Acceleration.NONE, max_iterations=60, tolerance=TIGHT)
    state, tried = iterate(840.0, 3.6, 1, how)
    assert [w.solved.verdict for w in tried] == [Verdict.MAX_ITERATIONS, Verdict.ACCEPTED, Verdict.ACCEPTED]
    direct, plain = iterate(840.0, 3.6, 2, how)
    assert state.now.T.tobytes() == direct.now.T.tobytes()
    assert counts(tried)[1:] == counts(plain)
    assert tried[0].solved.message.startswith(
        "not converged: after 60 iterations with acceleration none the last two differ in temperature by ")


def test_accepting_is_told_and_kept_apart_from_converging():
    how = Iteration(acceleration=Acceleration.NONE, max_iterations=3, tolerance=TIGHT, on_max=OnMax.ACCEPT)
    state, tried = iterate(840.0, 16.0, 2, how)
    assert [(w.solved.verdict, w.accepted) for w in tried] == [(Verdict.MAX_ITERATIONS, True)] * 2
    assert state.now.t == 16.0


def test_a_discard_within_an_iteration_puts_both_back():
    plain, _ = iterate(840.0, 16.0, 2)
    halves = lumped(840.0, h_max=8.5), shrinking(840.0)
    state, tried = couple(halves, start(840.0, gap_of(840.0)), (16.0, 1), Scheme.ITERATED, how=HOW)
    assert [w.solved.verdict for w in tried] == [Verdict.THERMAL_DISCARD, Verdict.ACCEPTED, Verdict.ACCEPTED]
    assert state.now.T.tobytes() == plain.now.T.tobytes()


def test_a_half_without_states_cannot_be_iterated():
    halves = lumped(840.0), replace(shrinking(840.0), can_save=False)
    with pytest.raises(CouplingError, match="a window is to be iterated; half 'shrinking' keeps no states"):
        couple(halves, start(840.0, gap_of(840.0)), (16.0, 1), Scheme.ITERATED, how=HOW)


@pytest.mark.parametrize("scheme", [Scheme.ITERATED, Scheme.MECHANICAL_FIRST])
@pytest.mark.parametrize("substeps", [(1, 1), (3, 2)])
def test_heat_of_the_last_iterate_is_delivered_once_in_its_own_window(scheme, substeps):
    halves = lumped(840.0), shrinking(840.0, heat=1e4)
    state, tried = couple(halves, start(840.0, gap_of(840.0)), (20.0, 5), scheme, how=HOW, substeps=substeps)
    account = state.accounts["E_M"]
    assert account.made == pytest.approx(2e5, rel=1e-13)
    assert account.delivered == account.made
    assert account.carry.sum() == 0.0
    for w in tried:
        assert sum(terms["heat.mechanical"] for terms in w.solved.terms) == pytest.approx(4e4, rel=1e-10)


def melting() -> FakeHalf:
    """T stays 900 K while f_s falls with the heat that x[0, 1] lets through: f_s carries what T does not show."""

    def rule(state, inputs, t, h):
        f = np.clip(state[0] - 0.5 * float(inputs["x"][0, 1]), 0.0, 1.0)
        return np.array([f]), {"T": np.array([900.0]), "f_s": np.array([f])}

    made = table(lambda T: T)
    blocks = {**made.blocks, "f_s": replace(T_OUT, name="f_s", unit="1")}
    return replace(made, name="melting", blocks=blocks, rule=rule, state=np.array([0.75]))


def opening() -> FakeHalf:
    made = echo()
    return replace(made, blocks={**made.blocks, "f_s": replace(T_IN, name="f_s", unit="1")},
                   rule=lambda s, i, t, h: (s, {"x": np.array([[0.0, float(i["f_s"][0])]])}))


def test_the_solid_fraction_is_exchanged_where_temperature_stands_still():
    """f = 3/4 - (x_0 + f)/4 at the end of a window that starts at f = x_0 = 3/4: f = .45."""
    first = replace(start(900.0, 0.75), now=replace(start(900.0, 0.75).now, f_s=np.array([0.75])))
    tolerance = TIGHT.changed(solid_fraction=Tolerance(atol=1e-12, rtol=0.0))
    state, tried = couple((melting(), opening()), first, (1.0, 1), Scheme.ITERATED,
                          how=HOW.changed(tolerance=tolerance))
    assert float(state.now.f_s[0]) == pytest.approx(0.45, abs=1e-12)
    assert tried[0].solved.history.misfits[0]["solid_fraction"] > 1.0


def test_what_was_learnt_in_a_window_serves_the_next():
    def total(reuse: int) -> int:
        how = Iteration(acceleration=Acceleration.IQN_ILS, reuse=reuse, tolerance=TIGHT)
        return sum(counts(iterate(840.0, 20.0, 10, how)[1]))

    assert total(2) < total(0)


SMALL = {"bodies.lower.mesh.rectangle.cells": [4, 4], "bodies.upper.mesh.rectangle.cells": [5, 5],
         "coupling.scheme": "iterated", "coupling.end": 11500, "materials.steel.alpha": 1.2e-5,
         "coupling.windows": [{"until": 2500, "size": 2500}, {"until": 10000, "first": 2500, "last": 300},
                              {"until": 11500, "size": 300}]}


def solve(folder: Path, name: str, **how: object) -> Results:
    processes = bool(how.pop("processes", False))
    return run(load_scenario(ROOT / "scenarios/sliding_blocks.yaml", overrides={**SMALL, **how}),
               out=folder / f"{name}.h5", processes=processes)


@pytest.mark.slow
def test_iterated_embedded_and_in_processes_gives_the_same_bits(tmp_path):
    a, b = solve(tmp_path, "embedded"), solve(tmp_path, "hosted", processes=True)
    assert a.outcome == b.outcome == "completed"
    assert a.windows.touching.max() > 2
    assert a.windows.iterations.max() > 1
    for name in a.probe_names:
        np.testing.assert_array_equal(a.probe(name)[1], b.probe(name)[1], err_msg=name)
    assert a.iterates.tobytes() == b.iterates.tobytes()
    assert a.heat_imbalance < 1e-10
    # What is recorded is consistent: a row an iterate, a solve of each half an iterate.
    assert len(a.iterates) == a.windows.iterations.sum() == a.windows.thermal_solves.sum()
    assert (a.windows.misfit[a.windows.taken] <= 1.0).all()
    assert (a.windows.contraction < 1.0).all()
    # And shown.
    assert f"{a.windows.iterations.mean():.1f} iterations a window" in summary(a)
    assert f"{len(a.iterates)} iterations in {len(a.windows)} windows" in render(a)
