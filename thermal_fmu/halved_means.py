"""What nodes of a half have in place of a field that halved cells have: the means of its cells are the same.

Bodies expand by the mean temperature of their cells.  At its nodes a coarse mesh may be right and its means wrong all
the same, as with heat that is made evenly: the field of halved cells bends in between.  So c at nodes of halved cells
becomes that e at those of the half which makes

    sum_cells V (mean of e - mean of c)^2 + SLIGHT int (e - c)^2 dV

least: there are more nodes than quads, and of all e with the same means the one next to c is taken, which has the
slopes of c where a single row of cells bends.  Triangles are more than nodes; then their means are met on the whole,
and that of a body is met in full, as it is by the first term.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from contact.half.linalg import factorise
from thermal_fmu.cells import CellMesh, shapes_of
from thermal_fmu.halved import Halved

Floats = NDArray[np.float64]

SLIGHT = 1e-3


class Means:
    """Takes fields at nodes of halved cells to those of the half.  It remembers what follows from the mesh alone."""

    def __init__(self, volume: CellMesh, of: Halved) -> None:
        """volume : of the halved cells.  Raises SingularMatrixError."""
        n, n_cells = volume.n, len(of.parent) // 4
        mass, means = csr_matrix((n, n)), csr_matrix((n_cells, n))
        for block, shape in zip(volume.blocks, shapes_of(volume, of.interface.nodes), strict=True):
            N, cells = block.table.N, block.cells
            each = np.einsum("eq,qi,qj->eij", shape.dV, N, N)
            rows, columns = np.repeat(cells, N.shape[1], axis=1), np.tile(cells, N.shape[1])
            mass = mass + csr_matrix((each.ravel(), (rows.ravel(), columns.ravel())), shape=(n, n))
            parents = np.repeat(of.parent[block.numbers], N.shape[1])
            means = means + csr_matrix(((shape.dV @ N).ravel(), (parents, cells.ravel())), shape=(n_cells, n))
        V = np.asarray(means.sum(axis=1)).ravel()
        # Sums over a cell, of which V times a mean is one.
        own = csr_matrix(means @ of.P)
        by_V = diags_array(np.divide(1.0, V, out=np.zeros(V.size), where=V > 0.0))
        # fault: means of cells are those of what lies about them too -> self._to: csr_matrix = csr_matrix(of.P.T @
        #   mass) | thermal_fmu/test_halved_means
        self._to: csr_matrix = csr_matrix(own.T @ by_V @ means + SLIGHT * (of.P.T @ mass))
        matrix = csr_matrix(self._to @ of.P)
        # A node that no cell of the half has stays as it is.
        none = matrix.diagonal() == 0.0
        self._solve = factorise(csr_matrix(matrix + diags_array(none.astype(np.float64))), symmetric=True)

    def at_nodes(self, c: Floats) -> Floats:
        """Return (n,) e of c : (n_halved,), in its unit; 0 at nodes without cells."""
        return np.asarray(self._solve(self._to @ c))
