"""What a solver of the inside of bodies is told of a scene, and how its matrix is taken over."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.interface import Interface
from contact.half.linalg import Pattern

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class VolumeError(ArithmeticError):
    """A solver of the inside of bodies gave what cannot be used."""


@dataclass(frozen=True)
class VolumeMesh:
    """The bodies of a scene, in one numbering from 0.

    nodes : (n, 2) reference coordinates [m].  quads : (n_quads, 4), triangles : (n_triangles, 3), anticlockwise.
    quad_part, triangle_part : (n_quads,), (n_triangles,) number of the part each belongs to.  parts : their names, the
    bodies and then their regions.  axisymmetric : x = r, y = z, per whole turn; else per metre of depth.
    """

    nodes: Floats
    quads: Ints
    triangles: Ints
    quad_part: Ints
    triangle_part: Ints
    parts: tuple[str, ...]
    axisymmetric: bool


def volume_mesh(interface: Interface) -> VolumeMesh:
    """Return the mesh of an interface file."""
    return VolumeMesh(interface.nodes, interface.quads, interface.triangles, interface.quad_part,
                      interface.triangle_part, interface.parts, interface.axisymmetric)


def on_pattern(K: Any, pattern: Pattern, whose: str) -> Floats:
    """Return the entries (nnz,) of a matrix K : (n, n) at the places of a pattern, in its unit.

    K : sparse or dense.  whose : for messages.  Raises VolumeError for another shape, and for what is coupled though no
    cell has both: the unknowns then are not those of the mesh's nodes.
    """
    if np.shape(K) != (pattern.n, pattern.n):
        raise VolumeError(f"{whose}: K has shape {np.shape(K)}, but there are {pattern.n} unknowns")
    entries = csr_matrix(K).tocoo()
    rows = np.repeat(np.arange(pattern.n, dtype=np.int64), np.diff(pattern.indptr))
    keys, own = rows * pattern.n + pattern.indices, entries.row.astype(np.int64) * pattern.n + entries.col
    at = np.minimum(np.searchsorted(keys, own), keys.size - 1)
    # fault: what no cell couples is dropped in silence -> beside = np.zeros(at.size, dtype=bool) |
    #   thermal_fmu/test_given_volume
    beside = (keys[at] != own) & (entries.data != 0.0)
    if beside.any():
        i, j = int(entries.row[beside][0]), int(entries.col[beside][0])
        raise VolumeError(f"{whose}: K couples unknowns {i + 1} and {j + 1}, which no cell has both of: they must be "
                          "those of the mesh's nodes")
    if not np.isfinite(entries.data).all():
        raise VolumeError(f"{whose}: K is not finite")
    same = keys[at] == own
    return np.asarray(np.bincount(at[same], weights=entries.data[same], minlength=keys.size), dtype=np.float64)


def part_volumes(mesh: VolumeMesh, x: Floats) -> Floats:
    """Return (n_parts,) the areas of the cells of each part [m2] on coordinates x : (n, 2) [m], of a plane scene."""
    areas = np.zeros(len(mesh.parts))
    for cells, part in ((mesh.quads, mesh.quad_part), (mesh.triangles, mesh.triangle_part)):
        if len(cells):
            a, b = x[cells], x[np.roll(cells, -1, axis=1)]
            np.add.at(areas, part, 0.5 * (a[..., 0] * b[..., 1] - b[..., 0] * a[..., 1]).sum(axis=1))
    return areas
