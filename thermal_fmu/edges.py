"""What couples the two nodes of each edge of cells: conduction, as a matrix of its secant, and conduction added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.linalg import Pattern
from thermal_fmu.cells import MatrixEntries
from thermal_fmu.surface_terms import at_nodes

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


@dataclass(frozen=True)
class AddedConduction:
    """Conduction between the two nodes of edges, beside that of the cells: Kuzmin's discrete upwinding (monotone.py).

    nodes : (m, 2).  strength : (m,) >= 0 [W/K].  slots : (m, 2, 2) places in the matrix data.
    """

    nodes: Ints
    strength: Floats
    slots: NDArray[np.int64]

    def conduct(self, T: Floats, dT: Floats | None, f: Floats, into: MatrixEntries) -> None:
        """Add it: f : (n,) -= the heat that leaves each node [W];  entries += slope * its derivative by s.

        T : (n,) [K].  dT : (n,) its derivative by s [1]; None: 1.  As much enters one node as leaves the other.
        """
        flow = self.strength * (T[self.nodes[:, 0]] - T[self.nodes[:, 1]])
        f -= at_nodes(self.nodes, np.stack([flow, -flow], axis=1), f.size)
        if into.data.size:
            values = into.slope * self.strength[:, None, None] * np.array([[1.0, -1.0], [-1.0, 1.0]])
            if dT is not None:
                values = values * dT[self.nodes][:, None, :]
            np.add.at(into.data, self.slots.ravel(), values.ravel())


@dataclass(frozen=True)
class Couplings:
    """Numbers of the pairs of nodes that cells couple: places in the matrix data.

    row, column : (nnz,) the nodes of each.  keys : (nnz,) ascending.
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    keys: NDArray[np.int64]
    n: int

    @staticmethod
    def of(pattern: Pattern) -> Couplings:
        """Number those of a pattern."""
        row = np.repeat(np.arange(pattern.n, dtype=np.int64), np.diff(pattern.indptr))
        column = pattern.indices.astype(np.int64)
        return Couplings(row, column, row * pattern.n + column, pattern.n)

    def slots(self, nodes: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return (m, 2, 2) the places of the block of each edge, nodes : (m, 2) of it."""
        pair = nodes.astype(np.int64)
        return np.searchsorted(self.keys, pair[:, :, None] * self.n + pair[:, None, :])

    def between(self, edges: NDArray[np.integer], values: Floats) -> Floats:
        """Return (nnz,) the sums of values : (m,) that couple the two nodes of edges : (m, 2), in both directions."""
        slots = self.slots(edges)
        both = np.concatenate([slots[:, 0, 1], slots[:, 1, 0]])
        return np.asarray(np.bincount(both, np.tile(values, 2), self.keys.size), dtype=np.float64)
