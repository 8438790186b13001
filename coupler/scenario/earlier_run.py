"""What another run left: its meshes, and its fields at a time, read from its results file.

The file may be anyone's: h5py alone reads it, nothing it holds is run, and what it says of sizes and places is held
against what is there before it is read.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from coupler.scenario.transfer import BodyNodes, frames_around

Floats = NDArray[np.float64]

RUN_FORMAT, RUN_VERSION = "slideline.run", 3
MAX_NODES = 20_000_000
MAX_COURSE = 20_000_000  # values of a body over time
MAX_HEADER = 50_000_000  # bytes


class EarlierRunError(ValueError):
    """A results file that cannot be used.  remedy : what to do."""

    def __init__(self, message: str, remedy: str = "") -> None:
        super().__init__(message)
        self.remedy = remedy


@dataclass(frozen=True)
class EarlierRun:
    """A results file that was found in order.

    bodies : names, in the order of `*_body`.  pairs : names.  times : (n_t,) [s] of the frames.  outcome : of the run.
    """

    path: Path
    field_files: dict[str, str]
    bodies: tuple[str, ...]
    pairs: tuple[str, ...]
    outcome: str
    times: Floats
    nodes: Floats
    quads: NDArray[np.int64]
    triangles: NDArray[np.int64]
    quad_body: NDArray[np.int64]
    triangle_body: NDArray[np.int64]

    @cached_property
    def sha256(self) -> str:
        """Hash of the results file and of the field files that are read with it."""
        digest = hashlib.sha256()
        for path in (self.path, *(self.path.with_name(name) for _, name in sorted(self.field_files.items()))):
            if path.is_file():
                with path.open("rb") as stream:
                    digest.update(hashlib.file_digest(stream, "sha256").digest())
        return digest.hexdigest()

    def nodes_of(self, body: str) -> NDArray[np.intp]:
        """Return the numbers (n,) of the nodes of a body, ascending."""
        index = self.bodies.index(body)
        return np.unique(np.concatenate([self.quads[self.quad_body == index].ravel(),
                                         self.triangles[self.triangle_body == index].ravel()])).astype(np.intp)

    def mesh_of(self, body: str) -> BodyNodes:
        """Return the mesh of a body, numbered from 0."""
        index, own = self.bodies.index(body), self.nodes_of(body)
        return BodyNodes(self.nodes[own], np.searchsorted(own, self.quads[self.quad_body == index]),
                         np.searchsorted(own, self.triangles[self.triangle_body == index]))

    def time(self, t: float | str) -> float:
        """Return the time [s] meant by a number or "end".  Raises EarlierRunError where it lies outside the frames."""
        first, last = float(self.times[0]), float(self.times[-1])
        if t == "end":
            return last
        if not first <= float(t) <= last:
            raise EarlierRunError(f"{self.path.name} has frames from {first:g} to {last:g} s",
                                  "Write a time in between, or `end`.")
        return float(t)

    def temperatures(self, body: str, t: float) -> Floats:
        """Return the temperatures (n,) [K] of a body's nodes at a time [s] between the frames.

        Raises EarlierRunError.
        """
        shares, frames = self._around(t)
        return np.asarray(shares @ self._temperatures(body, frames))

    def displacements(self, body: str, t: float) -> Floats:
        """Return the displacements (n, 2) [m] of a body's nodes at a time [s] between the frames.

        Raises EarlierRunError.
        """
        shares, frames = self._around(t)
        return np.tensordot(shares, self._frames("mechanical", "u", body, frames, dim=2)[..., :2], axes=1)

    def course(self, body: str) -> Floats:
        """Return the temperatures (n_t, n) [K] of a body's nodes in all frames.  Raises EarlierRunError."""
        own = self.nodes_of(body)
        if own.size * len(self.times) > MAX_COURSE:
            raise EarlierRunError(f"{len(self.times)} frames of {own.size} nodes are more than {MAX_COURSE} values",
                                  "Keep fewer frames (output.fields) in that run.")
        return self._temperatures(body, range(len(self.times)))

    def _around(self, t: float) -> tuple[Floats, list[int]]:
        """The shares [1] and numbers of the frames that make up a time [s]."""
        around = list(frames_around(self.times, t))
        return np.array([share for _, share in around]), [k for k, _ in around]

    def _temperatures(self, body: str, frames: Sequence[int]) -> Floats:
        """Temperatures (k, n) [K] of a body's nodes in some frames."""
        T = self._frames("thermal", "T", body, frames)
        if not (T > 0.0).all():
            name = self.path.with_name(self.field_files["thermal"]).name
            raise EarlierRunError(f"{name}: body {body!r} reaches {T.min():g} K")
        return T

    def _frames(self, half: str, field: str, body: str, frames: Sequence[int], dim: int = 1) -> Floats:
        """A field (k, n) or (k, n, 3) of a half at a body's nodes, in some frames.  dim : of what the file holds."""
        path, n, own = self.path.with_name(self.field_files[half]), len(self.nodes), self.nodes_of(body)
        with opened(path) as f:
            data = dataset(f, f"VTKHDF/PointData/{field}", "f", dim)
            if data.shape != (n * len(self.times), 3)[:dim]:
                raise EarlierRunError(f"{path.name} has {len(data)} values of {field} for {n} nodes and "
                                      f"{len(self.times)} frames")
            values = np.array([data[k * n:(k + 1) * n][own] for k in frames], dtype=np.float64)
        if not np.isfinite(values).all():
            raise EarlierRunError(f"{path.name}: {field} is not finite everywhere")
        return values


def earlier_run(path: Path) -> EarlierRun:
    """Read what a results file says of itself.  Raises EarlierRunError where it cannot be used, with what to do."""
    if not path.is_file():
        raise EarlierRunError(f"there is no file {path}", "Paths are relative to the scenario file.")
    with opened(path) as f:
        if f.attrs.get("format") != RUN_FORMAT or f.attrs.get("version") != RUN_VERSION:
            raise EarlierRunError(f"{path.name} is not the results file of a run", "Give the run.h5 of a run.")
        if "mesh" not in f:
            raise EarlierRunError(f"{path.name} was written by a version that kept no mesh in it", "Run it again.")
        header = _header(f, path)
        mesh = {name: _small(dataset(f, f"mesh/{name}", kind, dim)) for name, kind, dim in (
            ("nodes", "f", 2), ("quads", "i", 2), ("triangles", "i", 2), ("quad_body", "i", 1),
            ("triangle_body", "i", 1))}
        outcome = str(f.attrs.get("outcome"))
    _fits(path, header, mesh)
    files = {half: _beside(path, header["field_files"].get(half)) for half in ("thermal", "mechanical")}
    with opened(path.with_name(files["thermal"])) as f:
        times = _small(dataset(f, "VTKHDF/Steps/Values", "f", 1)).astype(np.float64)
    if not times.size or not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise EarlierRunError(f"{path.name} has no frames in order of time")
    whole = {name: mesh[name].astype(np.int64) for name in ("quads", "triangles", "quad_body", "triangle_body")}
    pairs = tuple(str(pair["name"]) for pair in header.get("pairs", ()))
    return EarlierRun(path, files, tuple(header["bodies"]), pairs, outcome, times, mesh["nodes"].astype(np.float64),
                      **whole)


@contextmanager
def opened(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file, while the block lasts.  Raises EarlierRunError, whatever goes wrong with it in the block."""
    if not path.is_file():
        raise EarlierRunError(f"there is no file {path}", "Keep the field files of a run beside its results file.")
    try:
        with h5py.File(path, "r") as f:
            yield f
    except EarlierRunError:
        raise
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, RecursionError) as exc:
        said = " ".join(str(exc).split())[:200]
        raise EarlierRunError(f"{path.name} cannot be read as results of a run ({said})",
                              "Give the run.h5 of a run.") from exc


def _header(f: h5py.File, path: Path) -> dict[str, Any]:
    text = f.attrs["header"]
    if not isinstance(text, str) or len(text) > MAX_HEADER:
        raise EarlierRunError(f"{path.name} has no header")
    header = json.loads(text)
    good = (isinstance(header, dict) and isinstance(header.get("field_files"), dict)
            and isinstance(header.get("bodies"), list) and all(isinstance(b, str) for b in header["bodies"]))
    if not good:
        raise EarlierRunError(f"{path.name} has no header of a run")
    return dict(header)


def _beside(path: Path, name: object) -> str:
    """The name of a file in the same folder; nothing else may be meant."""
    # fault: the name of a field file leads anywhere -> if not isinstance(name, str): |
    #   coupler/test_starts_from_runs::test_a_file_that_cannot_be_is_refused_by_name
    if not isinstance(name, str) or Path(name).name != name or name in ("", ".", "..") or "\0" in name:
        raise EarlierRunError(f"{path.name} names no field file beside it")
    return name


def dataset(f: h5py.File, name: str, kind: str, dim: int) -> h5py.Dataset:
    """Find a dataset that lies in the file itself, of numbers of a kind (numpy's letter) in so many dimensions.

    Raises EarlierRunError.
    """
    group: Any = f
    for part in name.split("/"):
        if not isinstance(group, h5py.Group) or part not in group:
            raise EarlierRunError(f"{Path(f.filename).name} has no {name}")
        if not isinstance(group.get(part, getlink=True), h5py.HardLink):
            raise EarlierRunError(f"{Path(f.filename).name}: {name} leads to another place")
        group = group[part]
    wrong = (not isinstance(group, h5py.Dataset) or group.dtype.kind != kind or group.is_virtual
             or group.external is not None or group.ndim != dim)
    if wrong:
        raise EarlierRunError(f"{Path(f.filename).name}: {name} is no array of numbers in {dim} dimension"
                              f"{'s' * (dim > 1)}")
    return group


def _small(data: h5py.Dataset) -> NDArray[Any]:
    """What a dataset holds, unless it says to be larger than any mesh."""
    # fault: a file says how much memory is taken -> if False: |
    #   coupler/test_starts_from_runs::test_a_file_that_cannot_be_is_refused_by_name
    if data.size > 4 * MAX_NODES:
        raise EarlierRunError(f"{Path(data.file.filename).name}: {data.name} has {data.size} values, more than a mesh")
    return np.asarray(data[()])


def _fits(path: Path, header: dict[str, Any], mesh: dict[str, NDArray[Any]]) -> None:
    """Raises EarlierRunError where a mesh cannot be one."""
    n, n_bodies = len(mesh["nodes"]), len(header["bodies"])
    fits = (mesh["nodes"].shape == (n, 2) and 0 < n <= MAX_NODES and np.isfinite(mesh["nodes"]).all()
            and mesh["quads"].shape[1:] == (4,) and mesh["triangles"].shape[1:] == (3,)
            and mesh["quad_body"].shape == mesh["quads"].shape[:1]
            and mesh["triangle_body"].shape == mesh["triangles"].shape[:1])
    fits = fits and all(((mesh[k] >= 0) & (mesh[k] < n)).all() for k in ("quads", "triangles"))
    fits = fits and all(((mesh[k] >= 0) & (mesh[k] < n_bodies)).all() for k in ("quad_body", "triangle_body"))
    if not fits:
        raise EarlierRunError(f"the mesh in {path.name} does not fit together", "Give the run.h5 of a run.")
