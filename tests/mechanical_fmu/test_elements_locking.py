"""B2: the thick cylinder up to nu = .499999.  B3: NAFEMS LE11.  By mean dilatation and by enhanced strain.

The closed forms are linear: loads are scaled by SMALL and answers by 1/SMALL.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from cell_scenes import EXPECTED, Stuff, equilibrium, grid, moduli_of, quads, volume_of

from mechanical_fmu.cells import Treatment, at_points

FORMS = {"mean dilatation": Treatment(), "enhanced": Treatment(enhanced=True)}
A, B, HEIGHT, SMALL = 0.02, 0.05, 0.002, 0.1


@pytest.mark.parametrize(("nu", "u_a"), list(zip(EXPECTED["B2"]["nu"], EXPECTED["B2"]["u_a"], strict=True)))
@pytest.mark.parametrize("form", FORMS)
def test_a_tube_under_pressure_does_not_lock(form, nu, u_a):
    """B2, axisymmetric, 20 graded cells."""
    nodes, cells = grid(20, 1, lambda s, t: (A * (B / A) ** s, HEIGHT * t))
    volume = volume_of(quads(nodes, cells, "axisymmetric"), FORMS[form])
    force = np.zeros_like(nodes)
    force[:2, 0] = SMALL * EXPECTED["B2"]["p"] * np.pi * A * HEIGHT
    held = {(i, 1): 0.0 for i in range(len(nodes))}
    found = equilibrium(volume, moduli_of(volume, Stuff(200e9, nu)), held, force, tolerance=1e-5)
    assert found.u[:2, 0] / SMALL == pytest.approx(u_a, rel=EXPECTED["B2"]["tolerance"])


@pytest.mark.parametrize("form", FORMS)
def test_a_sheared_quarter_of_the_tube_does_not_lock(form):
    """B2 in the plane: a quarter of slanted cells, which a uniform strain alone does not make pass."""
    n, m, nu, u_a = 20, 24, EXPECTED["B2"]["nu"][-1], EXPECTED["B2"]["u_a"][-1]
    nodes, cells = grid(n, m, lambda s, t: polar(A * (B / A) ** s, 0.5 * np.pi * (t + 0.2 * s * t * (1.0 - t))))
    volume = volume_of(quads(nodes, cells), FORMS[form])
    force = np.zeros_like(nodes)
    for j in range(m):
        along = nodes[j + 1] - nodes[j]
        force[[j, j + 1]] += 0.5 * SMALL * EXPECTED["B2"]["p"] * np.array([along[1], -along[0]])
    held = {(i * (m + 1), 1): 0.0 for i in range(n + 1)} | {(i * (m + 1) + m, 0): 0.0 for i in range(n + 1)}
    found = equilibrium(volume, moduli_of(volume, Stuff(200e9, nu)), held, force, tolerance=1e-5)
    u_r = np.linalg.norm(found.u[: m + 1], axis=1) / SMALL
    assert u_r == pytest.approx(u_a, rel=EXPECTED["B2"]["tolerance"])


def polar(r, angle):
    return r * np.cos(angle), r * np.sin(angle)


def le11(n):
    """Nodes and quads of NAFEMS LE11: rings, cone and cylinder, ruled between the inner and the outer line."""
    knee, outer, end = np.sqrt(0.5), np.array([1.4 * np.cos(np.pi / 6), 0.7]), np.array([1.0, 1.39])
    turn = np.pi / 180.0
    inside = (lambda t: polar(1.0, 30 * turn * t), lambda t: polar(1.0, (30 + 15 * t) * turn),
              lambda t: (knee, knee + t * (1.39 - knee)), lambda t: (knee, 1.39 + 0.4 * t))
    outside = (lambda t: polar(1.4, 30 * turn * t), lambda t: tuple(outer + 0.35 * t * (end - outer)),
               lambda t: tuple(outer + (0.35 + 0.65 * t) * (end - outer)), lambda t: (1.0, 1.39 + 0.4 * t))
    counts = (2 * n, n, 2 * n, n)

    def line(parts):
        return np.array([parts[0](0.0)] + [part((i + 1) / c) for part, c in zip(parts, counts, strict=True)
                                           for i in range(c)])

    a, b, across = line(inside), line(outside), np.linspace(0.0, 1.0, 2 * n + 1)
    nodes = a[:, None] * (1.0 - across)[None, :, None] + b[:, None] * across[None, :, None]
    number = np.arange(nodes.size // 2).reshape(len(a), -1)
    cells = np.stack([number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]], axis=-1)
    return nodes.reshape(-1, 2), cells.reshape(-1, 4)


@pytest.mark.parametrize("form", FORMS)
def test_le11(form):
    """B3: T = r + z, s_zz at A continued from the points of its cell."""
    small = 0.01
    nodes, cells = le11(16)
    volume = volume_of(quads(nodes, cells, "axisymmetric"), FORMS[form])
    T = nodes.sum(axis=1)
    warm = at_points(volume.kinds[0], T) if form == "enhanced" else volume.means(T)[0][:, None]
    e_th = 3.0 * np.log(1.0 + small * 2.3e-4 * warm)
    moduli = (replace(moduli_of(volume, Stuff(210e9, 0.3))[0], e_th=e_th),)
    flat = (nodes[:, 1] < 1e-9) | (nodes[:, 1] > 1.79 - 1e-9)
    found = equilibrium(volume, moduli, {(i, 1): 0.0 for i in np.flatnonzero(flat)}, tolerance=1e-7, floor=1e6)
    points = volume.stress(found.u, moduli)[0][0][0, :, 1] / small
    s_zz = np.linalg.solve(volume.kinds[0].N, points)[0]
    assert EXPECTED["B3"]["least"] <= s_zz <= EXPECTED["B3"]["most"]
    if form == "enhanced":
        assert s_zz == pytest.approx(EXPECTED["B3"]["s_zz_A"], rel=0.006)
