"""Inner steps of a substep: an honest estimate, bounds that are kept, kinks, jumps, state."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, FlatContact, imbalance, inputs_of, run, scene, spec, the_context

from contact.half.interface import Pair
from contact.half.model import Discard
from contact.half.state import from_bytes, to_bytes
from thermal_fmu.half import load
from thermal_fmu.methods import METHODS, theta_method
from thermal_fmu.sources import Calendar
from thermal_fmu.step import damped_step, flow_at, local_error, take_step
from thermal_fmu.substeps import (
    NO_STEPS_YET,
    StepController,
    StepMeasure,
    after_step,
    ends_within,
    shorter_step,
    step_length,
)

HELD = {"on": "a.left", "temperature": 100.0}


def warm_pair(**more):
    """Two bodies in contact, h(T), k(T), c(T), a film with an exponent, radiation, a growing flux."""
    mesh = scene(Box(0, 1, 0, 1, 6, 2), Box(0, 1, 1, 2, 7, 2), pairs=(Pair("p", "b.bottom", "a.top", 0.05, 1e9),))
    law = {"law": "table", "variable": "T", "x": [200.0, 400.0, 800.0], "h": [2.0, 5.0, 6.0]}
    model = spec([{"on": "b.top", "convection": {"h": 0.2, "T": {"t": [0, 100], "value": [700, 3000]},
                                                 "exponent": 0.3}},
                  {"on": "a.right", "radiation": {"emissivity": 0.8, "T": 300.0}},
                  {"on": "b.right", "flux": {"t": [0, 100], "value": [0, 2e4]}}],
                 k={"polynomial": [1.0, 2e-3]}, c={"polynomial": [1.0, 1e-3, 1e-6]}, T0=300.0,
                 pairs={"p": {"conduction": {"closed": law, "open": None}}}, sigma_SB=5e-9, **more)
    model["bodies"]["b"] = {"material": "m", "T0": 700.0}
    return mesh, model


def pressed(mesh):
    return np.full(len(mesh.pair_nodes), -1e6)


@cache
def smooth_start():
    """A course of `warm_pair`, and its state at t = .3 s, when the start is forgotten."""
    mesh, model = warm_pair()
    context = the_context(mesh, model, t_N=pressed(mesh))
    s = np.where(mesh.node_body == 0, 300.0, 700.0)
    for i in range(40):
        method = METHODS["backward_euler" if i < 8 else "sdirk2"]
        s = take_step(context, method, s, None, i * 0.0075, 0.0075).s
    return context, s


def honesty(method, h, damped=False):
    """Estimated by true local error of one step h [s] from `smooth_start`."""
    context, s = smooth_start()
    take = damped_step if damped else take_step
    done = take(context, method, s, None, 0.3, h)
    estimate, _ = local_error(context, flow_at(context, s, 0.3, h, 1), done, 0.3, h)
    exact, parts = s, 32
    for i in range(parts):
        exact = take_step(context, METHODS["sdirk2"], exact, None, 0.3 + i * h / parts, h / parts).s
    return estimate / float(np.abs(exact - done.s).max())


@pytest.mark.few("midpoint-0.05", "backward_euler-0.05")
@pytest.mark.parametrize("h", [pytest.param(0.2, marks=pytest.mark.slow), 0.05,
                               pytest.param(0.0125, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["midpoint", "sdirk2", "backward_euler", "theta"])
def test_the_estimate_is_honest(name, h):
    """Within a factor of 1.8 of the true local error, h from a third of the slowest scale down."""
    method = theta_method(0.7) if name == "theta" else METHODS[name]
    assert 1 / 1.8 < honesty(method, h) < 1.8


@pytest.mark.few("0.05")
@pytest.mark.parametrize("h", [0.2, 0.05])
def test_the_estimate_of_a_damped_step_is_honest(h):
    assert 1 / 1.8 < honesty(METHODS["midpoint"], h, damped=True) < 1.8


@cache
def fine_end():
    """T of `warm_pair` at t = .2 by 60 graded steps of sdirk2, whose own error is below 3e-3 K."""
    mesh, model = warm_pair(method="sdirk2")
    ends = 0.2 * (np.arange(61) / 60) ** 2
    return run(mesh, model, np.diff(ends), t_N=pressed(mesh)).T[-1]


@pytest.mark.few("sdirk2")
@pytest.mark.parametrize("method", ["midpoint", "sdirk2"])
def test_a_tighter_tolerance_is_a_smaller_error(method):
    """Errors at the end of a run fall with the tolerance and stay near it; the balance closes."""
    mesh, model = warm_pair(method=method)
    exact = fine_end()
    worst, counts = [], []
    for tolerance in (1.0, 0.1, 0.03):
        ran = run(mesh, model | {"adaptive": {"tolerance": tolerance}}, 0.1, 2, t_N=pressed(mesh))
        worst.append(float(np.abs(ran.T[-1] - exact).max()))
        counts.append(sum(o["substeps"] for o in ran.outputs))
        assert ran.imbalance() < EXPECTED["A16"]["tolerance"]
        assert worst[-1] < 1.5 * tolerance
    assert worst[2] < 0.7 * worst[1] < 0.5 * worst[0]
    assert counts[0] < counts[1] < counts[2] < 60


@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "theta"])
def test_shocks_do_not_ring(method):
    """A2, A18: inner steps grow a hundredfold after the shock; no node cools on the way by more than the tolerance."""
    bar = scene(Box(0, 1, 0, 1, 40))
    more = {"theta": 0.5} if method == "theta" else {}
    ran = run(bar, spec([HELD], method=method, adaptive={"tolerance": 0.02}, **more), [0.005] * 20 + [0.05] * 12)
    case = EXPECTED["A18"]
    for x, expected in ((8, case["T_02"]), (32, case["T_08"])):
        found = [ran.T[int(np.argmin(np.abs(ran.t - t))), x] for t in case["t"]]
        assert np.abs(np.subtract(found, expected)).max() < 0.05
    assert np.diff(ran.T[:, :41], axis=0).min() > -0.02
    assert ran.outputs[0]["rejected"] > 0
    assert ran.outputs[-1]["substeps"] <= 3


def test_the_change_of_temperature_is_bounded():
    """max_dT alone: 2 K a step, and no estimate is made (one linear solve a step once the start is damped)."""
    bar = scene(Box(0, 1, 0, 1, 10))
    ran = run(bar, spec([{"on": "a.left", "flux": 100.0}], adaptive={"max_dT": 2.0}), 0.5, 4)
    free = run(bar, spec([{"on": "a.left", "flux": 100.0}]), 0.5, 4)
    for o, change in zip(ran.outputs, np.abs(np.diff(ran.T, axis=0, prepend=0.0)).max(axis=1), strict=True):
        assert change / 2.0 <= o["substeps"] < 2.5 * change
        assert o["max_dT"] == pytest.approx(change)
    assert ran.outputs[-1]["iterations"] == ran.outputs[-1]["substeps"] + ran.outputs[-1]["rejected"]
    assert "substeps" not in free.outputs[0]
    assert abs(ran.outputs[-1]["heat.flux"] - 50.0) < 1e-9


def test_a_prescribed_ramp_is_no_change_that_is_watched():
    """10 K in each substep at the hot end, as prescribed: what is told is the largest change of the other nodes."""
    bar = scene(Box(0, 1, 0, 1, 10))
    ramp = [{"on": "a.left", "temperature": {"t": [0, 2], "value": [0, 40]}}]
    ran = run(bar, spec(ramp), 0.5, 4)
    hot = np.unique(bar.surfaces["a.left"])
    change = np.abs(np.diff(ran.T, axis=0, prepend=0.0))
    assert change[:, hot] == pytest.approx(10.0)
    for o, told in zip(ran.outputs, np.delete(change, hot, axis=1).max(axis=1), strict=True):
        assert 0.0 < told < 9.999
        assert o["max_dT"] == pytest.approx(told)


def test_inner_steps_end_at_kinks_and_jumps_restart_damped():
    """A wall that jumps inside the substep, off every regular step: nothing happens before, nothing rings after."""
    bar = scene(Box(0, 1, 0, 1, 20))
    wall = {"t": [0, 0.137, 0.137, 0.9], "value": [0, 0, 100, 100]}
    model = spec([HELD | {"temperature": wall}], adaptive={"tolerance": 0.05})
    ran = run(bar, model, 0.137, 1)
    assert np.abs(ran.T[-1]).max() < 1e-12
    assert ran.outputs[-1]["substeps"] == 1
    over = run(bar, model, 0.337, 1)
    exact = run(bar, spec([HELD], method="sdirk2"), 0.0005, 400)
    assert np.abs(over.T[-1] - exact.T[-1]).max() < 0.2
    assert over.imbalance() < EXPECTED["A16"]["tolerance"]


def test_where_inner_steps_end():
    """Kinks inside; two that no clock can tell apart are one; those at the ends are the ends."""
    kinks = np.array([-1.0, 0.0, 0.3, 0.3 + 1e-12, 0.5, 1.0 - 1e-12, 2.0])
    assert ends_within(Calendar(kinks, kinks), 0.0, 1.0) == (0.3, 0.5, 1.0)
    assert ends_within(Calendar(np.empty(0), np.empty(0)), 0.2, 0.1) == (0.2 + 0.1,)


def test_the_last_inner_step_is_no_sliver():
    assert step_length(0.0, 0.7) == 0.7
    assert step_length(0.7 * (1 - 1e-12), 0.7) == 0.7
    assert step_length(0.6, 0.7) == 0.35
    assert step_length(0.2, 0.7) == 0.2
    left, steps = 1.0, []
    while left > 0.0:
        steps.append(step_length(0.3, left))
        left = 0.0 if steps[-1] == left else left - steps[-1]
    assert min(steps) >= 0.15


def test_the_pace():
    """Grows where the error is small, at most fourfold; not after a retry; a kink says nothing against it."""
    small, large = StepMeasure(1e-4, 0.0, 2), StepMeasure(8.0, 0.0, 2)
    assert after_step(StepController(1.0, 1.0), 1.0, small, False).h == 4.0
    assert after_step(StepController(1.0, 1.0), 1.0, small, True).h <= 1.0
    assert after_step(StepController(1.0, 1.0), 0.01, small, False).h == 1.0
    assert after_step(NO_STEPS_YET, 1.0, StepMeasure(0.0, 0.5, 1), False).h == pytest.approx(1.8)
    assert shorter_step(1.0, large) == pytest.approx(0.45)
    assert shorter_step(1.0, StepMeasure(0.0, 10.0, 2)) == pytest.approx(0.1)
    assert shorter_step(1.0, None) == 0.5
    assert shorter_step(1.0, StepMeasure(1e9, 0.0, 2)) == 0.1
    assert not StepMeasure(float("nan"), 0.0, 2).passes


def test_the_state_of_the_pace_is_complete():
    """Step, restore, step: the same bits, from a hot half, a cold one, and from bytes."""
    mesh, model = warm_pair(adaptive={"tolerance": 0.1, "max_dT": 40.0})

    def steps(half, state, first, last):
        bits = []
        for i in range(first, last):
            given = inputs_of(mesh, half, t_N=pressed(mesh)) | {"control.event": i // 3, "control.method": i % 3}
            done = half.step(state, given, 0.05 * i, 0.05, FlatContact())
            state = done.state
            bits.append({name: np.asarray(v).tobytes() for name, v in done.outputs.items()})
        return state, bits

    half = load(mesh, model)
    start, _ = half.start(inputs_of(mesh, half, t_N=pressed(mesh)), 0.0, FlatContact())
    middle, _ = steps(half, start, 0, 3)
    assert 0.0 < middle.controller.h < 0.05
    _, hot = steps(half, middle, 3, 5)
    steps(half, start, 0, 1)
    _, again = steps(half, middle, 3, 5)
    _, cold = steps(load(mesh, model), from_bytes(to_bytes(middle), {"thermal_fmu"}), 3, 5)
    assert hot == again == cold


def test_bounds_nobody_meets_change_nothing():
    """Bounds that no step meets: the substep is one step of the method, to round-off in its length."""
    mesh, model = warm_pair()
    plain = run(mesh, model, 0.05, 3, t_N=pressed(mesh))
    loose = run(mesh, model | {"adaptive": {"tolerance": 1e6, "max_dT": 1e6}}, 0.05, 3, t_N=pressed(mesh))
    assert np.abs(plain.T - loose.T).max() < 1e-9
    assert [o["substeps"] for o in loose.outputs] == [1.0, 1.0, 1.0]
    assert imbalance(loose.outputs) < EXPECTED["A16"]["tolerance"]


def test_a_step_that_cannot_be_solved_is_cut_and_then_discarded():
    """k turns negative beyond 500 K: a wall of 510 K is reached by a ramp; inner steps halve down to `least`."""
    bar = scene(Box(0, 1, 0, 1, 10))
    model = spec([HELD | {"temperature": {"t": [0, 1], "value": [300, 510]}}], k={"polynomial": [50.0, -0.1]}, T0=300.0,
                 adaptive={"tolerance": 1e3, "least": 0.01})
    half, link = load(bar, model), FlatContact()
    state, _ = half.start(inputs_of(bar, half), 0.0, link)
    done = half.step(state, inputs_of(bar, half), 0.0, 1.0, link)
    assert isinstance(done, Discard)
    assert "adaptive.least allows none shorter" in done.message
    assert "conductivity" in done.message
    assert done.dt_suggest == 0.005
    assert not isinstance(half.step(state, inputs_of(bar, half), 0.0, 0.5, link), Discard)


def test_a_tolerance_out_of_reach_is_discarded_too():
    bar = scene(Box(0, 1, 0, 1, 10))
    half, link = load(bar, spec([HELD], adaptive={"tolerance": 1e-3, "least": 0.1})), FlatContact()
    state, _ = half.start(inputs_of(bar, half), 0.0, link)
    done = half.step(state, inputs_of(bar, half), 0.0, 1.0, link)
    assert isinstance(done, Discard)
    assert "of adaptive.tolerance" in done.message


def test_steps_have_a_bound_from_the_cells_and_the_error_names_cause_and_cure():
    """They went down to 1e-13 s before; a node of cells of 0.1 m, a = 1, follows its neighbours in 3.3e-3 s."""
    bar = scene(Box(0, 1, 0, 0.1, 10))
    half, link = load(bar, spec([HELD], adaptive={"max_dT": 1e-9})), FlatContact()
    state, _ = half.start(inputs_of(bar, half), 0.0, link)
    done = half.step(state, inputs_of(bar, half), 0.0, 1e-2, link)
    assert isinstance(done, Discard)
    least = float(done.message.split("none is shorter than ")[1].split(" s")[0])
    assert 1e-9 < least < 1e-8
    for word in ("of a at (", "data jump there", "Raise adaptive.tolerance or max_dT", "adaptive.least"):
        assert word in done.message


@pytest.mark.parametrize("tolerance", [1.0, 1e-2])
def test_a_quench_is_resolved_within_its_data_in_few_steps(tolerance):
    """From 1200 to 300 K in windows far below h^2/a, where it peaked at 1396 K and steps fell to 1e-13 s."""
    bar = scene(Box(0, 1, 0, 0.1, 10))
    for dt in (1e-6, 1e-3, 1.0):
        ran = run(bar, spec([{"on": "a.left", "temperature": 300.0}], T0=1200.0,
                            adaptive={"tolerance": tolerance, "max_dT": 50.0}), dt, 5)
        assert ran.T.max() <= 1200.0 + 1e-9
        assert ran.T.min() >= 300.0 - 1e-9
        assert max(o["substeps"] for o in ran.outputs) < 400
