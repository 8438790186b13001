"""Notes on contact: what a user should know before a run, and losses of contact while it goes on.

A node that pressed at the end of one window and faces nothing at the end of the next has slid off the end, has been
lifted off farther than gap_max, or has been pushed through: deeper behind the other surface than the search looks,
where nothing pushes it back.  The last must be reported.  Only such nodes are examined: a window in which there are
none
costs a few comparisons.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contact.facing import Cut, cut_surfaces, project
from contact.half.interface import Interface, Pair, PairSide
from contact.half.outlines import thickness_behind
from contact.half.register import register_message, search_depth
from contact.messages import Facing, Floats
from contact.search import SELF_CONTACT_DEPTH
from contact.surfaces import surfaces_of

# Notes before a run, one sentence each

# A penalty beyond this times E/h loses four digits of every solve, and Newton's method the rest.
MAX_PENALTY_RATIO = 1e4


# An overlap of less than this share of the thinner body's thickness is no news: what a penalty lets in at rest and what
# coordinates are rounded to is less; of steel it would make some 20 MPa.
DRAWN_INSIDE = 1e-4
TOUCHES = 1e-6  # of an edge: how numbers of what touches are written
CROWN = 1.1  # times as deep as any node: less is how arcs are drawn through nodes that lie in them
DEEP = 0.1  # of that thickness: no press fit that is meant is as deep


def facing_at(interface: Interface, x: Floats) -> Facing:
    """Find what faces what with the nodes at x : (n_nodes, 2) [m].  Raises ValueError where x is no possible geometry.
    """
    return project(surfaces_of(register_message(interface)), np.ascontiguousarray(x[interface.contact_nodes]))


def gaps_at_start(interface: Interface) -> dict[str, tuple[float, float]]:
    """Return pair -> the least and the largest gap [m] of what faces each other as the scene begins, 0 where that is
    round-off; no pair that faces nothing."""
    if not interface.pairs:
        return {}
    facing, found = facing_at(interface, interface.nodes), {}
    for k, pair in enumerate(interface.pairs):
        sides = [side.at for side in interface.pair_sides if side.pair == pair.name]
        # A tip is at a node, between the points of the edges beside it.
        gap = np.concatenate([facing.gap[facing.pair == k],
                              *(facing.node_gap[at][facing.node_covered[at] > 0.0] for at in sides)])
        if gap.size:
            none = TOUCHES * float(edge_lengths(interface, pair.slave).min())
            least, most = (0.0 if abs(g) <= none else float(g) for g in (gap.min(), gap.max()))
            found[pair.name] = (least, most)
    return found


def start_notes(interface: Interface, stiffness: Mapping[str, float]) -> list[str]:
    """List the notes on a scene's contact at its start; stiffness : body -> E [Pa], of the bodies that have one."""
    if not interface.pairs:
        return []
    facing = facing_at(interface, interface.nodes)
    met = np.bincount(facing.pair, minlength=len(interface.pairs))
    # fault: what presses is told by the gap that heat sees -> pressing = facing | contact/test_notes
    pressing = seen_by_forces(interface)
    notes = []
    for pair, points in zip(interface.pairs, met, strict=True):
        # Just as deep as contact looks, rounding decides whether heat faces what forces press.
        inside = drawn_inside(interface, pair, pressing)
        notes += inside if points or inside else [nothing_faced(interface, pair, interface.nodes)]
        notes += folding(interface, pair) + stiff_penalty(interface, pair, stiffness)
    return notes


def nothing_faced(interface: Interface, pair: Pair, x: Floats) -> str:
    """Explain why a pair may have no contact quadrature point; x : (n_nodes, 2) [m]."""
    what = f"pair {pair.name}: nothing of {pair.slave} faces anything of {pair.master} at the start"
    if pair.slave == pair.master:
        return what
    d = nearest(interface, pair, x)
    if d > pair.gap_max:
        return f"{what}: their nearest nodes are {d:.3g} m apart, gap_max is {pair.gap_max:.3g} m"
    return (f"{what}, though their nearest nodes are {d:.3g} m apart (gap_max {pair.gap_max:.3g} m): they lie beside "
            "each other or look the same way")


def nearest(interface: Interface, pair: Pair, x: Floats) -> float:
    """Return the least distance [m] between a node of the slave and one of the master, at x : (n_nodes, 2) [m]."""
    slave, master = (x[np.unique(interface.surfaces[name])] for name in (pair.slave, pair.master))
    distances, _ = cKDTree(master).query(slave)
    return float(np.min(distances))


def drawn_inside(interface: Interface, pair: Pair, cut: Cut) -> list[str]:
    """Note bodies drawn into each other, no deeper than contact looks: it presses them apart from the first step on.

    cut : as forces see the surfaces: the chords of a `smooth` pair may overlap where its arcs do not.  A pair that
    states its fit, or is tied, leaves the gap as drawn aside.
    """
    if pair.tied or pair.name in interface.offset:
        return []
    depth, (x, y) = _deepest(interface, pair, cut)
    thick = thickness_behind(interface, pair) or float(edge_lengths(interface, pair.slave).min())
    # fault: bodies drawn into each other go by in silence -> if True: | contact/test_notes
    if depth <= DRAWN_INSIDE * thick:
        return []
    where = f"into each other, deepest at ({x:.4g}, {y:.4g}) m"
    smooth = replace(interface, pairs=tuple(replace(p, smooth=not p.tied) for p in interface.pairs))
    # fault: chords that overlap are told to be a press fit of their arcs -> if False: | contact/test_notes
    if not pair.smooth and _deepest(interface, pair, seen_by_forces(smooth))[0] <= DRAWN_INSIDE * thick:
        return [f"pair {pair.name}: the straight edges of {pair.slave} and {pair.master} lie {depth:.3g} m {where}, "
                "and press from the first step on, though the arcs of which they are chords do not overlap. Set "
                "smooth: true in the pair, state its fit (`clearance`), or use shorter edges"]
    return [f"pair {pair.name}: {pair.slave} and {pair.master} are drawn {depth:.3g} m {where}: that is a press fit of "
            f"this interference, {100.0 * depth / thick:.2g} % of what the thinner body is thick, and presses from the "
            "first step on; `clearance: 0` lets them begin in touch"
            # fault: bodies drawn one over the other pass for a press fit -> + ""] | contact/test_notes
            + ("; is a body in the wrong place?" if depth > DEEP * thick else "")]


def seen_by_forces(interface: Interface) -> Cut:
    """Cut the surfaces as drawn by the rays along which forces act."""
    return cut_surfaces(surfaces_of(register_message(interface)), interface.nodes[interface.contact_nodes])


def _deepest(interface: Interface, pair: Pair, cut: Cut) -> tuple[float, Floats]:
    """How deep [m] a pair's surfaces lie in each other where they face each other, and that place, (2,) [m].

    Nodes are looked at, and the points between: where a round surface lies on one edge, no node of it is in.
    """
    sides = [side for side in interface.pair_sides if side.pair == pair.name]
    gap = np.concatenate([np.where(cut.node_covered[s.at] > 0.0, cut.node_gap[s.at], np.inf) for s in sides])
    # fault: a crown between two nodes that is drawn into a body is not told -> own = cut.at[:, 0] < 0 |
    #   contact/test_notes
    own = (cut.at[:, 0] >= sides[0].at.start) & (cut.at[:, 0] < sides[-1].at.stop)
    ends, xi = interface.nodes[interface.pair_nodes[cut.at[own, :2]]], cut.values[own, :1]
    between = (1.0 - xi) * ends[:, 0] + xi * ends[:, 1]
    places, within = interface.nodes[np.concatenate([s.nodes for s in sides])], cut.values[own, 2]
    if within.min(initial=np.inf) < CROWN * min(float(gap.min()), 0.0):
        gap, places = within, between
    worst = int(gap.argmin())
    return -float(gap[worst]), places[worst]


def folding(interface: Interface, pair: Pair) -> list[str]:
    """Note what a surface that faces itself leaves out."""
    if pair.slave != pair.master:
        return []
    h = edge_lengths(interface, pair.slave)
    return [f"pair {pair.name}: {pair.slave} faces itself; edges that share a node never do, and a fold that overlaps "
            f"by more than {SELF_CONTACT_DEPTH:g} of an edge ({SELF_CONTACT_DEPTH * h.min():.3g} m at the shortest) is "
            "not seen"]


def stiff_penalty(interface: Interface, pair: Pair, stiffness: Mapping[str, float]) -> list[str]:
    """Note a penalty that spoils the condition of the matrix."""
    soft = [(stiffness[body], body) for name in (pair.slave, pair.master)
            if (body := name.split(".")[0]) in stiffness]
    if not soft:
        return []
    # fault: penalty held against the harder body -> E, body = max(soft) | contact/test_notes
    E, body = min(soft)
    h = float(edge_lengths(interface, pair.slave).mean())
    if not pair.eps_N * h > MAX_PENALTY_RATIO * E:
        return []
    return [f"pair {pair.name}: the penalty of {pair.eps_N:.3g} Pa/m is {pair.eps_N * h / E:.2g} times E/h (E of "
            f"{body}, h = {h:.3g} m): equations lose so many digits, and Newton's method may fail; 10 to 100 times E/h "
            f"({10 * E / h:.2g} to {100 * E / h:.2g} Pa/m), or `augmented`, would do"]


def edge_lengths(interface: Interface, surface: str) -> Floats:
    """Return (n_edges,) lengths [m] in the reference configuration."""
    ends = interface.nodes[interface.surfaces[surface]]
    return np.hypot(*(ends[:, 1] - ends[:, 0]).T)


Flags = NDArray[np.bool_]

# Losses of contact during a run

# Rays reach an edge's length behind a surface, but along tilted normals; a node at the very end that penetrates as the
# penalty allows is far from this.
MAX_DEPTH = 0.5  # of the longest edge
# Surfaces that lie against each other are no farther apart than this share of an edge: how numbers are written.
LYING = 1e-6
# Of gap_max: a node so far before the other side has left it by its gap.  Arcs to a tilted side are longer.
BEYOND = 0.9


@dataclass(frozen=True)
class ContactSample:
    """Contact at the end of a window.

    x : (n_nodes, 2) [m].  Of pair nodes t_N : (n_q,) [Pa], covered : (n_q,) [1], the part that faces something, and
    gap : (n_q,) [m].
    """

    x: Floats
    t_N: Floats
    covered: Floats
    gap: Floats


@dataclass(frozen=True)
class Slid:
    """Nodes that slid off an end, or went beyond reach: how many, and when the first one did [s]."""

    nodes: int
    first: float


@dataclass(frozen=True)
class ContactLog:
    """What was noted so far.

    faced : pairs of which something faced something.  slid : pair -> slave nodes that slid off.  lost : pairs of
    which a node went through.  far : pair -> slave nodes that went farther from the master than gap_max.
    otherwise : pairs that once pressed, or did not lie against each other.
    """

    faced: frozenset[str] = frozenset()
    slid: Mapping[str, Slid] = field(default_factory=dict)
    far: Mapping[str, Slid] = field(default_factory=dict)
    lost: frozenset[str] = frozenset()
    otherwise: frozenset[str] = frozenset()


class _Suspects(NamedTuple):
    """Nodes of a surface that pressed and now face nothing, and the surface they faced."""

    surface: str
    nodes: NDArray[np.int32]
    other: str


class ContactMonitor:
    """Note contact losses of a scene's pairs, window after window.

    crosses : pair -> conductance [W/m2K] that its laws have at gap_max, where that is no little part of what they have
    in touch.  torn : pair -> conductance at no gap and at no pressure [W/m2K], where they differ.
    """

    def __init__(self, interface: Interface, crosses: Mapping[str, float] | None = None,
                 torn: Mapping[str, tuple[float, float]] | None = None) -> None:
        self.interface, self.crosses, self.torn = interface, crosses or {}, torn or {}

    @cached_property
    def sides(self) -> dict[str, tuple[PairSide, ...]]:
        """Return pair -> its sides, the slave's first."""
        return {p.name: tuple(side for side in self.interface.pair_sides if side.pair == p.name)
                for p in self.interface.pairs}

    def after_window(self, log: ContactLog, t: float, before: ContactSample,
                     now: ContactSample) -> tuple[ContactLog, tuple[str, ...]]:
        """Compare the ends of two windows, the last at t [s]; return the log and the notes to give at once."""
        notes: list[str] = []
        # A rigid half tells the pressure of the whole surface, of nodes that have left long ago too.
        left = (before.covered > 0.0) & (now.covered == 0.0)
        gone = left & (before.t_N < 0.0)
        for pair in self.interface.pairs:
            sides = self.sides[pair.name]
            if pair.name not in log.faced and all(now.covered[side.at].any() for side in sides):
                log = replace(log, faced=log.faced | {pair.name})
            if pair.name in self.torn and pair.name not in log.otherwise and not self._lies(pair, now):
                log = replace(log, otherwise=log.otherwise | {pair.name})
            # fault: heat ends beyond gap_max without a word -> if False: | contact/test_notes
            if pair.name in self.crosses and left.any():
                log = self._beyond(log, pair, t, sides[0].nodes[left[sides[0].at]], now)
            if gone.any():
                for side in sides:
                    suspects = side.nodes[gone[side.at]]
                    if suspects.size:
                        other = pair.master if side.own else pair.slave
                        log, said = self._classify(log, pair.name, t, _Suspects(side.surface, suspects, other), now)
                        notes += said
        return log, tuple(notes)

    def _lies(self, pair: Pair, now: ContactSample) -> bool:
        """Whether a pair's surfaces lie against each other and nothing presses them."""
        slave = self.sides[pair.name][0].at
        near = now.gap[slave][now.covered[slave] > 0.0]
        least = float(edge_lengths(self.interface, pair.slave).min())
        return bool(near.size) and not now.t_N[slave].any() and float(near.min()) <= LYING * least

    def _beyond(self, log: ContactLog, pair: Pair, t: float, nodes: NDArray[np.int32],
                now: ContactSample) -> ContactLog:
        """Count slave nodes that faced something and are now before the master, but farther off than gap_max."""
        depth, beside = behind(now.x[self.interface.surfaces[pair.master]], now.x[nodes])
        n = int((~beside & (-depth > BEYOND * pair.gap_max)).sum())
        if not n:
            return log
        earlier = log.far.get(pair.name, Slid(0, t))
        return replace(log, far={**log.far, pair.name: Slid(earlier.nodes + n, earlier.first)})

    def at_end(self, log: ContactLog, x: Floats) -> list[str]:
        """List the notes of a run that ended with the nodes at x : (n_nodes, 2) [m]."""
        notes = []
        for pair in self.interface.pairs:
            if pair.name not in log.faced and pair.slave != pair.master:
                notes.append(f"pair {pair.name}: {pair.slave} and {pair.master} never faced each other; in the end "
                             f"their nearest nodes are {nearest(self.interface, pair, x):.3g} m apart (gap_max "
                             f"{pair.gap_max:.3g} m)")
            if pair.name in log.slid:
                slid = log.slid[pair.name]
                notes.append(f"pair {pair.name}: {_nodes(slid.nodes)} of {pair.slave} slid off the end of "
                             f"{pair.master}, the first by t = {slid.first:.6g} s")
            if pair.name in log.far:
                far = log.far[pair.name]
                notes.append(f"pair {pair.name}: {_nodes(far.nodes)} of {pair.slave} went farther from {pair.master} "
                             f"than gap_max, {pair.gap_max:.3g} m, the first by t = {far.first:.6g} s: no heat crosses "
                             f"there, though at that gap {self.crosses[pair.name]:.3g} W/m2K would. State a larger "
                             "gap_max")
            notes += self._never_pressed(log, pair)
        return notes

    def _never_pressed(self, log: ContactLog, pair: Pair) -> list[str]:
        """Note surfaces that lay against each other for the whole run, and conducted as if they were apart."""
        apart, touching = self.torn.get(pair.name, (0.0, 0.0))
        # fault: surfaces that nothing presses conduct nothing without a word -> if True: | contact/test_notes
        if touching <= apart or pair.name in log.otherwise or pair.name not in log.faced or pair.tied:
            return []
        return [f"pair {pair.name}: {pair.slave} and {pair.master} lay against each other, but nothing ever pressed "
                f"them, so they conducted {apart:.3g} W/m2K as if they were apart, and not the {touching:.3g} W/m2K of "
                f"`closed`. State a pressure (half rigid: mechanical.rigid.pressure.{pair.name}), press them together, "
                "or let `open` conduct as much at no gap"]

    def _classify(self, log: ContactLog, name: str, t: float, who: _Suspects,
                  now: ContactSample) -> tuple[ContactLog, list[str]]:
        """Classify nodes of one side that pressed and now face nothing: pushed through, or slid off an end."""
        own, suspects, other = who.surface, who.nodes, who.other
        x = now.x[suspects]
        depth, beside = behind(now.x[self.interface.surfaces[other]], x)
        reach = float(max(edge_lengths(self.interface, own).max(), edge_lengths(self.interface, other).max()))
        pair = next(p for p in self.interface.pairs if p.name == name)
        # fault: nodes pushed through go by in silence -> through = beside & (depth > MAX_DEPTH * reach) |
        #   contact/test_notes
        through = ~beside & (depth > MAX_DEPTH * reach)
        notes = []
        if through.any() and name not in log.lost:
            log = replace(log, lost=log.lost | {name})
            notes.append(f"pair {name}: by t = {t:.6g} s {_nodes(int(through.sum()))} of {own} went through {other}, "
                         f"up to {depth[through].max():.3g} m deep, where contact (it looks "
                         f"{max(reach, search_depth(self.interface, pair)):.3g} m deep) no longer "
                         "pushes back: take smaller windows or a larger penalty")
        if own == pair.slave and beside.any():
            earlier = log.slid.get(name, Slid(0, t))
            log = replace(log, slid={**log.slid, name: Slid(earlier.nodes + int(beside.sum()), earlier.first)})
        return log, notes


def _nodes(n: int) -> str:
    return f"{n} nodes" if n > 1 else "1 node"


def behind(edges: Floats, points: Floats) -> tuple[Floats, Flags]:
    """Measure how far points lie behind a surface (n,) [m], < 0: before it, and whether (n,) beyond an end of it.

    edges : (n_edges, 2, 2) [m], the body on the left.  points : (n, 2) [m].  Each against its nearest edge.
    """
    a, tangent = edges[:, 0], edges[:, 1] - edges[:, 0]
    length = np.linalg.norm(tangent, axis=1)
    along = ((points[:, None] - a) * tangent).sum(axis=2) / length**2
    foot = a + np.clip(along, 0.0, 1.0)[..., None] * tangent
    distance = np.linalg.norm(points[:, None] - foot, axis=2)
    e, i = distance.argmin(axis=1), np.arange(len(points))
    outward = np.column_stack([tangent[:, 1], -tangent[:, 0]]) / length[:, None]
    depth = -((points - a[e]) * outward[e]).sum(axis=1)
    return depth, (along[i, e] < 0.0) | (along[i, e] > 1.0)
