"""What goes into another body on its way: seen from the coordinates alone.

Contact looks for what faces what within a depth; this looks at all of a body's outside, and along the way of a step.
Nodes alone would not do: those of a side may run along the outline of a body that they belong to the end of, and a side
of one edge has no others.  Where neither the nodes nor the middles of edges of two sides that meet go in, no part does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.half.interface import Interface
from contact.half.outlines import Flags, Floats, Indices, cross, crossings, depths, inside, mean_thickness, outline_of

# Inside by less than this share of an edge, or of a thin body, is no passage: facing curved meshes overlap by their
# sagitta, and tips between quadrature points are not felt.
ALLOWED = 0.1
ASIDE = 1e-6  # of an edge
# A node that contact finds this share of an edge before the other surface, or behind it, is seen.
NEAR = 0.5


@dataclass(frozen=True)
class Side:
    """A side of a pair, and the outline of the body that its nodes may not enter.

    pair, surface, other : names of the pair, of the surface, of the other body.  nodes : (n,) of the surface.
    points : (p, 2) what is looked at: its nodes, each twice, then the ends of its edges, for their middles.
    ends : (p, 2) the same as places in nodes.  at : (n,) pair nodes of nodes.
    all_at : (k, 2) places in nodes, and the pair nodes there of all pairs of these bodies.
    outline : (m, 2) edges of the other body.  faced : (k, 2) those of the surface that faces this one.
    edge : mean length [m] of the surface's edges.
    limit : [m] how deep inside is no passage.  near : [m] gaps below this are seen.
    """

    pair: str
    surface: str
    other: str
    nodes: Indices
    points: Indices
    ends: Indices
    at: Indices
    all_at: Indices
    outline: Indices
    faced: Indices
    edge: float
    limit: float
    near: float

    @property
    def bodies(self) -> frozenset[str]:
        """Both bodies of the pair."""
        return frozenset((self.surface.partition(".")[0], self.other))

    def unseen(self, gap: Floats) -> Flags:
        """Say of self.points whether (p,) contact finds each neither pressed nor near; gap : (n_q,) [m], of all pairs.

        The middle of an edge is seen with either of its ends: what they tell is the mean over both of their edges.
        """
        unseen = np.ones(self.nodes.size, dtype=np.bool_)
        unseen[self.all_at[gap[self.all_at[:, 1]] < self.near, 0]] = False
        return np.asarray(unseen[self.ends].all(axis=1))

    def places(self, x: Floats) -> Floats:
        """Return where self.points are, (p, 2) [m]; x : (n_nodes, 2) [m]."""
        # fault: what goes in between nodes is not seen -> return x[self.points[:, 0]] | mechanical_fmu/test_passing
        return 0.5 * (x[self.points[:, 0]] + x[self.points[:, 1]])


def sides_of(interface: Interface) -> tuple[Side, ...]:
    """List both sides of every pair of two bodies.  A surface that folds onto its own body is left out."""
    outlines = {body: outline_of(interface, k) for k, body in enumerate(interface.bodies)}
    sides: list[Side] = []
    bodies = {pair.name: {pair.slave.partition(".")[0], pair.master.partition(".")[0]} for pair in interface.pairs}
    for pair in interface.pairs:
        for own, surface in ((pair.slave, pair.master), (pair.master, pair.slave)):
            other = surface.partition(".")[0]
            if own.partition(".")[0] == other:
                continue
            told = interface.side_of(pair.name, own)
            nodes = told.nodes.astype(np.intp)
            points = np.vstack([np.column_stack([nodes, nodes]), interface.surfaces[own]]).astype(np.intp)
            both = [(np.searchsorted(nodes, side.nodes[here]), np.arange(side.at.start, side.at.stop)[here])
                    for side in interface.pair_sides if bodies[side.pair] == bodies[pair.name]
                    if (here := np.isin(side.nodes, nodes)).any()]
            ends = interface.nodes[interface.surfaces[own]]
            edge = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
            # Sides that are told to be farther apart than they are drawn overlap in the drawing by as much.
            limit = (ALLOWED * min(edge, mean_thickness(interface.nodes, outlines[other]))
                     + max(float(interface.gap_offset[told.at].max(initial=0.0)), 0.0))
            at = np.arange(told.at.start, told.at.stop)
            # Where nothing is faced a node's gap is gap_max.
            sides.append(Side(pair.name, own, other, nodes, points, np.searchsorted(nodes, points), at,
                              np.concatenate([np.column_stack(rows) for rows in both]).astype(np.intp), outlines[other],
                              interface.surfaces[surface].astype(np.intp), edge, limit, min(NEAR * edge, pair.gap_max)))
    return tuple(sides)


@dataclass(frozen=True)
class Passage:
    """A point that was deep inside the other body on its way.  depth : [m] there.  share : [1] of the way.

    point : of side.points.  stays : whether it lies inside at the end.
    """

    side: Side
    point: int
    depth: float
    share: float
    stays: bool


def nearing(side: Side, candidates: Flags, before: Floats, after: Floats) -> Flags:
    """Say of candidates (p,) of side.points whether the box of their way meets the other body's, beyond the limit.

    before, after : (n_nodes, 2) [m].
    """
    ends = side.outline[:, 0]
    start, end = side.places(before)[candidates], side.places(after)[candidates]
    first, last = before[ends], after[ends]
    low, high = (np.minimum(first.min(axis=0), last.min(axis=0)), np.maximum(first.max(axis=0), last.max(axis=0)))
    near = candidates.copy()
    near[candidates] = ((np.maximum(start, end) >= low + side.limit)
                        & (np.minimum(start, end) <= high - side.limit)).all(axis=1)
    return near


def passage(side: Side, candidates: Flags, before: Floats, after: Floats) -> Passage | None:
    """Find the point that goes deepest into the other body on its straight way, None where none goes beyond the limit.

    candidates : (p,) which of side.points to look at.  before, after : (n_nodes, 2) [m].  Of a point that is inside
    from the start and comes out, as where pressed bodies slide off each other's ends, only what it sinks in further
    counts.
    """
    near = nearing(side, candidates, before, after)
    if not near.any():
        return None
    points = np.flatnonzero(near)
    start, end = side.places(before), side.places(after)
    # A little aside: meshes that match have nodes above nodes, and a way through a node may cross neither of its edges.
    aside = ASIDE * side.edge * np.array([0.618, 0.382])
    way = start[near] + aside, end[near] + aside
    a, b = ((before[side.outline[:, k]], after[side.outline[:, k]]) for k in range(2))
    stays, within, found = depths(way[1], a[1], b[1]), inside(way[0], a[0], b[0]), None
    who, when = crossings(way, a, b)
    for i, point in enumerate(points):
        times = [0.0] * bool(within[i]) + when[who == i].tolist()
        times += [1.0] * (len(times) % 2)
        deepest = [(float(stays[i]), 1.0)]
        for u, v in zip(times[::2], times[1::2], strict=True):
            if u == 0.0:
                deepest.append((_sunk(side, (start[point], end[point]), (before, after), v), v))
            else:
                now, from_, to = (w[0] + 0.5 * (u + v) * (w[1] - w[0]) for w in (way, a, b))
                deepest.append((float(depths(now[i:i + 1], from_, to)[0]), 0.5 * (u + v)))
        depth, share = max(deepest)
        if depth > max(side.limit, found.depth if found else 0.0):
            found = Passage(side, int(point), depth, share, bool(stays[i] > 0.0))
    return found


def _sunk(side: Side, way: tuple[Floats, Floats], x: tuple[Floats, Floats], share: float) -> float:
    """Return how much deeper [m] a point lies after a share of its way behind the faced edge that was nearest at first.

    way : (2,) [m] where it begins and ends.  x : (n_nodes, 2) [m] then.
    """
    def behind(point: Floats, x: Floats) -> Floats:
        a, b = x[side.faced[:, 0]], x[side.faced[:, 1]]
        return cross(b - a, point - a) / np.linalg.norm(b - a, axis=1)

    (start, end), (before, after) = way, x
    a, b = before[side.faced[:, 0]], before[side.faced[:, 1]]
    s = np.clip(((start - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0.0, 1.0)
    nearest = int(np.linalg.norm(start - a - s[:, None] * (b - a), axis=1).argmin())
    now, there = start + share * (end - start), before + share * (after - before)
    return float((behind(now, there) - behind(start, before))[nearest])
