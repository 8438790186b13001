"""Observed orders: of the methods in time with every nonlinear term on, and of the elements in space (A12)."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, order, run, scene, spec, the_context

from contact.half.interface import Pair
from thermal_fmu.methods import METHODS, theta_method
from thermal_fmu.step import take_step

A12 = EXPECTED["A12"]
TOLERANCE = A12["tolerance"]


def method_of(name):
    return theta_method(float(name)) if name[0].isdigit() else METHODS[name]


def taken(context, method, s, t_end, n, t=0.0):
    """s after n equal undamped steps from t to t_end."""
    dt = (t_end - t) / n
    for i in range(n):
        s = take_step(context, method, s, None, t + i * dt, dt).s
    return s


@pytest.mark.parametrize(("name", "expected"), [("0.5", A12["theta_half"]), ("1.0", A12["theta_one"]),
                                                ("0.75", A12["theta_one"])])
def test_a12_decay_of_a_mode(name, expected):
    """sin(pi x) at t = .1, against its exact decay on the mesh: its eigenvalue there is 4 s/h^2."""
    n = 8
    bar = scene(Box(0, 1, 0, 1, n))
    context = the_context(bar, spec([{"on": f"a.{s}", "temperature": 0.0} for s in ("left", "right")]))
    mode, s = np.sin(np.pi * bar.nodes[:, 0]), np.sin(0.5 * np.pi / n) ** 2
    exact = np.exp(-0.1 * 4.0 * n**2 * s) * mode
    errors = [np.abs(taken(context, method_of(name), mode, 0.1, k) - exact).max() for k in (16, 32, 64)]
    assert abs(order(errors) - expected) < TOLERANCE
    assert errors[-1] < (2e-5 if expected == 2.0 else 6e-3)


@pytest.mark.few("0.5-2.0")
@pytest.mark.parametrize(("name", "expected"), [("0.5", A12["theta_half"]), ("1.0", A12["theta_one"]),
                                                ("sdirk2", A12["sdirk2"])])
def test_a12_nonlinear_decay_of_a_lump(name, expected):
    """dT/dt = -(1 + T) T from T = 1: 1/(2e - 1) at t = 1."""
    cell = scene(Box(0, 1, 0, 1, 1))
    context = the_context(cell, spec([{"on": "a.right", "convection": {"h": 1.0, "T": 0.0, "exponent": 1.0}},
                                      {"on": "a.left", "convection": {"h": 1.0, "T": 0.0}}], k=1e7))
    errors = [np.abs(taken(context, method_of(name), np.ones(4), 1.0, n) - 1.0 / (2.0 * np.e - 1.0)).max()
              for n in (32, 64, 128)]
    assert abs(order(errors) - expected) < TOLERANCE
    assert errors[-1] < (1e-5 if expected == 2.0 else 3e-3)


@cache
def two_bodies():
    """Two bodies, every coefficient a function of T: a course and a smooth start at t = .05.

    k(T), c(T), a film of exponent .3, far radiation with eps(T), contact by h(T), and near radiation beside it.
    """
    mesh = scene(Box(0, 1, 0, 1, 5, 2), Box(0.1, 1.1, 1, 2, 6, 2), pairs=(Pair("p", "b.bottom", "a.top", 0.05, 1e9),))
    law = {"law": "table", "variable": "T", "x": [100.0, 900.0], "h": [1.0, 9.0]}
    eps = {"polynomial": [0.3, 5e-4]}
    model = spec([{"on": "b.top", "convection": {"h": 0.4, "T": {"t": [0, 1], "value": [1500, 2500]}, "exponent": 0.3}},
                  {"on": "a.right", "radiation": {"emissivity": eps, "T": 300.0}},
                  {"on": "a.left", "temperature": {"t": [0, 1], "value": [300, 500]}}],
                 k={"polynomial": [0.5, 2e-3]}, c={"polynomial": [1.0, 1e-3, 1e-6]}, T0=300.0, sigma_SB=5e-9,
                 pairs={"p": {"conduction": {"closed": law, "open": None},
                              "radiation": {"emissivity_slave": eps, "emissivity_master": 0.9}}})
    model["bodies"]["b"] = {"material": "m", "T0": 700.0}
    context = the_context(mesh, model, t_N=np.full(len(mesh.pair_nodes), -1e6))
    s = np.where(mesh.node_body == 0, 300.0, 700.0)
    return context, taken(context, METHODS["backward_euler"], s, 0.05, 10)


@cache
def reference():
    """At t = .4: sdirk2 with 40 and 80 steps, extrapolated; its error is a hundredth of any measured here."""
    context, s = two_bodies()
    coarse, fine = (taken(context, METHODS["sdirk2"], s, 0.4, n, 0.05) for n in (40, 80))
    return (4.0 * fine - coarse) / 3.0


@pytest.mark.slow
@pytest.mark.parametrize(("name", "expected"), [("midpoint", 2.0), ("sdirk2", 2.0), ("0.5", 2.0),
                                                ("backward_euler", 1.0)])
def test_order_with_every_coefficient_a_function_of_temperature(name, expected):
    """Coefficients taken at the start of the step give order 1 and are seen here."""
    context, s = two_bodies()
    errors = [np.abs(taken(context, method_of(name), s, 0.4, n, 0.05) - reference()).max()
              for n in (8, 16, 32)]
    assert abs(order(errors) - expected) < TOLERANCE
    assert errors[-1] < (0.02 if expected == 2.0 else 3.0)


def test_theta_of_one_half_is_the_midpoint_rule_and_one_is_backward_euler():
    """To the bit, through the half, restarts included."""
    bar = scene(Box(0, 1, 0, 1, 10))
    model = spec([{"on": "a.right", "convection": {"h": 2.0, "T": {"t": [0, 1], "value": [500, 900]},
                                                   "exponent": 0.25}}], k={"polynomial": [1.0, 1e-2]}, T0=300.0)
    for theta, method in ((0.5, "midpoint"), (1.0, "backward_euler")):
        a = run(bar, model | {"method": "theta", "theta": theta}, 0.02, 4)
        b = run(bar, model | {"method": method}, 0.02, 4)
        assert a.T.tobytes() == b.T.tobytes()
        assert [o["iterations"] for o in a.outputs] == [o["iterations"] for o in b.outputs]
        assert a.imbalance() < EXPECTED["A16"]["tolerance"]


@pytest.mark.parametrize("theta", [0.5, 0.6, 0.9])
@pytest.mark.parametrize("dt", [0.1, 0.005])
def test_a_theta_below_one_does_not_ring_after_a_shock(theta, dt):
    bar = scene(Box(0, 1, 0, 1, 20))
    ran = run(bar, spec([{"on": "a.right", "temperature": 300.0}], T0=400.0, method="theta",
                        theta=theta), dt, 10)
    assert (np.diff(ran.T[:, 19]) < 0).all()


def crooked(X):
    """Inner nodes moved by a smooth map of the unit square."""
    bump = np.sin(np.pi * X[:, :1]) * np.sin(np.pi * X[:, 1:])
    return X + bump * np.array([0.08, -0.06])


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("name", ["steady", "midpoint"])
def test_order_in_space(triangles, name):
    """T = x^2 + 2 y^2 + t with k = 1 + T on crooked quads and triangles; walls and sources are fields.

    Q_T = 1 - div(k grad T) = 1 - 6 (1 + x^2 + 2 y^2 + t) - 4 x^2 - 16 y^2; the steady state is that of t = 0.  In time
    T is linear, so what is seen is the error in space alone.  Cells take the integral of k linear between nodes: of
    this solution, whose T and not that is a parabola, they are 1.2 (quads) to 1.5 times (triangles) as far as those
    that take T linear; where nothing is made inside it is the other way round (test_steep_conductivity).
    """
    rate = 0.0 if name == "steady" else 1.0
    since = {"t": [0, 10], "value": [0.0, 10.0 * rate]}
    exact = [{"x": {"polynomial": [0, 0, 1]}}, {"y": {"polynomial": [0, 0, 2]}}, {"t": since}]
    source = [{"t": rate - 6.0}, {"t": {"t": [0, 10], "value": [0.0, -60.0 * rate]}},
              {"x": {"polynomial": [0, 0, -10]}}, {"y": {"polynomial": [0, 0, -28]}}]
    errors = []
    for n in (5, 10, 20):
        mesh = scene(Box(0, 1, 0, 1, n, n, triangles=triangles), move=crooked)
        model = spec([{"on": f"a.{s}", "temperature": {"terms": exact}}
                      for s in ("left", "right", "bottom", "top")], k={"polynomial": [1.0, 1.0]})
        model["bodies"]["a"]["Q_T"] = {"terms": source}
        T0 = mesh.nodes**2 @ [1.0, 2.0]
        T = taken(the_context(mesh, model), METHODS[name], T0, 0.4, 4)
        errors.append(np.abs(T - T0 - 0.4 * rate).max())
    assert abs(order(errors[1:]) - 2.0) < 0.1
    assert errors[-1] < (3e-4 if triangles else 2e-4)
