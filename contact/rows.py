"""Blocks of pieces added up into rows of nodes: a third of the bytes, and ready to be put into a matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel
from contact.wire import Floats, Ints


@kernel
def rows_of(n: int, nodes: Ints, blocks: Floats) -> tuple[Ints, Ints, Floats]:
    """starts : (n + 1,), columns : (n_b,) ascending in each row, and values : (n_b, 2, 2), the sum of all blocks.

    nodes : (n_pieces, m), the same node perhaps twice.  blocks : (n_pieces, 2 m, 2 m).
    """
    n_pieces, m = nodes.shape
    room = np.zeros(n + 1, dtype=np.int64)
    for p in range(n_pieces):
        for i in range(m):
            room[nodes[p, i] + 1] += m
    for s in range(n):
        room[s + 1] += room[s]
    columns, filled = np.empty(room[n], dtype=np.int32), np.zeros(n, dtype=np.int64)
    for p in range(n_pieces):
        for i in range(m):
            s = nodes[p, i]
            for j in range(m):
                _insert(columns[room[s]:room[s + 1]], filled, s, nodes[p, j])
    starts = np.zeros(n + 1, dtype=np.int32)
    for s in range(n):
        starts[s + 1] = starts[s] + filled[s]
    packed, values = np.empty(starts[n], dtype=np.int32), np.zeros((starts[n], 2, 2))
    for s in range(n):
        packed[starts[s]:starts[s + 1]] = columns[room[s]:room[s] + filled[s]]
    for p in range(n_pieces):
        for i in range(m):
            row = packed[starts[nodes[p, i]]:starts[nodes[p, i] + 1]]
            for j in range(m):
                at = starts[nodes[p, i]] + np.searchsorted(row, nodes[p, j])
                for d in range(2):
                    for e in range(2):
                        values[at, d, e] += blocks[p, 2 * i + d, 2 * j + e]
    return starts, packed, values


@kernel
def added_up(n: int, nodes: Ints, values: Floats) -> Floats:
    """(n, 2) sums of values : (n_pieces, m, 2) at nodes : (n_pieces, m)."""
    total = np.zeros((n, 2))
    for p in range(nodes.shape[0]):
        for i in range(nodes.shape[1]):
            for d in range(2):
                total[nodes[p, i], d] += values[p, i, d]
    return total


@kernel
def _insert(row: Ints, filled: NDArray[np.int64], s: int, column: int) -> None:
    """Put a column into its place in a sorted row, unless it is there; rows have a dozen columns."""
    k = filled[s]
    while k > 0 and row[k - 1] > column:
        k -= 1
    if k > 0 and row[k - 1] == column:
        return
    for i in range(filled[s], k, -1):
        row[i] = row[i - 1]
    row[k] = column
    filled[s] += 1
