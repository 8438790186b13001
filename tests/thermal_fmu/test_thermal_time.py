"""The thermal half in time: slabs, shocks, orders of the methods (A1, A2, A5, A12, A18, A20)."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, order, run, scene, spec


def at(ran, t, x, interface):
    """T at the bottom row's node at x, at the end of the step nearest to t."""
    node = int(np.argmin(np.hypot(interface.nodes[:, 0] - x, interface.nodes[:, 1])))
    assert abs(interface.nodes[node, 0] - x) < 1e-9
    return ran.T[int(np.argmin(np.abs(ran.t - t))), node]


def heisler(Bi, n, dt, Fo):
    """theta at (centre, surface) at the times Fo: k = rho c = L = 1, centre at x = 0."""
    bar = scene(Box(0, 1, 0, 1, n))
    model = spec([{"on": "a.right", "convection": {"h": Bi, "T": 300.0}}], T0=400.0)
    ran = run(bar, model, dt, round(max(Fo) / dt))
    assert ran.imbalance() < EXPECTED["A16"]["tolerance"]
    return [[(at(ran, t, x, bar) - 300.0) / 100.0 for x in (0.0, 1.0)] for t in Fo]


@pytest.mark.few("10")
@pytest.mark.parametrize("Bi", [1, 10])
def test_a1_convective_slab(Bi):
    """1e-3 with 20 elements (the page's tolerance), and second order as h and dt are halved together."""
    case = EXPECTED["A1"][f"Bi_{Bi}"]
    errors = [np.abs(np.subtract(heisler(Bi, n, 0.1 / n, case["Fo"]), case["theta"])).max() for n in (10, 20, 40)]
    assert errors[1] < EXPECTED["A1"]["tolerance"]
    assert abs(order(errors) - EXPECTED["A1"]["order"]) < 0.15
    assert errors[2] < 2.5e-4


@pytest.mark.few("midpoint")
@pytest.mark.parametrize("method", ["midpoint", "sdirk2"])
def test_a2_step_of_the_face_does_not_ring(method):
    """Centre within 2e-3 (20 elements, dt .0025); beside the face T falls without a rise once damped."""
    n, dt = 20, 0.0025
    bar = scene(Box(0, 1, 0, 1, n))
    ran = run(bar, spec([{"on": "a.right", "temperature": 300.0}], T0=400.0, method=method), dt, 200)
    case = EXPECTED["A2"]
    theta = [(at(ran, t, 0.0, bar) - 300.0) / 100.0 for t in case["Fo"]]
    assert np.abs(np.subtract(theta, case["centre"])).max() < 2e-3
    beside = (ran.T[:, n - 1] - 300.0) / 100.0
    assert (np.diff(beside) < 0).all()
    assert beside.min() > 0


@pytest.mark.few("0.1-sdirk2", "0.02-midpoint", "0.005-backward_euler")
@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
@pytest.mark.parametrize("dt", [0.1, 0.02, 0.005])
def test_a2_large_steps_do_not_ring_either(method, dt):
    """dt a/h^2 = 40, 8, 2: an L-stable method alone is not enough, sdirk2 undamped rises by 10 K after the jump."""
    bar = scene(Box(0, 1, 0, 1, 20))
    ran = run(bar, spec([{"on": "a.right", "temperature": 300.0}], T0=400.0, method=method), dt,
              round(0.5 / dt))
    assert (np.diff(ran.T[:, 19]) < 0).all()
    assert ran.T[:, 19].min() > 300.0


def test_a2_rings_where_nothing_damps(monkeypatch):
    """The same bar without a damped start: a step that overshoots is taken again; without that too it rings."""
    monkeypatch.setattr("thermal_fmu.half.DAMPED_SUBSTEPS", 0)
    bar = scene(Box(0, 1, 0, 1, 20))
    model = spec([{"on": "a.right", "temperature": 300.0}], T0=400.0)
    assert (np.diff(run(bar, model, 0.02, 25).T[:, 19]) > 0).sum() == 0
    monkeypatch.setattr("thermal_fmu.step.went_beyond", lambda *_: False)
    assert (np.diff(run(bar, model, 0.02, 25).T[:, 19]) > 0).sum() > 5


def test_a5_nafems_t3():
    """Driven face: within .1 at dt 1 s, within .01 refined (degC as differences; T0 = 0 as on the page)."""
    case = EXPECTED["A5"]
    t = np.linspace(0.0, 40.0, 4001)
    face = {"t": t.tolist(), "value": (100.0 * np.sin(np.pi * t / 40.0)).tolist()}

    def T(n, dt):
        bar = scene(Box(0, 0.1, 0, 0.1, n))
        model = spec([{"on": "a.left", "temperature": 0.0},
                      {"on": "a.right", "temperature": face}], k=35.0, c=440.5, rho=7200.0)
        return at(run(bar, model, dt, round(32 / dt)), 32.0, 0.08, bar)

    assert abs(T(40, 1.0) - case["expected"]) < case["tolerance_dt_1"]
    assert abs(T(100, 0.25) - case["expected"]) < case["tolerance_refined"]


def decay_errors(method, steps):
    """Error at t = .1 of the mode sin(pi x) against the exact decay of the same mesh (time error only)."""
    n = 8
    bar = scene(Box(0, 1, 0, 1, n))
    model = spec([{"on": f"a.{s}", "temperature": 0.0} for s in ("left", "right")], method=method)
    h, s = 1.0 / n, np.sin(0.5 * np.pi / n) ** 2
    rate = 4.0 / h**2 * s  # eigenvalue of the linear element that stores at its nodes
    return [_mode_error(bar, model, rate, 0.1 / k, k) for k in steps]


def _mode_error(bar, model, rate, dt, k):
    from thermal_scenes import FlatContact, inputs_of

    from thermal_fmu.half import ThermalState, load

    half = load(bar, model)
    mode = np.sin(np.pi * bar.nodes[:, 0])
    state = ThermalState(mode, bar.nodes, 0, 0, 0.0)
    for i in range(k):
        state = half.step(state, inputs_of(bar, half), i * dt, dt, FlatContact()).state
    return float(np.abs(state.s - np.exp(-rate * 0.1) * mode).max())


@pytest.mark.few("midpoint-0.0002", "sdirk2-0.0001")
@pytest.mark.parametrize(("method", "cap"), [("midpoint", 2e-4), ("sdirk2", 1e-4), ("backward_euler", 1.2e-2)])
def test_a12_order_in_time(method, cap):
    case = EXPECTED["A12"]
    errors = decay_errors(method, (8, 16, 32, 64))
    assert abs(order(errors[1:]) - case[method]) < case["tolerance"]
    assert errors[1] < cap


@cache
def cooled(method, n):
    """Temperatures at t = .4 after n steps, with k(T), c(T) and a film of exponent 1/3."""
    bar = scene(Box(0, 1, 0, 1, 6))
    model = spec([{"on": "a.right", "convection": {"h": 0.5, "T": 1.0, "exponent": 1 / 3}}], T0=3.0,
                 k={"polynomial": [1.0, 0.8]}, c={"polynomial": [1.0, 0.3, 0.1]}, method=method)
    return run(bar, model, 0.4 / n, n).T[-1]


@pytest.mark.slow
@pytest.mark.parametrize(("method", "expected"), [("midpoint", 2.0), ("sdirk2", 2.0), ("backward_euler", 1.0)])
def test_a12_order_with_temperature_dependent_conduction_and_film(method, expected):
    """Coefficients taken at the start of a step would give order 1."""
    errors = [float(np.abs(cooled(method, n) - cooled("sdirk2", 512)).max()) for n in (8, 16, 32, 64)]
    assert abs(order(errors[1:]) - expected) < 0.05
    assert errors[-1] < (1e-4 if expected == 2.0 else 1e-2)


def lumped(method, steps):
    """Error at t = 1 of dT/dt = -(1 + T) T, T(0) = 1: a film of exponent 1 and a steady one on one cell."""
    cell = scene(Box(0, 1, 0, 1, 1))
    model = spec([{"on": "a.right", "convection": {"h": 1.0, "T": 0.0, "exponent": 1.0}},
                  {"on": "a.left", "convection": {"h": 1.0, "T": 0.0}}], T0=1.0, k=1e7, method=method)
    exact = 1.0 / (2.0 * np.e - 1.0)
    return [abs(float(run(cell, model, 1.0 / n, n).T[-1].mean()) - exact) for n in steps]


@pytest.mark.slow
@pytest.mark.parametrize("method", ["midpoint", "sdirk2"])
def test_a12_nonlinear_decay(method):
    """The start is damped, which costs a constant, not an order."""
    case = EXPECTED["A12"]
    errors = lumped(method, (32, 64, 128))
    assert abs(order(errors) - case[method]) < case["tolerance"]
    assert errors[-1] < 5e-5


@pytest.mark.few("sdirk2")
@pytest.mark.parametrize("method", ["midpoint", "sdirk2"])
def test_a18_thermal_shock(method):
    """Half wall, 40 elements, dt .0025: within .05 of 100; insulated at x = 1."""
    case = EXPECTED["A18"]
    bar = scene(Box(0, 1, 0, 1, 40))
    model = spec([{"on": "a.left", "temperature": 100.0}], method=method)
    ran = run(bar, model, 0.0025, 280)
    for x, expected in ((0.2, case["T_02"]), (0.8, case["T_08"])):
        assert np.abs(np.subtract([at(ran, t, x, bar) for t in case["t"]], expected)).max() < 0.05


@pytest.mark.slow
def test_a18_damped_restart_keeps_second_order():
    """A shock at t = 0, errors against the same mesh solved finely: order 2 though the start is damped."""
    bar = scene(Box(0, 1, 0, 1, 20))
    model = spec([{"on": "a.left", "temperature": 100.0}])
    finest = run(bar, model | {"method": "sdirk2"}, 0.2 / 2048, 2048).T[-1]
    errors = [float(np.abs(run(bar, model, 0.2 / n, n).T[-1] - finest).max()) for n in (20, 40, 80, 160)]
    assert order(errors) > 1.9
    assert errors[-1] < 2e-3


def test_a20_constant_flux_into_a_half_space():
    """150 mm stand for infinity (3.7 lengths of diffusion); 1.25 mm elements, dt .25 s: within .05 K."""
    k, a = 45.0, 1.4e-5
    bar = scene(Box(0, 0.15, 0, 0.01, 120))
    model = spec([{"on": "a.left", "flux": 3.2e5}], k=k, rho=1000.0, c=k / a / 1000.0, T0=35.0)
    assert abs(at(run(bar, model, 0.25, 120), 30.0, 0.025, bar) - EXPECTED["A20"]["expected"]) < 0.05


@pytest.mark.few("0.0-sdirk2", "1e-13-midpoint", "-1e-13-backward_euler")
@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
@pytest.mark.parametrize("off", [0.0, 1e-13, -1e-13])
def test_a_jump_inside_the_half_is_damped_without_being_told(method, off):
    """A prescribed temperature that jumps at t = .1 by its own signal: T beside it does not ring.

    off : how far [s] a clock of ticks puts the end of a step from the jump.
    """
    bar = scene(Box(0, 1, 0, 1, 20))
    jump = {"t": [0.0, 0.1 + off, 0.1 + off, 1.0], "value": [400.0, 400.0, 300.0, 300.0]}
    model = spec([{"on": "a.right", "temperature": jump}], T0=400.0, method=method)
    ran = run(bar, model, 0.02, 25)
    assert (np.diff(ran.T[4:, 19]) < 0).all()
    assert np.abs(ran.T[4] - 400.0).max() < 1e-9  # before the jump nothing happens, at its own time too
    assert np.abs(ran.T[5, 20] - 300.0) < 1e-9


def test_a_jump_from_outside_does_not_ring(monkeypatch):
    """A factor that jumps: with control.event raised a damped step meets it, without notice the half sees that a value

    moved, or else the step that overshoots is taken again.  Without both it rings.
    """
    from thermal_scenes import FlatContact, inputs_of

    from thermal_fmu.half import load

    bar = scene(Box(0, 1, 0, 1, 20))
    half = load(bar, spec([{"on": "a.right", "temperature": 400.0, "name": "wall"}], T0=400.0))
    rises = {}
    for event, sees, limited in ((0, True, False), (0, False, True), (0, False, False), (1, False, False)):
        with monkeypatch.context() as patched:
            if not sees:
                patched.setattr("thermal_fmu.substeps.held_value_jumps", lambda *_: False)
            if not limited:
                patched.setattr("thermal_fmu.step.went_beyond", lambda *_: False)
            inputs = inputs_of(bar, half)
            state, _ = half.start(inputs, 0.0, FlatContact())
            T = []
            for i in range(20):
                changed = {"load.wall": 0.75, "control.event": event} if i >= 5 else {}
                state = half.step(state, inputs | changed, 0.02 * i, 0.02, FlatContact()).state
                T.append(state.s[19])
        rises[event, sees, limited] = int((np.diff(T) > 1e-9).sum())
    assert rises[1, False, False] == rises[0, True, False] == rises[0, False, True] == 0
    assert rises[0, False, False] > 3
