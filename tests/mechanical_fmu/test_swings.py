"""Rigid bodies with inertia that lie on a surface do not swing on its penalty; what falls onto it bounces."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_coming_to_rest import went
from test_friction_inertia import MASS, SIDE, G, sliding

EPS_N = 1e9  # [Pa/m]
DEPTH = MASS * G / (EPS_N * SIDE)  # [m] at which the block lies
PERIOD = 2.0 * np.pi * np.sqrt(DEPTH / G)


def swings(per_period: int, periods: float, along: float = 0.0, v: float = 0.0, swapped: bool = False):
    """A block on a floor, drawn as it touches without load.  along : the sine of its slope.  v : its speed upwards."""
    gravity = {"x": along * G, "y": -np.sqrt(1.0 - along**2) * G}
    half = sliding(True, swapped, v0=(0.0, v), eps_N=EPS_N, gravity=gravity)
    return went(half, (PERIOD / per_period,) * int(per_period * periods))


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("per_period", [8, 20, 50])
def test_what_is_put_on_a_surface_lies_at_its_depth(per_period: int, swapped: bool) -> None:
    """It swung between nothing and twice that for ever."""
    t, u, _, _ = swings(per_period, 4.0, swapped=swapped)
    assert u[t > 2.0 * PERIOD, 1] == pytest.approx(-DEPTH, rel=1e-3)
    assert u[:, 1].min() > -1.8 * DEPTH


@pytest.mark.parametrize("per_period", [8, 20])
def test_what_is_put_on_a_slope_sticks(per_period: int) -> None:
    """Friction was too weak in each swing, and it crept down."""
    t, u, _, heat = swings(per_period, 12.0, along=0.25)
    late = t > 6.0 * PERIOD
    assert np.ptp(u[late, 0]) < 0.02 * DEPTH
    assert heat[late].max() == 0.0


@pytest.mark.parametrize("per_period", [8, 30])
def test_what_falls_bounces(per_period: int) -> None:
    """From 20 times its depth it comes back to that height."""
    height = 20.0 * DEPTH
    v = np.sqrt(2.0 * G * height)
    _, u, _, _ = swings(per_period, (2.5 * v / G + 0.5 * PERIOD) / PERIOD, v=-v)
    assert u[:, 1].max() == pytest.approx(height, rel=0.03)
