"""Facing points: exact areas while sliding, coverage that adds up, and the same answer however the scene is turned."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_scenes import GAP_MAX, ask, curved, flat, mirrored, passes, renumbered, scene

from contact.messages import Facing, Floats, Register
from contact.pair_nodes import pair_layout_of

ROUND_OFF = 1e-12  # relative to numbers of order 1: a few hundred operations
MESHES = [(3, 4), (5, 7), (24, 31), (4, 4), (1, 1), (1, 9), (9, 1)]


def edge_parts(register: Register, x: Floats, facing: Facing, side: int) -> tuple[Floats, Floats]:
    """Integrals of both shape functions over each edge's faced pieces, and over the whole edge : (n_edges, 2)."""
    edge = facing.master_edge if side else facing.slave_edge
    xi, area = (facing.xi_m, facing.area_m) if side else (facing.xi_s, facing.area)
    n = len(register.edges)
    parts = np.column_stack([np.bincount(edge, area * N, n) for N in (1.0 - xi, xi)])
    a, b = x[register.edges[:, 0]], x[register.edges[:, 1]]
    L = np.linalg.norm(b - a, axis=1)
    r_a, r_b = (2 * np.pi * a[:, 0], 2 * np.pi * b[:, 0]) if register.axisymmetric else (np.ones(n), np.ones(n))
    return parts, np.column_stack([L * (2 * r_a + r_b) / 6, L * (r_a + 2 * r_b) / 6])


@pytest.mark.few("mesh0", "mesh1", "mesh6")
@pytest.mark.parametrize("mesh", MESHES)
def test_partial_overlap_is_exact_at_every_slide_position(mesh: tuple[int, int]) -> None:
    """D11: the sum of areas is the overlap w, on both sides, also a hair off a node and a hair before leaving."""
    slides = np.concatenate([np.linspace(-1.2, 1.2, 97), [1e-9, -1e-10, 1e-13, 1 / 3, 1 - 1e-10, 0.5 + 1e-12]])
    for slide in slides:
        register, x = flat(*mesh, slide=float(slide))
        facing = ask(register, x)
        w = max(0.0, 1.0 - abs(slide))
        assert abs(facing.area.sum() - w) <= ROUND_OFF
        assert abs(facing.area_m.sum() - w) <= ROUND_OFF
        np.testing.assert_allclose(facing.gap, 0.01, rtol=0, atol=ROUND_OFF)
        assert (facing.area > 0).all()
        # The two points of a pair lie above each other.
        X_s, X_m = points(register, x, facing)
        np.testing.assert_allclose(X_m - X_s, np.tile([0.0, -0.01], (len(X_s), 1)), rtol=0, atol=ROUND_OFF)


def points(register: Register, x: Floats, facing: Facing) -> tuple[Floats, Floats]:
    """Slave and master points : (n_p, 2)."""
    s, m = x[register.edges[facing.slave_edge]], x[register.edges[facing.master_edge]]
    xi_s, xi_m = facing.xi_s[:, None], facing.xi_m[:, None]
    return (1 - xi_s) * s[:, 0] + xi_s * s[:, 1], (1 - xi_m) * m[:, 0] + xi_m * m[:, 1]


def test_shape_functions_are_integrated_exactly_over_the_overlap() -> None:
    """Integral of a linear field over a partial overlap, from either side's points."""
    register, x = flat(5, 7, slide=0.37)
    facing = ask(register, x)
    X_s, X_m = points(register, x, facing)
    exact = (1.0 - 0.37**2) / 2  # of the coordinate x over 0.37..1
    assert facing.area @ X_s[:, 0] == pytest.approx(exact, abs=ROUND_OFF)
    assert facing.area_m @ X_m[:, 0] == pytest.approx(exact, abs=ROUND_OFF)


@pytest.mark.parametrize("axisymmetric", [False, True])
@pytest.mark.parametrize("mesh", [(5, 7), (24, 31), (1, 9)])
def test_pieces_of_a_fully_faced_edge_are_the_edge(mesh: tuple[int, int], axisymmetric: bool) -> None:
    """Whole edge minus pieces = uncovered rest: zero for each shape function, on both sides."""
    register, x = flat(*mesh, axisymmetric=axisymmetric)
    facing = ask(register, x)
    for side in (0, 1):
        parts, whole = edge_parts(register, x, facing, side)
        mine = register.edge_surface == side
        np.testing.assert_allclose(parts[mine], whole[mine], rtol=1e-11, atol=ROUND_OFF)
    np.testing.assert_allclose(facing.node_covered, 1.0, rtol=0, atol=1e-11)


def test_axisymmetric_areas_are_rings() -> None:
    """A disc of radius 1 that overlaps a ring from 0.25 outward: pi (1 - 0.25^2)."""
    register, x = flat(5, 7, axisymmetric=True)
    x[6:, 0] += 0.25
    facing = ask(register, x)
    assert facing.area.sum() == pytest.approx(np.pi * (1 - 0.25**2), rel=ROUND_OFF)
    assert facing.area_m.sum() == pytest.approx(np.pi * (1 - 0.25**2), rel=ROUND_OFF)


def test_axisymmetric_cylinders_see_each_other_by_their_own_radius() -> None:
    """Wall to wall: area on the slave at r = 1, area_m on the master at r = 1.02."""
    z = np.linspace(0, 1, 6)
    slave = np.column_stack([np.ones(6), z])
    master = np.column_stack([np.full(8, 1.02), np.linspace(1, 0, 8)])
    facing = ask(*scene(slave, master, axisymmetric=True))
    assert facing.area.sum() == pytest.approx(2 * np.pi, rel=ROUND_OFF)
    assert facing.area_m.sum() == pytest.approx(2 * np.pi * 1.02, rel=ROUND_OFF)
    np.testing.assert_allclose(facing.gap, 0.02, rtol=1e-12)


@pytest.mark.parametrize("mesh", [(5, 7), (24, 31), (31, 24), (3, 40), (40, 3)])
def test_curved_coverage_adds_up_on_both_sides(mesh: tuple[int, int]) -> None:
    """D3's geometry: every slave edge is faced whole; master edges are faced whole inside, not at all outside."""
    register, x = curved(*mesh)
    facing = ask(register, x)
    parts, whole = edge_parts(register, x, facing, 0)
    mine = register.edge_surface == 0
    np.testing.assert_allclose(parts[mine], whole[mine], rtol=1e-11, atol=ROUND_OFF)
    parts, whole = edge_parts(register, x, facing, 1)
    share = (parts.sum(axis=1) / whole.sum(axis=1))[~mine]
    assert (parts >= 0).all()
    assert ((share > -ROUND_OFF) & (share < 1 + 1e-9)).all()
    full = ~mine & (parts.sum(axis=1) > (1 - 1e-12) * whole.sum(axis=1))
    np.testing.assert_allclose(parts[full], whole[full], rtol=1e-11, atol=ROUND_OFF)
    inner = (share > 1e-9) & (share < 1 - 1e-9)
    assert inner.sum() <= 2, "only the edges at the two ends of the slave are partly covered"
    if mesh[1] > 10:
        assert (share < 1e-9).any()
        assert (share > 1 - 1e-9).any()
    # Arcs of one angle have areas as their radii: they go to the slave's very end.  A polygon of steps a is shorter
    # than its arc by at most a^2/8.
    step = max(1.0 / mesh[0], 1.5 / mesh[1])
    assert facing.area_m.sum() / facing.area.sum() == pytest.approx(1.02, abs=step**2 / 8)


@pytest.mark.parametrize("n", [8, 16, 32, 64])
def test_gap_between_circles_is_right_to_second_order(n: int) -> None:
    """Chords lie below their arcs by a^2/8 for steps of a, on both sides alike: 0.6 of that is left at most."""
    gap = ask(*curved(n, 3 * n // 2)).gap
    assert abs(gap - 0.02).max() < 0.6 * (1 / n) ** 2 / 8


@pytest.mark.parametrize("make", [lambda: flat(5, 7, slide=0.3), lambda: curved(24, 31), lambda: curved(7, 4)])
class TestInvariance:
    """The same points to 1e-12 under translation, quarter turn, mirror, and renumbering."""

    def compare(self, one: Facing, other: Facing, edge: Floats | None = None, flip: bool = False) -> None:
        def table(f: Facing, change: bool) -> Floats:
            slave, master, xi_s, xi_m = f.slave_edge, f.master_edge, f.xi_s, f.xi_m
            if change:
                slave, master = (edge[slave], edge[master]) if edge is not None else (slave, master)
                xi_s, xi_m = (1 - xi_s, 1 - xi_m) if flip else (xi_s, xi_m)
            rows = np.column_stack([slave, master, xi_s, xi_m, f.gap, f.area, f.area_m])
            return rows[np.lexsort((np.round(rows[:, 2], 9), rows[:, 1], rows[:, 0]))]

        np.testing.assert_allclose(table(one, True), table(other, False), rtol=0, atol=ROUND_OFF)

    def test_translation(self, make: object) -> None:
        register, x = make()
        self.compare(ask(register, x), ask(register, x + np.array([0.7, -0.3])))

    def test_quarter_turn(self, make: object) -> None:
        register, x = make()
        turned = np.column_stack([-x[:, 1], x[:, 0]])
        self.compare(ask(register, x), ask(register, turned))
        np.testing.assert_allclose(ask(register, x).node_gap, ask(register, turned).node_gap, atol=ROUND_OFF)

    def test_any_turn(self, make: object) -> None:
        register, x = make()
        c, s = np.cos(0.77), np.sin(0.77)
        self.compare(ask(register, x), ask(register, x @ np.array([[c, s], [-s, c]])))

    def test_mirror(self, make: object) -> None:
        register, x = make()
        self.compare(ask(register, x), ask(*mirrored(register, x)), flip=True)

    def test_renumbering(self, make: object) -> None:
        register, x = make()
        register_new, x_new, node, edge = renumbered(register, x)
        one, other = ask(register, x), ask(register_new, x_new)
        self.compare(one, other, edge)
        # One pair, which has every node once: its pair nodes are its nodes in another order.
        told = [np.full((2, len(x)), np.nan) for _ in range(2)]
        for at, asked, of in zip(told, (one, other), (register, register_new), strict=True):
            at[:, pair_layout_of(of).node] = asked.node_gap, asked.node_covered
        np.testing.assert_allclose(told[1][:, node], told[0], rtol=0, atol=ROUND_OFF)

    def test_same_input_same_bits(self, make: object) -> None:
        register, x = make()
        one, other = ask(register, x), ask(register, x.copy())
        assert all(np.asarray(a).tobytes() == np.asarray(b).tobytes()
                   for a, b in zip(vars(one).values(), vars(other).values(), strict=True))


def test_nodes_know_gap_and_share_on_both_sides() -> None:
    """Slid by 0.3 on a 2:2 mesh: who overhangs and who straddles are covered in part, with the gap of that part."""
    slave = np.column_stack([np.array([0.0, 0.5, 1.0]) + 0.3, np.full(3, 0.01)])
    master = np.column_stack([[1.0, 0.5, 0.0], np.zeros(3)])
    facing = ask(*scene(slave, master))
    np.testing.assert_allclose(facing.node_gap, np.full(6, 0.01), atol=ROUND_OFF)
    # Hat functions of width 0.5 cut at 0.4 of an edge: integrals of N over the faced part, by hand.
    part = 0.4 - 0.4**2 / 2  # of N_1 over the first 0.4 of an edge, per edge length; N_2: 0.4^2/2
    np.testing.assert_allclose(facing.node_covered[:3], [1.0, 0.5 + part, 0.4**2 / 2 / 0.5], atol=ROUND_OFF)
    np.testing.assert_allclose(facing.node_covered[3:], [1.0, 0.5 + part, 0.4**2 / 2 / 0.5], atol=ROUND_OFF)


@pytest.mark.parametrize("mesh", [(3, 4), (5, 7), (1, 9), (4, 4)])
@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_a_gap_goes_on_past_the_other_sides_end(mesh: tuple[int, int], slope: float) -> None:
    """A node is as far off as what its edges face, whose gap at a slope of the master goes with the place; it is
    gap_max off from where nothing of them faces anything, and does not jump before: a hair beyond the end included."""
    for slide in np.concatenate([np.linspace(-1.2, 1.2, 48), [1e-9, -1e-9, 1e-5, -1e-5]]):
        register, x = flat(*mesh, slide=float(slide))
        slave = np.arange(mesh[0] + 1)
        x[mesh[0] + 1 :, 1] += slope * (x[mesh[0] + 1 :, 0] - 0.5)  # the master
        x[slave, 1] += 0.15
        facing = ask(register, x)
        covered = facing.node_covered > 0.0
        assert (facing.node_gap[~covered] == GAP_MAX).all()
        at = np.clip(x[slave, 0], 0.0, 1.0)
        gap = x[slave, 1] - slope * (at - 0.5)
        np.testing.assert_allclose(facing.node_gap[slave][covered[slave]], gap[covered[slave]], rtol=0,
                                   atol=1e-9 + 0.1 * slope**2)  # arcs between sides that are not parallel are longer


def test_a_node_on_the_end_is_on_it() -> None:
    """Aligned ends stay faced when round-off moves one of them out by 1e-10 of an edge."""
    register, x = flat(4, 4)
    x[:5, 0] *= 1 + 2e-11
    np.testing.assert_allclose(ask(register, x).node_gap, 0.01, rtol=0, atol=1e-12)


def test_penetration_is_a_negative_gap_and_has_a_bound() -> None:
    """Penetration is seen up to the longest edge; the far side of a body never counts as facing."""
    register, x = flat(5, 7, gap=-0.1)
    np.testing.assert_allclose(ask(register, x).gap, -0.1, atol=ROUND_OFF)
    register, x = flat(5, 7, gap=-0.6)
    assert ask(register, x).area.size == 0
    np.testing.assert_allclose(ask(register, x).node_gap, GAP_MAX)


def test_beyond_gap_max_nothing_is_faced() -> None:
    register, x = flat(5, 7, gap=GAP_MAX * 1.01)
    facing = ask(register, x)
    assert facing.area.size == 0
    assert (facing.node_gap == GAP_MAX).all()
    assert (facing.node_covered == 0).all()


def test_surfaces_that_look_the_same_way_do_not_face() -> None:
    """The slave's body lies towards the master: its surface looks away."""
    register, x = flat(5, 7)
    away = replace(register, edges=np.concatenate([register.edges[:5, ::-1], register.edges[5:]]))
    assert ask(away, x).area.size == 0


@pytest.mark.parametrize("floor_first", [False, True])
def test_of_two_master_surfaces_on_one_ray_the_nearer_is_met(floor_first: bool) -> None:
    """A master chain that folds: a shelf 0.1 above the floor, seen from above at 0.01 over the shelf."""
    slave = np.column_stack([np.linspace(0.1, 0.9, 6), np.full(6, 0.11)])
    shelf = np.array([[1.0, 0.1], [0.5, 0.1], [0.5, 0.0], [0.0, 0.0]])  # down a step: floor at the left
    register, x = scene(slave, shelf)
    floor_under = np.array([[1.0, 0.0], [0.4, 0.0]])  # a second piece of master under the shelf
    x = np.concatenate([x, floor_under])
    register = replace(register, n_nodes=len(x), edge_surface=np.append(register.edge_surface, 1).astype(np.int32),
                       edges=np.concatenate([register.edges, [[len(x) - 2, len(x) - 1]]]).astype(np.int32))
    if floor_first:
        register = replace(register, edges=register.edges[[0, 1, 2, 3, 4, 8, 5, 6, 7]])
    facing = ask(register, x)
    X_s, X_m = points(register, x, facing)
    np.testing.assert_allclose(X_m[X_s[:, 0] > 0.5][:, 1], 0.1, atol=ROUND_OFF)
    np.testing.assert_allclose(X_m[X_s[:, 0] < 0.5][:, 1], 0.0, atol=ROUND_OFF)
    assert facing.area.sum() == pytest.approx(0.8, abs=ROUND_OFF)


def test_a_corner_keeps_its_faces_normals() -> None:
    """A square corner in a square nest: gaps are those of the faces, no ray leans."""
    slave = np.array([[0.0, 1.0], [0.0, 0.5], [0.0, 0.0], [0.5, 0.0], [1.0, 0.0]])
    nest = np.array([[1.0, -0.02], [0.4, -0.02], [-0.02, -0.02], [-0.02, 0.4], [-0.02, 1.0]])
    facing = ask(*scene(slave, nest))
    np.testing.assert_allclose(facing.gap, 0.02, atol=ROUND_OFF)
    np.testing.assert_allclose(facing.node_gap[:5], 0.02, atol=ROUND_OFF)
    assert facing.area.sum() == pytest.approx(2.0, abs=ROUND_OFF)
    assert facing.area_m.sum() == pytest.approx(2.0, abs=ROUND_OFF)


def test_two_pairs_on_one_surface() -> None:
    """A slave between two masters' ends: each pair has its own points, and its own gap and share at the slave's nodes.
    """
    register, x = flat(4, 4)
    half = np.array([[0.5, 0.0], [0.0, 0.0], [1.0, -0.1], [0.5, -0.1]])
    x = np.concatenate([x[:5], half])
    register = Register(9, np.array([[0, 1], [1, 2], [2, 3], [3, 4], [5, 6], [7, 8]], dtype=np.int32),
                        np.array([0, 0, 0, 0, 1, 2], dtype=np.int32), False,
                        replace(passes((0, 1), (0, 2)), pair=np.arange(2, dtype=np.int32),
                                gap_max=np.array([0.5, 0.4])))
    facing = ask(register, x)
    np.testing.assert_allclose(facing.gap, np.where(facing.pair == 0, 0.01, 0.11), atol=ROUND_OFF)
    np.testing.assert_allclose(np.bincount(facing.pair, facing.area), 0.5, atol=ROUND_OFF)
    # Pair nodes: slave 0 to 4 and master of the first pair, then of the second.
    covered, gap = facing.node_covered, facing.node_gap
    np.testing.assert_allclose(covered[:5] + covered[7:12], 1.0, atol=ROUND_OFF)
    np.testing.assert_allclose(covered[[5, 6, 12, 13]], 1.0, atol=ROUND_OFF)
    assert 0.0 < covered[2] < 1.0
    assert covered[4] == covered[7] == 0.0
    np.testing.assert_allclose(gap[[0, 4, 7, 11]], [0.01, 0.5, 0.4, 0.11], atol=ROUND_OFF)


def test_many_edges_cost_little_more_each() -> None:
    """Points found grow as the edges do (a search that lost or doubled candidates would show here)."""
    register, x = flat(3000, 4000, slide=0.123)
    facing = ask(register, x)
    assert facing.area.sum() == pytest.approx(1 - 0.123, abs=1e-11)
    assert facing.area.size <= 2 * (3000 + 4000)


@pytest.mark.parametrize("g", [1e-3, -1e-6])
def test_a_node_on_the_axis_has_its_gap_though_its_normal_tilts(g: float) -> None:
    """A bulging disc on a plate: at the axis the ray of an end node passes the other surface's end by a hair."""
    r = np.linspace(0.0, 1.0, 9)
    disc = np.column_stack([r, g + 1e-3 * r**2])
    plate = np.column_stack([r[::-1], np.zeros(9)])
    for register, x in (scene(disc, plate, axisymmetric=True), scene(plate, disc, axisymmetric=True)):
        gap = ask(register, x).node_gap
        on_axis = x[:, 0] == 0.0
        assert on_axis.sum() == 2
        np.testing.assert_allclose(gap[on_axis], g, rtol=1e-3)
    register, x = scene(disc + np.array([0.01, 0.0]), plate, axisymmetric=True)
    # 0.08 of an edge beyond the end: the gap of that end.
    assert ask(register, x).node_gap[8] == pytest.approx(g + 1e-3 * 0.99**2, abs=5e-6)
