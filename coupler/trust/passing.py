"""No body passes through another: surfaces that may meet are held against each other at every window's end.

The halves and the contact service look for what faces what within a search depth; what leapt past it in one window
presses nothing and says nothing.  Here a node of one side of a pair that lies inside the body of the other side, deeper
than what the half tells, or that crossed the outline of that body on its straight way through the window, is seen from
the coordinates alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict, measured

Array = NDArray[np.float64]
Ints = NDArray[np.integer]

# A node this share of an edge deeper than what is told is inside; facing curved meshes overlap by their sagitta.
ALLOWED = 0.1
DEPTHS = (0.01, 0.1)  # told penetration over the edge length: noted, broken
PASSES, SOFT = "no body passes through another", "penetration of pressed surfaces"


@dataclass(frozen=True)
class PassingLog:
    """depth : the deepest a node lay inside unseen, over its edge length, at t [s]; node, pair : which.

    crossed : whether it went across, not in.  drawn : pair -> depth over edge length at the start, as drawn.
    soft : the largest told penetration over the edge length, at soft_t [s] in soft_pair.
    """

    depth: float = 0.0
    node: int = -1
    pair: str = ""
    t: float = 0.0
    crossed: bool = False
    drawn: Mapping[str, float] = field(default_factory=dict)
    soft: float = 0.0
    soft_pair: str = ""
    soft_t: float = 0.0


@dataclass(frozen=True)
class _Side:
    """Nodes (n,) of a surface, their places (n,) among contact nodes, the outline (m, 2) of the body it may meet."""

    pair: str
    nodes: Ints
    at: Ints
    outline: Ints
    edge: float


class Sides:
    """Both sides of every pair of a scene whose bodies are two.  A surface that folds onto itself is left out."""

    def __init__(self, interface: Interface) -> None:
        self._sides: list[_Side] = []
        outlines = {body: outline(interface, k) for k, body in enumerate(interface.bodies)}
        for pair in interface.pairs:
            for own, other in ((pair.slave, pair.master), (pair.master, pair.slave)):
                if own.partition(".")[0] == other.partition(".")[0]:
                    continue
                nodes = np.unique(interface.surfaces[own])
                edges = interface.nodes[interface.surfaces[own]]
                self._sides.append(_Side(pair.name, nodes, np.searchsorted(interface.contact_nodes, nodes),
                                         outlines[other.partition(".")[0]],
                                         float(np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1).mean())))

    def begun(self, now: Level) -> PassingLog:
        """Return the log at the start: how bodies overlap as drawn."""
        drawn: dict[str, float] = {}
        for side in self._sides:
            _, depths = _inside(side, now)
            drawn[side.pair] = max(drawn.get(side.pair, 0.0), float(depths.max(initial=0.0)) / side.edge)
        return PassingLog(drawn=drawn)

    def watched(self, log: PassingLog, before: Level, now: Level) -> PassingLog:
        """Return the log after one more window."""
        for side in self._sides:
            told = np.nan_to_num(np.maximum(-now.gap[side.at], 0.0))
            if told.max(initial=0.0) > log.soft * side.edge:
                log = replace(log, soft=float(told.max()) / side.edge, soft_pair=side.pair, soft_t=now.t)
            nodes, depths = _inside(side, now)
            if nodes.size:
                unseen = (depths - self._told(side, now, nodes)) / side.edge - log.drawn.get(side.pair, 0.0)
                worst = int(unseen.argmax())
                # fault: what lies inside another body is not seen -> if False: | coupler/test_trust
                if unseen[worst] > max(ALLOWED, log.depth):
                    log = replace(log, depth=float(unseen[worst]), node=int(nodes[worst]), pair=side.pair, t=now.t,
                                  crossed=False)
            elif (node := _crossing(side, before, now)) >= 0 and not log.crossed:
                way = float(np.linalg.norm(now.x[node] - before.x[node])) / side.edge
                if way > max(ALLOWED, log.depth):
                    log = replace(log, depth=way, node=node, pair=side.pair, t=now.t, crossed=True)
        return log

    def _told(self, side: _Side, now: Level, nodes: Ints) -> Array:
        """Return the penetration (n,) [m] that is told at nodes (n,), or by a node of the pair within two edges."""
        found = np.zeros(len(nodes))
        for other in self._sides:
            if other.pair == side.pair:
                told = np.nan_to_num(np.maximum(-now.gap[other.at], 0.0))
                far = np.linalg.norm(now.x[nodes][:, None] - now.x[other.nodes][None], axis=2)
                found = np.maximum(found, np.where(far <= 2.0 * max(side.edge, other.edge), told, 0.0).max(axis=1))
        return found


def outline(interface: Interface, body: int) -> Ints:
    """Return the edges (m, 2) on the outside of a body, the body on the left hand."""
    cells = [c[b == body] for c, b in ((interface.quads, interface.quad_body),
                                       (interface.triangles, interface.triangle_body)) if len(c)]
    edges = np.vstack([np.column_stack([c.ravel(), np.roll(c, -1, axis=1).ravel()]) for c in cells])
    keys = {(int(a), int(b)) for a, b in edges}
    return np.array([(a, b) for a, b in edges.tolist() if (b, a) not in keys], dtype=np.int64)


def _near(side: _Side, x: Array, more: Array) -> Ints:
    """Return the places in side.nodes that lie in the box around the other body, on their way (n, 2) [m] too."""
    box = x[np.unique(side.outline)]
    low, high = box.min(axis=0), box.max(axis=0)
    a, b = x[side.nodes], more[side.nodes]
    inside = (np.maximum(a, b) >= low).all(axis=1) & (np.minimum(a, b) <= high).all(axis=1)
    return np.flatnonzero(inside)


def _inside(side: _Side, now: Level) -> tuple[Ints, Array]:
    """Return the nodes (n,) that lie inside the other body, and how deep (n,) [m]."""
    near = _near(side, now.x, now.x)
    p = now.x[side.nodes[near]]
    a, b = now.x[side.outline[:, 0]], now.x[side.outline[:, 1]]
    # Crossings of a ray along x: an odd number of them means inside.
    up = (a[:, 1] > p[:, None, 1]) != (b[:, 1] > p[:, None, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (p[:, None, 1] - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    inside = (up & (p[:, None, 0] < at)).sum(axis=1) % 2 == 1
    return side.nodes[near[inside]], _depths(p[inside], a, b)


def _crossing(side: _Side, before: Level, now: Level) -> int:
    """Return a node that went in at one side of the other body and out at another within the window, -1: none.

    The way is taken as the other body sees it: that body's own mean motion is taken out.
    """
    moved = now.x[np.unique(side.outline)].mean(axis=0) - before.x[np.unique(side.outline)].mean(axis=0)
    start = before.x + moved
    nodes = side.nodes[_near(side, now.x, start)]
    if not nodes.size:
        return -1
    # A little aside: meshes that match have nodes above nodes, and a way through a node crosses no edge clearly.
    aside = 1e-6 * side.edge * np.array([0.618, 0.382])
    p, q = start[nodes][:, None] + aside, now.x[nodes][:, None] + aside
    a, b = now.x[side.outline[:, 0]], now.x[side.outline[:, 1]]
    crosses = (_turn(p, q, a) * _turn(p, q, b) < 0.0) & (_turn(a, b, p) * _turn(a, b, q) < 0.0)
    for k in np.flatnonzero(crosses.sum(axis=1) >= 2):
        edges = np.flatnonzero(crosses[k])
        first, last = _turn(a[edges], b[edges], p[k]), _turn(a[edges], b[edges], q[k])
        s = np.sort(first / (first - last))
        middle = p[k] + 0.5 * (s[0] + s[1]) * (q[k] - p[k])
        # What slides along a surface crosses its ends and is never deep.
        if _depths(middle, a, b)[0] > ALLOWED * side.edge:
            return int(nodes[k])
    return -1


def _depths(p: Array, a: Array, b: Array) -> Array:
    """Return the distances (n,) [m] of points (n, 2) to the nearest of the edges a b, (m, 2) each."""
    d = b - a
    s = np.clip(((p[:, None] - a) * d).sum(axis=2) / (d * d).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(p[:, None] - (a + s[..., None] * d), axis=2).min(axis=1, initial=np.inf))


def _turn(a: Array, b: Array, c: Array) -> Array:
    """Return twice the area [m2] of the triangles a b c, positive anticlockwise."""
    u, v = b - a, c - a
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def checks(log: PassingLog, where: str, pairs: bool, prescribed: bool) -> tuple[Check, Check]:
    """Return the two checks at the end.

    where : of the deepest node, in words.  pairs : whether the scene has any.  prescribed : bodies move as the scenario
    says, whatever they press.
    """
    if not pairs:
        none = "there are no pairs"
        return Check(PASSES, TrustVerdict.UNCHECKED, what=none), Check(SOFT, TrustVerdict.UNCHECKED, what=none)
    how = "went across the other body in one window" if log.crossed else (
        f"lies {log.depth:.3g} edges inside the other body, beyond what contact found")
    passes = measured(PASSES, log.depth, (0.0, 0.0), unit="edges", t=log.t,
                      what=f"pair {log.pair}: {where} {how}, at t = {log.t:.6g} s",
                      remedy="Smaller windows, or a smaller step of the motion; contact finds what lies within an "
                             "edge's length behind a surface")
    soft = measured(SOFT, log.soft, DEPTHS, t=log.soft_t,
                    what=f"pair {log.soft_pair}: pressed surfaces overlap by {100 * log.soft:.3g} % of an edge at "
                         f"t = {log.soft_t:.6g} s",
                    remedy="augmented: {} in the pair drives it out; a larger penalty makes it smaller")
    if prescribed:
        soft = measured(SOFT, log.soft, (DEPTHS[1], np.inf), t=log.soft_t, unit="edges",
                        what=f"pair {log.soft_pair}: the prescribed motion goes through, {log.soft:.3g} edges deep at "
                             f"t = {log.soft_t:.6g} s", remedy="The half rigid moves bodies as it is told")
    return passes, soft
