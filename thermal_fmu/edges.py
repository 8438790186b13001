"""Points on the edges of surfaces, on the current geometry: where boundary terms are integrated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.half.sparse import Pattern

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# 2-point Gauss on [0, 1]: exact for N_i N_j r along an edge.
EDGE_XI: Floats = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
EDGE_WEIGHT = 0.5


@dataclass(frozen=True)
class EdgePoints:
    """edge : (n,) row of the surface's edges.  N : (n, 2) shape functions of its two nodes.

    area : (n,) [m2], per metre of depth when plane; may be negative where a share of an edge is taken off.
    """

    edge: NDArray[np.intp]
    N: Floats
    area: Floats


def shape_functions(xi: Floats) -> Floats:
    """(n, 2) values at xi : (n,) in [0, 1] of the shape functions of an edge's first and second node."""
    return np.stack([1.0 - xi, xi], axis=1)


def gauss_points(edges: Ints, x: Floats, axisymmetric: bool) -> EdgePoints:
    """Two points on every edge : (n, 2) nodes, at coordinates x : (n_nodes, 2) [m]; 2 pi r if axisymmetric."""
    a, b = x[edges[:, 0]], x[edges[:, 1]]
    length = np.repeat(np.hypot(b[:, 0] - a[:, 0], b[:, 1] - a[:, 1]), EDGE_XI.size)
    edge = np.repeat(np.arange(len(edges)), EDGE_XI.size)
    N = shape_functions(np.tile(EDGE_XI, len(edges)))
    r = N[:, 0] * a[edge, 0] + N[:, 1] * b[edge, 0]
    # fault: 2 pi r dropped on edges -> depth = 1.0 | thermal_fmu/test_thermal_space
    depth = 2.0 * np.pi * r if axisymmetric else 1.0
    return EdgePoints(edge, N, EDGE_WEIGHT * length * depth)


def edge_slots(pattern: Pattern, edges: Ints) -> NDArray[np.int64]:
    """(n, 2, 2) places in the matrix data of the blocks of edges : (n, 2), which are edges of cells."""
    row = np.repeat(edges[:, :, None], 2, axis=2).astype(np.int64)
    col = np.repeat(edges[:, None, :], 2, axis=1).astype(np.int64)
    rows = np.repeat(np.arange(pattern.n, dtype=np.int64), np.diff(pattern.indptr))
    keys = rows * pattern.n + pattern.indices
    slots = np.searchsorted(keys, row * pattern.n + col)
    if slots.size and not (keys[np.minimum(slots, keys.size - 1)] == row * pattern.n + col).all():
        raise ValueError("a surface has an edge that belongs to no cell")
    return slots
