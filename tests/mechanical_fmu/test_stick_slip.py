"""Stick and slip: what a slider on a spring loses is the work of friction, and as much as the closed forms say.

A rigid slider is pressed on a plate with N by a drawn overlap, and tied to a bar, its spring k, whose far end is held.
It sticks (but for the spring k_T of sticking) until it is pulled by mu N, x_s = mu N/k away.
"""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NO_CELLS, done, hold, inputs_of, rectangle

from contact.half.interface import Interface, Pair
from contact.rpc.link import open_link
from mechanical_fmu.elastic_half import load

E, LENGTH, SIZE, MU = 1e7, 1.0, 0.1, 0.3  # Pa, m, m (of bar and slider across), 1
EPS, DEPTH = 1e10, 1e-7  # Pa/m, m
TIE, STICK = 1e3 * E / LENGTH, 3e7  # Pa/m
RIGID = 1e9  # Pa/m, on the belt
N = EPS * DEPTH * SIZE  # N per metre
K = SIZE / (LENGTH / E + 1.0 / TIE)  # N/m per metre
X_S = MU * N / K
MASS = 1e5 * SIZE**2


def scene(form: str = "edges", stick: float = STICK) -> Interface:
    """Plate, slider with its left at 0 on it, and the bar to its left."""
    line = np.array([0.0, SIZE])
    parts = [rectangle(np.linspace(-1.0, 1.0, 8), np.array([-0.1, 0.0])), rectangle(line, line - DEPTH),
             rectangle(np.linspace(-LENGTH, 0.0, 4), line - DEPTH)]
    starts = np.cumsum([0, *(len(x) for x, _, _ in parts)])
    names = ("plate", "slider", "bar")
    surfaces = {f"{name}.{side}": edges + first
                for name, (_, _, sides), first in zip(names, parts, starts[:-1], strict=True)
                for side, edges in sides.items()}
    cells = [c + first for (_, c, _), first in zip(parts, starts[:-1], strict=True)]
    body = np.repeat(np.arange(3), [len(c) for _, c, _ in parts]).astype(np.int32)
    pairs = (Pair("face", "slider.bottom", "plate.top", 0.01, EPS, mu=MU, eps_T=stick, by_node=form == "nodes",
                  two_pass=form == "two passes"),
             Pair("tie", "slider.left", "bar.right", 1e-3, TIE, tied=True))
    return Interface("plane", np.concatenate([x for x, _, _ in parts]), np.concatenate(cells).astype(np.int32),
                     NO_CELLS[3], body, np.empty(0, np.int32), names, ("m", "heavy", "m"), surfaces, {}, pairs)


def went(times, plate, form="edges", v0=0.0, stick=STICK, **model):
    """Way of the slider [m], reaction of the plate [N] and friction heat so far [J] after each time.

    plate : signal of its way.  v0 : of the slider [m/s].
    """
    plain = {"E": E, "nu": 0.0, "alpha": 0.0, "rho": 1e-3}
    boundary = [{"body": "plate", "u_x": plate, "u_y": 0.0, "angle": 0.0}, {"body": "slider", "u_y": 0.0, "angle": 0.0},
                hold("bar.left", 0), hold("bar.bottom", 1), hold("bar.top", 1)]
    half = load(scene(form, stick), {"half": "elastic", "format": 2, "tolerance": 1e-8,
                              "materials": {"m": plain, "heavy": plain | {"rho": MASS / SIZE**2}},
                              "bodies": {"plate": {"material": "heavy", "rigid": True},
                                         "slider": {"material": "heavy", "rigid": True, "v0": [v0, 0.0]},
                                         "bar": {"material": "m"}}, "boundary": boundary, **model})
    found, heat = [], 0.0
    with closing(open_link("direct")) as link:
        state, _ = half.start(inputs_of(half), 0.0, link)
        for t0, t1 in zip([0.0, *times[:-1]], times, strict=True):
            state, out = done(half.step(state, inputs_of(half), t0, t1 - t0, link))
            heat += float(out["contact.E_friction"].sum())
            found.append((out["motion.slider"][0], out["reaction.plate"][0], heat))
    return np.array(found).T


@pytest.mark.slow
@pytest.mark.parametrize("form", ["edges", "nodes", "two passes"])
def test_a_cycle_to_and_fro_loses_what_friction_takes(form):
    """No inertia: 4 mu N (A - mu N/k - mu N/k_T) a cycle of amplitude A, in steps that do not end where it lets go."""
    A, cycles, steps = 3.3 * X_S, 2, 37
    corners = np.arange(2 * cycles + 2.0)
    plate = {"t": list(corners), "value": [0.0, *(A * (-1.0) ** np.arange(2 * cycles + 1))]}
    times = np.concatenate([c + np.arange(1, steps + 1) / steps for c in corners[:-1]])
    x, force, heat = went(times, plate, form)
    by_cycle = np.diff(heat[steps - 1 :: 2 * steps])
    assert by_cycle == pytest.approx(4.0 * MU * N * (A - X_S - MU * N / (STICK * SIZE)), rel=1e-6)
    assert np.abs(force).max() == pytest.approx(MU * N, rel=1e-8)
    assert np.abs(x).max() == pytest.approx(X_S, rel=1e-4)
    # The plate's work: its way goes straight from step to step, the force is that of each step's end.
    way = np.interp(times, plate["t"], plate["value"])
    work = (force[1:] * np.diff(way))[steps - 1 :].sum()
    stored = 0.5 * MU * N * (X_S + MU * N / (STICK * SIZE))
    assert work == pytest.approx(by_cycle.sum(), abs=2.0 * stored)


@pytest.mark.slow
def test_a_slider_that_swings_loses_what_coulomb_says():
    """6.5, 4.5, 2.5 and 0.5 x_s far, where it stays: its energy, and mu N over a path of 27.5 x_s."""
    far = 6.5 * X_S
    v0 = np.sqrt(K / MASS * ((far + X_S) ** 2 - X_S**2))
    times = np.pi * np.sqrt(MASS / K) * np.arange(1, 91) / 20.0
    x, _, heat = went(times, 0.0, v0=v0, dynamics={})
    assert x.max() == pytest.approx(far, rel=0.05)
    assert np.abs(x[-10:]).max() <= X_S
    assert heat[-1] == pytest.approx(MU * N * 27.5 * X_S, rel=0.005)
    assert heat[-1] == pytest.approx(0.5 * MASS * v0**2, abs=0.5 * K * X_S**2)


@pytest.mark.slow
def test_on_a_belt_it_sticks_then_slips_and_heats_as_the_swing_says():
    """Carried at V up to x_s, then x = x_s + V/w sin w tau: heat mu N (V tau - V/w sin w tau)."""
    w = np.sqrt(K / MASS)
    V = 2.0 * X_S * w
    lets_go = X_S / V
    end = lets_go + 1.9 * np.pi / w
    times = end * np.arange(1, 121) / 120.0
    x, _, heat = went(times, {"t": [0.0, 1e3], "value": [0.0, 1e3 * V]}, v0=V, stick=RIGID, dynamics={})
    tau = np.maximum(times - lets_go, 0.0)
    wanted = MU * N * (V * tau - V / w * np.sin(w * tau))
    assert np.abs(heat - wanted).max() <= 0.01 * wanted[-1]
    assert heat[-1] == pytest.approx(wanted[-1], rel=0.005)
    assert np.abs(x - np.where(tau > 0.0, X_S + V / w * np.sin(w * tau), V * times)).max() <= 0.01 * np.ptp(x)
