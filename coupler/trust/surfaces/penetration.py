"""How much of a pressure may be missing because surfaces overlap: their overlap against what matters.

A penetration is small or large beside the depth that the bodies give way by: g_N against p (1/M_s + 1/M_m) L, with L
the width of the contact zone or what the thinner body measures behind it, whichever is less (Hertz: about the
indentation of the zone; a bar: its shortening).  Where bodies are drawn into each other that depth is known: the
interference.  The overlap is the mean over the pressed nodes of a pair's slave, weighted by their pressure: the work
that is lost in it over that of the bodies.  The largest overlap would do for no mesh: at a corner the pressure has no
bound, and its overlap grows with each refinement.

Of an augmented pair no pressure is missing: its multipliers are found so that the gap of what a node faces is zero in
the mean.  Where meshes differ, at corners and on curves its nodes overlap all the same, however little presses.  Such a
pair is held against an interference as drawn alone.

Of a pair with one point a slave node (`form: nodes`) nothing is felt between these: a node of the master there, or one
of the slave beside the master's end, sinks in as far as the bodies let it.  Such a pair, augmented or not, is held by
the deepest node of either side.  Where it sinks in and nothing of the pair presses, all of the pressure is missing, and
the run is not to be trusted.  So it is of an augmented pair where a corner sinks in, and nothing presses by the end: on
one long edge a corner may lie deep though the gap of the edge is positive in the mean.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface, Pair
from contact.half.outlines import cell_sizes, depths, outline_of, thickness_behind
from contact.leaning import LEAN_COS
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict, measured

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SHARES = (0.01, np.inf)  # noted; how much of a pressure it spoils hangs on what presses, so it breaks nothing
SHARE = "penetration against what bodies yield"
FAINT = 1e-6  # of the largest load of the pair so far: less is the touch that a window ended at
UNPRESSED = 1e-4  # of the slave's mean part of a node: less is round-off, or the touch that a window ended at


@dataclass(frozen=True)
class PenetrationLog:
    """share : the largest penetration over what matters, of `pair` at t [s]; depth : that penetration [m].

    drawn : whether what matters there was the interference as drawn.  between : whether it is that of one node, where
    no point of the slave presses.  unpressed : the deepest node [m] of a pair of which nothing pressed, of
    `unpressed_pair` at unpressed_t [s]; by_node : whether that has one point a slave node.  most : pair -> the largest
    load of its slave so far [N/m].
    """

    share: float = 0.0
    pair: str = ""
    t: float = 0.0
    depth: float = 0.0
    drawn: bool = False
    between: bool = False
    unpressed: float = 0.0
    unpressed_pair: str = ""
    unpressed_t: float = 0.0
    most: Mapping[str, float] = field(default_factory=dict)
    by_node: bool = False


@dataclass(frozen=True)
class PairYield:
    """A pair whose bodies are known to yield.

    at : (n,) pair nodes of its slave, nodes : (n,) of the mesh, reach : (n,) [m] their share of the surface.
    softness : (n,) 1/M_s + 1/M_m [1/Pa], thick : [m] the thinner body.  drawn : [m] mean depth as drawn, 0: none.
    both : (m,) pair nodes of both sides, of a pair with one point a slave node, else (0,).
    corners : (m,) pair nodes of both sides at corners, of any other pair, else (0,).
    """

    name: str
    at: Indices
    nodes: Indices
    reach: Array
    softness: Array
    thick: float
    drawn: float
    both: Indices
    corners: Indices

    def load(self, now: Level) -> Array:
        """Return what each slave node carries, (n,) [N/m], 0 where none presses."""
        return np.asarray(np.maximum(-now.t_N[self.at], 0.0) * self.reach * now.covered[self.at])

    def gives(self, now: Level, load: Array) -> float:
        """Return how far [m] both bodies yield to a load: over its width, or the thinner body if that is less."""
        width = float((self.reach * now.covered[self.at])[load > 0.0].sum())
        p = np.maximum(-now.t_N[self.at], 0.0)
        return float(load @ (p * self.softness) / load.sum()) * min(width, self.thick)


class Yields:
    """The pairs of a scene whose bodies have a stiffness."""

    def __init__(self, interface: Interface, augmented: Container[str] = ()) -> None:
        """augmented : names of pairs whose pressure is not their overlap times a penalty."""
        self.pairs = [y for pair in interface.pairs if (y := _yield_of(interface, pair)) is not None]
        self._augmented, self._nodes = augmented, interface.pair_nodes

    def __bool__(self) -> bool:
        return bool(self.pairs)

    def remedy(self, pair: str) -> str:
        """Return what lets the surfaces of a pair overlap less."""
        # fault: a pair that has it is told to take augmented -> if True: | coupler/test_penetration
        if pair not in self._augmented:
            return "Set augmented: {} in the pair, or use a finer mesh"
        return ("Use shorter edges there, and smooth: true where both sides are round: the pair is augmented, so what "
                "a node faces overlaps by nothing in the mean")

    def watched(self, log: PenetrationLog, now: Level) -> PenetrationLog:
        """Return the log after one more window."""
        for pair in self.pairs:
            # fault: an overlap of augmented surfaces is held against a pressure not due to it -> held = False |
            #   coupler/test_penetration
            held = pair.name in self._augmented and not pair.drawn
            load = pair.load(now)
            if held and not pair.both.size:
                log = self._sunk(pair, log, now, float(load.sum()))
                continue
            # fault: of points at nodes what lies between them is not told -> deepest = 0.0 | coupler/test_penetration
            deepest = float(np.fmax.reduce(-now.gap[pair.both], initial=0.0))
            if not load.sum() > 0.0:
                # fault: what sinks in where nothing presses is passed over -> if False: | coupler/test_penetration
                if deepest > max(UNPRESSED * float(pair.reach.mean()), log.unpressed):
                    log = replace(log, unpressed=deepest, unpressed_pair=pair.name, unpressed_t=now.t, by_node=True)
                continue
            total, most = float(load.sum()), log.most.get(pair.name, 0.0)
            # A window that ends where a pair parts leaves a load of round-off, to which no overlap belongs.
            # fault: the overlap of a touch is held against its load -> if False: | coupler/test_penetration
            if total < FAINT * most and not pair.both.size:
                continue
            if total > most:
                log = replace(log, most={**log.most, pair.name: total})
            depth = 0.0 if held else float(load @ np.maximum(-now.gap[pair.at], 0.0) / load.sum())
            # fault: penetration held against a metre -> matters = 1.0 + pair.drawn | coupler/test_penetration
            matters = pair.drawn or pair.gives(now, load)
            if max(depth, deepest) > log.share * matters:
                log = replace(log, share=max(depth, deepest) / matters, pair=pair.name, t=now.t,
                              depth=max(depth, deepest), drawn=pair.drawn > 0.0, between=deepest > depth)
        return log

    def _sunk(self, pair: PairYield, log: PenetrationLog, now: Level, load: float) -> PenetrationLog:
        """Return the log with the corner that lies deepest in an augmented pair of which nothing pressed so far.

        load : of the pair now [N/m].  What presses later is soon as if it had always: that pair's corners are
        forgotten.  A corner that another pair presses is held by that.
        """
        if load > 0.0:
            mine = log.unpressed_pair == pair.name
            return replace(log, most={**log.most, pair.name: max(load, log.most.get(pair.name, 0.0))},
                           unpressed=0.0 if mine else log.unpressed)
        # fault: a corner that another pair presses sinks in -> held = pair.corners < 0 | coupler/test_penetration
        held = np.isin(self._nodes[pair.corners], self._nodes[now.t_N < 0.0])
        # fault: a corner that sinks in where multipliers press nowhere is passed over -> deepest = 0.0 |
        #   coupler/test_penetration
        deepest = float(np.fmax.reduce(-now.gap[pair.corners[~held]], initial=0.0))
        if pair.name in log.most or not deepest > max(UNPRESSED * float(pair.reach.mean()), log.unpressed):
            return log
        return replace(log, unpressed=deepest, unpressed_pair=pair.name, unpressed_t=now.t, by_node=False)


def _corners(interface: Interface, pair: Pair) -> Indices:
    """Return the pair nodes of both sides where a surface ends, or turns by more than 20 degrees."""
    found = []
    for name in (pair.slave, pair.master):
        side, edges = interface.side_of(pair.name, name), interface.surfaces[name]
        along = interface.nodes[edges[:, 1]] - interface.nodes[edges[:, 0]]
        along /= np.linalg.norm(along, axis=1)[:, None]
        leaves = dict(zip(edges[:, 0].tolist(), along, strict=True))
        meets = dict(zip(edges[:, 1].tolist(), along, strict=True))
        found += [side.at.start + k for k, node in enumerate(side.nodes.tolist())
                  if node not in leaves or node not in meets or leaves[node] @ meets[node] < LEAN_COS]
    return np.array(found, dtype=np.intp)


def _yield_of(interface: Interface, pair: Pair) -> PairYield | None:
    sides = (pair.slave, pair.master)
    if pair.tied or pair.slave == pair.master or not all(side in interface.stiffness for side in sides):
        return None
    own, edges = interface.side_of(pair.name, pair.slave), interface.surfaces[pair.slave]
    place = np.searchsorted(own.nodes, edges)
    length = np.linalg.norm(interface.nodes[edges[:, 1]] - interface.nodes[edges[:, 0]], axis=1)
    soft = [1.0 / (interface.stiffness[side] * cell_sizes(interface, interface.surfaces[side])) for side in sides]
    reach, softness = np.zeros(own.nodes.size), np.zeros(own.nodes.size)
    for end in range(2):
        np.add.at(reach, place[:, end], 0.5 * length)
        np.add.at(softness, place[:, end], 0.5 * length * soft[0])
    thick = thickness_behind(interface, pair)
    both = [np.arange(side.at.start, side.at.stop) for side in interface.pair_sides if side.pair == pair.name]
    return PairYield(pair.name, np.arange(own.at.start, own.at.stop), own.nodes.astype(np.intp), reach,
                     softness / reach + float(soft[1].mean()), thick if thick > 0.0 else np.inf,
                     0.0 if pair.name in interface.offset else _drawn(interface, pair, own.nodes.astype(np.intp)),
                     np.concatenate(both) if pair.by_node else np.empty(0, dtype=np.intp),
                     np.empty(0, dtype=np.intp) if pair.by_node else _corners(interface, pair))


def _drawn(interface: Interface, pair: Pair, nodes: Indices) -> float:
    """Return the mean depth [m] of the slave's nodes that are drawn inside the other body; 0 where none is."""
    body = int(interface.node_body[interface.surfaces[pair.master].flat[0]])
    edges = outline_of(interface, body)
    deep = depths(interface.nodes[nodes], interface.nodes[edges[:, 0]], interface.nodes[edges[:, 1]])
    size = float(np.ptp(interface.nodes, axis=0).max())
    inside = deep > 1e-9 * size  # less is how numbers are written
    return float(deep[inside].mean()) if inside.any() else 0.0


def check(log: PenetrationLog, yields: Yields, prescribed: bool) -> Check:
    """Return the check at the end.  prescribed : bodies move as the scenario says, whatever they press."""
    if prescribed or not yields:
        return Check(SHARE, TrustVerdict.UNCHECKED, what="no pair has two deformable bodies")
    if log.unpressed > 0.0:
        what, why, remedy = (
            ("node", "with form: nodes only the slave's nodes press",
             "Use form: edges, which also presses between nodes, or a slave with shorter edges") if log.by_node else
            ("corner", "the edges beside it are so long that they are apart in the mean", "Use shorter edges there"))
        return Check(SHARE, TrustVerdict.BROKEN, 1.0, SHARES[0], t=log.unpressed_t, remedy=remedy,
                     what=f"pair {log.unpressed_pair}: a {what} penetrates by {log.unpressed:.3g} m without any "
                          f"pressure, at t = {log.unpressed_t:.6g} s: {why}")
    by = "the interference as drawn" if log.drawn else "the compression of the bodies over the contact zone"
    if log.between:
        return measured(SHARE, log.share, SHARES, t=log.t,
                        what=f"pair {log.pair}: a node penetrates by {log.depth:.3g} m, {100 * log.share:.3g} % of "
                             f"{by}, at t = {log.t:.6g} s: with form: nodes only the slave's nodes press",
                        remedy="Use form: edges, which also presses between nodes, or let nodes face each other")
    return measured(SHARE, log.share, SHARES, t=log.t,
                    what=f"pair {log.pair}: pressed surfaces overlap by {log.depth:.3g} m on average, "
                         f"{100 * log.share:.3g} % of {by}, at t = {log.t:.6g} s; if a displacement or expansion "
                         "makes the pressure, this share of it may be missing",
                    remedy=yields.remedy(log.pair))
