"""The solid fraction as an input, the stress of a liquid, and stress components as outputs."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from mechanical_scenes import NoLink, block, done, elastic, hold, inputs_of

ETA, BULK, E = 1e6, 4e10, 2e11
LIQUID = {"eta": ETA, "bulk": BULK, "T_s": 1000.0, "T_l": 1100.0}
RATE = 1e-4  # 1/s


def sheared(**more):
    """A unit block in simple shear at a constant rate: sigma_12 = eta rate, nothing else."""
    path = {"t": [0.0, 10.0], "value": [0.0, 10.0 * RATE]}
    held = [hold("block.bottom", 0), hold("block.bottom", 1), hold("block.top", 0, path), hold("block.top", 1)]
    return elastic(block([0.0, 1.0], [0.0, 1.0]), held, {"alpha": 0.0, "liquid": LIQUID}, tolerance=1e-10, **more)


def after(half, T, dt=1.0, steps=1, **inputs):
    given = inputs_of(half, T)
    state, _ = half.start(given, 0.0, NoLink())
    for i in range(steps):
        state, outputs = done(half.step(state, given | inputs, i * dt, dt, NoLink()))
    return outputs


@pytest.mark.parametrize("element", ["mean_dilatation", "enhanced"])
def test_a_liquid_shows_its_viscous_stress(element):
    outputs = after(sheared(element=element), 1200.0, steps=3)
    # The rate of logarithmic strain is the rate of shear to second order of 3e-4.
    assert outputs["sigma"][0, 2] == pytest.approx(ETA * RATE, rel=1e-3)
    assert outputs["sigma_v"][0] == pytest.approx(np.sqrt(3.0) * ETA * RATE, rel=1e-3)


def test_the_solid_fraction_that_is_given_rules():
    half = sheared()
    solid = E / 2.6 * RATE
    assert after(half, 1200.0)["sigma"][0, 2] == pytest.approx(ETA * RATE, rel=1e-3)
    assert after(half, 1200.0, f_s=np.ones(4))["sigma"][0, 2] == pytest.approx(solid, rel=1e-3)
    assert after(half, 300.0, f_s=np.zeros(4))["sigma"][0, 2] == pytest.approx(ETA * RATE, rel=1e-3)
    # Half of it solidifies in the step; it does so at once, in the shape it has before the shear.
    assert after(half, 1200.0, f_s=np.full(4, 0.5))["sigma"][0, 2] == pytest.approx(
        0.5 * solid + 0.5 * ETA * RATE, rel=1e-3)


def test_only_what_can_melt_asks_for_it():
    names = [v.name for v in elastic(block([0, 1], [0, 1])).variables]
    assert "f_s" not in names
    assert "f_s" in [v.name for v in sheared().variables]


def test_shrinkage_follows_the_solid_fraction_that_is_given():
    """Free but for its bottom: the block is narrower by the shrinkage times f_s, whatever T says."""
    def width(f_s):
        half = elastic(block([0.0, 1.0], [0.0, 1.0]), [hold("block.bottom", 1), hold("block.left", 0)],
                       {"alpha": 0.0, "nu": 0.0, "liquid": LIQUID | {"shrinkage": 0.02}}, state="plane_stress")
        given = inputs_of(half, 1050.0)
        state, _ = half.start(given | {"f_s": np.zeros(4)}, 0.0, NoLink())
        for i in range(40):
            state, outputs = done(half.step(state, given | {"f_s": np.full(4, f_s * (i + 1) / 40)}, float(i), 1.0,
                                            NoLink()))
        return outputs["x"][2, 0] - outputs["x"][0, 0]

    assert width(0.0) == pytest.approx(1.02, rel=1e-9)
    assert width(1.0) == pytest.approx(1.0, rel=1e-4)


def test_what_was_poured_has_the_shape_of_its_mesh_at_the_start():
    """Nothing moves at T0; solid again at T_ref, it is narrower by the shrinkage and by its thermal strain."""
    half = elastic(block([0.0, 1.0], [0.0, 1.0]), [hold("block.bottom", 1), hold("block.left", 0)],
                   {"alpha": 2e-5, "T_ref": 300.0, "nu": 0.0, "liquid": LIQUID | {"shrinkage": 0.02}},
                   bodies={"block": {"material": "m", "drawn_at": 1200.0}}, state="plane_stress")
    state, outputs = half.start(inputs_of(half, 1200.0), 0.0, NoLink())
    assert np.ptp(outputs["x"], axis=0) == pytest.approx([1.0, 1.0], abs=1e-12)
    for i, T in enumerate(np.linspace(1200.0, 300.0, 91)[1:]):
        state, outputs = done(half.step(state, inputs_of(half, T), float(i), 1.0, NoLink()))
    assert np.ptp(outputs["x"][:, 0]) == pytest.approx(1.0 / (1.0 + 2e-5 * 900.0 + 0.02), rel=1e-4)


def test_a_plane_stress_sheet_that_flows_shows_how_its_thickness_changed():
    """Drawn alike both ways far beyond yield: the volume is kept, so the thickness changes most."""
    drawn = {"t": [0.0, 1.0, 2.0], "value": [0.0, 0.02, 0.04]}
    half = elastic(block([0.0, 1.0], [0.0, 1.0]),
                   [hold("block.bottom", 1), hold("block.left", 0), hold("block.right", 0, drawn),
                    hold("block.top", 1, drawn)], {"alpha": 0.0, "plastic": {"s_y": 1e8}}, state="plane_stress")
    given = inputs_of(half)
    state, _ = half.start(given, 0.0, NoLink())
    state, _ = done(half.step(state, given, 0.0, 1.0, NoLink()))
    _, outputs = done(half.step(state, given, 1.0, 1.0, NoLink()))
    # The elastic strain stays as it was at yield: J = 1 + 3.3e-4, here not told apart from 1.
    assert outputs["max_strain_increment"] == pytest.approx(0.5 * (1.02**-4 - 1.04**-4), rel=2e-3)
