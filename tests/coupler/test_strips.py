"""What is recorded of contact along a surface: the surface unrolled, its rows in run.h5, and the picture of them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler.record.strips import strips, unrolled

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import END, GAP, Case, L, blocks, level, times_of, write_run

CASE = Case()


def test_a_surface_is_unrolled_in_order_from_its_left_end() -> None:
    X = np.array([[3.0, 4.0], [0.0, 0.0], [3.0, 0.0], [9.0, 9.0]])
    for edges in ([[0, 2], [2, 1]], [[1, 2], [2, 0]], [[2, 0], [1, 2]]):
        nodes, s = unrolled(np.array(edges), X)
        assert nodes.tolist() == [1, 2, 0]
        assert s.tolist() == [0.0, 3.0, 7.0]


def test_pieces_follow_each_other_and_a_ring_closes() -> None:
    X = np.array([[0.0, 0.0], [1.0, 0.0], [5.0, 0.0], [7.0, 0.0], [0.0, 1.0]])
    nodes, s = unrolled(np.array([[3, 2], [0, 1]]), X)
    assert nodes.tolist() == [0, 1, 2, 3]
    assert s.tolist() == [0.0, 1.0, 1.0, 3.0]
    nodes, s = unrolled(np.array([[0, 1], [1, 4], [4, 0]]), X)
    assert nodes[0] == nodes[-1]
    assert s[-1] == pytest.approx(2 + np.sqrt(2))


def test_rows_are_what_the_windows_ended_with(tmp_path: Path) -> None:
    along = write_run(tmp_path / "run.h5", CASE).contact["interface"]
    scene = blocks(CASE.n)
    strip = strips(scene)[0]
    assert along.s == pytest.approx(np.linspace(0, L, CASE.n + 1))
    assert pytest.approx(np.column_stack([along.s, np.full(CASE.n + 1, L + GAP)])) == along.X
    levels = [level(scene, t) for t in times_of(CASE)]
    assert along.t_N == pytest.approx(np.array([now.t_N[strip.at] for now in levels]), rel=1e-6)
    assert along.gap == pytest.approx(np.array([now.gap[strip.at] for now in levels]), rel=1e-6)
    assert along.t_T is None
    assert times_of(CASE)[-1] == END
