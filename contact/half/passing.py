"""Nodes that go into another body on their way: seen from the coordinates alone.

Contact looks for what faces what within a depth; this looks at all of a body's outside, and along the way of a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.half.interface import Interface, outline_of
from contact.half.outlines import Flags, Floats, Indices, cross, crossings, depths, inside, mean_thickness

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
    at : (n,) their pair nodes.  all_at : (k, 2) places in nodes, and the pair nodes there of all pairs of these bodies.
    outline : (m, 2) edges of the other body.  faced : (k, 2) those of the surface that faces this one.
    edge : mean length [m] of the surface's edges.
    limit : [m] how deep inside is no passage.  near : [m] gaps below this are seen.
    """

    pair: str
    surface: str
    other: str
    nodes: Indices
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
        """Say of self.nodes whether (n,) contact finds each neither pressed nor near; gap : (n_q,) [m], of all pairs.
        """
        unseen = np.ones(self.nodes.size, dtype=np.bool_)
        unseen[self.all_at[gap[self.all_at[:, 1]] < self.near, 0]] = False
        return unseen


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
            both = [(np.searchsorted(nodes, side.nodes[here]), np.arange(side.at.start, side.at.stop)[here])
                    for side in interface.pair_sides if bodies[side.pair] == bodies[pair.name]
                    if (here := np.isin(side.nodes, nodes)).any()]
            ends = interface.nodes[interface.surfaces[own]]
            edge = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
            # Sides that are told to be farther apart than they are drawn overlap in the drawing by as much.
            limit = (ALLOWED * min(edge, mean_thickness(interface.nodes, outlines[other]))
                     + max(float(interface.gap_offset[told.at].max(initial=0.0)), 0.0))
            # Where nothing is faced a node's gap is gap_max.
            sides.append(Side(pair.name, own, other, nodes, np.arange(told.at.start, told.at.stop),
                              np.concatenate([np.column_stack(rows) for rows in both]).astype(np.intp),
                              outlines[other], interface.surfaces[surface].astype(np.intp), edge, limit,
                              min(NEAR * edge, pair.gap_max)))
    return tuple(sides)


@dataclass(frozen=True)
class Passage:
    """A node that was deep inside the other body on its way.  depth : [m] there.  share : [1] of the way.

    stays : whether it lies inside at the end.
    """

    side: Side
    node: int
    depth: float
    share: float
    stays: bool


def nearing(side: Side, candidates: Flags, before: Floats, after: Floats) -> Flags:
    """Say of candidates (n,) of side.nodes whether the box of their way meets that of the other body, beyond the limit.

    before, after : (n_nodes, 2) [m].
    """
    nodes, ends = side.nodes[candidates], side.outline[:, 0]
    start, end, first, last = before[nodes], after[nodes], before[ends], after[ends]
    low, high = (np.minimum(first.min(axis=0), last.min(axis=0)), np.maximum(first.max(axis=0), last.max(axis=0)))
    near = candidates.copy()
    near[candidates] = ((np.maximum(start, end) >= low + side.limit)
                        & (np.minimum(start, end) <= high - side.limit)).all(axis=1)
    return near


def passage(side: Side, candidates: Flags, before: Floats, after: Floats) -> Passage | None:
    """Find the node that goes deepest into the other body on its straight way, None where none goes beyond the limit.

    candidates : (n,) which of side.nodes to look at.  before, after : (n_nodes, 2) [m].  Of a node that is inside from
    the start and comes out, as where pressed bodies slide off each other's ends, only what it sinks in further counts.
    """
    near = nearing(side, candidates, before, after)
    if not near.any():
        return None
    nodes = side.nodes[near]
    # A little aside: meshes that match have nodes above nodes, and a way through a node may cross neither of its edges.
    aside = ASIDE * side.edge * np.array([0.618, 0.382])
    way = before[nodes] + aside, after[nodes] + aside
    a, b = ((before[side.outline[:, k]], after[side.outline[:, k]]) for k in range(2))
    stays, within, found = depths(way[1], a[1], b[1]), inside(way[0], a[0], b[0]), None
    who, when = crossings(way, a, b)
    for i in range(len(nodes)):
        times = [0.0] * bool(within[i]) + when[who == i].tolist()
        times += [1.0] * (len(times) % 2)
        deepest = [(float(stays[i]), 1.0)]
        for u, v in zip(times[::2], times[1::2], strict=True):
            if u == 0.0:
                deepest.append((_sunk(side, int(nodes[i]), before, after, v), v))
            else:
                now, from_, to = (w[0] + 0.5 * (u + v) * (w[1] - w[0]) for w in (way, a, b))
                deepest.append((float(depths(now[i:i + 1], from_, to)[0]), 0.5 * (u + v)))
        depth, share = max(deepest)
        if depth > max(side.limit, found.depth if found else 0.0):
            found = Passage(side, int(nodes[i]), depth, share, bool(stays[i] > 0.0))
    return found


def _sunk(side: Side, node: int, before: Floats, after: Floats, share: float) -> float:
    """Return how much deeper [m] a node lies after a share of its way behind the faced edge that was nearest at first.
    """
    def behind(x: Floats) -> Floats:
        a, b = x[side.faced[:, 0]], x[side.faced[:, 1]]
        return cross(b - a, x[node] - a) / np.linalg.norm(b - a, axis=1)

    a, b = before[side.faced[:, 0]], before[side.faced[:, 1]]
    s = np.clip(((before[node] - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0.0, 1.0)
    nearest = int(np.linalg.norm(before[node] - a - s[:, None] * (b - a), axis=1).argmin())
    return float((behind(before + share * (after - before)) - behind(before))[nearest])
