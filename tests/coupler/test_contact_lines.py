"""What is recorded of contact along a surface: the surface unrolled, its rows in run.h5, and the picture of them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler.record.results import Along
from coupler.record.tables import contact_lines, unrolled
from coupler.report.contact import ALONE, OPEN, SLIPS, STICKS, TOUCHES, closer, contact_pictures, edges_of, status

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
    line = contact_lines(scene)[0]
    assert along.s == pytest.approx(np.linspace(0, L, CASE.n + 1))
    assert pytest.approx(np.column_stack([along.s, np.full(CASE.n + 1, L + GAP)])) == along.X
    levels = [level(scene, t) for t in times_of(CASE)]
    assert along.t_N == pytest.approx(np.array([now.t_N[line.at] for now in levels]), rel=1e-6)
    assert along.gap == pytest.approx(np.array([now.gap[line.at] for now in levels]), rel=1e-6)
    assert along.t_T is None
    assert along.slip_share is None
    assert times_of(CASE)[-1] == END


def test_what_a_node_does() -> None:
    """Rows: apart, pressed without shear, below and at Coulomb's bound (mu = .3), and a rigid body that slid off."""
    t_N = np.array([[0.0], [-1e6], [-1e6], [-1e6], [-1e6]], np.float32)
    gap = np.array([[2e-3], [0.0], [0.0], [-1e-7], [0.01]], np.float32)
    t_T = np.array([[0.0], [0.0], [0.1e6], [-0.3e6], [0.3e6]], np.float32)
    s, X = np.zeros(1), np.zeros((1, 2))
    assert status(Along(s, X, t_N, gap, t_T), 0.3, 0.01)[:, 0].tolist() == [OPEN, STICKS, STICKS, SLIPS, ALONE]
    assert status(Along(s, X, t_N, gap), 0.3, 0.01)[:, 0].tolist() == [OPEN, TOUCHES, TOUCHES, TOUCHES, ALONE]
    assert status(Along(s, X, t_N, gap, t_T), 0.0, 0.01)[3, 0] == TOUCHES
    share = np.array([[0.0], [0.0], [0.51], [0.49], [1.0]], np.float32)
    assert status(Along(s, X, t_N, gap, t_T, share), 0.3, 0.01)[:, 0].tolist() == [OPEN, STICKS, SLIPS, STICKS, ALONE]
    unknown = np.full_like(t_T, np.nan)
    assert status(Along(s, X, t_N, gap, unknown), 0.3, 0.01)[1, 0] == TOUCHES


def test_the_picture_tells_what_share_does_what(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", CASE)
    (picture,) = contact_pictures(results)
    pressed = sum(10000 < t < 15000 for t in times_of(CASE)[1:]) / CASE.windows
    assert f"touches {100 * pressed:.2g} %" in picture.alt
    assert "upper.bottom does against lower.top" in picture.caption
    assert "from (x 0, y 127 mm) to (x 76.2, y 127 mm)" in picture.caption
    results.header["geometry"] = "axisymmetric"
    assert "from (r 0, z 127 mm)" in contact_pictures(results)[0].caption
    results.contact = {}
    assert contact_pictures(results) == []


def test_a_surface_of_two_pairs_is_shown_against_the_one_asked_for(tmp_path: Path) -> None:
    results = write_run(tmp_path / "run.h5", CASE)
    results.header["pairs"].append({**results.header["pairs"][0], "name": "lid", "slave": "salt.top",
                                    "master": "upper.bottom"})
    assert "against lower.top, as found" in contact_pictures(results)[0].caption


def test_cells_reach_halfway_and_changes_are_found() -> None:
    assert edges_of(np.array([0.0, 1.0, 3.0])).tolist() == [0.0, 0.5, 2.0, 3.0]
    t = np.linspace(0, 100, 101)
    code = np.full((101, 2), OPEN, np.int8)
    code[11:14, 0] = code[20:, 1] = TOUCHES
    assert closer(t, code) == pytest.approx((10 - 0.08 * 10, 20 + 0.08 * 10))
    assert closer(t, np.full((101, 2), OPEN, np.int8)) is None
