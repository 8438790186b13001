"""From the nodes of one mesh of a body to the nodes of another: which weights, and what lies outside."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contact.half.outlines import outline

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]

SLACK = 1e-9  # of a cell: points on edges, and round-off, are still inside
NEWTON_STEPS = 20
AT_ONCE = 2_000_000  # pairs of a point and an edge looked at in one go


@dataclass(frozen=True)
class BodyNodes:
    """The mesh of one body.  nodes : (n, 2) [m].  quads : (n_q, 4), triangles : (n_t, 3) node numbers."""

    nodes: Floats
    quads: Ints
    triangles: Ints

    def same_as(self, other: BodyNodes) -> bool:
        """Whether both meshes are one, to the bit."""
        return all(np.array_equal(getattr(self, n), getattr(other, n)) for n in ("nodes", "quads", "triangles"))


@dataclass(frozen=True)
class Transfer:
    """Values of a mesh at points: sum_k weights[:, k] values[nodes[:, k]].

    nodes, weights : (m, 4).  outside : (m,) [m] how far each point lies off the mesh, 0 inside; such a point takes the
    value of the nearest point of its edge.
    """

    nodes: Ints
    weights: Floats
    outside: Floats

    def of(self, values: Floats) -> Floats:
        """Return the values (m,) or (m, k) at the points, of values : (n,) or (n, k) at the nodes of the mesh."""
        return np.asarray(np.einsum("mk,mk...->m...", self.weights, values[self.nodes]))


def transfer(mesh: BodyNodes, points: Floats) -> Transfer:
    """Find points : (m, 2) [m] in the reference shape of a mesh."""
    nodes = np.zeros((len(points), 4), dtype=np.intp)
    weights, depth = np.zeros((len(points), 4)), np.full(len(points), -np.inf)
    tree = cKDTree(points)
    for cells in (mesh.quads, mesh.triangles):
        if not len(cells):
            continue
        x = mesh.nodes[cells]
        middle = x.mean(axis=1)
        reach = np.linalg.norm(x - middle[:, None], axis=2).max(axis=1) * (1.0 + SLACK)
        found = tree.query_ball_point(middle, reach)
        cell = np.repeat(np.arange(len(cells)), [len(f) for f in found])
        point = np.array([p for f in found for p in f], dtype=np.intp)
        if not point.size:
            continue
        N = shapes_at(x[cell], points[point])
        inner = N.min(axis=1)
        # The best of a point's cells: the deepest inside, which comes last.
        order = np.lexsort((inner, point))
        last = order[np.append(np.flatnonzero(np.diff(point[order])), len(order) - 1)]
        better = last[inner[last] > depth[point[last]]]
        at = point[better]
        depth[at] = inner[better]
        nodes[at], weights[at] = 0, 0.0
        nodes[at, :x.shape[1]], weights[at, :x.shape[1]] = cells[cell[better]], N[better]
    outside = np.zeros(len(points))
    off = np.flatnonzero(~(depth >= -SLACK))
    if off.size:
        edges = outline(mesh.quads, mesh.triangles)
        for part in np.array_split(off, max(1, off.size * len(edges) // AT_ONCE)):
            nodes[part], weights[part], outside[part] = _nearest(mesh.nodes, edges, points[part])
    weights = np.clip(weights, 0.0, None)
    return Transfer(nodes, weights / weights.sum(axis=1, keepdims=True), outside)


def shapes_at(x: Floats, at: Floats) -> Floats:
    """Compute the shape functions (p, 3) or (p, 4) of cells x : (p, 3, 2) or (p, 4, 2) [m] at points at : (p, 2) [m].

    Outside its cell a point has some below 0.
    """
    return _in_quads(x, at) if x.shape[1] == 4 else _in_triangles(x, at)


def _in_triangles(x: Floats, at: Floats) -> Floats:
    """(p, 3) barycentric coordinates of points in their triangles x : (p, 3, 2)."""
    one, two, to = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0], at - x[:, 0]
    det = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    b = (to[:, 0] * two[:, 1] - to[:, 1] * two[:, 0]) / det
    c = (one[:, 0] * to[:, 1] - one[:, 1] * to[:, 0]) / det
    return np.stack([1.0 - b - c, b, c], axis=1)


def _in_quads(x: Floats, at: Floats) -> Floats:
    """(p, 4) bilinear shape functions of points in their quads x : (p, 4, 2), by Newton; outside: some below 0."""
    a, b = np.full(len(at), 0.5), np.full(len(at), 0.5)
    for _ in range(NEWTON_STEPS):
        N = _bilinear(a, b)
        miss = at - np.einsum("pk,pki->pi", N, x)
        along = np.stack([b - 1, 1 - b, b, -b], axis=1)
        across = np.stack([a - 1, -a, a, 1 - a], axis=1)
        p, q = np.einsum("pk,pki->pi", along, x), np.einsum("pk,pki->pi", across, x)
        det = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
        det = np.where(np.abs(det) < 1e-300, 1e-300, det)
        a = np.clip(a + (miss[:, 0] * q[:, 1] - miss[:, 1] * q[:, 0]) / det, -1.0, 2.0)
        b = np.clip(b + (p[:, 0] * miss[:, 1] - p[:, 1] * miss[:, 0]) / det, -1.0, 2.0)
    N = _bilinear(a, b)
    miss = np.abs(at - np.einsum("pk,pki->pi", N, x)).max(axis=1)
    N[miss > SLACK * np.ptp(x, axis=1).max(axis=1)] = -1.0  # not reached: it lies elsewhere
    return N


def _bilinear(a: Floats, b: Floats) -> Floats:
    return np.stack([(1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b], axis=1)


def _nearest(nodes: Floats, edges: Ints, points: Floats) -> tuple[Ints, Floats, Floats]:
    """Nodes and weights (m, 4) of the nearest point of an edge, and how far it is (m,) [m]."""
    a, b = nodes[edges[:, 0]], nodes[edges[:, 1]]
    along = b - a
    share = np.einsum("mei,ei->me", points[:, None] - a, along) / (along**2).sum(axis=1)
    share = np.clip(share, 0.0, 1.0)
    far = np.linalg.norm(points[:, None] - a - share[..., None] * along, axis=2)
    nearest = far.argmin(axis=1)
    rows = np.arange(len(points))
    w = share[rows, nearest]
    out = np.zeros((len(points), 4), dtype=np.intp)
    out[:, :2] = edges[nearest]
    return out, np.stack([1.0 - w, w, 0.0 * w, 0.0 * w], axis=1), far[rows, nearest]


@dataclass(frozen=True)
class Moved:
    """Values on another mesh, and what that did to them.

    values : (m,) or (m, k).  same : nothing was interpolated.  worst, rms : of the difference at the nodes they came
    from, once interpolated back, in their unit.  outside : how many points lay off the mesh, farthest : by how much
    [m].
    """

    values: Floats
    same: bool
    worst: float = 0.0
    rms: float = 0.0
    outside: int = 0
    farthest: float = 0.0


def moved(values: Floats, source: BodyNodes, target: BodyNodes) -> Moved:
    """Take nodal values : (n,) or (n, k) from one mesh of a body to another.

    The error told is that of going there and back: what the other mesh cannot hold, and what interpolation smears.
    Raises ValueError where no node of the target lies in the source.
    """
    if source.same_as(target):
        return Moved(values, same=True)
    there = transfer(source, target.nodes)
    size = float(np.ptp(source.nodes, axis=0).max())
    off = there.outside > SLACK * size
    if off.all():
        raise ValueError("no node of it lies in the body of that run")
    new = there.of(values)
    back = transfer(target, source.nodes)
    inside = back.outside <= SLACK * size
    lost = (back.of(new) - values)[inside]
    lost = np.abs(lost) if lost.ndim == 1 else np.linalg.norm(lost, axis=1)
    worst, rms = (float(lost.max()), float(np.sqrt((lost**2).mean()))) if lost.size else (0.0, 0.0)
    return Moved(new, False, worst, rms, int(off.sum()), float(there.outside.max()))


def frames_around(times: Floats, t: float) -> Iterator[tuple[int, float]]:
    """Frames and their shares [1] that make up a time [s] on a straight line; one alone where it is that one's."""
    k = int(np.searchsorted(times, t))
    for near in (k - 1, k):
        if 0 <= near < len(times) and abs(times[near] - t) <= SLACK * max(abs(t), 1e-300):
            yield near, 1.0
            return
    share = (t - times[k - 1]) / (times[k] - times[k - 1])
    yield k - 1, 1.0 - share
    yield k, share
