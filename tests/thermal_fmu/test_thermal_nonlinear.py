"""Temperature dependent properties, Newton's method and the heat balance (A7, A16, A17)."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from thermal_scenes import EXPECTED, Box, FlatContact, imbalance, inputs_of, run, scene, spec

from contact.half.interface import Pair
from thermal_fmu.half import contact_at, load
from thermal_fmu.methods import METHODS
from thermal_fmu.newton import StageProblem, balance
from thermal_fmu.scene import freeze
from thermal_fmu.sources import loads_at

PEAK = {"T": [0, 395, 398, 400, 402, 405, 1000], "value": [900, 900, 950, 60000, 950, 900, 900], "form": "cubic"}
QUADRATIC = {"polynomial": [800.0, 0.5, 2e-3]}


def test_a7_conductivity_linear_in_temperature():
    case = EXPECTED["A7"]
    bar = scene(Box(0, 1, 0, 1, 20))
    model = spec([{"on": "a.left", "temperature": 100.0},
                  {"on": "a.right", "temperature": 500.0}], k={"polynomial": [10.0, 0.02]}, T0=100.0,
                 method="steady")
    ran = run(bar, model, 1.0, 1)
    out = ran.outputs[-1]
    # T^2 and T combined are linear in x: nodally exact but for the quadrature of k, so 20 cells give 1e-9.
    assert abs(ran.T[-1, 10] - case["T_half"]) < 1e-6
    assert out["iterations"] <= case["iterations"]
    assert abs(out["heat.temperature.in"] + out["heat.temperature.out"]) < 1e-6 * case["q"]
    probe = load(bar, model)
    Q = -np.array([_flow_in(probe, bar, ran.T[-1], edge) for edge in ("a.left", "a.right")])
    assert np.abs(np.abs(Q) / case["q"] - 1.0).max() < 1e-9


def _flow_in(half, mesh, T, surface):
    """Residual of steady conduction at the nodes of a surface [W]."""
    scene_ = half._scene
    held = freeze(scene_, scene_.masses(mesh.nodes), mesh.nodes, np.zeros(len(mesh.quads)), None)
    stage = METHODS["steady"].stages[0]
    problem = StageProblem(scene_, held, loads_at(scene_.model, {}, 0.0, 1), stage, 1.0, T, np.zeros(T.size),
                           np.zeros(T.size), False)
    return balance(problem, T, jacobian=False).R[np.unique(mesh.surfaces[surface])].sum()


def test_a17_flux_into_a_medium_that_stiffens():
    case = EXPECTED["A17"]
    bar = scene(Box(0, 2, 0, 1, 40))
    law = {"polynomial": [1.0, 0.5]}
    ran = run(bar, spec([{"on": "a.left", "flux": 1.0}], k=law, c=law), 0.01, 100)
    for t, expected in zip(case["t"], case["T"], strict=True):
        T = ran.T[round(t / 0.01) - 1]
        # 40 elements, dt .01: 2e-4 is the size of h^2/12 of the curvature.
        assert np.abs(T[[0, 20, 40]] - expected).max() < 5e-4
    assert ran.imbalance() < EXPECTED["A16"]["tolerance"]


@pytest.mark.few("plane-sdirk2-peaked", "axisymmetric-midpoint-quadratic", "axisymmetric-sdirk2-constant")
@pytest.mark.parametrize("c", [500.0, QUADRATIC, PEAK], ids=["constant", "quadratic", "peaked"])
@pytest.mark.parametrize("method", ["midpoint", "sdirk2", "backward_euler"])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_a16_heat_balance_on_a_moving_mesh(c, method, geometry):
    """All mechanisms at once, mesh squeezed as it goes: the ledger closes, and each step's too."""
    mesh = scene(Box(0.1, 0.2, 0, 0.1, 6, 5, triangles=True), Box(0.1, 0.2, 0.1, 0.2, 5, 4), geometry=geometry,
                 pairs=(Pair("p", "b.bottom", "a.top", 0.1, 0.0),))
    gas = {"law": "gas", "k_g": 0.05, "g_m": 1e-4}
    model = spec([{"on": "a.bottom", "temperature": {"t": [0, 10], "value": [300, 420]}},
                  {"on": "b.right", "flux": 3e4},
                  {"on": "b.top", "convection": {"h": 50, "T": 700, "exponent": 0.25}},
                  {"on": "a.top", "convection": {"h": 40, "T": 350, "gap": {"d_cut": 1e-3, "d_full": 6e-3}}}],
                 k={"polynomial": [20.0, 0.01]}, c=c, rho=2000.0, T0=380.0, method=method,
                 pairs={"p": {"conduction": {"closed": {"law": "constant", "h": 3000.0}, "open": gas}}})
    model["bodies"] = {"a": {"material": "m", "T0": 390.0, "Q_T": 2e5}, "b": {"material": "m", "T0": 420.0}}
    half, link = load(mesh, model), FlatContact()
    given = inputs_of(mesh, half, E_M=np.linspace(0, 5, len(mesh.quads) + len(mesh.triangles)))
    state, _ = half.start(given, 0.0, link)
    outputs, n = [], 12
    for i in range(n):
        x = mesh.nodes * np.array([1.0 + 0.02 * i, 1.0 - 0.01 * i])
        x[mesh.node_body == 1, 1] += 0.002 * (i % 3)
        t_N = np.full(len(mesh.pair_nodes), -1e6 if i % 3 == 0 else 0.0)
        done = half.step(state, given | {"x": x, "contact.t_N": t_N}, 0.5 * i, 0.5, link)
        state = done.state
        outputs.append(dict(done.outputs))
        assert imbalance(outputs[-1:]) < EXPECTED["A16"]["tolerance"]
    assert imbalance(outputs) < EXPECTED["A16"]["tolerance"]
    terms = {k for o in outputs for k, v in o.items() if k.startswith("heat.") and v != 0.0}
    assert {"heat.contact.slave", "heat.gap.master", "heat.mechanical", "heat.source", "heat.flux",
            "heat.convection", "heat.temperature.in"} <= terms
    made = sum(o["heat.mechanical"] for o in outputs)
    assert abs(made / (n * given["E_M"].sum()) - 1.0) < 1e-12


def test_squeezing_a_mesh_makes_no_heat():
    """rho dV = rho0 dV0: an insulated body keeps T and enthalpy while its volume shrinks by half."""
    mesh = scene(Box(0, 1, 0, 1, 3, 3))
    half, link = load(mesh, spec([], T0=400.0)), FlatContact()
    state, _ = half.start(inputs_of(mesh, half), 0.0, link)
    for i in range(5):
        x = mesh.nodes * np.array([1.0, 1.0 - 0.1 * i])
        done = half.step(state, inputs_of(mesh, half, x=x), float(i), 1.0, link)
        state = done.state
    assert np.abs(state.s - 400.0).max() == 0.0
    heated = half.step(state, inputs_of(mesh, half, x=x, E_M=np.full(9, 2.0)), 5.0, 1.0, link)
    assert abs(np.mean(heated.outputs["T"]) - 418.0) < 1e-9  # 18 J into 1 kg of c = 1 in the reference


@pytest.mark.parametrize("stage", range(2))
def test_the_jacobian_is_the_derivative(stage):
    """Finite differences of the residual, every term on: relative 1e-7 (central differences, step 1e-3 K)."""
    mesh = scene(Box(0, 0.1, 0, 0.1, 3, 2, triangles=True), Box(0, 0.1, 0.1, 0.2, 4, 2),
                 pairs=(Pair("p", "b.bottom", "a.top", 0.1, 0.0),))
    table = {"law": "table", "variable": "T", "x": [300, 500], "h": [1000.0, 5000.0]}
    model = spec([{"on": "a.bottom", "temperature": 300.0},
                  {"on": "b.top", "convection": {"h": 50, "T": 700, "exponent": 0.25}}],
                 k={"polynomial": [20.0, 0.01]}, c=QUADRATIC, rho=2000.0, T0=380.0,
                 pairs={"p": {"conduction": {"closed": table, "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": 420.0}
    half, link = load(mesh, model), FlatContact()
    given = inputs_of(mesh, half, t_N=np.full(len(mesh.pair_nodes), -1e6))
    half.start(given, 0.0, link)
    sc = half._scene
    held = freeze(sc, sc.masses(mesh.nodes), mesh.nodes, np.zeros(20), contact_at(sc.surfaces, mesh.nodes, given, link))
    T = 380.0 + 60.0 * np.sin(np.arange(len(mesh.nodes)))
    zeros = np.zeros(T.size)
    chosen = METHODS["midpoint"].stages[0] if stage == 0 else METHODS["sdirk2"].stages[1]
    problem = StageProblem(sc, held, loads_at(sc.model, {}, 0.0, 1), chosen, 0.7, T - 5.0, zeros, zeros, True)
    J = balance(problem, T, jacobian=True).jacobian.toarray()
    free = np.flatnonzero(~sc.fixed)
    for j in free:
        e = np.where(np.arange(T.size) == j, 1e-3, 0.0)
        column = (balance(problem, T + e, False).R - balance(problem, T - e, False).R)[free] / 2e-3
        assert np.abs(J[free, j] - column).max() < 1e-7 * np.abs(J).max()


def test_newton_converges_quadratically_and_a_linear_scene_takes_one_solve():
    bar = scene(Box(0, 1, 0, 1, 10))
    film = [{"on": "a.right", "convection": {"h": 2.0, "T": 300.0}}]
    linear = run(bar, spec(film, T0=400.0), 0.05, 4)
    # The damped start is four quarter steps, one solve each.
    assert [o["iterations"] for o in linear.outputs] == [4, 1, 1, 1]
    curved = run(bar, spec(film, k={"polynomial": [1.0, 0.01]}, c={"polynomial": [1.0, 0.0, 1e-5]}, T0=400.0), 0.05, 4)
    assert max(o["iterations"] for o in curved.outputs[1:]) <= 4
