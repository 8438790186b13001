"""B5, B6, B8: bending without locking; and where enhanced strain must not be used: hourglasses under compression.

The closed forms of B8 are linear: its load is scaled by SMALL and the answer by 1/SMALL.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from cell_scenes import EXPECTED, PLANE, Stuff, equilibrium, grid, moduli_of, quads, volume_of

from contact.half.linalg import pattern_of
from mechanical_fmu.cells import Treatment
from mechanical_fmu.volume import PointStep

SMALL = 1e-6


def cook(n, form, triangles=False):
    """Deflection of the middle of the free edge."""
    nodes, cells = grid(n, n, lambda s, t: (48.0 * s, 44.0 * s + t * (44.0 - 28.0 * s)))
    interface = quads(nodes, cells)
    if triangles:
        halves = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]]).astype(np.int32)
        interface = replace(interface, quads=np.empty((0, 4), np.int32), quad_body=np.empty(0, np.int32),
                            triangles=halves, triangle_body=np.zeros(len(halves), np.int32))
    volume = volume_of(interface, form)
    force = np.zeros_like(nodes)
    right = np.arange(n * (n + 1), (n + 1) ** 2)
    force[right, 1] = SMALL / n * np.where(np.isin(right, right[[0, -1]]), 0.5, 1.0)
    held = {(j, c): 0.0 for j in range(n + 1) for c in (0, 1)}
    found = equilibrium(volume, moduli_of(volume, Stuff(1.0, 1.0 / 3.0)), held, force, tolerance=1e-7)
    return found.u[right[n // 2], 1] / SMALL


def test_cook_s_membrane():
    """B8.  Every element climbs to the answer; the table is what docs/elements.md shows."""
    v, tolerance = EXPECTED["B8"]["v"], EXPECTED["B8"]["tolerance"]
    table = {"quads": [11.8452, 18.2992, 22.0792, 23.4304, 23.8176],
             "enhanced": [21.0503, 23.0164, 23.6888, 23.8833, 23.9398],
             "triangles": [6.7425, 11.252, 17.3312, 21.5921, 23.2751]}
    meshes = (2, 4, 8, 16, 32)
    for name, form, triangles in (("quads", PLANE["plane stress"], False),
                                  ("enhanced", PLANE["enhanced plane stress"], False),
                                  ("triangles", PLANE["plane stress"], True)):
        found = [cook(n, form, triangles) for n in meshes]
        assert found == pytest.approx(table[name], rel=1e-4)
        assert (np.diff(np.abs(np.array(found) - v)) < 0.0).all()
        assert abs(found[-1] - v) <= (tolerance if name == "enhanced" else 0.03) * v


def test_the_elastica():
    """B6: a dead load at the tip of a cantilever, rotations beyond 80 degrees, one cell through the thickness."""
    case, n, h, E = EXPECTED["B6"], 40, 0.01, 1e9
    nodes, cells = grid(n, 1, lambda s, t: (s, h * t))
    volume, found = volume_of(quads(nodes, cells), PLANE["enhanced plane stress"]), None
    moduli = moduli_of(volume, Stuff(E, 0.0))
    tips = {}
    for load in range(1, 11):
        force = np.zeros_like(nodes)
        force[-2:, 1] = -load * E * h**3 / 12.0 / 2.0
        found = equilibrium(volume, moduli, {(0, 0): 0.0, (1, 0): 0.0, (0, 1): 0.0}, force, found, tolerance=1e-8)
        tips[float(load)] = -found.u[-2:].mean(axis=0)
    for load, w, u in zip(case["PL2_EI"], case["w_L"], case["u_L"], strict=True):
        assert tips[load] == pytest.approx([u, w], rel=case["tolerance"])


def test_a_bimetal_strip():
    """B5: two metals heated by 100 K, plane stress, two cells through the thickness."""
    case, n = EXPECTED["B5"], 40
    nodes, cells = grid(n, 2, lambda s, t: (0.1 * s, 0.002 * t))
    volume = volume_of(quads(nodes, cells, body=np.arange(len(cells)) % 2), *(PLANE["enhanced plane stress"],) * 2)
    moduli = moduli_of(volume, Stuff(200e9, 0.3, 12e-4), Stuff(70e9, 0.3, 24e-4))
    found = equilibrium(volume, moduli, {(1, 0): 0.0, (1, 1): 0.0, (0, 0): 0.0}, tolerance=1e-10, floor=1e6)
    middle = (nodes + found.u).reshape(n + 1, 3, 2)[:, 1]
    a, b, c = middle[n // 4], middle[n // 2], middle[3 * n // 4]
    area = (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]
    curvature = 2.0 * abs(area) / np.linalg.norm(b - a) / np.linalg.norm(c - b) / np.linalg.norm(a - c)
    assert curvature == pytest.approx(case["curvature"], rel=case["tolerance"])
    assert abs(found.u.reshape(n + 1, 3, 2)[-1, 1, 1]) == pytest.approx(case["tip"], rel=case["tolerance"])


def spurious_at(form, stretches, nu=0.3):
    """First stretch at which a square block of 4 x 4 cells, pressed along y and free to widen, has a tangent with
    a negative eigenvalue while all nodes follow the uniform state; nan where none has."""
    nodes, cells = grid(4, 4)
    volume = volume_of(quads(nodes, cells), form)
    moduli = moduli_of(volume, Stuff(1.0, nu))
    pattern, history, wide = pattern_of(2 * len(nodes), *(c.dofs for c in volume.kinds)), np.empty(0), 1.0
    fixed = np.array([2 * (i * 5 + j) + 1 for i in range(5) for j in (0, 4)] + [2 * j for j in range(5)])
    free = np.setdiff1d(np.arange(2 * len(nodes)), fixed)
    for stretch in stretches:
        for _ in range(30):  # the width at which the sides are free
            u = nodes * [wide - 1.0, stretch - 1.0]
            sides = [volume.evaluate(u + nodes * [d, 0.0], moduli, PointStep(1.0, history)).f[-5:, 0].sum()
                     for d in (0.0, 1e-6)]
            wide -= sides[0] / (sides[1] - sides[0]) * 1e-6
        found = volume.evaluate(nodes * [wide - 1.0, stretch - 1.0], moduli, PointStep(1.0, history), tangent=True)
        history = found.history
        K = pattern.matrix(found.entries)[free][:, free].toarray()
        if np.linalg.eigvalsh(0.5 * (K + K.T))[0] < 0.0:
            return stretch
    return np.nan


@pytest.mark.parametrize(("nu", "onset"), [(0.3, 0.64), (0.4999, 0.68)])
def test_enhanced_strain_hourglasses_under_strong_compression(nu, onset):
    """The known weakness of the element (Wriggers & Reese 1996): where it begins, against mean dilatation."""
    stretches = np.arange(0.98, 0.45, -0.02)
    assert spurious_at(Treatment(enhanced=True), stretches, nu) == pytest.approx(onset, abs=0.011)
    assert np.isnan(spurious_at(Treatment(), stretches, nu))
