"""The mesh of a run as it was before anything moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.integer]


@dataclass(frozen=True, eq=False)
class RunMesh:
    """nodes : (n, 2) [m].  quads : (n_q, 4), triangles : (n_tri, 3) node numbers; cells of fields are quads first.

    quad_body : (n_q,), triangle_body : (n_tri,) numbers of `bodies`.
    """

    nodes: Array
    quads: Ints
    triangles: Ints
    quad_body: Ints
    triangle_body: Ints
    bodies: tuple[str, ...]

    @property
    def cell_body(self) -> Ints:
        """The body of each cell (n_cells,), quads first."""
        return np.concatenate([self.quad_body, self.triangle_body])

    @property
    def node_body(self) -> Ints:
        """The body of each node (n,)."""
        found = np.zeros(len(self.nodes), dtype=np.int64)
        found[self.quads] = self.quad_body[:, None]
        found[self.triangles] = self.triangle_body[:, None]
        return found

    def outline(self) -> Ints:
        """Return the edges (n_edges, 2) that belong to one cell only, as ascending node numbers."""
        edges = np.concatenate([cells[:, [i, (i + 1) % cells.shape[1]]]
                                for cells in (self.quads, self.triangles) for i in range(cells.shape[1])])
        unique, count = np.unique(np.sort(edges, axis=1), axis=0, return_counts=True)
        return np.asarray(unique[count == 1])
