"""Maps between two meshes of the same bodies: what is straight stays straight, totals stay, like meshes are one."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.interface import Interface
from coupler.scenario.mesh_maps import MeshMaps, mesh_maps
from coupler.scenario.overlaps import Overlap, cell_overlap

sys.path.insert(0, str(Path(__file__).parent))
from mesh_scenes import rectangles, rings, turned

pytestmark = pytest.mark.fast

CLOSE = 1e-12
COARSE, FINE = {"low": (5, 3), "up": (4, 3)}, {"low": (17, 7), "up": (9, 11)}
SCENES = {
    "finer": (rectangles(COARSE), rectangles(FINE)),
    "coarser": (rectangles(FINE), rectangles(COARSE)),
    "graded triangles": (rectangles(COARSE, grading=(3.0, 0.3)), rectangles(FINE, triangles=("low",))),
    "one triangles": (rectangles(FINE, triangles=("low", "up"), grading=(0.2, 4.0)), rectangles(FINE)),
    "axisymmetric": (rectangles(COARSE, "axisymmetric"), rectangles(FINE, "axisymmetric", triangles=("up",))),
    "rings": (rings({"shaft": 40, "hub": 64}), rings({"shaft": 50, "hub": 48}, layers=3)),
}
IDS = list(SCENES)


@pytest.fixture(params=IDS)
def both(request: pytest.FixtureRequest) -> tuple[Interface, Interface, MeshMaps]:
    scene, own = SCENES[request.param]
    return scene, own, mesh_maps(scene, own)


def shared(maps: MeshMaps) -> dict[str, Overlap]:
    return {n: getattr(maps, n) for n in ("cells", "contact_nodes", "pair_nodes")}


def test_straight_lines_in_space_stay(both):
    """Any linear map of coordinates: stretched, sheared, turned by two turns, moved."""
    scene, own, maps = both
    for A in (np.eye(2), np.array([[2.0, 0.7], [-0.4, 0.5]]), np.array([[0.0, -1.0], [1.0, 0.0]])):
        for to, a, b in ((maps.to_own, scene, own), (maps.to_scene, own, scene)):
            assert np.abs(to.places @ (a.nodes @ A + 0.3) - (b.nodes @ A + 0.3)).max() < CLOSE * 10.0


@pytest.mark.parametrize("name", [n for n in IDS if n != "rings"])
def test_temperatures_on_a_straight_line_stay(name):
    scene, own = SCENES[name]
    maps = mesh_maps(scene, own)
    for to, a, b in ((maps.to_own, scene, own), (maps.to_scene, own, scene)):
        T = 300.0 + a.nodes @ [100.0, -70.0]
        assert np.abs(to.values @ T - 300.0 - b.nodes @ [100.0, -70.0]).max() < CLOSE * 400.0
    on = own.nodes[own.contact_nodes] @ [100.0, -70.0]
    assert np.abs(maps.surface_to_scene @ on - scene.nodes[scene.contact_nodes] @ [100.0, -70.0]).max() < CLOSE * 400.0


def test_values_keep_their_bounds(both):
    """Beside a curve, too."""
    scene, own, maps = both
    rng = np.random.default_rng(3)
    for to, n in ((maps.to_own, len(scene.nodes)), (maps.to_scene, len(own.nodes))):
        v = rng.random(n)
        assert (to.values @ v).max() <= v.max() * (1 + CLOSE)
        assert (to.values @ v).min() >= v.min() * (1 - CLOSE)


def test_totals_stay(both):
    """Joules of cells, of surfaces and of each side of a pair, to and fro."""
    *_, maps = both
    rng = np.random.default_rng(5)
    for overlap in shared(maps).values():
        for way in (overlap, overlap.turned):
            E = rng.normal(size=way.shares.shape[0])
            assert abs(way.sums(E).sum() - E.sum()) < CLOSE * np.abs(E).sum()
    scene, own, _ = both
    E = rng.random(len(scene.pair_nodes))
    for one, other in zip(scene.pair_sides, own.pair_sides, strict=True):
        assert maps.pair_nodes.sums(E)[other.at].sum() == pytest.approx(E[one.at].sum(), rel=CLOSE)


def test_what_is_uniform_stays_uniform(both):
    *_, maps = both
    for overlap in shared(maps).values():
        for way in (overlap, overlap.turned):
            assert np.abs(way.means(np.full(way.shares.shape[0], -7.0)) + 7.0).max() < CLOSE * 7.0


def node_areas(interface: Interface) -> np.ndarray:
    """Half of every edge around each pair node, around an axis of its cone."""
    found = np.zeros(len(interface.pair_nodes))
    for side in interface.pair_sides:
        edges = interface.surfaces[side.surface]
        a, b = interface.nodes[edges[:, 0]], interface.nodes[edges[:, 1]]
        length = np.linalg.norm(b - a, axis=1)
        for k, (one, other) in enumerate(((a, b), (b, a))):
            r = 0.75 * one[:, 0] + 0.25 * other[:, 0] if interface.axisymmetric else 1.0
            np.add.at(found[side.at], np.searchsorted(side.nodes, edges[:, k]), 0.5 * length * r)
    return found


@pytest.mark.parametrize("name", [n for n in IDS if n != "rings"])
def test_pressure_keeps_its_force_and_its_sign(name):
    scene, own = SCENES[name]
    t_N = -np.random.default_rng(7).random(len(scene.pair_nodes)) * 1e7
    there = mesh_maps(scene, own).pair_nodes.means(t_N)
    assert there @ node_areas(own) == pytest.approx(t_N @ node_areas(scene), rel=CLOSE)
    assert (there <= 0.0).all()
    assert there.min() >= t_N.min()


def test_around_an_axis_parts_count_by_volume():
    """A uniform heat per volume stays one: cells of a ring hold as much as they have volume."""
    scene, own = SCENES["axisymmetric"]
    def volumes(i: Interface) -> np.ndarray:
        found = []
        for cells in (i.quads, i.triangles):
            x = i.nodes[cells]
            y = np.roll(x, -1, axis=1)
            twice = x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0]
            found.append(((x[..., 0] + y[..., 0]) * twice).sum(axis=1) / 6.0)
        return np.concatenate(found)

    E = mesh_maps(scene, own).cells.sums(volumes(scene))
    assert np.abs(E - volumes(own)).max() < CLOSE


def test_cells_share_what_they_share():
    """Two rectangles, a triangle in a square, cells apart."""
    square = np.array([[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]])
    others = np.array([[[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]],
                       [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.0, 2.0]],
                       [[5.0, 0.0], [6.0, 0.0], [6.0, 1.0], [5.0, 1.0]]])
    found = cell_overlap(square, others, False)
    assert found.shares.toarray()[0] == pytest.approx([1 / 3, 2 / 3, 0.0])
    assert found.parts.toarray()[:, 0] == pytest.approx([1.0, 1.0, 1.0])  # one apart takes after the nearest


@pytest.mark.parametrize("name", IDS)
def test_like_meshes_are_one(name):
    """The same bits come out as go in."""
    for i in SCENES[name]:
        maps = mesh_maps(i, Interface(**{n: getattr(i, n) for n in i.__dataclass_fields__}))
        rng = np.random.default_rng(11)
        v = rng.random(len(i.nodes))
        for to in (maps.to_own, maps.to_scene):
            assert (to.values @ v == v).all()
            assert (to.places @ v == v).all()
        for overlap in shared(maps).values():
            v = rng.random(overlap.shares.shape[0])
            assert (overlap.sums(v) == v).all()
            assert (overlap.means(v) == v).all()
        v = rng.random(len(i.contact_nodes))
        assert (maps.surface_to_own @ v == v).all()


def test_bodies_turned_and_moved_have_the_same_maps():
    scene, own = SCENES["finer"]
    there, here = (mesh_maps(*(turned(i, angle, shift) for i in (scene, own))) for angle, shift in (
        (0.7, (3.0, -2.0)), (0.0, (0.0, 0.0))))
    rng = np.random.default_rng(13)
    for one, other in zip(shared(there).values(), shared(here).values(), strict=True):
        v = rng.random(one.shares.shape[0])
        assert np.abs(one.sums(v) - other.sums(v)).max() < 1e-9
    v = rng.random(len(scene.nodes))
    assert np.abs(there.to_own.values @ v - here.to_own.values @ v).max() < 1e-9


def test_both_sides_of_a_pair_are_carried_alike():
    """Slave and master exchanged: the rows move, the numbers stay."""
    pairs = [(rectangles(COARSE, swapped=s), rectangles(FINE, swapped=s)) for s in (False, True)]
    carried = []
    for scene, own in pairs:
        E = np.concatenate([1.0 + scene.nodes[side.nodes, 0] for side in scene.pair_sides])
        there = mesh_maps(scene, own).pair_nodes.sums(E)
        carried.append({side.surface: there[side.at] for side in own.pair_sides})
    assert carried[0].keys() == carried[1].keys()
    assert all((carried[0][n] == carried[1][n]).all() for n in carried[0])


def test_a_smooth_field_is_carried_to_second_order():
    """Temperature at nodes; the pressure that acts on a part of a surface."""
    off_T, off_p = [], []
    for n in (8, 16, 32):
        scene = rectangles({"low": (n, n), "up": (n, n)})
        own = rectangles({"low": (3 * n // 2 + 1, n + 3), "up": (n + 5, n)})
        maps = mesh_maps(scene, own)
        f = lambda x: np.sin(3.0 * x[:, 0]) * np.cos(2.0 * x[:, 1])  # noqa: E731
        off_T.append(np.abs(maps.to_own.values @ f(scene.nodes) - f(own.nodes)).max())
        p = maps.pair_nodes.means(-1.0 - np.sin(3.0 * scene.nodes[scene.pair_nodes, 0]))
        weight = node_areas(own) * np.cos(own.nodes[own.pair_nodes, 0])
        off_p.append(abs(p @ weight - (-1.0 - np.sin(3.0 * own.nodes[own.pair_nodes, 0])) @ weight))
    assert np.log2(np.divide(off_T[:-1], off_T[1:])).min() > 1.7
    assert off_T[-1] < 1.5e-3
    assert np.log2(off_p[0] / off_p[-1]) / 2 > 1.5
    assert off_p[-1] < 1e-3
