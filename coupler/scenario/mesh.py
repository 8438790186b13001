"""The mesh of a body: what a scenario says of it, and how it is made, from a file or as a rectangle."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import StrictBool, model_validator

from contact.problem.part import Entry, Part, exactly_one
from contact.problem.values import Number, Positive, Text, Whole, did_you_mean, problem
from coupler.scenario.transfer import BodyNodes

# The part of the schema that says what there is: bodies and their meshes.

MAX_CELLS = 4_000_000


class Rectangle(Part):
    """origin, size [m]; cells along x and y; grading: last cell's size over the first's, along x and y."""

    origin: Annotated[tuple[Number, Number], Entry("lower left corner", unit="m")]
    size: Annotated[tuple[Positive, Positive], Entry("lengths of its sides", unit="m")]
    cells: Annotated[tuple[Whole, Whole], Entry("number of cells", kind="[x, y]")]
    grading: Annotated[tuple[Positive, Positive], Entry(
        "size of the last cell over that of the first; in between they grow geometrically",
        kind="[x, y]")] = (1.0, 1.0)
    triangles: Annotated[StrictBool, Entry("every quad cut in two")] = False

    @model_validator(mode="after")
    def _not_too_many(self) -> Rectangle:
        if self.cells[0] * self.cells[1] > MAX_CELLS:
            raise problem(f"more than {MAX_CELLS} cells in one body", at=("cells",))
        return self


class MeshFile(Part):
    """A mesh file; path relative to the scenario; unit of its coordinates; region: a group of cells."""

    path: Annotated[Text, Entry(
        "relative to the scenario file; gmsh (2.2, 4.1) or a format that meshio reads, with first-order cells")]
    unit: Annotated[Literal["m", "cm", "mm", "um"], Entry("of the file's coordinates")] = "m"
    region: Annotated[Text | None, Entry(
        "the named group of cells (gmsh: physical surface) to take",
        default="all cells")] = None

    @model_validator(mode="after")
    def _has_a_path(self) -> MeshFile:
        if not PurePath(self.path).name or "\0" in self.path:
            raise problem("not the path of a file", at=("path",))
        return self


class Mesh(Part):
    """Exactly one way to mesh a body."""

    rectangle: Annotated[Rectangle | None, Entry("a rectangle", default="one of the two")] = None
    file: Annotated[MeshFile | None, Entry("a mesh file", default="one of the two")] = None

    @model_validator(mode="after")
    def _one_way(self) -> Mesh:
        exactly_one(self, ("rectangle", "file"))
        return self


# The mesh of one body, whatever it came from, and what makes its cells fit to be solved on.

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# A corner whose cross product is below this share of the cell's longest edge squared has none to round-off.
FLAT = 1e-10


class MeshError(ValueError):
    """A mesh that cannot be used.  at : the keys within `mesh` that are to blame.  remedy : what to do."""

    def __init__(self, message: str, remedy: str = "", at: tuple[str | int, ...] = ()) -> None:
        super().__init__(message)
        self.remedy = remedy
        self.at = at


@dataclass(frozen=True)
class BodyMesh:
    """One body, numbered from 0.

    nodes : (n, 2) [m].  quads : (n_q, 4), triangles : (n_t, 3), anticlockwise.
    surfaces : name -> (n_edges, 2), the body on the left.  node_sets : name -> node numbers.
    points : name -> (2,) [m], places with a name, whether a node is there or not.
    groups : named groups of cells, name -> (rows of quads, rows of triangles).
    """

    nodes: Floats
    quads: Ints
    triangles: Ints
    surfaces: Mapping[str, Ints]
    node_sets: Mapping[str, Ints] = field(default_factory=dict)
    points: Mapping[str, Floats] = field(default_factory=dict)
    groups: Mapping[str, tuple[Ints, Ints]] = field(default_factory=dict)

    @property
    def nodes_and_cells(self) -> BodyNodes:
        """The mesh without names."""
        return BodyNodes(self.nodes, self.quads, self.triangles)


def anticlockwise(nodes: Floats, cells: NDArray[np.integer], kind: str) -> Ints:
    """Return the cells (n, m), node numbers, with clockwise ones turned round.

    nodes : (n_nodes, 2) [m].  cells : (n, m) node numbers of quads (m = 4) or triangles (m = 3).  kind : their name.
    Raises MeshError naming the first cell (1-based) that is flat, folded or, for quads, not convex.
    """
    if len(cells) == 0:
        return np.asarray(cells, dtype=np.int32)
    x = nodes[cells]
    ahead, behind = np.roll(x, -1, axis=1) - x, x - np.roll(x, 1, axis=1)
    corner = behind[..., 0] * ahead[..., 1] - behind[..., 1] * ahead[..., 0]
    sign = np.where(corner.sum(axis=1) < 0, -1.0, 1.0)
    longest = (ahead**2).sum(axis=2).max(axis=1)
    bad = np.flatnonzero((corner * sign[:, None]).min(axis=1) <= FLAT * longest)
    if bad.size:
        at = ", ".join(f"({X:g}, {Y:g})" for X, Y in x[bad[0]])
        raise MeshError(f"{kind} {bad[0] + 1} is flat, folded or not convex; its corners are {at} m",
                          "Mend the mesh: every corner of a cell must turn the same way.")
    # fault: clockwise cells kept -> return cells.astype(np.int32) | coupler/test_scenario_mesh
    return np.where(sign[:, None] < 0, cells[:, ::-1], cells).astype(np.int32)


def directed_edges(quads: Ints, triangles: Ints) -> NDArray[np.int64]:
    """Return every edge of every cell (4 n_quads + 3 n_triangles, 2), node numbers, running with its cell on the left.

    quads : (n_quads, 4) and triangles : (n_triangles, 3) node numbers, anticlockwise.
    """
    parts = [np.stack([c, np.roll(c, -1, axis=1)], axis=2).reshape(-1, 2) for c in (quads, triangles)]
    return np.concatenate(parts).astype(np.int64)


METRES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
SIZES = {"line": 2, "triangle": 3, "quad": 4, "vertex": 1}
MAX_BYTES = 500_000_000

Groups = dict[str, dict[str, NDArray[np.int64]]]


def file_mesh(spec: MeshFile, folder: Path, *, with_regions: bool = False) -> BodyMesh:
    """Mesh a body from a file beside the scenario.  Raises MeshError, with what to do.

    with_regions : lines inside it, where its regions meet, are no surfaces and left out.
    """
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
            taken = groups[kind].get(spec.region, np.empty(0, dtype=np.int64))
            cells[kind] = cells[kind][taken]
            groups[kind] = {name: np.flatnonzero(np.isin(taken, rows)) for name, rows in groups[kind].items()}
    if not len(cells["quad"]) + len(cells["triangle"]):
        raise MeshError("the file has no quads and no triangles", at=("file", "path"))
    quads, triangles = (anticlockwise(points, cells[kind], kind) for kind in ("quad", "triangle"))
    used = np.unique(np.concatenate([quads.ravel(), triangles.ravel()]))
    surfaces = dict(
        _surfaces(cells["line"], groups["line"], quads, triangles, lenient=spec.region is not None or with_regions)
    )
    sets = {name: np.intersect1d(cells["vertex"][rows], used) for name, rows in groups["vertex"].items()}
    sets |= {name: np.intersect1d(np.asarray(ids), used) for name, ids in (raw.point_sets or {}).items()}

    points_too = {name for name, ids in sets.items() if ids.size and name in surfaces}
    for name in (*_given_twice(mesh_path(spec, folder)), *points_too):
        # A group without a name goes by its number, which each dimension counts for itself.
        # fault: a name of lines and points at once is taken -> if False: | coupler/test_scenario_mesh
        if not name.isdecimal():
            raise MeshError(f"{name!r} is the name of two groups, of points and of lines, or of lines and of cells",
                            "Rename one of them in the mesh: what a name stands for must not depend on where it is "
                            "written.", at=("file", "path"))
    for name in (*surfaces, *sets):
        if "/" in name:
            raise MeshError(f"the group name {name!r} has a slash", "Rename it in the mesh.", at=("file", "path"))

    def renumbered(ids: NDArray[np.integer]) -> Ints:
        return np.searchsorted(used, ids).astype(np.int32)

    node_sets = {name: renumbered(ids) for name, ids in sets.items() if ids.size}
    return BodyMesh(points[used], renumbered(quads), renumbered(triangles),
                    {name: renumbered(edges) for name, edges in surfaces.items()}, node_sets,
                    groups=_cell_groups(groups))


def _cell_groups(groups: Groups) -> dict[str, tuple[Ints, Ints]]:
    """The named groups of cells: name -> (rows of quads, rows of triangles)."""
    none = np.empty(0, dtype=np.int64)
    names = dict.fromkeys((*groups["quad"], *groups["triangle"]))
    return {name: (groups["quad"].get(name, none).astype(np.int32), groups["triangle"].get(name, none).astype(np.int32))
            for name in names}


def _given_twice(path: Path) -> list[str]:
    """Names that a gmsh file gives to groups of several dimensions: its readers keep the last of them alone."""
    if path.suffix != ".msh":
        return []
    dimensions: dict[str, set[bytes]] = {}
    inside = False
    with path.open("rb") as f:
        for line in f:
            if line.startswith((b"$Nodes", b"$EndPhysicalNames")):
                break
            if inside and len(parts := line.split(b'"')) == 3:
                dimensions.setdefault(parts[1].decode(errors="replace"), set()).add(parts[0].split()[0])
            inside = inside or line.startswith(b"$PhysicalNames")
    return sorted(name for name, found in dimensions.items() if len(found) > 1)


def mesh_path(spec: MeshFile, folder: Path) -> Path:
    """Where the file is: paths are relative to the scenario's folder."""
    return (folder / spec.path).resolve()


def _read(path: Path) -> Any:
    if not path.is_file():
        raise MeshError(
            f"there is no file {path}", "Paths are relative to the scenario file.", at=("file", "path")
        )
    if not path.stat().st_size:
        raise MeshError(f"{path.name} is empty", "Write the mesh anew.", at=("file", "path"))
    if path.stat().st_size > MAX_BYTES:
        raise MeshError(f"{path.name} is larger than {MAX_BYTES} bytes", at=("file", "path"))
    # Here and not above: a scene of rectangles need not wait for it.
    import meshio

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
    # fault: a mesh file without coordinates ends in a traceback -> if False: | coupler/test_scenario_mesh
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        raise MeshError("the file has no coordinates of nodes", "Write it as gmsh .msh 2.2 or 4.1.",
                        at=("file", "path"))
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
    found, times = np.unique(forward, return_counts=True)
    # fault: cells that lie on each other are not seen -> if False: | coupler/test_scenario_mesh
    if (times > 1).any():
        a, b = divmod(int(found[np.argmax(times > 1)]), n)
        raise MeshError(f"two cells lie on the same side of the edge between nodes {a + 1} and {b + 1}: the mesh is "
                        "folded onto itself", "Mend the mesh: cells may touch, not overlap.", at=("file", "path"))
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


# A rectangle meshed by rows and columns, its four surfaces and its named points.

# A node this near (as a share of the rectangle's side) to a named point is that point.
NEAR = 1e-9
# surface -> (axis it runs along, is it at the far end of the other axis, does it run backwards with the body
# on its left, names of its points in ascending order of the axis)
SIDES = {
    "bottom": (0, False, False, ("left", "centre", "right")),
    "right": (1, True, False, ("bottom", "centre", "top")),
    # fault: top surface runs the wrong way -> "top": (0, True, False, ("left", "centre", "right")), |
    #   coupler/test_scenario_mesh
    "top": (0, True, True, ("left", "centre", "right")),
    "left": (1, False, True, ("bottom", "centre", "top")),
}


def rectangle_mesh(rectangle: Rectangle) -> BodyMesh:
    """Mesh a rectangle with quads, or with triangles by cutting each quad in two."""
    axes = [_ticks(o, s, n, g) for o, s, n, g in zip(
        rectangle.origin, rectangle.size, rectangle.cells, rectangle.grading, strict=True)]
    from skfem import MeshQuad  # a tenth of a second, which what meshes nothing need not wait for

    mesh = MeshQuad.init_tensor(*axes)
    nodes = np.ascontiguousarray(mesh.p.T)
    quads = anticlockwise(nodes, mesh.t.T, "quad")
    triangles = np.empty((0, 3), dtype=np.int32)
    if rectangle.triangles:
        triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
        quads = np.empty((0, 4), dtype=np.int32)
    surfaces = {side: _surface(nodes, axes, side) for side in SIDES}
    points = _points(axes)
    sets = {name: found for name, at in points.items() if (found := _node_at(nodes, at, rectangle.size)).size}
    return BodyMesh(nodes, quads, triangles, surfaces, sets, points)


def _ticks(origin: float, size: float, cells: int, grading: float) -> Floats:
    """(cells + 1,) coordinates; cells grow geometrically, the last over the first is `grading`."""
    ratio = grading ** (1.0 / (cells - 1)) if cells > 1 else 1.0
    share = np.concatenate([[0.0], np.cumsum(ratio ** np.arange(cells))])
    ticks = origin + size * (share / share[-1])
    ticks[-1] = origin + size
    return ticks


def _surface(nodes: Floats, axes: list[Floats], side: str) -> Ints:
    along, far, backwards, _ = SIDES[side]
    across = 1 - along
    on = np.flatnonzero(nodes[:, across] == axes[across][-1 if far else 0])
    chain = on[np.argsort(nodes[on, along])]
    if backwards:
        chain = chain[::-1]
    return np.stack([chain[:-1], chain[1:]], axis=1).astype(np.int32)


def _points(axes: list[Floats]) -> dict[str, Floats]:
    points = {}
    for side, (along, far, _, names) in SIDES.items():
        ends = axes[along]
        for name, value in zip(names, (ends[0], (ends[0] + ends[-1]) / 2, ends[-1]), strict=True):
            at = np.empty(2)
            at[along], at[1 - along] = value, axes[1 - along][-1 if far else 0]
            points[f"{side}.{name}"] = at
    return points


def _node_at(nodes: Floats, at: Floats, size: tuple[float, float]) -> Ints:
    return np.flatnonzero((np.abs(nodes - at) <= NEAR * np.asarray(size)).all(axis=1)).astype(np.int32)


