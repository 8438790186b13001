"""What nodes of a half have in place of a field that halved cells have: its means are the same.

Bodies expand by the mean temperature of their cells.  At its nodes a coarse mesh may be right and its means wrong all
the same, as with heat that is made evenly: the field of halved cells bends in between.  So c at nodes of halved cells
becomes e at those of the half, sum_j (int N_i N_j dV) e_j = int N_i c dV: of all fields with straight lines in the
half's cells the one next to c.  The integral of c times any such field is kept: what c adds to the length of a bar,
to its bend, and to the mean of a body.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from contact.half.linalg import factorise
from thermal_fmu.cells import CellMesh, shapes_of

Floats = NDArray[np.float64]


class Means:
    """Takes fields at nodes of halved cells to those of the half.  It remembers what follows from the mesh alone."""

    def __init__(self, volume: CellMesh, X: Floats, P: csr_matrix) -> None:
        """volume : of the halved cells.  X : (n_halved, 2) [m] as drawn.  P : as of Halved.

        Raises SingularMatrixError.
        """
        rows, columns, entries = [], [], []
        for block, shape in zip(volume.blocks, shapes_of(volume, X), strict=True):
            N = block.table.N
            entries.append(np.einsum("eq,qi,qj->eij", shape.dV, N, N).ravel())
            rows.append(np.repeat(block.cells, N.shape[1], axis=1).ravel())
            columns.append(np.tile(block.cells, N.shape[1]).ravel())
        fine = csr_matrix((np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))),
                          shape=(volume.n, volume.n))
        self._to: csr_matrix = csr_matrix(P.T @ fine)
        own = csr_matrix(self._to @ P)
        # A node that no cell of the half has stays as it is.
        self._none = own.diagonal() == 0.0
        self._solve = factorise(csr_matrix(own + diags_array(self._none.astype(np.float64))), symmetric=True)

    def at_nodes(self, c: Floats) -> Floats:
        """Return (n,) e of c : (n_halved,), in its unit; 0 at nodes without cells."""
        return np.asarray(self._solve(self._to @ c))
