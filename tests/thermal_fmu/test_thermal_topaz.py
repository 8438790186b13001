"""The validation cases of TOPAZ2D (A21): steady, nonlinear and transient unit slabs.

Read so, where the page does not say: 0 <= x <= 1, insulated at x = 0, what is named acts at x = 1, T = 0 at first,
h = 1 in 3.3 and 3.7.  1.4 and 2.9a generate 1 and hold T(1) = 0; 2.3 holds 0 degC and faces 100 degC.
"""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

sys.path.insert(0, str(Path(__file__).parent))
from slab_series import EXACT
from thermal_scenes import EXPECTED, Box, FlatContact, inputs_of, order, run, scene, spec

from thermal_fmu.half import load

CASE = EXPECTED["A21"]
TIMES = np.linspace(0.0, 1.0, 101)
GROWTH = {"t": TIMES.tolist(), "value": np.exp(0.1 * TIMES).tolist()}
ACTS = {
    "3.1": {"on": "a.right", "temperature": 1.0},
    "3.2": {"on": "a.right", "flux": 1.0},
    "3.3": {"on": "a.right", "convection": {"h": 1.0, "T": 1.0}},
    "3.4a": {"on": "a.right", "temperature": 0.0},
    "3.5": {"on": "a.right", "temperature": GROWTH},
    "3.7": {"on": "a.right", "convection": {"h": 1.0, "T": {"t": [0, 10], "value": [0, 10]}}},
}


@cache
def errors(name, n=10, dt=0.01):
    """(steps,) largest error over the nodes at the end of every step up to t = .6."""
    bar = scene(Box(0, 1, 0, 1, n))
    model = spec([ACTS[name]])
    model["bodies"]["a"]["Q_T"] = 1.0 if name == "3.4a" else 0.0
    ran = run(bar, model, dt, round(0.6 / dt))
    assert ran.imbalance() < EXPECTED["A16"]["tolerance"]
    x = bar.nodes[: n + 1, 0]
    return np.array([np.abs(T[: n + 1] - EXACT[name](x, t)).max() for t, T in zip(ran.t, ran.T, strict=True)])


def test_1_4_steady_generation():
    """Linear elements are exact at the nodes."""
    bar = scene(Box(0, 1, 0, 1, 10))
    model = spec([ACTS["3.4a"]], method="steady")
    model["bodies"]["a"]["Q_T"] = 1.0
    assert np.abs(run(bar, model, 1.0, 1).T[-1] - 0.5 * (1.0 - bar.nodes[:, 0] ** 2)).max() < 1e-12


def test_2_3_radiation_to_a_plate():
    """Kelvin inside: 0 and 100 degC.  Linear in x, so 10 elements are exact."""
    bar = scene(Box(0, 1, 0, 1, 10))
    model = spec([{"on": "a.left", "temperature": 273.15},
                  {"on": "a.right", "radiation": {"emissivity": 0.5, "T": 373.15}}], T0=300.0, method="steady",
                 sigma_SB=5.6697e-8)
    T = run(bar, model, 1.0, 1).T[-1]
    assert abs(T[10] - T[0] - CASE["slope"]) < 1e-6
    assert abs(T[5] - T[0] - 0.5 * CASE["slope"]) < 1e-6


def test_2_9a_conductivity_grows_with_temperature():
    """T + T^2/2 = (1 - x^2)/2, exact at the nodes."""
    bar = scene(Box(0, 1, 0, 1, 10))
    model = spec([ACTS["3.4a"]], k={"polynomial": [1.0, 1.0]}, method="steady")
    model["bodies"]["a"]["Q_T"] = 1.0
    T = run(bar, model, 1.0, 1).T[-1]
    assert abs(T[0] - CASE["T_0"]) < 1e-9
    assert np.abs(T + 0.5 * T**2 - 0.5 * (1.0 - bar.nodes[:, 0] ** 2)).max() < 1e-9


def on_the_mesh(name, n, times):
    """(times, n + 1) temperatures of the mesh without any error in time: expm of its linear ordinary equations."""
    h = 1.0 / n
    K, M = np.zeros((n + 1, n + 1)), np.zeros((n + 1, n + 1))
    for e in range(n):
        K[e:e + 2, e:e + 2] += np.array([[1, -1], [-1, 1]]) / h
        M[e:e + 2, e:e + 2] += np.eye(2) * h / 2.0
    wall = np.zeros(n + 1)
    wall[n] = 1.0
    if name in ("3.3", "3.7"):
        K[n, n] += 1.0
    free = n if name in ("3.1", "3.5") else n + 1
    inverse = np.linalg.inv(M[:free, :free])
    # (u, g, g') with g' growing like g of the case: constant, exp(.1 t), t.
    A = np.zeros((free + 2, free + 2))
    A[:free, :free] = -inverse @ K[:free, :free]
    if free == n:
        A[:free, free] = -inverse @ K[:n, n]
        A[free, free + 1] = 1.0
        A[free + 1, free + 1] = 0.1 if name == "3.5" else 0.0
        start = [1.0, 0.1 if name == "3.5" else 0.0]
    else:
        A[:free, free] = inverse @ wall
        A[free, free + 1] = 1.0
        start = [1.0, 0.0] if name == "3.3" else [0.0, 1.0]
    z = np.concatenate([np.zeros(free), start])
    found = np.array([expm(A * t) @ z for t in times])
    return found[:, : n + 1]


@pytest.mark.parametrize("name", ["3.1", "3.3", "3.5", "3.7"])
def test_bands_are_beaten_in_time(name):
    """10 elements, dt .01, t >= .1: the error in time is a tenth of the published band and far less.

    Against the same mesh solved exactly in time, as the error of ten linear elements is no matter of the method.
    """
    bar = scene(Box(0, 1, 0, 1, 10))
    ran = run(bar, spec([ACTS[name]]), 0.01, 60)
    late = ran.t > 0.095
    error = np.abs(ran.T[late][:, :11] - on_the_mesh(name, 10, ran.t[late])).max()
    assert error < CASE["bands"][name] / CASE["times_better"]
    assert error < {"3.1": 2e-4, "3.3": 5e-5, "3.5": 2e-4, "3.7": 1.5e-5}[name]


@pytest.mark.few("3.7-20-0.0", "3.1-10-0.5")
@pytest.mark.parametrize(("name", "n", "since"), [("3.1", 10, 0.5), ("3.3", 10, 0.5), ("3.5", 10, 0.5),
                                                  ("3.1", 20, 0.15), ("3.3", 20, 0.1), ("3.5", 20, 0.15),
                                                  ("3.7", 20, 0.0)])
def test_bands_are_beaten_as_a_whole(name, n, since):
    """Against the series.  Ten linear elements do it late; early, and with 3.7 always, h^2 asks for twenty."""
    late = errors(name, n)[round(since / 0.01):]
    assert late.max() < CASE["bands"][name] / CASE["times_better"]


@pytest.mark.few("3.2", "3.5", "3.7")
@pytest.mark.parametrize("name", ACTS)
def test_transients_converge_to_the_series(name):
    """Order 2 as h and dt are halved together, from t = .2 on, and small in the end."""
    found = [errors(name, n, 0.2 / n)[n - 1:].max() for n in (10, 20, 40)]
    assert abs(order(found) - 2.0) < 0.1
    assert found[-1] < 1.5e-4


def root_flux_errors(n, dt, method, events):
    """(steps,) errors up to t = .4.  Each step is given the mean of 1/sqrt t over it: no heat is lost at t = 0."""
    bar = scene(Box(0, 1, 0, 1, n))
    half, link = load(bar, spec([ACTS["3.2"] | {"name": "q"}], method=method)), FlatContact()
    state, _ = half.start(inputs_of(bar, half), 0.0, link)
    found = []
    for i in range(round(0.4 / dt)):
        t = (i + 1) * dt
        given = inputs_of(bar, half, load_q=2.0 / (np.sqrt(t) + np.sqrt(t - dt))) | {"control.event": min(i, events)}
        state = half.step(state, given, i * dt, dt, link).state
        found.append(np.abs(state.s[: n + 1] - EXACT["3.6"](bar.nodes[: n + 1, 0], t)).max())
    return np.array(found)


def test_3_6_flux_that_falls_with_the_root_of_time():
    """10 elements, dt .02.  The flux falls in jumps, the first are large: told as events or not, the half is calm."""
    for events in (4, 0):
        assert root_flux_errors(10, 0.02, "midpoint", events)[9:].max() < 5e-3


def test_3_6_converges():
    found = [root_flux_errors(n, 0.1 / n, "sdirk2", 0)[2 * n - 1:].max() for n in (10, 20, 40)]
    assert abs(order(found) - 2.0) < 0.1
    assert found[-1] < 3e-4
