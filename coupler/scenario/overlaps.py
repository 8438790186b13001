"""What parts of two meshes of one body share: cells by area, nodes of a surface by the length around them.

Both are measures w_ij >= 0 of what part i of the one and part j of the other have in common.  A quantity that adds up
(an energy) goes over as sum_i E_i w_ij / sum_j w_ij: its total stays.  One per area (a pressure, a flux) goes over as
sum_i p_i w_ij / sum_i w_ij: what is uniform stays uniform, nothing leaves its bounds, and its integral stays, too.
Where the meshes match, w is diagonal and every value the same bits.  The transpose of the interpolation keeps totals
as well, but piles the energies of a coarse mesh up at single nodes of a fine one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from contact.half.outlines import cross

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]
Indices = NDArray[np.intp]

SLIVER = 1e-12  # of the smaller of two parts: what they share beyond round-off
AT_ONCE = 20_000  # pairs of cells cut in one go
PAIRS_AT_ONCE = 2_000_000  # pairs of a point and an edge looked at in one go
AXIS = 1e-12  # of the largest radius: parts on the axis have no measure, but a share all the same


@dataclass(frozen=True)
class Overlap:
    """What parts of two meshes share.

    shares : (n, m) of the parts i of the one, each row adds up to 1: what adds up goes there by its transpose, and what
    is per area comes back by it.  parts : (m, n) the same of the other.
    """

    shares: csr_array
    parts: csr_array

    @property
    def turned(self) -> Overlap:
        """The same seen from the other mesh."""
        return Overlap(self.parts, self.shares)

    def sums(self, values: Floats) -> Floats:
        """Return (m,) or (m, k) of values (n,) or (n, k) that add up: their total stays."""
        # fault: what is added up goes over as a mean -> return np.asarray(self.parts @ values) |
        #   coupler/test_mesh_maps::test_totals_stay
        return np.asarray(self.shares.T @ values)

    def means(self, values: Floats) -> Floats:
        """Return (m,) or (m, k) of values (n,) or (n, k) per area: what is uniform stays, and so does the integral."""
        # fault: what is per area is added up -> return np.asarray(self.shares.T @ values) |
        #   coupler/test_mesh_maps::test_what_is_uniform_stays_uniform
        return np.asarray(self.parts @ values)


def _overlap(rows: Ints, columns: Ints, measure: Floats, nearest_row: Ints, nearest_column: Ints) -> Overlap:
    """The overlap of measures; a part that shares nothing has its share with the nearest of the other."""
    n, m = len(nearest_column), len(nearest_row)
    w = csr_array((measure, (rows, columns)), shape=(n, m))
    return Overlap(_by_row(w, nearest_column), _by_row(csr_array(w.T), nearest_row))


def _by_row(w: csr_array, nearest: Ints) -> csr_array:
    """Rows that add up to 1."""
    total = np.asarray(w.sum(axis=1)).ravel()
    alone = np.flatnonzero(total <= 0.0)
    w = w.tocoo()
    rows = np.concatenate([w.row, alone])
    values = np.concatenate([w.data / np.where(total > 0.0, total, 1.0)[w.row], np.ones(alone.size)])
    return csr_array((values, (rows, np.concatenate([w.col, nearest[alone]]))), shape=w.shape)


# Cells by area.

def cell_overlap(one: Floats, other: Floats, axisymmetric: bool) -> Overlap:
    """Return what cells share.  one : (n, 4, 2), other : (m, 4, 2) [m] corners, convex, anticlockwise; a triangle has
    its last corner twice.  Measured by area, around an axis by volume.
    """
    rows, columns = _candidates(one, other)
    measure, size = np.zeros(len(rows)), np.minimum(_areas(one)[rows], _areas(other)[columns])
    for at in np.array_split(np.arange(len(rows)), len(rows) // AT_ONCE + 1):
        area, r = _shared_area(one[rows[at]], other[columns[at]])
        # fault: cells around an axis share areas, not volumes -> measure[at] = np.where(area > SLIVER * size[at], area,
        #   0.0) | coupler/test_mesh_maps::test_around_an_axis_parts_count_by_volume
        measure[at] = np.where(area > SLIVER * size[at], area * (np.maximum(r, 0.0) if axisymmetric else 1.0), 0.0)
    kept = measure > 0.0
    middles = [x.mean(axis=1) for x in (one, other)]
    return _overlap(rows[kept], columns[kept], measure[kept], cKDTree(middles[0]).query(middles[1])[1],
                    cKDTree(middles[1]).query(middles[0])[1])


def _candidates(one: Floats, other: Floats) -> tuple[Indices, Indices]:
    """Pairs of cells whose boxes overlap."""
    low, high = other.min(axis=1), other.max(axis=1)
    reach = 0.5 * float(np.linalg.norm(high - low, axis=1).max())
    tree = cKDTree(0.5 * (low + high))
    rows, columns = [np.empty(0, np.intp)], [np.empty(0, np.intp)]
    for part in np.array_split(np.arange(len(one)), len(one) // 1000 + 1):
        lowest, highest = one[part].min(axis=1), one[part].max(axis=1)
        near = tree.query_ball_point(0.5 * (lowest + highest),
                                     reach + 0.5 * np.linalg.norm(highest - lowest, axis=1))
        i = np.repeat(np.arange(len(part)), [len(n) for n in near])
        j = np.array([n for found in near for n in found], dtype=np.intp)
        meet = ((low[j] < highest[i]) & (lowest[i] < high[j])).all(axis=1)
        rows.append(part[i[meet]])
        columns.append(j[meet])
    return np.concatenate(rows), np.concatenate(columns)


def _shared_area(one: Floats, other: Floats) -> tuple[Floats, Floats]:
    """The area (p,) [m2] of what convex cells (p, 4, 2) [m] share, and x (p,) [m] of its centroid."""
    # About a corner of its own each: cells are small beside their coordinates.
    origin = one[:, :1]
    P, clip = one - origin, other - origin
    for a in range(4):
        start, along = clip[:, a, None], clip[:, (a + 1) % 4, None] - clip[:, a, None]
        P = _left_of(P, cross(along, P - start))
    following = np.roll(P, -1, axis=1)
    twice = cross(P, following)
    area = 0.5 * twice.sum(axis=1)
    moment = ((P[..., 0] + following[..., 0]) * twice).sum(axis=1) / 6.0
    return area, origin[:, 0, 0] + np.divide(moment, area, out=np.zeros(len(area)), where=area > 0.0)


def _left_of(P: Floats, d: Floats) -> Floats:
    """Polygons (p, k, 2) cut off where d : (p, k) of their corners is below 0."""
    ahead, d_ahead = np.roll(P, -1, axis=1), np.roll(d, -1, axis=1)
    inside = d >= 0.0
    crosses = inside != (d_ahead >= 0.0)
    share = np.divide(d, d - d_ahead, out=np.zeros_like(d), where=crosses)
    corners = np.stack([P, P + share[..., None] * (ahead - P)], axis=2).reshape(len(P), -1, 2)
    kept = np.stack([inside, crosses], axis=2).reshape(len(P), -1)
    order = np.argsort(~kept, axis=1, kind="stable")
    count = kept.sum(axis=1)
    order = order[:, :max(int(count.max(initial=0)), 1)]
    # Those with fewer corners have their first one more than once.
    order = np.where(np.arange(order.shape[1]) < count[:, None], order, order[:, :1])
    found = np.take_along_axis(corners, order[..., None], axis=1)
    return np.where(count[:, None, None] > 0, found, 0.0)


def _areas(x: Floats) -> Floats:
    x = x - x[:, :1]
    return 0.5 * np.abs(cross(x, np.roll(x, -1, axis=1)).sum(axis=1))


# Nodes of a surface by the length around them.

@dataclass(frozen=True)
class Nearest:
    """The nearest points of edges.  edge : (n,) row.  at : (n,) in [0, 1] along it.  far : (n,) [m] away."""

    edge: Indices
    at: Floats
    far: Floats


def nearest_on(edges: Floats, points: Floats) -> Nearest:
    """Find the points of edges (m, 2, 2) [m] that are nearest to points (n, 2) [m]."""
    a, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    found = []
    for part in np.array_split(points, len(points) * len(edges) // PAIRS_AT_ONCE + 1):
        share = np.clip(((part[:, None] - a) * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
        far = np.linalg.norm(part[:, None] - a - share[..., None] * along, axis=2)
        edge = far.argmin(axis=1)
        rows = np.arange(len(part))
        found.append((edge, share[rows, edge], far[rows, edge]))
    return Nearest(*(np.concatenate(column) for column in zip(*found, strict=True)))


def surface_overlap(one: Ints, X: Floats, other: Ints, Y: Floats, axisymmetric: bool) -> Overlap:
    """Return what nodes share of a surface: each has the halves of its edges.

    one : (k, 2) edges of nodes X : (n, 2) [m], other : (l, 2) of Y : (m, 2) [m]; every node is of an edge.  Measured
    along the first, around an axis by its area.
    """
    edges, others = X[one], Y[other]
    cuts = nearest_on(edges, np.concatenate([Y, others.mean(axis=1)]))
    edge = np.concatenate([np.repeat(np.arange(len(one)), 3), cuts.edge])
    at = np.concatenate([np.tile([0.0, 0.5, 1.0], len(one)), cuts.at])
    order = np.lexsort((at, edge))
    edge, at = edge[order], at[order]
    piece = np.flatnonzero((np.diff(edge) == 0) & (np.diff(at) > SLIVER))
    middle, length, edge = 0.5 * (at[piece] + at[piece + 1]), at[piece + 1] - at[piece], edge[piece]
    place = edges[edge, 0] + middle[:, None] * (edges[edge, 1] - edges[edge, 0])
    there = nearest_on(others, place)
    measure = length * np.linalg.norm(edges[edge, 1] - edges[edge, 0], axis=1)
    if axisymmetric:
        measure = measure * np.maximum(place[:, 0], AXIS * float(np.abs(X[:, 0]).max()))
    rows = np.where(middle < 0.5, one[edge, 0], one[edge, 1])
    columns = np.where(there.at < 0.5, other[there.edge, 0], other[there.edge, 1])
    return _overlap(rows, columns, measure, cKDTree(X).query(Y)[1], cKDTree(Y).query(X)[1])
