"""A mesh from a file, by meshio: cells, groups of lines as surfaces, groups of points as node sets."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from coupler.scenario.body_mesh import BodyMesh, Floats, Ints, MeshError, anticlockwise, directed_edges
from coupler.scenario.quantity import did_you_mean
from coupler.scenario.schema_scene import MeshFile

METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
SIZES = {"line": 2, "triangle": 3, "quad": 4, "vertex": 1}
MAX_BYTES = 500_000_000

Groups = dict[str, dict[str, NDArray[np.int64]]]


def file_mesh(spec: MeshFile, folder: Path) -> BodyMesh:
    """Mesh a body from a file beside the scenario.  Raises MeshError, with what to do."""
    raw = _read(mesh_path(spec, folder))
    cells, groups = _blocks(raw)
    # fault: unit of a mesh file ignored -> points = _in_plane(np.asarray(raw.points, dtype=float)) |
    #   coupler/test_scenario_mesh
    points = _in_plane(np.asarray(raw.points, dtype=float)) * METRES[spec.unit]
    if spec.region is not None:
        if spec.region not in (known := {**groups["quad"], **groups["triangle"]}):
            raise MeshError(
                f"the file has no group of cells {spec.region!r}",
                did_you_mean(spec.region, known),
                at=("file", "region"),
            )
        for kind in ("quad", "triangle"):
            cells[kind] = cells[kind][groups[kind].get(spec.region, np.empty(0, dtype=np.int64))]
    if not len(cells["quad"]) + len(cells["triangle"]):
        raise MeshError("the file has no quads and no triangles", at=("file", "path"))
    quads, triangles = (anticlockwise(points, cells[kind], kind) for kind in ("quad", "triangle"))
    used = np.unique(np.concatenate([quads.ravel(), triangles.ravel()]))
    surfaces = dict(
        _surfaces(cells["line"], groups["line"], quads, triangles, lenient=spec.region is not None)
    )
    sets = {name: np.intersect1d(cells["vertex"][rows], used) for name, rows in groups["vertex"].items()}
    sets |= {name: np.intersect1d(np.asarray(ids), used) for name, ids in (raw.point_sets or {}).items()}

    for name in (*surfaces, *sets):
        if "/" in name:
            raise MeshError(f"the group name {name!r} has a slash", "Rename it in the mesh.", at=("file", "path"))

    def renumbered(ids: NDArray[np.integer]) -> Ints:
        return np.searchsorted(used, ids).astype(np.int32)

    node_sets = {name: renumbered(ids) for name, ids in sets.items() if ids.size}
    return BodyMesh(points[used], renumbered(quads), renumbered(triangles),
                    {name: renumbered(edges) for name, edges in surfaces.items()}, node_sets)


def mesh_path(spec: MeshFile, folder: Path) -> Path:
    """Where the file is: paths are relative to the scenario's folder."""
    return (folder / spec.path).resolve()


def _read(path: Path) -> Any:
    if not path.is_file():
        raise MeshError(
            f"there is no file {path}", "Paths are relative to the scenario file.", at=("file", "path")
        )
    if path.stat().st_size > MAX_BYTES:
        raise MeshError(f"{path.name} is larger than {MAX_BYTES} bytes", at=("file", "path"))
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            return meshio.read(path)
    except (Exception, SystemExit) as exc:
        # A true border: the readers raise whatever a broken file makes them trip over, and where none of them
        # fits, meshio prints and leaves the interpreter.
        told = said.getvalue() if isinstance(exc, SystemExit) else str(exc)
        reason = " ".join(told.split())[:200] or type(exc).__name__
        raise MeshError(
            f"{path.name} cannot be read as a mesh ({reason})",
            "Write it as gmsh .msh 2.2 or 4.1.",
            at=("file", "path"),
        ) from exc


def _in_plane(points: Floats) -> Floats:
    """(n, 2) of (n, 2) or (n, 3) coordinates.  A mesh out of one plane z = constant is refused."""
    if not np.isfinite(points).all():
        raise MeshError("the file has coordinates that are not finite", at=("file", "path"))
    if points.shape[1] == 3 and np.ptp(points[:, 2]) > 1e-9 * max(np.ptp(points[:, :2]), 1e-300):
        raise MeshError("the mesh does not lie in a plane z = constant", at=("file", "path"))
    return np.ascontiguousarray(points[:, :2])


def _blocks(raw: Any) -> tuple[dict[str, NDArray[np.int64]], Groups]:
    """Cells of each kind in one array, and the groups they are in: kind -> name -> rows of that array."""
    names = {(int(dim), int(tag)): name for name, (tag, dim) in raw.field_data.items()}
    tags = raw.cell_data.get("gmsh:physical", [None] * len(raw.cells))
    cells: dict[str, list[NDArray[np.int64]]] = {kind: [] for kind in SIZES}
    rows: dict[str, dict[str, list[NDArray[np.int64]]]] = {kind: {} for kind in SIZES}
    for i, block in enumerate(raw.cells):
        if block.type not in SIZES:
            raise MeshError(
                f"the file has cells of kind {block.type}",
                "Only lines, triangles and quads of first order can be used.",
                at=("file", "path"),
            )
        start = sum(len(c) for c in cells[block.type])
        cells[block.type].append(np.asarray(block.data, dtype=np.int64))
        for name, within in _groups_of(raw, i, tags[i], names, {"vertex": 0, "line": 1}.get(block.type, 2)):
            rows[block.type].setdefault(name, []).append(start + within)
    joined = {
        kind: np.concatenate([np.empty((0, n), dtype=np.int64), *cells[kind]]) for kind, n in SIZES.items()
    }
    return joined, {kind: {n: np.concatenate(r) for n, r in found.items()} for kind, found in rows.items()}


def _groups_of(raw: Any, i: int, tags: Any, names: dict[tuple[int, int], str], dim: int,
               ) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """The named groups (gmsh: physical) that cells of block i are in."""
    if tags is not None:
        for tag in np.unique(tags):
            # A group without a name goes by its number, as gmsh shows it; 0 means no group.
            if tag:
                yield names.get((dim, int(tag)), str(int(tag))), np.flatnonzero(np.asarray(tags) == tag)
        return
    for name, blocks in (raw.cell_sets or {}).items():
        if not name.startswith("gmsh:") and blocks[i] is not None and len(blocks[i]):
            yield name, np.asarray(blocks[i], dtype=np.int64)


def _surfaces(lines: NDArray[np.int64], groups: dict[str, NDArray[np.int64]], quads: Ints, triangles: Ints, *,
              lenient: bool) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """Groups of lines turned so that the body is on their left.

    lenient : lines that are no edges of these cells belong to another region of the file and are left out.
    """
    edges = directed_edges(quads, triangles)
    n = int(max(edges.max(), lines.max(initial=0))) + 1
    forward, backward = edges @ (n, 1), edges @ (1, n)
    outer = np.setdiff1d(forward, backward)
    for name, rows in groups.items():
        line = lines[rows]
        as_is, turned = np.isin(line @ (n, 1), outer), np.isin(line @ (1, n), outer)
        on = as_is | turned
        if not on.all() and not lenient:
            a, b = line[np.flatnonzero(~on)[0]]
            raise MeshError(
                f"the line group {name!r} has a line (nodes {a + 1} and {b + 1}) that is not on the "
                "boundary of the body",
                "Surfaces are made of outer edges; where regions meet in the file, take one by `region`.",
                at=("file", "path"),
            )
        if on.any():
            # fault: lines of mesh files not turned -> yield name, line[on] | coupler/test_scenario_mesh
            yield name, np.where(turned[:, None], line[:, ::-1], line)[on]
