"""No bodies meet where no pair names their surfaces: contact looks at what pairs name, and at nothing else.

A bar that grows into a wall that nobody named a pair with goes through it as through air, and nothing else tells: heat
balances, and every step is solved.  Here the outside of each body is held against that of every other at the ends of
windows, but for the surfaces that a pair names for both.  What lies inside deeper than it was drawn is taken beside the
way that the bodies moved, or the length of an edge there if that is less: bodies that warm a little side by side, and
bodies that slide far, are both told by it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.half.outlines import depths, outline_of
from contact.half.passing import ALLOWED
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, amount, measured

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

NAME = "no bodies meet without a pair"
SHARES = (0.01, 0.1)  # of the way, or of an edge: noted, broken
FLAT = 1e-6  # of an edge: how numbers of what lies side by side are written


@dataclass(frozen=True)
class UnpairedLog:
    """share : the deepest overlap that no pair tells, over the way or an edge, at t [s]; depth : that overlap [m].

    node, end : the node that lies inside, or the ends of the edge whose middle does; body : in which.
    """

    share: float = 0.0
    depth: float = 0.0
    node: int = -1
    end: int = -1
    body: str = ""
    t: float = 0.0


@dataclass(frozen=True)
class Outside:
    """What of one body no pair names beside another.

    body, other : their numbers.  points : (p, 2) nodes, each twice, then the ends of edges, for their middles.
    edge : mean length [m].  drawn : how deep the deepest is drawn inside the other [m].
    """

    body: int
    other: int
    points: Indices
    edge: float
    drawn: float


class Unpaired:
    """The bodies of a scene, two by two."""

    def __init__(self, interface: Interface) -> None:
        self._bodies, self._drawn_x = interface.bodies, interface.nodes
        self._outlines = [outline_of(interface, body) for body in range(len(interface.bodies))]
        self._nodes = [np.unique(edges) for edges in self._outlines]
        self._named = _named(interface)
        self._known: dict[tuple[int, int], Outside] = {}

    def __bool__(self) -> bool:
        return len(self._bodies) > 1

    def watched(self, log: UnpairedLog, now: Level) -> UnpairedLog:
        """Return the log after one more window."""
        boxes = [(now.x[nodes].min(axis=0), now.x[nodes].max(axis=0)) for nodes in self._nodes]
        for a, b in combinations(range(len(self._bodies)), 2):
            if not (np.maximum(boxes[a][0], boxes[b][0]) < np.minimum(boxes[a][1], boxes[b][1])).all():
                continue
            for own in (self._outside(a, b), self._outside(b, a)):
                log = self._held(log, own, now)
        return log

    def _held(self, log: UnpairedLog, own: Outside, now: Level) -> UnpairedLog:
        if own.drawn > ALLOWED * own.edge:  # what is drawn inside another body is meant to be there
            return log
        deep = self._deep(own, now.x)
        worst = int(deep.argmax()) if deep.size else 0
        depth = float(deep[worst]) - own.drawn if deep.size else 0.0
        # fault: what no pair names is not looked at -> if depth >= 0.0: | coupler/test_trust_unpaired
        if depth <= FLAT * own.edge:
            return log
        moved = max(float(np.linalg.norm(now.x[n] - self._drawn_x[n], axis=1).max())
                    for n in (self._nodes[own.body], self._nodes[own.other]))
        # fault: an overlap is held against an edge alone -> share = depth / own.edge |
        #   coupler/test_trust_unpaired::test_a_bar_that_grows_into_a_wall_without_a_pair_is_broken
        share = depth / min(moved, own.edge)
        if share <= log.share:
            return log
        node, end = own.points[worst]
        return replace(log, share=share, depth=depth, node=int(node), end=int(end), body=self._bodies[own.other],
                       t=now.t)

    def _outside(self, body: int, other: int) -> Outside:
        if (body, other) not in self._known:
            edges = self._outlines[body]
            # fault: what a pair tells is told again -> named = np.empty(0, dtype=np.intp) | coupler/test_trust_unpaired
            named = self._named.get((body, other), np.empty(0, dtype=np.intp))
            free = edges[~np.isin(edges, named).all(axis=1)]
            nodes = np.setdiff1d(free, named)
            length = np.linalg.norm(self._drawn_x[edges[:, 1]] - self._drawn_x[edges[:, 0]], axis=1)
            own = Outside(body, other, np.vstack([np.column_stack([nodes, nodes]), free]).astype(np.intp),
                          float(length.mean()), 0.0)
            drawn = float(self._deep(own, self._drawn_x).max(initial=0.0))
            self._known[body, other] = replace(own, drawn=drawn)
        return self._known[body, other]

    def _deep(self, own: Outside, x: Array) -> Array:
        points = 0.5 * (x[own.points[:, 0]] + x[own.points[:, 1]])
        outline = self._outlines[own.other]
        return depths(points, x[outline[:, 0]], x[outline[:, 1]])

    def checks(self, log: UnpairedLog, where: str, prescribed: bool) -> tuple[Check, ...]:
        """Return the check at the end, none of a single body.

        where : of the deepest point, in words.  prescribed : bodies move as the scenario says, whatever they meet.
        """
        if not self:
            return ()
        return (measured(NAME, log.share, (SHARES[0], np.inf if prescribed else SHARES[1]), t=log.t,
                         what=f"{where} lies {amount(log.depth, 'm')} inside {log.body} at t = {log.t:.6g} s, and "
                              "no pair names both surfaces: contact does not see that they meet",
                         remedy="Name the surfaces that meet as a pair under contact"),)


def _named(interface: Interface) -> Mapping[tuple[int, int], Indices]:
    """Return (body, other body) -> the nodes of the first on surfaces that a pair names for both."""
    found: dict[tuple[int, int], list[Indices]] = {}
    for pair in interface.pairs:
        for own, other in ((pair.slave, pair.master), (pair.master, pair.slave)):
            bodies = tuple(interface.bodies.index(surface.partition(".")[0]) for surface in (own, other))
            found.setdefault((bodies[0], bodies[1]), []).append(interface.surfaces[own].ravel().astype(np.intp))
    return {bodies: np.unique(np.concatenate(nodes)) for bodies, nodes in found.items()}
