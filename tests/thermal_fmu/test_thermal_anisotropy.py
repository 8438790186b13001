"""Conductivity tensors: patches with skewed axes (A13), axes that turn with the material, derivatives, heat flux."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_thermal_space import distorted, fixed_to
from thermal_scenes import EXPECTED, Box, FlatContact, inputs_of, run, scene, spec

from contact.half.interface import Pair
from contact.half.model import Done
from thermal_fmu.half import contact_at, load
from thermal_fmu.methods import METHODS
from thermal_fmu.newton import StageProblem, balance
from thermal_fmu.scene import freeze
from thermal_fmu.sources import loads_at

ANGLE = 0.6
SKEW = {"k_1": 40.0, "k_2": 5.0, "angle": ANGLE, "turns": False}
CAST = {"L": 3.0e5, "T_s": 400.0, "T_l": 440.0}


def tensor(k_1, k_2, angle):
    a, b = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    return k_1 * np.outer(a, a) + k_2 * np.outer(b, b)


def turn(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("geometry", ["plane", "axisymmetric"])
def test_a13_patch_with_skewed_axes(triangles, geometry):
    """Linear T; when axisymmetric the one without radial flux, k_rr T,r + k_rz T,z = 0 (any other needs a source)."""
    K = tensor(40.0, 5.0, ANGLE)
    g = np.array([30.0, -17.0]) if geometry == "plane" else np.array([17.0 * K[0, 1] / K[0, 0], -17.0])
    mesh = scene(Box(0.5, 1.5, 0, 1, 5, 5, triangles=triangles), geometry=geometry, move=distorted)
    exact = 300.0 + mesh.nodes @ g
    ran = run(mesh, spec(fixed_to(mesh, exact), k=SKEW, method="steady", T0=300.0), 1.0, 1)
    assert np.abs(ran.T[-1] - exact).max() < EXPECTED["A13"]["tolerance"]
    assert ran.outputs[-1]["iterations"] == 1
    q = -K @ g
    assert np.abs(ran.outputs[-1]["q"] - q).max() < 1e-11 * np.abs(q).max() * 10
    assert geometry == "plane" or abs(q[0]) < 1e-12


def cooling(k, move, triangles=False):
    """The outputs after 3 steps of a square with a cold side and a warm one, on x = move(X)."""
    mesh = scene(Box(-0.5, 0.5, -0.5, 0.5, 6, 6, triangles=triangles), move=distorted)
    cold = [{"on": "a.left", "temperature": 100.0},
            {"on": "a.top", "convection": {"h": 30.0, "T": 700.0}}]
    half = load(mesh, spec(cold, k=k, T0=500.0, rho=100.0, c=10.0, method="sdirk2"))
    state, _ = half.start(inputs_of(mesh, half), 0.0, FlatContact())
    for i in range(3):
        done = half.step(state, inputs_of(mesh, half, x=move(mesh.nodes)), 2.0 * i, 2.0, FlatContact())
        assert isinstance(done, Done), done
        state = done.state
    return done.outputs


@pytest.mark.parametrize("triangles", [False, True])
def test_axes_turn_with_the_material(triangles):
    """A rigid turn by 2.5 rad changes nothing where axes turn, 1 K and more where they stay; q turns with it."""
    R = turn(2.5)
    turning = SKEW | {"turns": True}
    still = cooling(turning, lambda X: X, triangles)
    turned = cooling(turning, lambda X: X @ R.T + np.array([3.0, -1.0]), triangles)
    assert np.abs(turned["T"] - still["T"]).max() < 1e-9
    assert np.abs(turned["q"] - still["q"] @ R.T).max() < 1e-9 * np.abs(still["q"]).max()
    stays = cooling(SKEW, lambda X: X @ R.T, triangles)
    assert np.abs(stays["T"] - still["T"]).max() > 1.0


def test_the_turn_is_that_of_the_polar_decomposition():
    """x = R U X: as on U X, whose stretch is symmetric and so turns nothing, and as axes set at angle + turn."""
    U = np.array([[1.3, 0.2], [0.2, 0.8]])
    R = turn(0.7)
    turning = SKEW | {"turns": True}
    stretched = cooling(turning, lambda X: X @ U)
    moved = cooling(turning, lambda X: X @ (R @ U).T)
    assert np.abs(moved["T"] - stretched["T"]).max() < 1e-9
    fixed = cooling(SKEW, lambda X: X @ U)
    assert np.abs(fixed["T"] - stretched["T"]).max() < 1e-9
    set_so = cooling(SKEW | {"angle": ANGLE + 0.7}, lambda X: X @ (R @ U).T)
    assert np.abs(moved["T"] - set_so["T"]).max() < 1e-9


def test_equal_axes_are_isotropic():
    def grow(X):
        return X @ np.array([[1.1, 0.2], [0.0, 0.9]])

    law = {"polynomial": [20.0, 0.05]}
    plain = cooling(law, grow)
    equal = cooling({"k_1": law, "k_2": law, "angle": 0.3, "turns": True}, grow)
    assert np.abs(plain["T"] - equal["T"]).max() < 1e-10
    assert np.abs(plain["q"] - equal["q"]).max() < 1e-9 * np.abs(plain["q"]).max()


@pytest.mark.parametrize("latent", [None, CAST], ids=["solid", "melts"])
@pytest.mark.parametrize("chosen", ["midpoint", "sdirk2"])
def test_the_jacobian_is_the_derivative(latent, chosen):
    """Central differences in s, everything on: tensors of T and f_s that turn, film, contact; relative 1e-7.

    No node is within .5 K of a kink of its law.
    """
    mesh = scene(Box(0, 0.1, 0, 0.1, 3, 2, triangles=True), Box(0, 0.1, 0.1, 0.2, 4, 2),
                 pairs=(Pair("p", "b.bottom", "a.top", 0.1, 0.0),))
    table = {"law": "table", "variable": "T", "x": [300, 500], "h": [1000.0, 5000.0]}
    k_1 = {"polynomial": [40.0, 0.05]}
    k = {"k_1": {"solid": k_1, "liquid": 20.0} if latent else k_1, "k_2": {"polynomial": [15.0, 0.01]}, "angle": 0.4,
         "turns": True}
    model = spec([{"on": "a.bottom", "temperature": 300.0},
                  {"on": "b.top", "convection": {"h": 50, "T": 700, "exponent": 0.25}}],
                 k=k, c={"polynomial": [800.0, 0.5, 2e-3]}, rho=2000.0, T0=380.0,
                 pairs={"p": {"conduction": {"closed": table, "open": None}}})
    model["bodies"]["b"] = {"material": "m", "T0": 420.0}
    if latent:
        model["materials"]["m"]["latent"] = latent
    half, link = load(mesh, model), FlatContact()
    x = mesh.nodes @ np.array([[1.0, 0.0], [0.0, 1.1]])
    given = inputs_of(mesh, half, t_N=np.full(len(mesh.pair_nodes), -1e6))
    half.start(given, 0.0, link)
    sc = half._scene
    held = freeze(sc, sc.masses(mesh.nodes), x @ turn(0.0), np.zeros(20), contact_at(sc.surfaces, x, given, link))
    s = 480.0 + (250.0 if latent else 60.0) * np.sin(np.arange(len(mesh.nodes)))
    if latent:
        kinks = np.array([400.0, 400.0 + sc.melting[0].change.W])
        assert np.abs(s[:, None] - kinks).min() > 0.5
        assert sum(((s > kinks[0]) & (s < kinks[1])).tolist()) > 3
    zeros = np.zeros(s.size)
    stage = METHODS[chosen].stages[-1]
    problem = StageProblem(sc, held, loads_at(sc.model, {}, 0.0, 1), stage, 0.7, s - 5.0, zeros, zeros, True)
    J = balance(problem, s, jacobian=True).jacobian.toarray()
    free = np.flatnonzero(~sc.fixed)
    for j in free:
        e = np.where(np.arange(s.size) == j, 1e-3, 0.0)
        column = (balance(problem, s + e, False).R - balance(problem, s - e, False).R)[free] / 2e-3
        assert np.abs(J[free, j] - column).max() < 1e-7 * np.abs(J).max()


def test_surfaces_tell_what_they_gave_off():
    """surface.E of both sides of a pair = the heat of the ledger, node by node on the matching mesh; surface.T is T."""
    mesh = scene(Box(0, 1, 0, 1, 4, 3), Box(0, 1, 1, 2, 4, 3), pairs=(Pair("p", "b.bottom", "a.top", 0.1, 0.0),))
    model = spec([{"on": "a.bottom", "temperature": 300.0}], k=SKEW, T0=300.0, rho=10.0,
                 method="sdirk2", pairs={"p": {"conduction": {"closed": {"law": "constant", "h": 50.0}, "open": None}}})
    model["bodies"] |= {"a": {"material": "m", "T0": 300.0, "Q_T": 200.0}, "b": {"material": "m", "T0": 600.0}}
    half, link = load(mesh, model), FlatContact()
    given = inputs_of(mesh, half, t_N=np.full(len(mesh.pair_nodes), -1e6), E_M=np.full(24, 3.0))
    state, _ = half.start(given, 0.0, link)
    for i in range(3):
        done = half.step(state, given, 0.2 * i, 0.2, link)
        state, out = done.state, done.outputs
        assert np.array_equal(out["surface.T"], out["T"][mesh.contact_nodes])
        upper = mesh.node_body[mesh.contact_nodes] == 1
        assert out["surface.E"][upper].sum() == pytest.approx(-out["heat.contact.slave"], rel=1e-9)
        assert out["surface.E"][~upper].sum() == pytest.approx(-out["heat.contact.master"], rel=1e-9)
        at = mesh.nodes[mesh.contact_nodes]
        one, other = (out["surface.E"][side][np.argsort(at[side, 0])] for side in (upper, ~upper))
        assert np.abs(one + other).max() < 1e-8 * np.abs(one).max()
        assert one.min() > 0.0
