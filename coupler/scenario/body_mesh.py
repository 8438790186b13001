"""The mesh of one body, whatever it came from, and what makes its cells fit to be solved on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

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
    """

    nodes: Floats
    quads: Ints
    triangles: Ints
    surfaces: Mapping[str, Ints]
    node_sets: Mapping[str, Ints] = field(default_factory=dict)
    points: Mapping[str, Floats] = field(default_factory=dict)


def anticlockwise(nodes: Floats, cells: NDArray[np.integer], kind: str) -> Ints:
    """Cells (n, m) with clockwise ones turned round.

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
    """(n, 2) every edge of every cell, running with its cell on the left."""
    parts = [np.stack([c, np.roll(c, -1, axis=1)], axis=2).reshape(-1, 2) for c in (quads, triangles)]
    return np.concatenate(parts).astype(np.int64)
