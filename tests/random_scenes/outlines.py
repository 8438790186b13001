"""Plain geometry of bodies: outlines, which points lie inside and how deep, and what crosses what on its way."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


def outline_of(interface: Interface, body: str) -> Ints:
    """(m, 2) node numbers of the edges that belong to one cell of a body only, the body on their left."""
    number = interface.bodies.index(body)
    edges = np.concatenate([
        np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)
        for cells in (interface.quads[interface.quad_body == number],
                      interface.triangles[interface.triangle_body == number]) if len(cells)]).astype(np.intp)
    both = {(int(a), int(b)) for a, b in edges}
    return np.array([(a, b) for a, b in edges.tolist() if (b, a) not in both], dtype=np.intp)


def inside(points: Floats, a: Floats, b: Floats) -> NDArray[np.bool_]:
    """Whether points (n, 2) lie inside the polygons of edges a to b : (m, 2), by how often a ray crosses them."""
    x, y = points[:, :1], points[:, 1:]
    over = (a[:, 1] > y) != (b[:, 1] > y)
    rise = np.where(a[:, 1] == b[:, 1], 1.0, b[:, 1] - a[:, 1])
    at = a[:, 0] + (y - a[:, 1]) * (b[:, 0] - a[:, 0]) / rise
    return np.asarray((over & (x < at)).sum(axis=1) % 2 == 1)


def nearest_edge(points: Floats, a: Floats, b: Floats) -> tuple[Floats, Ints]:
    """Distance (n,) of points (n, 2) from edges a to b : (m, 2), and the number of the nearest."""
    t = b - a
    along = ((points[:, None] - a) * t).sum(axis=2) / np.maximum((t * t).sum(axis=1), 1e-300)
    foot = a + np.clip(along, 0.0, 1.0)[..., None] * t
    distance = np.linalg.norm(points[:, None] - foot, axis=2)
    e = distance.argmin(axis=1)
    return distance[np.arange(len(points)), e], e


def depth(points: Floats, a: Floats, b: Floats) -> Floats:
    """How deep (n,) points (n, 2) lie inside the polygons of edges a to b : (m, 2); below 0: so far outside."""
    distance, _ = nearest_edge(points, a, b)
    return np.where(inside(points, a, b), distance, -distance)


@dataclass(frozen=True)
class Crossing:
    """A point that was deep inside a body on its way, and at neither end of it.

    point : its number.  depth : half way between going in and out.
    """

    point: int
    depth: float


def jumped(points: tuple[Floats, Floats], a: tuple[Floats, Floats], b: tuple[Floats, Floats]) -> list[Crossing]:
    """Points (n, 2), before and after, that went through the polygons of edges a to b : (m, 2), before and after.

    All move along straight lines at constant speed.
    """
    r0, r1 = (p[:, None] - q for p, q in zip(points, a, strict=True))
    e0, e1 = (q - p for p, q in zip(a, b, strict=True))
    dr, de = r1 - r0, e1 - e0

    def cross(u: Floats, v: Floats) -> Floats:
        return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])

    c0, c1, c2 = cross(r0, e0), cross(r0, de) + cross(dr, e0), cross(dr, de)
    inner = c1 * c1 - 4.0 * c2 * c0
    q = -0.5 * (c1 + np.where(c1 >= 0.0, 1.0, -1.0) * np.sqrt(np.maximum(inner, 0.0)))
    found: list[list[float]] = [[] for _ in range(len(points[0]))]
    with np.errstate(divide="ignore", invalid="ignore"):
        for s in (c0 / q, q / c2):
            at, along = r0 + s[..., None] * dr, e0 + s[..., None] * de
            u = (at * along).sum(axis=2) / (along * along).sum(axis=2)
            hit = (inner >= 0.0) & (s > 0.0) & (s < 1.0) & (u >= -1e-9) & (u <= 1.0 + 1e-9)
            for i, k in zip(*np.nonzero(hit), strict=True):
                found[i].append(float(s[i, k]))
    crossings = []
    for i, times in enumerate(found):
        times.sort()
        for first, last in pairwise(times):
            s = 0.5 * (first + last)
            now, from_, to = ((1.0 - s) * v[0] + s * v[1] for v in (points, a, b))
            deep = float(depth(now[i:i + 1], from_, to)[0])
            if deep > 0.0:
                crossings.append(Crossing(i, deep))
    return crossings
