"""B1 and B2: the thick cylinder, heated from inside and under pressure, up to nu = .499999.

The closed forms are linear; the loads are scaled by SMALL and the answers by 1/SMALL, or finite strain (.24 % in B1,
.08 % in B2) would count as error.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import EXPECTED, NoLink, block, elastic, hold, inputs_of, press, stress_of

SMALL = 0.01
A, B = 0.02, 0.05
RADII = np.geomspace(A, B, 21)  # 20 graded cells


def cylinder(nu, p=0.0, T_inside=0.0, kind="quads"):
    """(half, state, T) of a slice in plane strain; p [Pa] inside, T logarithmic from T_inside to 0."""
    interface = block(RADII, [0.0, 0.002], kind, "axisymmetric")
    half = elastic(interface, [hold("block.bottom", 1), hold("block.top", 1), press("block.left", SMALL * p)],
                   {"E": 200e9, "nu": nu, "alpha": 1.2e-5, "T_ref": 0.0}, tolerance=1e-10)
    T = SMALL * T_inside * np.log(B / interface.nodes[:, 0]) / np.log(B / A)
    state, _ = half.start(inputs_of(half, T), 0.0, NoLink())
    return half, state, T


def at_radius(half, state, T, component, r):
    """Cell means of a stress component, continued to radius r by the parabola through the three nearest cells."""
    means = stress_of(half, state, T)[0][..., component].mean(axis=1) / SMALL
    centres = half.system.interface.nodes[half.system.interface.quads][:, :, 0].mean(axis=1)
    near = np.argsort(np.abs(centres - r))[:3]
    return np.polyval(np.polyfit(centres[near] - r, means[near], 2), 0.0)


def test_b1_heated_from_inside():
    row = EXPECTED["B1"]
    half, state, T = cylinder(0.3, T_inside=200.0)
    found = {"s_th_a": at_radius(half, state, T, 3, A), "s_th_b": at_radius(half, state, T, 3, B),
             "s_r_03": at_radius(half, state, T, 0, 0.03),
             "u_a": state.u[0, 0] / SMALL, "u_b": state.u[-1, 0] / SMALL}
    for name, value in found.items():
        assert value == pytest.approx(row[name], rel=row["tolerance"]), name


@pytest.mark.parametrize("i", range(3))
def test_b2_nothing_locks(i):
    row = EXPECTED["B2"]
    _, state, _ = cylinder(row["nu"][i], p=row["p"])
    assert state.u[0, 0] / SMALL == pytest.approx(row["u_a"][i], rel=row["tolerance"])


def test_triangles_agree_where_they_do_not_lock():
    _, state, _ = cylinder(0.3, p=EXPECTED["B2"]["p"], kind="triangles")
    assert state.u[0, 0] / SMALL == pytest.approx(EXPECTED["B2"]["u_a"][0], rel=EXPECTED["B2"]["tolerance"])


def test_stiffness_and_expansion_follow_their_tables_in_temperature():
    """A free block at 500 K with alpha(500) expands by it; pressed, it yields as E(500)."""
    material = {"E": {"T": [300.0, 500.0], "value": [2e11, 1e11]}, "nu": 0.0, "T_ref": 300.0,
                "alpha": {"T": [300.0, 500.0], "value": [1e-5, 2e-5]}}
    interface = block([0.0, 0.5, 1.0], [0.0, 0.5, 1.0])
    half = elastic(interface, [hold("block.bottom", 1), hold("block.left", 0), press("block.top", 1e5, name="p")],
                   material, tolerance=1e-11)
    _, free = half.start(inputs_of(half, 500.0, p=0.0), 0.0, NoLink())
    _, pressed = half.start(inputs_of(half, 500.0, p=1.0), 0.0, NoLink())
    assert free["x"][2, 1] - 1.0 == pytest.approx(2e-5 * 200.0, rel=1e-2)  # plane strain, nu = 0: to second order
    assert free["x"][2, 1] - pressed["x"][2, 1] == pytest.approx(1e5 / 1e11, rel=2e-2)
