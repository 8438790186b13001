"""Stations: nodes that share one temperature, the columns of rods or whole lumped bodies, and their band matrix."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgbsv
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

from contact.half.columns import Columns, columns_of
from contact.half.interface import Interface
from contact.half.sparse import SingularMatrixError
from thermal_fmu.nodal import at_nodes

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True)
class Stations:
    """of_node : (n_nodes,) station of each node.  body : (n,) body of each station.

    own : the stations of each body, from left to right; where there is heat conduction inside, neighbours in it are
    joined.  width : how far apart the numbers of two stations that exchange heat may be.  columns : of rods, with
    order : (n,) the column of each station; None: bodies are lumped.
    """

    of_node: Ints
    body: Ints
    own: tuple[Ints, ...]
    width: int
    columns: Columns | None = None
    order: Ints | None = None

    @property
    def n(self) -> int:
        """Number of stations."""
        return self.body.size

    def slots(self, rows: NDArray[np.integer], columns: NDArray[np.integer]) -> Ints:
        """Places of entries (row, column) in the band (3 width + 1, n), flat."""
        return np.asarray((2 * self.width + rows - columns) * self.n + columns, dtype=np.intp)

    def solve(self, band: Floats, b: Floats) -> Floats:
        """(n,) x with A x = b : (n,), A by its band : (3 width + 1, n).  Raises SingularMatrixError."""
        _, _, x, info = dgbsv(self.width, self.width, band, b)
        if info != 0:
            raise SingularMatrixError(f"the matrix of {self.n} temperatures is singular (row {info})")
        return np.asarray(x)

    def gather(self, values: Floats) -> Floats:
        """(n,) sums over the nodes of each station of values : (n_nodes,)."""
        return at_nodes(self.of_node, values, self.n)

    @cached_property
    def column_of_slot(self) -> Ints:
        """((3 width + 1) n,) the column of each place of the band."""
        return np.tile(np.arange(self.n), 3 * self.width + 1)


def lumped_stations(interface: Interface) -> Stations:
    """One station a body.  Raises ValueError for a node that belongs to no body."""
    if (interface.node_body < 0).any():
        raise ValueError(f"node {int(np.argmin(interface.node_body)) + 1} of the mesh belongs to no cell")
    n = len(interface.bodies)
    node_body = interface.node_body.astype(np.intp)
    found = Stations(node_body, np.arange(n), tuple(np.array([b]) for b in range(n)), 0)
    return _ordered(found, interface, np.arange(n), None)


def rod_stations(interface: Interface) -> Stations:
    """One station a column.  Raises ValueError where a body is no rod along x."""
    columns = columns_of(interface)
    own = tuple(columns.of_body(b) for b in range(len(interface.bodies)))
    body = np.repeat(np.arange(len(own)), [len(c) for c in own])
    return _ordered(Stations(columns.of_node, body, own, 0), interface, np.arange(columns.count), columns)


def _ordered(found: Stations, interface: Interface, number: Ints, columns: Columns | None) -> Stations:
    """Renumbered so that stations that exchange heat come close to each other: rods in a row are tridiagonal."""
    pairs = [np.stack([c[:-1], c[1:]], axis=1) for c in found.own]
    for pair in interface.pairs:
        slave, master = (np.unique(found.of_node[interface.surfaces[s]]) for s in (pair.slave, pair.master))
        pairs.append(np.stack([a.ravel() for a in np.meshgrid(slave, master)], axis=1))
    joined = np.concatenate(pairs)
    n = found.n
    both = np.concatenate([joined, joined[:, ::-1]])
    graph = coo_matrix((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(n, n)).tocsr()
    order = reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.intp)
    new = np.empty(n, dtype=np.intp)
    new[order] = number
    width = int(np.abs(new[joined[:, 0]] - new[joined[:, 1]]).max(initial=0))
    return Stations(new[found.of_node], found.body[order], tuple(new[c] for c in found.own), width, columns, order)
