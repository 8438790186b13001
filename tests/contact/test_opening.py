"""Where surfaces part between two nodes, the pressure up to there counts, wherever the nodes of the other side are.

Two points a piece saw a corner when a fifth of its edge was in, and its force and energy hung on the slivers that the
other side's nodes cut off: a rigid block that bounced gained many times its energy.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import EPS, curved, push, scene
from test_smooth import cut, smooth
from test_traction import dense, differences

TILT = 0.05  # of the slave


def parting(register):
    """The scene with its pair by its penalty alone."""
    return replace(register, passes=replace(register.passes, parting=np.ones(1, np.int32)))


def corner(depth: float, n_slave: int, n_master: int):
    """A straight edge of 1 m, tilted, whose lower end is `depth` [m] deep in a flat one that is longer."""
    s = np.linspace(0.0, 1.0, n_slave + 1)
    tilted = np.column_stack([s * np.cos(TILT), s * np.sin(TILT) - depth])
    register, x = scene(tilted, np.column_stack([np.linspace(1.3, -0.7, n_master + 1), np.zeros(n_master + 1)]))
    return parting(register), x


@pytest.mark.parametrize("n_master", [1, 2, 3, 7, 40])
@pytest.mark.parametrize("depth", [1e-6, 1e-4, 0.003, 0.02])
def test_a_corner_is_met_as_soon_as_it_is_in(depth: float, n_master: int) -> None:
    """Force eps depth^2/(2 tan), wherever the nodes of the other side are."""
    register, x = corner(depth, 1, n_master)
    reply = push(register, x)
    # Gaps are along the slave's normal, and lengths along its edge.
    gap, length = depth / np.cos(TILT), depth / np.sin(TILT)
    assert np.linalg.norm(reply.force[:2].sum(axis=0)) == pytest.approx(0.5 * EPS * gap * length, rel=1e-9)
    assert reply.stored == pytest.approx(EPS * gap**2 * length / 6.0, rel=1e-9)


@pytest.mark.parametrize("slide", [0.0, 1e-3, 0.21, 0.4])
def test_no_energy_comes_of_sliding(slide: float) -> None:
    """The springs hold as much wherever the corner stands beside a node."""
    stored = []
    for shift in (0.0, slide):
        register, x = corner(0.01, 3, 8)
        x = x.copy()
        x[:4, 0] += shift
        stored.append(push(register, x).stored)
    assert stored[1] == pytest.approx(stored[0], rel=1e-12)


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("axisymmetric", [False, True])
@pytest.mark.parametrize("rounded", [False, True])
def test_stiffness_where_surfaces_part(mu: float, axisymmetric: bool, rounded: bool) -> None:
    """Exact for normals that turn, rings and arcs: the place where they part moves with all of them."""
    register, drawn = curved(6, 5, gap=0.0)
    drawn = drawn + [3.0, 0.0]
    x = drawn + 2e-3 * np.random.default_rng(3).standard_normal(drawn.shape)
    register = replace(parting(smooth(register, drawn, mu=mu, on=rounded)), axisymmetric=axisymmetric)
    before = drawn + np.where(np.arange(len(x)) < 7, 4e-3, 0.0)[:, None]
    reply = push(register, x, x_before=before)
    assert (reply.n_slipping > 0) == (mu > 0.0)
    assert 0 < reply.n_touching < cut(register, x).values.shape[0]
    K, B = differences(register, x, 1e-7, before), dense(reply, len(x))
    assert abs(B - K).max() <= 1e-7 * abs(K).max()


@pytest.mark.parametrize("depth", [-1e-6, 3e-6, 1e-5, 1e-4])
@pytest.mark.parametrize("turn", [0.0, 0.3, -0.45])
def test_the_crown_of_a_round_surface_is_met_as_soon_as_it_is_in(depth: float, turn: float) -> None:
    """A disc of radius 1 with edges of 0.05 rad, turned by so much of an edge, above a flat: both ends of the edge in
    the middle are 0.3 mm above it, or less.  Force 4/3 eps depth (2 depth)^(1/2), of a parabola; derivative exact.
    """
    a = 1.5 * np.pi + 0.05 * (np.arange(-2.5, 3.0) + turn)
    disc = np.column_stack([np.cos(a), np.sin(a) + 1.0 - depth])
    register, x = scene(disc, np.column_stack([np.linspace(0.35, -0.25, 4), np.zeros(4)]))
    register = parting(smooth(register, x))
    reply = push(register, x)
    assert (reply.n_touching > 0) == (depth > 0.0)
    found = reply.force[:6].sum(axis=0)
    assert found[1] == pytest.approx(4.0 / 3.0 * EPS * max(depth, 0.0) * np.sqrt(2.0 * max(depth, 0.0)), rel=0.03)
    if depth > 0.0:
        K, B = differences(register, x, 1e-3 * depth), dense(reply, len(x))
        assert abs(B - K).max() <= 1e-5 * abs(K).max()
