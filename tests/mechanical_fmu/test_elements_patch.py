"""B16: constant states are met exactly by every element, elastic and plastic, warm and cold.  B17: they turn along."""

from __future__ import annotations

import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from cell_scenes import EXPECTED, PLANE, Stuff, equilibrium, mesh, moduli_of, of, rim, volume_of

from mechanical_fmu.cells import Treatment
from mechanical_fmu.volume import PointStep

N = 4
SMALL = EXPECTED["B16"]["tolerance"]
STUFF = Stuff(2.5, 0.25, yield_stress=0.05, H=0.1)
AROUND = {"mean dilatation": Treatment(), "enhanced": Treatment(enhanced=True)}
FORMS = [("plane", kind, form) for kind, form in product(("quads", "triangles"), PLANE)]
FORMS += [("axisymmetric", kind, form) for kind, form in product(("quads", "triangles"), AROUND)]
G = {"plane": np.array([[0.05, 0.03], [-0.02, -0.04]]), "axisymmetric": np.diag([0.03, -0.05])}


def stress(volume, found, moduli):
    return np.concatenate([s.reshape(-1, 4) for s, _ in volume.stress(found.u, moduli, found.step)])


@pytest.mark.parametrize("plastic", [False, True], ids=("elastic", "plastic"))
@pytest.mark.parametrize(("geometry", "kind", "form"), FORMS, ids=str)
def test_a_constant_strain_held_at_the_rim_is_found_inside(geometry, kind, form, plastic):
    interface = mesh(kind, geometry, N)
    volume = volume_of(interface, of(PLANE[form], plastic))
    moduli = moduli_of(volume, STUFF)
    u = interface.nodes @ G[geometry].T
    found = equilibrium(volume, moduli, {(i, c): u[i, c] for i in rim(N) for c in (0, 1)}, tolerance=1e-14, floor=1.0)
    assert np.abs(found.u - u).max() <= SMALL
    s = stress(volume, found, moduli)
    assert np.abs(s).max() > 0.02
    assert np.abs(s - s.mean(axis=0)).max() <= SMALL * np.abs(s).max()
    if plastic:
        assert found.heat.min() > 0.0
        assert np.ptp(found.heat / np.concatenate([c.volume for c in volume.kinds])) <= SMALL
    if "stress" in form:
        assert np.abs(s[:, 3]).max() <= SMALL


@pytest.mark.parametrize(("geometry", "kind", "form"), FORMS, ids=str)
def test_a_free_body_at_another_temperature_grows_without_stress(geometry, kind, form):
    interface = mesh(kind, geometry, N)
    free = 0.02
    volume = volume_of(interface, PLANE[form])
    moduli = moduli_of(volume, Stuff(2.5, 0.25, free))
    if geometry == "plane" and "stress" not in form:
        # Held in its plane of strain the body is not free: it grows by the transverse strain as well.
        pytest.skip("plane strain holds the body through its thickness")
    held = {(i * (N + 1), 1): 0.0 for i in range(N + 1)}
    if geometry == "plane":
        held |= {(0, 0): 0.0}
    found = equilibrium(volume, moduli, held, tolerance=1e-14, floor=1.0)
    grown = interface.nodes * free - (np.array([free, 0.0]) if geometry == "plane" else 0.0)
    assert np.abs(found.u - grown).max() <= SMALL
    assert np.abs(stress(volume, found, moduli)).max() <= SMALL


@pytest.mark.parametrize("form", PLANE)
def test_a_uniform_pull_makes_uniform_stress(form):
    """The load form of the patch: dead forces on an edge, small, against Hooke's law."""
    interface = mesh("quads", "plane", N)
    volume = volume_of(interface, PLANE[form])
    pull, E, nu = 1e-9, STUFF.E, STUFF.nu
    force = np.zeros_like(interface.nodes)
    right = np.arange(N * (N + 1), (N + 1) ** 2)
    force[right, 0] = pull / N * np.where(np.isin(right, right[[0, -1]]), 0.5, 1.0)
    moduli = moduli_of(volume, STUFF)
    found = equilibrium(volume, moduli, {(j, 0): 0.0 for j in range(N + 1)} | {(0, 1): 0.0}, force, tolerance=1e-5)
    s = stress(volume, found, moduli) / pull
    assert np.abs(s[:, [0, 1, 2]] - [1.0, 0.0, 0.0]).max() <= 1e-5  # round-off of F over a strain of 4e-10
    E_plane = E if "stress" in form else E / (1.0 - nu * nu)
    assert found.u[right, 0] == pytest.approx(pull / E_plane, rel=1e-5)


@pytest.mark.parametrize("plastic", [False, True], ids=("elastic", "plastic"))
@pytest.mark.parametrize("kind", ["quads", "triangles"])
@pytest.mark.parametrize("form", PLANE)
def test_turned_by_75_degrees_in_three_unequal_steps_the_stress_turns_along(form, kind, plastic):
    """B17: a block stretched by 1.3 with a waist, then turned rigidly; plastic points flow no further."""
    interface = mesh(kind, "plane", N)
    volume, X = volume_of(interface, of(PLANE[form], plastic)), interface.nodes
    moduli = moduli_of(volume, STUFF)
    x = X * [EXPECTED["B17"]["stretch"], 1.0] + 0.03 * np.stack([0.0 * X[:, 0], np.sin(4.0 * X[:, 0])], axis=1)
    now = volume.evaluate(x - X, moduli, PointStep(1.0))
    still, forces = volume.stress(x - X, moduli, PointStep(1.0))[0][0], now.f
    assert not plastic or now.heat.min() > 0.0
    for degrees in (10.0, 31.0, EXPECTED["B17"]["degrees"]):
        c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
        Q = np.array([[c, -s], [s, c]])
        u = x @ Q.T - X
        turned = volume.stress(u, moduli, PointStep(1.0, now.history))[0][0]
        now = volume.evaluate(u, moduli, PointStep(1.0, now.history))
        full = np.array([[still[..., 0], still[..., 2]], [still[..., 2], still[..., 1]]])
        want = np.einsum("ai,ij...,bj->ab...", Q, full, Q)
        got = np.stack([turned[..., 0], turned[..., 1], turned[..., 2], turned[..., 3]])
        scale = EXPECTED["B17"]["tolerance"] * np.abs(still).max()
        assert np.abs(got - np.stack([want[0, 0], want[1, 1], want[0, 1], still[..., 3]])).max() <= scale
        assert np.abs(now.f - forces @ Q.T).max() <= EXPECTED["B17"]["tolerance"] * np.abs(forces).max()
        assert np.abs(now.heat).max(initial=0.0) <= 1e-10
