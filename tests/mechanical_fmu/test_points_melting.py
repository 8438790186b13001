"""Points that melt and solidify: what the liquid forgets, what the solid begins with, and the change of volume."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from point_driver import material, parameters, strained, virgin

T_S, T_L = 1000.0, 1100.0
LIQUID = {"eta": 1e3, "bulk": 5e10, "T_s": T_S, "T_l": T_L}
METAL = material(plastic={"s_y": 250e6, "hardening": {"law": "linear", "H": 2e9}, "kinematic": {"C": 1e9}},
                 liquid=LIQUID)
PULL = np.array([1.0, -0.5, 0.2, -0.5])


def deviatoric(point):
    return point.S - point.S[[0, 1, 3]].mean() * np.array([1.0, 1.0, 0.0, 1.0])


def test_a_liquid_resists_by_its_rate_alone():
    point = strained(virgin(METAL), 0.1 * PULL, 10.0, 1200.0)
    assert deviatoric(point) == pytest.approx(2 * 1e3 * 0.01 * PULL, rel=1e-12)
    assert point.heat == pytest.approx(2 * 1e3 * 0.1**2 * (1.5 + 2 * 0.04) / 10.0, rel=1e-12)
    still = strained(point, point.E, 10.0, 1200.0)
    assert np.abs(deviatoric(still)).max() <= 1e-6
    assert still.heat == 0.0


def test_what_solidifies_begins_free_of_stress_and_hardening():
    """Drawn as a solid, melted, stirred, and cold again: only strain after solidification is felt."""
    drawn = strained(virgin(METAL), 0.1 * PULL)
    assert drawn.h[4] > 0.1
    assert np.abs(drawn.h[6:10]).max() > 1e7
    melted = strained(drawn, 0.3 * PULL, 1.0, 1200.0)
    assert melted.h[4] == 0.0
    assert not melted.h[6:10].any()
    cold = strained(melted, melted.E, 1.0, 300.0)
    assert np.abs(deviatoric(cold)).max() <= 1e-3
    pulled = strained(cold, cold.E + 1e-4 * PULL)
    assert deviatoric(pulled) == pytest.approx(2e11 / 1.3 * 1e-4 * PULL, rel=1e-9)


def test_in_the_mush_the_stress_does_not_jump_as_solid_grows():
    """The strain is held: what was there keeps its force, what is new brings none; melting takes its share away."""
    half = strained(virgin(METAL), 5e-4 * PULL, 1.0, f_s=0.5)
    force = 0.5 * 2e11 / 1.3 * 5e-4 * PULL
    resting = strained(half, half.E, 1.0, f_s=0.5)
    assert deviatoric(resting) == pytest.approx(force, rel=1e-9)
    grown = strained(resting, resting.E, 1.0, f_s=0.8)
    assert deviatoric(grown) == pytest.approx(force, rel=1e-9)
    shrunk = strained(grown, grown.E, 1.0, f_s=0.2)
    assert deviatoric(shrunk) == pytest.approx(0.25 * force, rel=1e-9)


def test_the_solid_fraction_is_the_input_or_follows_the_temperature():
    for T, f_s in ((300.0, 1.0), (1000.0, 1.0), (1025.0, 0.75), (1100.0, 0.0), (1500.0, 0.0)):
        assert parameters(METAL, T)[0].solid_fraction == f_s
    assert parameters(METAL, 300.0, f_s=0.4)[0].solid_fraction == 0.4
    sharp = material(liquid={**LIQUID, "T_l": T_S})
    assert [parameters(sharp, T)[0].solid_fraction for T in (999.9, 1000.0)] == [1.0, 0.0]


def test_volume_through_the_mush():
    """Bulk modulus mixes, and the linear shrinkage over the mush comes on top of alpha."""
    m = material(alpha=1e-5, T_ref=300.0, liquid={**LIQUID, "shrinkage": 0.02})
    solid, mush, liquid = (parameters(m, T) for T in (1000.0, 1025.0, 1100.0))
    assert solid[3] == pytest.approx(3 * np.log(1.007), rel=1e-12)
    assert mush[3] == pytest.approx(3 * np.log(1.00725 + 0.005), rel=1e-12)
    assert liquid[3] == pytest.approx(3 * np.log(1.008 + 0.02), rel=1e-12)
    K = 2e11 / 1.2
    assert [p[2] for p in (solid, mush, liquid)] == pytest.approx([K, 0.75 * K + 0.25 * 5e10, 5e10], rel=1e-12)


def test_no_time_no_flow():
    """At the start (dt = 0) the liquid answers as an elastic solid, so that the first equilibrium has a stiffness."""
    point = strained(virgin(METAL), 1e-4 * PULL, 0.0, 1200.0)
    assert deviatoric(point) == pytest.approx(2e11 / 1.3 * 1e-4 * PULL, rel=1e-12)
    assert point.heat == 0.0
