"""Where a corner meets a face, contact pushes along the face's normal, however the corner stands.

With the normals of its own edges a corner without friction was pushed sideways by up to its tilt: no force of contact
was that of its energy, and a rigid block dropped 2 mm onto its corner came 9 mm aside.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import EPS, chain, passes, push
from test_opening import parting
from test_traction import dense, differences

from contact.messages import Floats, Register

SIDE = 0.25  # of what is dropped


def leaning(register: Register) -> Register:
    """The scene with its pair by its penalty alone, and a master that does not deform."""
    register = parting(register)
    return replace(register, passes=replace(register.passes, leaning=np.ones(1, np.int32)))


def polygon(n: int, per_side: int) -> Floats:
    """A regular polygon around its lowest corner, anticlockwise, the body on the left."""
    corners = np.array([-1j * np.exp(2j * np.pi * k / n) for k in range(n + 1)])
    ring = np.concatenate([a + (b - a) * np.arange(per_side) / per_side
                           for a, b in pairwise(corners)])
    ring = (ring + 1j) * SIDE / abs(corners[1] - corners[0])
    return np.column_stack([ring.real, ring.imag])


def dropped(n: int, tilt: float, depth: float, *, per_side: int = 2, n_floor: int = 7, slope: float = 0.0,
            aside: float = 0.0, gap_max: float = 0.5, mu: float = 0.0) -> tuple[Register, Floats]:
    """A polygon that stands on a corner, turned by `tilt` about it, `depth` [m] deep in a floor of some slope."""
    def turned(at: Floats, by: float) -> Floats:
        return at @ np.array([[np.cos(by), np.sin(by)], [-np.sin(by), np.cos(by)]])

    body = turned(polygon(n, per_side), tilt) + [aside, -depth]
    floor = np.column_stack([np.linspace(1.0, -1.2, n_floor + 1), np.zeros(n_floor + 1)])
    ring = np.column_stack([np.arange(len(body)), np.roll(np.arange(len(body)), -1)])
    edges = np.concatenate([ring, chain(n_floor, len(body))]).astype(np.int32)
    register = Register(len(body) + len(floor), edges, np.repeat([0, 1], [len(ring), n_floor]).astype(np.int32), False,
                        passes((0, 1), gap_max=gap_max, mu=mu))
    return leaning(register), turned(np.concatenate([body, floor]), slope)


# What leans goes back to the edge's own normal along the edge: a share of what is in.
SHORT = 1e-5

TILTS = [(4, 0.0), (4, 0.3), (4, -0.6), (4, 0.75), (8, 0.0), (8, 0.25), (8, -0.36), (3, 0.4)]


@pytest.mark.parametrize(("n", "tilt"), TILTS)
@pytest.mark.parametrize("slope", [0.0, 0.4, -2.0])
@pytest.mark.parametrize("gap_max", [0.5, 1e-3])
def test_a_corner_is_pushed_along_the_face(n: int, tilt: float, slope: float, gap_max: float) -> None:
    """The force of a wedge, eps depth^2/2 (cot + cot) of the angles of its two sides, along the normal."""
    register, x = dropped(n, tilt, SHORT, slope=slope, gap_max=gap_max)
    n_body = len(x) - 8
    force = push(register, x).force[:n_body].sum(axis=0)
    normal = np.array([-np.sin(slope), np.cos(slope)])
    along = normal @ force
    assert abs(force - along * normal).max() <= 1e-3 * along
    sides = [np.pi / n + tilt, np.pi / n - tilt]
    assert along == pytest.approx(0.5 * EPS * SHORT**2 * sum(1.0 / np.sin(side) for side in sides), rel=1e-3)


@pytest.mark.parametrize(("n", "tilt"), TILTS)
def test_the_force_is_that_of_the_energy(n: int, tilt: float) -> None:
    """No energy comes of sliding, and what comes of sinking is the force's work."""
    def stored(depth: float, aside: float = 0.0) -> float:
        return push(*dropped(n, tilt, depth, aside=aside)).stored

    register, x = dropped(n, tilt, SHORT)
    force = push(register, x).force[:-8].sum(axis=0)
    d = 1e-3 * SHORT
    assert (stored(SHORT + d) - stored(SHORT - d)) / (2.0 * d) == pytest.approx(force[1], rel=1e-3)
    for aside in (1e-6, 0.01, 0.131):
        assert stored(SHORT, aside) == pytest.approx(stored(SHORT), rel=1e-6)


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize(("n", "tilt", "per_side", "n_floor"), [
    (4, 0.3, 1, 40), (4, -0.6, 3, 3), (8, 0.1, 2, 50), (8, 0.45, 1, 9), (8, -0.41, 3, 40), (3, 0.4, 2, 5)])
def test_the_stiffness_follows_faces_and_neighbours(mu: float, n: int, tilt: float, per_side: int,
                                                    n_floor: int) -> None:
    """Exact, wherever the face is that a corner leans to, and beyond its cone, where a side is nearly flush."""
    register, x = dropped(n, tilt, 0.02, per_side=per_side, n_floor=n_floor, mu=mu)
    before = x.copy()
    before[:-n_floor - 1, 0] += 1e-3
    x = x + 1e-4 * np.random.default_rng(5).standard_normal(x.shape)
    reply = push(register, x, x_before=before)
    assert reply.n_touching > 0
    K, B = differences(register, x, 1e-7, before), dense(reply, len(x))
    assert abs(B - K).max() <= 1e-6 * abs(K).max()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_nothing_jumps_where_a_side_comes_flush(side: float) -> None:
    """A side of an octagon that lies down on the floor: its corners lean as far as their cones, and no farther."""
    told = [push(*dropped(8, side * (np.pi / 8.0 + more), 0.02)) for more in (-1e-9, 1e-9)]
    force = [reply.force[:-8].sum(axis=0) for reply in told]
    assert force[1] == pytest.approx(force[0], abs=1e-6 * force[0][1])
    assert told[1].stored == pytest.approx(told[0].stored, rel=1e-6)


def test_a_face_that_lies_flush_is_pushed_as_ever() -> None:
    """Square on a floor: the normals of its bottom are its own, whatever stands beside it on the same surface."""
    square = np.array([[0.0, -1e-5], [0.1, -1e-5], [0.2, -1e-5], [0.2, 0.2], [0.0, 0.2]])
    ring = np.column_stack([np.arange(5), np.roll(np.arange(5), -1)])
    for wall in ([], [[0.2 + 1e-6, 0.3]]):
        corner = np.array([*wall, [0.2 + 1e-6 if wall else 0.5, 0.0], [-0.1, 0.0]])
        n = len(corner) - 1
        edges = np.concatenate([ring, chain(n, 5)]).astype(np.int32)
        surface = np.repeat([0, 1], [5, n]).astype(np.int32)
        register = leaning(Register(5 + n + 1, edges, surface, False, passes((0, 1))))
        force = push(register, np.concatenate([square, corner])).force[:5].sum(axis=0)
        assert force == pytest.approx([0.0, EPS * 1e-5 * 0.2], abs=1e-9 * EPS * 1e-5)


@pytest.mark.parametrize("tilt", [0.1, 0.7])
def test_faces_that_deform_are_pushed_along_the_normals_of_edges(tilt: float) -> None:
    """They come to fit what presses on them, and their own normals jump at its corner."""
    register, x = dropped(4, tilt, 0.02, per_side=8)
    register = replace(register, passes=replace(register.passes, leaning=np.zeros(1, np.int32)))
    n = len(x) - 8
    force = push(register, x).force[:n].sum(axis=0)
    assert abs(force[0]) > 0.05 * force[1]
