"""Meshes: where surfaces run, what is named, what files bring, and what is refused."""

from __future__ import annotations

import random
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

from contact.half.interface import Interface
from coupler.errors import ScenarioError
from coupler.scenario.mesh import MeshError, MeshFile, anticlockwise, file_mesh

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import GOOD, load_text

NORMALS = {"bottom": (0, -1), "right": (1, 0), "top": (0, 1), "left": (-1, 0)}
RECTANGLE = "{rectangle: {origin: [0, 0], size: [2, 1], cells: [4, 2]}}"


def area(interface: Interface) -> float:
    """Area of all cells [m2], negative where they run clockwise."""
    total = 0.0
    for cells in (interface.quads, interface.triangles):
        x, y = np.moveaxis(interface.nodes[cells], 2, 0)
        total += 0.5 * float((x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum())
    return total


def outward(interface: Interface, surface: str) -> np.ndarray:
    """Outward normals of the edges of a surface, (n, 2)."""
    a, b = np.moveaxis(interface.nodes[interface.surfaces[surface]], 1, 0)
    t = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    return np.stack([t[:, 1], -t[:, 0]], axis=1)


@pytest.mark.parametrize("triangles", [False, True])
def test_rectangles_have_their_area_and_their_surfaces_face_outwards(triangles: bool, tmp_path: Path) -> None:
    i = load_text(tmp_path, GOOD, {"bodies.upper.mesh.rectangle.triangles": triangles}).interface
    assert area(i) == pytest.approx(4.0, rel=1e-14)
    assert (len(i.quads), len(i.triangles)) == ((8, 20) if triangles else (18, 0))
    assert set(i.surfaces) == {f"{body}.{side}" for body in ("lower", "upper") for side in NORMALS}
    for name, edges in i.surfaces.items():
        normals = outward(i, name)
        assert np.abs(normals - NORMALS[name.split(".")[1]]).max() < 1e-14
        assert (edges[1:, 0] == edges[:-1, 1]).all(), "edges follow each other"
    length = np.linalg.norm(np.diff(i.nodes[i.surfaces["upper.left"]], axis=1), axis=2).sum()
    assert length == pytest.approx(1.0)


def test_bodies_share_one_numbering_but_no_nodes(tmp_path: Path) -> None:
    i = load_text(tmp_path, GOOD).interface
    assert i.bodies == ("lower", "upper")
    assert i.materials == ("steel", "steel")
    assert len(i.nodes) == 5 * 3 + 6 * 3
    assert (i.node_body == np.repeat([0, 1], [15, 18])).all()
    assert set(i.contact_nodes) == set(i.surfaces["lower.top"].ravel()) | set(i.surfaces["upper.bottom"].ravel())


def test_named_points_are_where_they_say(tmp_path: Path) -> None:
    i = load_text(tmp_path, GOOD).interface
    places = {"bottom.left": (0, 0), "bottom.centre": (1, 0), "bottom.right": (2, 0), "right.bottom": (2, 0),
              "right.centre": (2, 0.5), "right.top": (2, 1), "top.left": (0, 1), "top.centre": (1, 1),
              "top.right": (2, 1), "left.bottom": (0, 0), "left.centre": (0, 0.5), "left.top": (0, 1)}
    for name, at in places.items():
        (node,) = i.node_sets[f"lower.{name}"]
        assert i.nodes[node] == pytest.approx(at)
    # Five cells have no node in the middle.
    assert "upper.top.centre" not in i.node_sets
    assert "upper.left.centre" in i.node_sets


def test_grading_is_the_last_cell_over_the_first(tmp_path: Path) -> None:
    i = load_text(tmp_path, GOOD, {"bodies.lower.mesh.rectangle.grading": [8, 0.25]}).interface
    x = np.unique(i.nodes[i.node_body == 0][:, 0])
    sizes = np.diff(x)
    assert sizes[-1] / sizes[0] == pytest.approx(8)
    assert sizes[1:] / sizes[:-1] == pytest.approx(np.full(3, 2.0))
    y = np.diff(np.unique(i.nodes[i.node_body == 0][:, 1]))
    assert y[-1] / y[0] == pytest.approx(0.25)
    assert (x[0], x[-1]) == (0.0, 2.0)


def test_surfaces_of_round_off_sizes_are_whole(tmp_path: Path) -> None:
    """Coordinates such as 0.1 + 0.2 are not round; the top row must still be found."""
    i = load_text(tmp_path, GOOD, {"bodies.lower.mesh.rectangle": {
        "origin": [0.1, 0.1], "size": [0.2, 0.7], "cells": [7, 7], "grading": [3, 1 / 3]}}).interface
    assert all(len(i.surfaces[f"lower.{side}"]) == 7 for side in NORMALS)


def test_clockwise_cells_are_turned_and_bad_ones_named() -> None:
    nodes = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [0.2, 0.2]], dtype=float)
    turned = anticlockwise(nodes, np.array([[0, 3, 2, 1], [0, 1, 2, 3]]), "quad")
    assert turned[0].tolist() == [1, 2, 3, 0]
    assert turned[1].tolist() == [0, 1, 2, 3]
    with pytest.raises(MeshError, match="triangle 2 is flat"):
        anticlockwise(nodes, np.array([[0, 1, 2], [0, 1, 4]]), "triangle")
    with pytest.raises(MeshError, match=r"quad 1 .* not convex"):
        anticlockwise(nodes, np.array([[0, 1, 5, 3]]), "quad")
    with pytest.raises(MeshError, match="quad 1"):
        anticlockwise(nodes, np.array([[0, 2, 1, 3]]), "quad")


def block_file(path: Path, *, z: float = 0.0, extra: tuple[str, list[list[int]]] | None = None) -> None:
    """A 2 x 1 block of one clockwise quad and two triangles, named as gmsh names groups; lines run anyhow."""
    points = np.array([[0, 0, z], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0], [9, 9, 0]], dtype=float)
    cells = [("quad", [[0, 3, 4, 1]]), ("triangle", [[1, 2, 5], [1, 5, 4]]),
             ("line", [[3, 4], [4, 5]]), ("line", [[1, 0], [1, 2]]), ("vertex", [[0]]), *([extra] if extra else [])]
    tags = [[7], [7, 7], [1, 1], [2, 2], [3], *([[1] * len(extra[1])] if extra else [])]
    data = {name: [np.array(t) for t in tags] for name in ("gmsh:physical", "gmsh:geometrical")}
    names = {"block": np.array([7, 2]), "top": np.array([1, 1]), "bottom": np.array([2, 1]), "foot": np.array([3, 0])}
    meshio.write(path, meshio.Mesh(points, cells, cell_data=data, field_data=names), file_format="gmsh22", binary=False)


WITH_FILE = GOOD.replace(RECTANGLE, "{file: {path: meshes/block.msh, unit: cm}}").replace(
    "[0, 1], size: [2, 1]", "[0, 0.01], size: [0.02, 0.01]").replace(
    "{T: lower.top.left}", "{T: {at: [0.015, 0.0], body: lower}}").replace(
    "on: upper.top, u_y", "on: upper.top, u_x: 0, u_y").replace("upper.top.left", "lower.foot")


def test_a_mesh_file_brings_cells_surfaces_and_points(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    block_file(tmp_path / "meshes" / "block.msh")
    i = load_text(tmp_path, WITH_FILE).interface
    assert (len(i.triangles), (i.quad_body == 0).sum()) == (2, 1)
    assert area(i) == pytest.approx(2 * 2e-4, rel=1e-13)
    assert len(i.nodes) == 6 + 18, "the node no cell uses is left out"
    for side in ("top", "bottom"):
        assert np.abs(outward(i, f"lower.{side}") - NORMALS[side]).max() < 1e-14
    assert i.nodes[i.node_sets["lower.foot"]] == pytest.approx(np.zeros((1, 2)))


@pytest.mark.parametrize(("change", "words"), [
    ({"z": 0.5}, "plane"),
    ({"extra": ("line", [[1, 4]])}, "not on the boundary"),
    ({"extra": ("triangle", [[0, 1, 2]])}, "flat"),
    ({"extra": ("triangle6", [[0, 1, 2, 3, 4, 5]])}, "triangle6"),
    ({"extra": ("triangle", [[1, 2, 4]])}, "folded onto itself"),
])
def test_a_mesh_that_cannot_be_used_is_named(change: dict[str, object], words: str, tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    block_file(tmp_path / "meshes" / "block.msh", **change)  # type: ignore[arg-type]
    with pytest.raises(ScenarioError) as caught:
        load_text(tmp_path, WITH_FILE)
    assert words in caught.value.message
    assert "'lower'" in caught.value.message
    assert caught.value.key.startswith("bodies.lower.mesh")


@pytest.mark.parametrize("data", [None, b"", b"$MeshFormat\n4.1 0 8\n", bytes(range(256)) * 20])
def test_a_broken_mesh_file_is_one_error(data: bytes | None, tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    if data is not None:
        (tmp_path / "meshes" / "block.msh").write_bytes(data)
    with pytest.raises(ScenarioError) as caught:
        load_text(tmp_path, WITH_FILE)
    assert caught.value.key == "bodies.lower.mesh.file.path"


GMSH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
1 1 "foot"
0 {tag} "{name}"
2 3 "all"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
3
1 1 2 1 1 1 2
2 15 2 {tag} 1 1
3 3 2 3 1 1 2 3 4
$EndElements
"""


@pytest.mark.parametrize("tag", [1, 2])
def test_one_name_for_lines_and_points_is_an_error(tag: int, tmp_path: Path) -> None:
    """gmsh's readers would forget the one of the two."""
    (tmp_path / "m.msh").write_text(GMSH.format(tag=tag, name="corner"))
    mesh = file_mesh(MeshFile(path="m.msh"), tmp_path)
    assert (list(mesh.surfaces), list(mesh.node_sets)) == (["foot"], ["corner"])
    (tmp_path / "m.msh").write_text(GMSH.format(tag=tag, name="foot"))
    with pytest.raises(MeshError, match="'foot' is the name of two groups, of points and of lines"):
        file_mesh(MeshFile(path="m.msh"), tmp_path)


def test_one_name_for_a_set_of_points_and_a_set_of_lines_is_an_error(tmp_path: Path) -> None:
    """In a format of which both come through."""
    points, cells = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]), [("quad", [[0, 1, 2, 3]]),
                                                                                 ("line", [[0, 1]])]
    meshio.Mesh(points, cells, point_sets={"foot": [0]},
                cell_sets={"foot": [np.array([], int), np.array([0])]}).write(tmp_path / "m.inp")
    with pytest.raises(MeshError, match="'foot' is the name of two groups"):
        file_mesh(MeshFile(path="m.inp"), tmp_path)


def test_a_mesh_file_that_names_no_surface_is_told_so(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    block_file(tmp_path / "meshes" / "block.msh")
    raw = meshio.read(tmp_path / "meshes" / "block.msh")
    bare = meshio.Mesh(raw.points, [cells for cells in raw.cells if cells.type in ("quad", "triangle")])
    meshio.write(tmp_path / "meshes" / "block.msh", bare, file_format="gmsh22", binary=False)
    with pytest.raises(ScenarioError) as caught:
        load_text(tmp_path, WITH_FILE)
    told = {error.key: error.remedy for error in (caught.value, *caught.value.others)}
    assert told["contact.face.master"].startswith("lower has none: a mesh file names them as groups of lines (gmsh: "
                                                  "Physical Curve). Known here: upper.bottom, ")
    assert "thermal.boundary.0.on" in told


def test_unknown_regions_are_named_and_known_ones_taken(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    block_file(tmp_path / "meshes" / "block.msh")
    s = load_text(tmp_path, WITH_FILE, {"bodies.lower.mesh.file.region": "block"})
    assert len(s.interface.triangles) == 2
    with pytest.raises(ScenarioError, match="'block'"):
        load_text(tmp_path, WITH_FILE, {"bodies.lower.mesh.file.region": "blok"})


def test_the_hash_follows_the_mesh_file(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    path = tmp_path / "meshes" / "block.msh"
    block_file(path)
    first = load_text(tmp_path, WITH_FILE).hash
    path.write_text(path.read_text().replace("\n2 1 0 0\n", "\n2 1.0 0 0.0\n") + "\n")
    assert load_text(tmp_path, WITH_FILE).hash != first


def test_no_damaged_file_ends_in_a_traceback(tmp_path):
    """Flipped bits, bytes left out and put in, files cut: a mesh, or an error that says what is wrong with it."""
    block_file(tmp_path / "text.msh")
    whole = meshio.read(tmp_path / "text.msh")
    meshio.write(tmp_path / "binary.msh", whole, file_format="gmsh22", binary=True)
    files, rng = [(tmp_path / f"{name}.msh").read_bytes() for name in ("text", "binary")], random.Random(1)
    outcomes = {"read": 0, "refused": 0}
    for _ in range(300):
        data = bytearray(rng.choice(files))
        for _ in range(rng.choice([1, 1, 2, 4])):
            at, how = rng.randrange(len(data)), rng.random()
            if how < 0.4:
                data[at] ^= 1 << rng.randrange(8)
            elif how < 0.6:
                del data[at:at + rng.randrange(1, 9)]
            elif how < 0.8:
                data[at:at] = rng.choice([b"999999999", b"-1", b"1e999", b"\n", b"$End", b"\xff" * 8, b"0 "])
            else:
                del data[max(at, 1):]
        (tmp_path / "m.msh").write_bytes(data)
        try:
            mesh = file_mesh(MeshFile(path="m.msh"), tmp_path)
        except MeshError:
            outcomes["refused"] += 1
        else:
            outcomes["read"] += 1
            assert np.isfinite(mesh.nodes).all()
            for cells in (mesh.quads, mesh.triangles):
                assert cells.min(initial=0) >= 0
                assert cells.max(initial=0) < len(mesh.nodes)
    assert min(outcomes.values()) > 20, outcomes
