"""Columns: the nodes of a rectangle that share one x, for halves that know one dimension only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.half.interface import Floats, Interface
from contact.half.outlines import Indices

SAME = 1e-9  # of a body's length: nodes nearer to each other in x stand in one column


@dataclass(frozen=True)
class Columns:
    """The columns of every body, numbered body by body, from left to right.

    of_node : (n_nodes,) column of each node.  first : (n_bodies + 1,) first column of each body, and the end.
    bottom, top : (n_columns,) lowest and highest node.  size : (n_columns,) number of nodes.
    of_cell : (n_cells,) the left one of the two columns each cell stands between, quads before triangles.
    """

    of_node: Indices
    first: Indices
    bottom: Indices
    top: Indices
    size: Indices
    of_cell: Indices

    @property
    def count(self) -> int:
        """Number of columns."""
        return self.size.size

    def of_body(self, body: int) -> Indices:
        """Return the numbers (n,) of the columns of a body, from left to right."""
        return np.arange(self.first[body], self.first[body + 1])

    def mean(self, values: Floats) -> Floats:
        """Return the means over the nodes of each column, (n_columns,), in the unit of the values.

        values : (n_nodes,), in any unit.
        """
        return np.asarray(np.bincount(self.of_node, weights=values, minlength=self.count) / self.size)

    def heights(self, x: Floats) -> Floats:
        """Return the heights (n_columns,) [m] of columns whose nodes are at x : (n_nodes, 2) [m]."""
        return np.asarray(x[self.top, 1] - x[self.bottom, 1])


def columns_of(interface: Interface) -> Columns:
    """The columns of an interface.

    Raises ValueError where a body is no rod along x: a cell that does not stand between two columns beside each other.
    """
    of_node, first = np.full(len(interface.nodes), -1, dtype=np.intp), [0]
    for body in range(len(interface.bodies)):
        own = np.flatnonzero(interface.node_body == body)
        order = own[np.argsort(interface.nodes[own, 0], kind="stable")]
        x = interface.nodes[order, 0]
        of_node[order] = first[-1] + np.concatenate([[0], np.cumsum(np.diff(x) > SAME * (x[-1] - x[0]))])
        first.append(int(of_node[order[-1]]) + 1)
    if (of_node < 0).any():
        raise ValueError(f"node {int(np.argmin(of_node)) + 1} of the mesh belongs to no cell")
    of_cell = _between(interface, of_node)
    by_height = np.lexsort((interface.nodes[:, 1], of_node))
    size = np.bincount(of_node)
    end = np.cumsum(size)
    return Columns(of_node, np.array(first), by_height[end - size], by_height[end - 1], size, of_cell)


def _between(interface: Interface, of_node: Indices) -> Indices:
    left = []
    for cells, body in ((interface.quads, interface.quad_body), (interface.triangles, interface.triangle_body)):
        columns = of_node[cells]
        low = columns.min(axis=1, initial=of_node.size)
        wrong = columns.max(axis=1, initial=0) != low + 1
        if wrong.any():
            raise ValueError(f"body {interface.bodies[body[np.argmax(wrong)]]!r} is no rod along x: its cells must "
                             "stand in columns, as those of a rectangle do")
        left.append(low)
    return np.concatenate(left)
