"""Fields over time as VTKHDF: one unstructured grid a half, points moving with the bodies; ParaView steps it.

Layout: the VTK file format's UnstructuredGrid, version 2.0, transient: connectivity stored once, points and
fields appended a frame at a time, offsets of each frame in Steps.  Every array that is written in pieces, and every one
of cells, has a checksum (Fletcher32), which any HDF5 library checks as it reads.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from coupler.errors import ResultsError
from coupler.record.checksums import put

VTK_TRIANGLE, VTK_QUAD = 5, 9
# fault: field files have no checksums -> CHECKED: dict[str, Any] = {} |
#   coupler/test_damaged_results::test_a_field_file_that_was_damaged_is_refused
CHECKED: dict[str, Any] = {"fletcher32": True}
HELD = 4 << 20  # bytes of frames that are written at once
Array = NDArray[np.float64]


@dataclass(frozen=True)
class FileField:
    """A field that every frame brings.  components : columns, 1 for plain numbers.  sparse : it is mostly NaN.

    Two columns are a vector (the third is zero); four are 11, 22, 12, 33 of a tensor and become XX, YY, ZZ, XY, YZ, XZ,
    which ParaView takes for a symmetric one.
    """

    name: str
    unit: str = ""
    components: int = 1
    description: str = ""
    sparse: bool = False

    @property
    def width(self) -> int:
        """Columns in the file; 0 for plain numbers."""
        return {1: 0, 2: 3, 4: 6}.get(self.components, self.components)


@dataclass(frozen=True)
class MeshCells:
    """quads : (n_quads, 4), triangles : (n_triangles, 3) node numbers.  n_points : nodes of the mesh."""

    quads: NDArray[np.integer]
    triangles: NDArray[np.integer]
    n_points: int


class FieldFile:
    """Writes frames to a .vtkhdf file.

    point_fields, cell_fields : what every frame brings.
    cell_constants : (n_cells,) or (n_cells, k) each by name, quads first, written once.
    """

    def __init__(self, path: Path, mesh: MeshCells, point_fields: Sequence[FileField], cell_fields: Sequence[FileField],
                 cell_constants: Mapping[str, NDArray[Any]]) -> None:
        quads, triangles, n_points = mesh.quads, mesh.triangles, mesh.n_points
        self._n_points, self._n_cells = n_points, len(quads) + len(triangles)
        self._constants = tuple(cell_constants)
        self._file = h5py.File(path, "w")
        root = self._file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0], dtype=np.int64)
        kind = b"UnstructuredGrid"
        root.attrs.create("Type", kind, dtype=h5py.string_dtype("ascii", len(kind)))
        connectivity = np.concatenate([quads.ravel(), triangles.ravel()]).astype(np.int64)
        sizes = np.concatenate([np.full(len(quads), 4), np.full(len(triangles), 3)])
        put(root, "Connectivity", connectivity)
        put(root, "Offsets", np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64))
        put(root, "Types", np.where(sizes == 4, VTK_QUAD, VTK_TRIANGLE).astype(np.uint8))
        for name, value in (("NumberOfPoints", n_points), ("NumberOfCells", self._n_cells),
                            ("NumberOfConnectivityIds", connectivity.size)):
            put(root, name, np.array([value], dtype=np.int64))
        self._place = root.create_dataset("Points", (0, 3), maxshape=(None, 3), dtype="f8",
                                          chunks=(max(n_points, 1), 3), **CHECKED)
        self._points = {f.name: _growing(root.require_group("PointData"), f, n_points) for f in point_fields}
        cells = root.require_group("CellData")
        for n, v in cell_constants.items():
            put(cells, n, v)
        self._cells = {f.name: _growing(cells, f, self._n_cells) for f in cell_fields}
        self._steps = self._prepare_steps(root)
        self._times: list[float] = []
        self._held: dict[h5py.Dataset, list[Array]] = {}
        self._bytes = 0

    def _prepare_steps(self, root: h5py.Group) -> h5py.Group:
        steps = root.create_group("Steps")
        steps.attrs["NSteps"] = np.int64(0)
        steps.create_dataset("Values", (0,), maxshape=(None,), dtype="f8", **CHECKED)
        for name in ("PartOffsets", "NumberOfParts", "PointOffsets"):
            steps.create_dataset(name, (0,), maxshape=(None,), dtype="i8", **CHECKED)
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            steps.create_dataset(name, (0, 1), maxshape=(None, 1), dtype="i8", **CHECKED)
        for group, names in (("PointDataOffsets", self._points), ("CellDataOffsets",
                                                                  [*self._cells, *self._constants])):
            for name in names:
                steps.require_group(group).create_dataset(name, (0,), maxshape=(None,), dtype="i8", **CHECKED)
        return steps

    def append(self, t: float, points: Array, point_data: Mapping[str, Array],
               cell_data: Mapping[str, Array]) -> None:
        """Add a frame at time t [s] with points : (n_points, 2) [m].

        point_data : (n_points,) or (n_points, k) each by name, in the unit of its field.
        cell_data : (n_cells,) or (n_cells, k) each by name, quads first, in the unit of its field.
        Names that are no field of the file are left out.
        """
        self._times.append(t)
        self._hold(self._place, np.column_stack([points, np.zeros(len(points))]))
        for fields, given in ((self._points, point_data), (self._cells, cell_data)):
            for name, data in fields.items():
                self._hold(data, _in_space(given[name]))
        if self._bytes > HELD:
            self._write()

    def _hold(self, data: h5py.Dataset, rows: Array) -> None:
        self._held.setdefault(data, []).append(rows)
        self._bytes += rows.nbytes

    def _write(self) -> None:
        """Write the frames that are held: many at once, as each call of HDF5 costs what a small frame does."""
        for data, rows in self._held.items():
            _extend(data, np.concatenate(rows))
        k, n = int(self._steps.attrs["NSteps"]), len(self._times)
        frames = np.arange(k, k + n)
        _extend(self._steps["Values"], np.array(self._times))
        for name, offsets in (("PartOffsets", 0 * frames), ("NumberOfParts", np.ones_like(frames)),
                              ("PointOffsets", frames * self._n_points)):
            _extend(self._steps[name], offsets)
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            _extend(self._steps[name], np.zeros((n, 1), dtype=np.int64))
        for name in self._points:
            _extend(self._steps["PointDataOffsets"][name], frames * self._n_points)
        for name in self._cells:
            _extend(self._steps["CellDataOffsets"][name], frames * self._n_cells)
        for name in self._constants:
            _extend(self._steps["CellDataOffsets"][name], 0 * frames)
        self._steps.attrs["NSteps"] = np.int64(k + n)
        self._times, self._held, self._bytes = [], {}, 0

    def close(self) -> None:
        try:
            if self._times:
                self._write()
        finally:
            self._file.close()

    def __enter__(self) -> FieldFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


def _growing(group: h5py.Group, field: FileField, rows: int) -> h5py.Dataset:
    shape, most = ((0, field.width), (None, field.width)) if field.width else ((0,), (None,))
    # Nearly all of a field of contact nodes is the same NaN: packed, it takes hardly any room.
    packed: dict[str, Any] = {"compression": "gzip", "compression_opts": 1} if field.sparse else {}
    data = group.create_dataset(field.name, shape, maxshape=most, dtype="f8", chunks=(max(rows, 1), *shape[1:]),
                                **packed, **CHECKED)
    data.attrs["unit"] = field.unit
    if field.description:
        data.attrs["description"] = field.description
    return data


def _in_space(value: Array) -> Array:
    """Scalars as they are, vectors and tensors of a plane with the components that are zero; others are columns."""
    value = value.reshape(len(value), -1) if value.ndim > 1 else value
    if value.ndim == 2 and value.shape[1] == 1:
        return value[:, 0]
    if value.ndim == 2 and value.shape[1] == 4:
        # fault: shear for thickness in field files -> return np.column_stack([value, np.zeros((len(value), 2))]) |
        #   scenarios/test_plastic_heating
        return np.column_stack([value[:, [0, 1, 3, 2]], np.zeros((len(value), 2))])
    return np.column_stack([value, np.zeros(len(value))]) if value.ndim == 2 and value.shape[1] == 2 else value


def in_plane(value: Array, components: int) -> Array:
    """Return a field as it was before it was written for ParaView: (n,) or (n, components), in its unit.

    value : (n,), (n, 3) of 2 components, (n, 6) = XX, YY, ZZ, XY, YZ, XZ of 4 = XX, YY, XY, ZZ, else (n, components),
    in the unit of the field.  components : columns it had.
    """
    if components == 4:
        return np.asarray(value[:, [0, 1, 3, 2]])
    return np.asarray(value[:, :2]) if components == 2 else value


def _extend(data: h5py.Dataset, rows: NDArray[Any]) -> None:
    n = data.shape[0]
    data.resize(n + len(rows), axis=0)
    data[n:] = rows


class FieldReader:
    """Reads a file written here, a frame at a time.

    times : (n,) [s].  quads : (n_quads, 4), triangles : (n_triangles, 3) node numbers; cells are quads first.
    point_fields, cell_fields : the names in it.
    Raises ResultsError if the file is missing or not one of these.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._file = h5py.File(path, "r")
        except OSError as exc:
            raise ResultsError(f"{path}: not a readable field file ({exc})") from exc
        try:
            root = self._file["VTKHDF"]
            self.times: Array = root["Steps/Values"][()]
            self._n_points, self._n_cells = int(root["NumberOfPoints"][0]), int(root["NumberOfCells"][0])
            connectivity, quads = root["Connectivity"][()], int((root["Types"][()] == VTK_QUAD).sum())
            self.quads = connectivity[: 4 * quads].reshape(-1, 4)
            self.triangles = connectivity[4 * quads:].reshape(-1, 3)
            self.point_fields, self.cell_fields = tuple(root["PointData"]), tuple(root["CellData"])
        except (KeyError, ValueError, OSError) as exc:
            self._file.close()
            raise ResultsError(f"{path}: not a field file of a run ({exc})") from exc
        self._root = root

    def points(self, frame: int) -> Array:
        """Return where the nodes are at a frame, (n_points, 2) [m]."""
        return np.asarray(self._rows(self._root["Points"], frame, self._n_points)[:, :2])

    def point_field(self, name: str, frame: int) -> Array:
        """Return a field of a frame at the nodes, (n_points,) or (n_points, k) in SI; k = 3 of vectors."""
        return self._rows(self._root["PointData"][name], frame, self._n_points)

    def cell_field(self, name: str, frame: int) -> Array:
        """Return a field of a frame in the cells, in SI: (n_cells,), of vectors (n_cells, 3), of tensors (n_cells, 6).

        The columns of a tensor are XX, YY, ZZ, XY, YZ, XZ; others have their own.
        """
        return self._rows(self._root["CellData"][name], frame, self._n_cells)

    @staticmethod
    def _rows(data: h5py.Dataset, frame: int, n: int) -> Array:
        frame = 0 if len(data) == n else frame  # stored once: the same at every time
        try:
            return np.asarray(data[frame * n : (frame + 1) * n])
        except OSError as exc:
            raise ResultsError(f"{data.file.filename}: {data.name} cannot be read: the file is damaged") from exc

    def __enter__(self) -> FieldReader:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._file.close()
