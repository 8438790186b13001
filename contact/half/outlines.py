"""Outlines of bodies: their edges, what lies inside and crosses them, how thick they are behind a surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface, Pair

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Indices = NDArray[np.intp]
Flags = NDArray[np.bool_]

OWN_EDGE = 1e-9  # of its length


def outline(*cells: NDArray[np.integer]) -> Indices:
    """Return the edges (m, 2) that belong to one cell only, the body on the left hand.

    cells : (n, 3) or (n, 4) nodes of the cells of one body, each.
    """
    edges = np.vstack([np.empty((0, 2), np.int32), *(np.column_stack([c.ravel(), np.roll(c, -1, axis=1).ravel()])
                                                     for c in cells)])
    edges = edges.astype(np.intp)
    # One number an edge, whichever way a cell goes along it.  Sorted, those of one cell have no equal beside them.
    low, high = np.minimum(*edges.T), np.maximum(*edges.T)
    number = low * (high.max(initial=0) + 1) + high
    ascending = np.sort(number)
    starts = np.flatnonzero(np.diff(ascending, prepend=-1))
    once = ascending[starts[np.diff(starts, append=len(ascending)) == 1]]
    # fault: a body's outline has the edges between its cells too -> return edges | contact/test_outlines
    return np.asarray(edges[np.searchsorted(once, number, side="right") > np.searchsorted(once, number)])


def thickness(x: Floats, surface: Ints, edges: Indices) -> float:
    """Return how thick [m] a body is at least behind a surface (k, 2), straight in from the middle of its edges.

    x : (n_nodes, 2) [m].  edges : (m, 2) the body's outline.
    """
    t = x[surface[:, 1]] - x[surface[:, 0]]
    start = 0.5 * (x[surface[:, 0]] + x[surface[:, 1]])[:, None]
    inward = np.column_stack([-t[:, 1], t[:, 0]])[:, None] / np.linalg.norm(t, axis=1)[:, None, None]
    a, along = x[edges[:, 0]], x[edges[:, 1]] - x[edges[:, 0]]
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = cross(inward, along)
        way, at = cross(a - start, along) / sine, cross(a - start, inward) / sine
    # Its own edge it leaves at once.
    met = (at >= 0.0) & (at <= 1.0) & (way > OWN_EDGE * np.linalg.norm(t, axis=1)[:, None])
    return float(way[met].min(initial=np.inf))


def mean_thickness(x: Floats, edges: Indices) -> float:
    """Return twice the area over the perimeter [m] of outline edges (m, 2); x : (n_nodes, 2) [m]."""
    a, b = x[edges[:, 0]], x[edges[:, 1]]
    return float(cross(a, b).sum() / np.linalg.norm(b - a, axis=1).sum())


def inside(points: Floats, a: Floats, b: Floats) -> Flags:
    """Say of points (n, 2) whether (n,) they lie inside edges a to b : (m, 2) [m]: a ray along x crosses an odd number.
    """
    x, y = points[:, :1], points[:, 1:]
    over = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
    at = a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / rise
    return np.asarray((over & (x < at)).sum(axis=1) % 2 == 1)


def depths(points: Floats, a: Floats, b: Floats) -> Floats:
    """Return how deep (n,) [m] points (n, 2) lie inside edges a to b : (m, 2) [m]; 0 outside."""
    found, within = np.zeros(len(points)), ((points > a.min(axis=0)) & (points < a.max(axis=0))).all(axis=1)
    within[within] = inside(points[within], a, b)
    p, d = points[within][:, None], b - a
    s = np.clip(((p - a) * d).sum(axis=2) / (d * d).sum(axis=1), 0.0, 1.0)
    found[within] = np.linalg.norm(p - a - s[..., None] * d, axis=2).min(axis=1, initial=np.inf)
    return found


def crossings(points: tuple[Floats, Floats], a: tuple[Floats, Floats],
              b: tuple[Floats, Floats]) -> tuple[Indices, Floats]:
    """Find when points (n, 2) cross edges a to b : (m, 2) [m], each before and after, along straight ways.

    Returns (k,) points, ascending, and (k,) shares [1] of the way, ascending for each.  Roots of
    (p - a) x (b - a) = 0, a quadratic, that lie between the ends of the edge.
    """
    r, e = points[0][:, None] - a[0], b[0] - a[0]
    dr, de = points[1][:, None] - a[1] - r, b[1] - a[1] - e
    c0, c1, c2 = cross(r, e), cross(r, de) + cross(dr, e), np.broadcast_to(cross(dr, de), r.shape[:2])
    inner = c1 * c1 - 4.0 * c2 * c0
    q = -0.5 * (c1 + np.where(c1 >= 0.0, 1.0, -1.0) * np.sqrt(np.maximum(inner, 0.0)))
    who, when = [], []
    with np.errstate(divide="ignore", invalid="ignore"):
        for s in (c0 / q, q / c2):
            now, along = r + s[..., None] * dr, e + s[..., None] * de
            u = (now * along).sum(axis=2) / (along * along).sum(axis=2)
            # Half open: a way through a node of the outline crosses one of its two edges.
            i, j = np.nonzero((inner >= 0.0) & (s > 0.0) & (s <= 1.0) & (u >= 0.0) & (u < 1.0))
            who.append(i)
            when.append(s[i, j])
    points_at, shares = np.concatenate(who), np.concatenate(when)
    order = np.lexsort((shares, points_at))
    return points_at[order], shares[order]


def cross(u: Floats, v: Floats) -> Floats:
    """Return u x v (...) of vectors (..., 2), in the product of their units."""
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def thickness_behind(interface: Interface, pair: Pair) -> float:
    """Return how thick [m] the thinner body of a pair is behind its surface; 0 where both are of one body, or none."""
    first, second = (int(interface.node_body[interface.surfaces[side].flat[0]]) for side in (pair.slave, pair.master))
    if first == second or min(first, second) < 0:
        return 0.0
    thick = [thickness(interface.nodes, interface.surfaces[side], outline_of(interface, body))
             for side, body in ((pair.slave, first), (pair.master, second))]
    return min(thick) if np.isfinite(thick).all() else 0.0


def cell_sizes(interface: Interface, edges: Ints) -> Floats:
    """Return the size [m] of the cell behind each edge (n, 2): its depth (area over edge; a triangle's height) or the
    edge, whichever is more.
    """
    x, n = interface.nodes, len(interface.nodes)
    of_cell: list[tuple[Ints, Floats]] = []
    for cells, share in ((interface.quads, 1.0), (interface.triangles, 2.0)):
        ends = np.stack([cells, np.roll(cells, -1, axis=1)], axis=-1)
        area = 0.5 * np.abs(cross(x[ends[..., 0]], x[ends[..., 1]]).sum(axis=1))
        of_cell.append((ends.reshape(-1, 2), np.repeat(share * area, cells.shape[1])))
    ends = np.concatenate([e for e, _ in of_cell]).astype(np.int64)
    keys, areas = ends @ (n, 1), np.concatenate([a for _, a in of_cell])
    order = np.argsort(keys)
    own = order[np.searchsorted(keys, edges.astype(np.int64) @ (n, 1), sorter=order)]
    length = np.linalg.norm(x[edges[:, 1]] - x[edges[:, 0]], axis=1)
    return np.asarray(np.maximum(areas[own] / length, length))


def outline_of(interface: Interface, body: int) -> Indices:
    """Return the edges (m, 2) on the outside of a body, the body on the left hand."""
    kinds = ((interface.quads, interface.quad_body), (interface.triangles, interface.triangle_body))
    return outline(*(cells[of == body] for cells, of in kinds))
