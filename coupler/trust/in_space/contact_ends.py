"""How much too large the force of a contact is because it ends at an edge on a body that yields.

Under the edge of a punch the speed of the surface jumps: material under the punch goes with it, material beside it
rises.  A mesh has no jumps in a cell.  It spreads this one over the first edge beyond, so that the punch drags that
along, as if it were wider by some 0.3 of that edge, and 0.4 to 0.8 where the punch ends within an edge.  The force of
that acts at the nodes next to the end, as a pressure that no body bears there.  What it bears is known (Prandtl 1920,
Hill 1950): where a body yields beside a free surface its slip lines are a fan, and the pressure is 2 k (1 + theta), k
its yield stress in shear and theta the angle of the fan: pi/2, less by what the surface beyond turns away.  In plane
stress no pressure is more than 2 k.  From there the pressure may rise or fall to that further inside.  What nodes near
the end press beyond it is made of nothing.  The energy norm (mesh.py) sees little of it, for it is a power of flow.

Told of ends next to which all cells yield and the surface goes on: not where the yielding body itself ends, as a block
that is upset between larger dies, nor where the next edge is pressed too.  Where contact ends smoothly (a roller) the
pressure falls to 0, and nothing is beyond.  Creep counts as flow, by the stress that it takes.  In bodies that harden
much, by strain or by rate, the pressure at an edge is higher than by the cells next to it, and less is told.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface, Pair
from contact.half.outlines import outline_of
from coupler.fmu.half import Block
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, measured

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Flags = NDArray[np.bool_]

LIMITS = (0.05, 0.2)  # of the force: noted, broken
TURNED = -np.deg2rad(45.0)  # a surface that turns away by more than this ends there
SLIVER = 0.2  # of an edge: where contact goes no further, it ends at the node before
HERE = 1e-6  # of an edge: what lies so near to a node is of the edge inside
NEAR, INSIDE = 2.0, 4.0  # edges from the end: as far acts what is dragged along; up to here pressure is that inside
NAME = "cells fine enough where contact ends"
FLOWED, STRESS = ("peeq", "ceeq"), "sigma_v"


def outputs(blocks: Mapping[str, Block], known: list[str]) -> list[str]:
    """Return the outputs that the check needs beside the stress of cells, none where a half lacks some.

    known : what the stress of cells is read from.
    """
    return [name for name in FLOWED if name in blocks] if STRESS in known else []


@dataclass(frozen=True)
class EndLog:
    """What contact presses at its ends.

    most : pair -> its largest force so far [N].  excess : pair -> the largest part of a force that is made of nothing
    [N], at t [s], and the node (of the body that yields) where it is most.  flowed : (n_cells,) plastic and creep
    strain at the last look, (0,) before the first.
    """

    most: Mapping[str, float] = field(default_factory=dict)
    excess: Mapping[str, tuple[float, float, int]] = field(default_factory=dict)
    flowed: Floats = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True)
class Chain:
    """Nodes along a surface, its body on the left hand.

    at : (n,) pair nodes, nodes : (n,) of the mesh.  closed : whether the first follows on the last.
    """

    at: Ints
    nodes: Ints
    closed: bool


@dataclass(frozen=True)
class Pressed:
    """Successive nodes of a slave that face the other body, towards an end of what of them presses.

    nodes : (n,), x : (n, 2) [m].  force : (n,) [N].  faced : (n,) [m2] what of their parts of the surface faces the
    other body.  first : the first that presses; from there on all do.  reach : share of the last edge that faces it.
    back : the nodes go against the surface.
    """

    nodes: Ints
    x: Floats
    force: Floats
    faced: Floats
    first: int
    reach: float
    back: bool

    @property
    def end(self) -> Floats:
        """(2,) [m] where contact ends, a little inside."""
        return np.asarray(self.x[-2] + (1.0 - HERE) * self.reach * (self.x[-1] - self.x[-2]))

    @property
    def last(self) -> int:
        """The place of the node next to the end."""
        # fault: a sliver of an edge is taken for all of it -> return len(self.nodes) - 1 |
        #   coupler/test_trust_contact_ends
        return len(self.nodes) - (1 if self.reach > SLIVER else 2)


@dataclass(frozen=True)
class Edge:
    """The edge of a body at which contact ends.

    size [m].  last : its node there.  beyond : the next node, 0-based.  lip : by how much [rad] the surface rises
    beyond `last`, against the direction of contact.
    """

    size: float
    last: int
    beyond: int
    lip: float


class ContactEnds:
    """The pairs of a scene that press on a body that may yield."""

    def __init__(self, interface: Interface, model: Mapping[str, Any]) -> None:
        """model : model.json of the mechanical half."""
        self._interface = interface
        bodies, materials = model.get("bodies", {}), model.get("materials", {})
        flows = {name for name, m in materials.items() if m.get("plastic") or m.get("creep")}
        # What is struck is pressed harder than it can bear at rest.
        moves = model.get("dynamics") is not None
        self._yielding = {b for b, name in enumerate(interface.bodies)
                          if not moves and _may_yield(bodies.get(name, {}), flows)}
        self._in_plane = model.get("state") == "plane_stress" and not interface.axisymmetric
        self._pairs = [pair for pair in interface.pairs if not pair.tied and pair.slave != pair.master
                       and {self._body(pair.slave), self._body(pair.master)} & self._yielding]
        self._chains = {pair.name: _chains(interface, pair) for pair in self._pairs}
        edges = [edge for body in sorted(self._yielding) for edge in outline_of(interface, body).tolist()]
        self._next, self._previous = dict(edges), {b: a for a, b in edges}
        self._cells = _cells_around(interface) if self._pairs else {}

    def _body(self, surface: str) -> int:
        return int(self._interface.node_body[self._interface.surfaces[surface].flat[0]])

    def watched(self, log: EndLog, told: Mapping[str, Floats], now: Level) -> EndLog:
        """Return the log after a look.  told : of FLOWED what there is [1], and sigma_v [Pa], (n_cells,)."""
        of = [told[name] for name in FLOWED if name in told]
        if not self._pairs or not of:
            return log
        # fault: creep is no flow -> flowed = of[0] | coupler/test_trust_contact_ends
        flowed = np.sum(of, axis=0)
        # fault: a body that does not yield any more is taken to -> flows = flowed > 0.0 |
        #   coupler/test_trust_contact_ends
        flows = flowed > (log.flowed if log.flowed.size else flowed)
        log = replace(log, flowed=flowed)
        on = set(self._interface.pair_nodes[(now.t_N < 0.0) & (now.covered > 0.5 * SLIVER**2)].tolist())
        for pair in self._pairs:
            whole, excess, worst = self._force(pair, now), 0.0, (0.0, 0)
            for both in self._runs(pair, now):
                ends = [end for run in both for side in (pair.slave, pair.master)
                        if (end := self._end(side, run, now.x, flows, told[STRESS], on, slave=side == pair.slave))]
                of_nothing = _of_nothing(ends)
                excess += of_nothing
                node = max(((run.force[-1], edge.last) for run, edge, _ in ends), default=(0.0, 0))[1]
                worst = max(worst, (of_nothing, node))
            if whole > log.most.get(pair.name, 0.0):
                log = replace(log, most={**log.most, pair.name: whole})
            # fault: what was too much before is forgotten -> if excess > 0.0: | coupler/test_trust_contact_ends
            if excess > log.excess.get(pair.name, (0.0,))[0]:
                log = replace(log, excess={**log.excess, pair.name: (excess, now.t, worst[1])})
        return log

    def _bears(self, yields: float, lip: float) -> float:
        """Return the pressure [Pa] that a body bears at the end of a contact.  yields [Pa]: in tension."""
        k = yields / np.sqrt(3.0)
        # A lip rises on a mesh over its first edge, much more steeply than beside a punch.
        # fault: a body of plane stress bears as much as one of plane strain -> fan = 0.5 * np.pi |
        #   coupler/test_trust_contact_ends
        fan = 0.0 if self._in_plane else 0.5 * np.pi + min(lip, 0.0)
        return float(2.0 * k * (1.0 + fan))

    def _faced(self, chain: Chain, now: Level) -> tuple[Floats, Floats]:
        """(n,) [m2] what of the parts of nodes along a chain faces the other body, and (n,) [N] what presses there."""
        faced = now.covered[chain.at] * _areas(now.x[chain.nodes], chain.closed, self._interface.axisymmetric)
        return faced, np.maximum(-now.t_N[chain.at], 0.0) * faced

    def _force(self, pair: Pair, now: Level) -> float:
        """What a pair presses in all [N]."""
        return sum(float(self._faced(chain, now)[1].sum()) for chain in self._chains[pair.name])

    def _runs(self, pair: Pair, now: Level) -> Iterator[tuple[Pressed, Pressed]]:
        """Successive nodes of the slave that press, towards the one end and towards the other."""
        for chain in self._chains[pair.name]:
            x, (faced, force) = now.x[chain.nodes], self._faced(chain, now)
            steps = np.diff((force > 0.0).astype(int), prepend=0, append=0)
            apart = np.flatnonzero(np.concatenate([[True], faced == 0.0, [True]])) - 1
            for first, behind in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True):
                if behind - first < 2:
                    continue
                found = []
                for back, here in ((False, np.arange(apart[apart < first].max() + 1, behind)),
                                   (True, np.arange(apart[apart >= behind].min() - 1, first - 1, -1))):
                    half = _areas(x[here[-2:]], False, self._interface.axisymmetric)[-1]
                    found.append(Pressed(chain.nodes[here], x[here], force[here], faced[here],
                                         here.size - int(behind - first),
                                         float(np.sqrt(min(faced[here[-1]] / half, 1.0))), back))
                yield found[0], found[1]

    def _end(self, side: str, run: Pressed, x: Floats, flows: Flags, sigma_v: Floats, on: set[int], *,
             slave: bool) -> tuple[Pressed, Edge, float] | None:
        """Where a run ends on a body that yields there and goes on, and the pressure [Pa] that this bears; else None.

        flows : (n_cells,), sigma_v : (n_cells,) [Pa].  on : nodes that are pressed.  slave : whether `side` is it.
        """
        edge = self._edge(side, run, x, slave=slave)
        # fault: where a block ends it drags something along -> if edge is None or edge.beyond in on: |
        #   coupler/test_trust_contact_ends
        # fault: what another pair presses is dragged along -> if edge is None or edge.lip < TURNED: |
        #   coupler/test_trust_contact_ends
        if edge is None or edge.beyond in on or edge.lip < TURNED:
            return None
        cells = self._cells[edge.last]
        return (run, edge, self._bears(float(sigma_v[cells].mean()), edge.lip)) if flows[cells].all() else None

    def _edge(self, surface: str, run: Pressed, x: Floats, *, slave: bool) -> Edge | None:
        """Find where contact ends on a surface; None: its body does not yield, or ends there.

        x : (n_nodes, 2) [m].  slave : whether it is the slave.
        """
        if self._body(surface) not in self._yielding or (slave and run.last < 1):
            return None
        if slave:
            inner, last, back = int(run.nodes[run.last - 1]), int(run.nodes[run.last]), run.back
            along = run.x[max(run.last - 1, 1)] - run.x[max(run.last - 2, 0)]
        else:
            edges = self._interface.surfaces[surface]
            start, way = x[edges[:, 0]], x[edges[:, 1]] - x[edges[:, 0]]
            at = np.clip(((run.end - start) * way).sum(axis=1) / (way * way).sum(axis=1), 0.0, 1.0)
            nearest = int(np.argmin(np.hypot(*(run.end - start - at[:, None] * way).T)))
            along = run.x[-1] - run.x[-2]
            back = bool(way[nearest] @ along < 0.0)
            inner, last = edges[nearest, :: -1 if back else 1].tolist()
        beyond = (self._previous if back else self._next).get(last)
        if beyond is None:
            return None
        # The other body is on the right hand of the surface.
        # fault: a surface turns the wrong way where nodes go back -> lip = -_angle(along, x[beyond] - x[last]) |
        #   coupler/test_trust_contact_ends
        lip = _angle(along, x[beyond] - x[last]) * (1.0 if back else -1.0)
        return Edge(float(np.hypot(*(x[last] - x[inner]))), last, beyond, lip)

    def checks(self, log: EndLog) -> tuple[Check, ...]:
        """Return the row at the end, none where nothing pressed on what may yield."""
        if not log.most:
            return ()
        shares = {name: of[0] / (log.most[name] - of[0]) for name, of in log.excess.items()}
        name = max(shares, key=lambda n: shares[n], default="")
        # fault: a force that is too large is not told -> share = 0.0 | coupler/test_trust_contact_ends
        share = shares.get(name, 0.0)
        _, t, node = log.excess.get(name, (0.0, 0.0, 0))
        x, y = self._interface.nodes[node]
        what = (f"the force of pair {name} is some {100.0 * share:.3g} % too large: it ends on a body that yields, and "
                f"drags the first cell beyond along, most next to ({x:.4g}, {y:.4g}) m, at t = {t:.6g} s")
        remedy = ("Draw a narrow column of cells just beyond the end, a tenth as wide as those beside it, with a node "
                  "where the other body ends, or use smaller cells there")
        return (measured(NAME, share, LIMITS, t=t, what=what, remedy=remedy),)


def _of_nothing(ends: Sequence[tuple[Pressed, Edge, float]]) -> float:
    """Force [N] that a run presses near its ends, one or both, beyond what the body bears there, [Pa] of each."""
    found = 0.0
    for run, edge, bears in ends:
        steps = np.hypot(*np.diff(run.x, axis=0).T)
        size = max(edge.size, float(steps[-1]))
        steps[-1] *= run.reach
        depth = np.append(np.cumsum(steps[::-1])[::-1], 0.0)
        near, far = np.clip(NEAR - depth / size, 0.0, 1.0), np.clip(1.0 - depth / (NEAR * size), 0.0, 1.0)
        inside = (depth > NEAR * size) & (depth < INSIDE * size)
        within = float(run.force[inside].sum() / run.faced[inside].sum()) if inside.any() else bears
        # fault: a pressure that rises inside is taken for too much -> of_end = np.ones_like(depth) |
        #   coupler/test_trust_contact_ends
        of_end = far if within > bears else near
        most = within + of_end * (bears - within)
        # What is nearer to the other end, where that is one, is of that.
        # fault: what both ends of a short contact press counts twice -> own = np.ones_like(depth) |
        #   coupler/test_trust_contact_ends
        own = np.clip(0.5 + (0.5 * depth[run.first] - depth) / (HERE * size), 0.0, 1.0) if len(ends) == 2 else 1.0
        found += float((own * near) @ (run.force - most * run.faced))
    return max(found, 0.0)


def _angle(u: Floats, v: Floats) -> float:
    """By how much [rad] v turns to the left of u, both (2,)."""
    return float(np.arctan2(u[0] * v[1] - u[1] * v[0], u @ v))


def _may_yield(body: Mapping[str, Any], flows: set[str]) -> bool:
    """Whether a body of model.json may.  flows : names of materials that do."""
    parts = [body, *(body.get("regions") or {}).values()]
    return not body.get("rigid") and not flows.isdisjoint(str(part.get("material")) for part in parts)


def _areas(x: Floats, closed: bool, axisymmetric: bool) -> Floats:
    """(n,) [m2] the part of a surface that belongs to each of its nodes, at x : (n, 2) [m] along it."""
    ends = np.roll(x, -1, axis=0) if closed else x[1:]
    first, area = x[: len(ends)], np.zeros(len(x))
    length = np.hypot(*(ends - first).T)
    # fault: an end about an axis counts as one in a plane -> r, s = 1.0, 1.0 | coupler/test_trust_contact_ends
    r, s = (2.0 * np.pi * first[:, 0], 2.0 * np.pi * ends[:, 0]) if axisymmetric else (1.0, 1.0)
    area[: len(ends)] += length * (2.0 * r + s) / 6.0
    area[(np.arange(len(ends)) + 1) % len(x)] += length * (r + 2.0 * s) / 6.0
    return area


def _chains(interface: Interface, pair: Pair) -> list[Chain]:
    """The slave of a pair, a chain for each of its pieces."""
    side, edges = interface.side_of(pair.name, pair.slave), interface.surfaces[pair.slave]
    place = {int(k): side.at.start + i for i, k in enumerate(side.nodes)}
    ahead = dict(edges.tolist())
    found, left = [], set(ahead)
    for start in [*(set(ahead) - set(ahead.values())), *ahead]:
        if start not in left:
            continue
        nodes = [start]
        while nodes[-1] in left:
            left.discard(nodes[-1])
            nodes.append(ahead[nodes[-1]])
        closed = nodes[-1] == start
        nodes = nodes[:-1] if closed else nodes
        found.append(Chain(np.array([place[k] for k in nodes]), np.array(nodes, dtype=np.intp), closed))
    return found


def _cells_around(interface: Interface) -> dict[int, NDArray[np.intp]]:
    """Node -> the cells around it, quads first."""
    found: dict[int, list[int]] = {}
    first = 0
    for cells in (interface.quads, interface.triangles):
        for number, corners in enumerate(cells.tolist(), first):
            for k in corners:
                found.setdefault(k, []).append(number)
        first += len(cells)
    return {k: np.array(v, dtype=np.intp) for k, v in found.items()}
