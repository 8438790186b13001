"""Newton's method: its exponent, peaked heat capacities, and what is told where it cannot go on."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_thermal_phase import PURE, held_at, metal
from thermal_scenes import EXPECTED, Box, FlatContact, inputs_of, run, scene, spec

from contact.half.model import Discard, Done
from thermal_fmu import newton as newton_module
from thermal_fmu.half import load
from thermal_fmu.settled import left_over


def residuals_of(monkeypatch, mesh, model, dt):
    """Norm of the residual at every iterate of one step."""
    norms: list[float] = []
    original = newton_module.descend

    def noted(balance_at, s, step, before, floor, may_climb):
        trial, after = original(balance_at, s, step, before, floor, may_climb)
        norms.extend([before.norm, after.norm] if not norms else [after.norm])
        return trial, after

    monkeypatch.setattr(newton_module, "descend", noted)
    run(mesh, model, dt, 1)
    return norms


@pytest.mark.parametrize("k", [{"polynomial": [5.0, 0.02]},
                               {"k_1": {"polynomial": [5.0, 0.02]}, "k_2": 3.0, "angle": 0.4, "turns": False}],
                         ids=["isotropic", "skewed"])
def test_newton_is_quadratic_on_smooth_problems(monkeypatch, k):
    """k(T), c(T), free convection: the exponent of the last three residuals above round-off is at least 1.8."""
    mesh = scene(Box(0, 0.1, 0, 0.1, 8, 8))
    model = spec([{"on": "a.right", "convection": {"h": 20.0, "T": 1500.0, "exponent": 0.33}},
                  held_at("left", 300.0)], k=k, c={"polynomial": [400.0, 0.3, 3e-4]}, rho=3000.0, T0=400.0,
                 method="backward_euler", tolerance=1e-14)
    norms = np.array(residuals_of(monkeypatch, mesh, model, 400.0))
    # Below 1e-11 of the first residual round-off takes over.
    above = np.log(norms[norms > 1e-11 * norms[0]])
    assert len(above) >= 3
    last = above[-3:]
    assert (last[2] - last[1]) / (last[1] - last[0]) >= 1.8


@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
@pytest.mark.parametrize("dt", [1.0, 30.0])
def test_a_sharply_peaked_heat_capacity(dt, method):
    """All the latent heat of a metal in a peak of c(T) 4 K wide, no phase change said: steps converge, heat is kept."""
    peak = {"T": [300, 928, 930, 931, 932, 934, 1200], "value": [1100, 1100, 1.1e5, 2e5, 1.1e5, 1180, 1180],
            "form": "cubic"}
    mesh = scene(Box(0, 0.05, 0, 0.01, 12))
    ran = run(mesh, spec([held_at("right", 600.0)], k=100.0, c=peak, rho=2500.0, T0=940.0, method=method), dt, 4)
    assert ran.imbalance() < EXPECTED["A16"]["tolerance"]
    assert ran.T.min() > 599.0


def test_a_property_that_fails_names_body_and_cell():
    mesh = scene(Box(0, 1, 0, 1, 4, 1))
    model = spec([held_at("right", 900.0), held_at("left", 300.0)], k={"polynomial": [10.0, -0.02]}, T0=300.0)
    half = load(mesh, model)
    state, _ = half.start(inputs_of(mesh, half), 0.0, FlatContact())
    answer = half.step(state, inputs_of(mesh, half), 0.0, 1.0, FlatContact())
    assert isinstance(answer, Discard)
    assert "conductivity of body a is -" in answer.message
    assert "in cell 4" in answer.message
    assert answer.dt_suggest == 0.5


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_heat_that_is_not_finite_names_body_and_node(bad):
    mesh = scene(Box(0, 1, 0, 1, 4, 1))
    half = load(mesh, metal([held_at("left", 300.0)], PURE))
    given = inputs_of(mesh, half)
    given["E_M"] = np.array([0.0, 0.0, 0.0, bad])
    state, _ = half.start(given, 0.0, FlatContact())
    answer = half.step(state, given, 0.0, 1.0, FlatContact())
    assert isinstance(answer, Discard)
    assert "not finite at node 4 of body a" in answer.message


def test_a_trial_that_leaves_a_propertys_range_is_shortened():
    """k turns negative above 520 K: Newton's first step goes there, its solution does not."""
    mesh = scene(Box(0, 0.1, 0, 0.01, 10))
    law = {"polynomial": [10.0, -0.0476], "T_ref": 310.0}
    model = spec([{"on": "a.right", "flux": 8000.0}, held_at("left", 300.0)], k=law, T0=300.0,
                 method="steady")
    half = load(mesh, model)
    state, _ = half.start(inputs_of(mesh, half), 0.0, FlatContact())
    done = half.step(state, inputs_of(mesh, half), 0.0, 1.0, FlatContact())
    assert isinstance(done, Done), done
    # Kirchhoff: integral of k from 300 to T(L) = q L.
    T = done.outputs["T"].max()
    psi = 10.476 * (T - 300.0) - 0.0238 * (T - 300.0) ** 2
    assert abs(psi / 800.0 - 1.0) < 0.01


def test_the_phase_continuation_is_used_and_counted(monkeypatch):
    """A slab that freezes in one step: without the detour there is no way, with it the solves add up."""
    mesh = scene(Box(0, 0.2, 0, 0.01, 40))
    model = metal([held_at("right", 293.15)], PURE, method="backward_euler")
    assert run(mesh, model, 100.0, 1).outputs[0]["iterations"] > 25

    def none(solve, tolerance):
        raise newton_module.NotConvergedError("no detour")

    monkeypatch.setattr(newton_module, "phase_continuation", none)
    half = load(mesh, model)
    state, _ = half.start(inputs_of(mesh, half), 0.0, FlatContact())
    answer = half.step(state, inputs_of(mesh, half), 0.0, 100.0, FlatContact())
    assert isinstance(answer, Discard)
    assert answer.dt_suggest == 50.0


def test_round_off_is_no_heat_that_is_missing():
    """A step in which hardly any heat flows leaves the round-off of what the bodies hold, which may be all of it."""
    at_rest = SimpleNamespace(norm=5e-13, missing=5e-13, scale=1e-12)
    assert left_over(at_rest, floor=1e-12) == 0.0
    assert left_over(at_rest, floor=1e-13) == pytest.approx(0.4)
    assert left_over(SimpleNamespace(norm=0.0, missing=0.0, scale=0.0), floor=0.0) == 0.0
