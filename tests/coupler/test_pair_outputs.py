"""What probes, frames and lines tell where pairs share a node: the pair asked for, else one value for a node."""

from __future__ import annotations

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from coupler.fmu.outputs import of_pairs, told_at
from coupler.record.observe import contact_field
from coupler.record.tables import contact_lines, contact_row
from coupler.schemes.levels import Level

pytestmark = pytest.mark.usefixtures("unlooked")

# Floor 0 1 2 and wall 3 4 of a block whose corner is 5: its bottom 5 6 7, its left 8 5.
NODES = np.array([[0, 0], [1, 0], [2, 0], [0, 0], [0, 1], [0, 0], [1, 0], [2, 0], [0, 1]], dtype=float)
EDGES = {"block.bottom": [[5, 6], [6, 7]], "block.left": [[8, 5]], "floor.top": [[2, 1], [1, 0]],
         "wall.right": [[3, 4]]}
BOTTOM, LEFT = slice(0, 3), slice(6, 8)
CORNER = 5


@pytest.fixture
def scene() -> Interface:
    none = np.empty((0, 4), dtype=np.int32)
    pairs = (Pair("floor", "block.bottom", "floor.top", 0.1, 1e9), Pair("wall", "block.left", "wall.right", 0.2, 1e9))
    return Interface("plane", NODES, none, none[:, :3], none[:, 0], none[:, 0], (), (),
                     {n: np.array(e, dtype=np.int32) for n, e in EDGES.items()}, pairs=pairs)


@pytest.fixture
def level() -> Level:
    """The floor carries 1 Pa, the wall stands 0.1 m off."""
    t_N, gap = np.zeros(10), np.full(10, 0.1)
    t_N[:6], gap[:6] = -1.0, -1e-9
    return Level(0.0, np.zeros(9), NODES, t_N, gap, np.ones(10))


def test_a_surface_is_told_by_its_own_pairs(scene: Interface, level: Level) -> None:
    left, bottom = np.array([5, 8]), np.array([5, 6, 7])
    assert told_at(left, scene).tolist() == [6, 7]
    assert told_at(bottom, scene).tolist() == [0, 1, 2]
    assert told_at(np.array([CORNER]), scene).tolist() == [0, 1, 2, 6, 7]
    assert told_at(np.array([2, 8]), scene).tolist() == list(range(10)), "no surface has both"
    p = contact_field("p", level, told_at(left, scene), scene)
    assert (p[left] == 0.0).all()
    assert np.isnan(np.delete(p, left)).all()
    assert (contact_field("gap", level, told_at(left, scene), scene)[left] == 0.1).all()
    assert (contact_field("p", level, told_at(bottom, scene), scene)[bottom] == 1.0).all()


def test_a_node_of_two_pairs_has_the_larger_pressure_and_the_smaller_gap(scene: Interface, level: Level) -> None:
    everywhere = np.arange(10)
    for turned in (level, Level(0.0, level.T, level.x, level.t_N[::-1].copy(), level.gap[::-1].copy(), level.covered)):
        assert contact_field("p", turned, everywhere, scene)[CORNER] == 1.0
        assert contact_field("gap", turned, everywhere, scene)[CORNER] == -1e-9


def test_energies_add_up_and_of_the_rest_the_largest_is_told(scene: Interface) -> None:
    values = np.zeros(10)
    values[0], values[6] = 2.0, -3.0  # the corner in either pair
    nodes = scene.pair_nodes
    assert nodes[[0, 6]].tolist() == [CORNER, CORNER]
    for unit, told in (("J", -1.0), ("N", -1.0), ("Pa", -3.0), ("1", -3.0)):
        assert of_pairs(values, nodes, 11, unit)[CORNER] == told, unit
        assert np.isnan(of_pairs(values, nodes, 11, unit)[[9, 10]]).all()
    assert of_pairs(-values[::-1].copy(), nodes[::-1].copy(), 11, "Pa")[CORNER] == 3.0
    vectors = np.column_stack([values, np.zeros(10)])
    assert of_pairs(vectors, nodes, 11, "Pa")[CORNER].tolist() == [-3.0, 0.0]
    values[6] = np.nan
    assert of_pairs(values, nodes, 11, "Pa")[CORNER] == 2.0, "what is undefined in one pair is not told"


def test_lines_are_those_of_the_pair(scene: Interface, level: Level) -> None:
    floor, wall = contact_lines(scene)
    assert np.array_equal(scene.pair_nodes[floor.at], floor.nodes)
    assert np.array_equal(scene.pair_nodes[wall.at], wall.nodes)
    row = contact_row((floor, wall), level, {"t_T": np.arange(10.0)})
    assert row["contact.t_N"].tolist() == [-1.0, -1.0, -1.0, 0.0, 0.0]
    assert set(row["contact.t_T"][3:].tolist()) == {6.0, 7.0}
