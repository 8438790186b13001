"""Whether contact conducts so well that meshes whose nodes do not face each other hold each other.

Temperatures are linear along the edges of either side.  Where contact passes far more heat than the cells behind it, a
pair asks them to agree everywhere along the surface, and where edges end at other places they can only if they are
linear along all of it: the mesh of the surface is lost, and the answer gets worse as the conductance grows.  Measured
is the conductance over that of the two cells in a row, k/l, at pressed nodes of the slave that lie inside an edge of
the master and have a node of the master inside an edge of their own.  Steps of 500 K beside such a contact on meshes of
4 and 7 cells (docs/trust.md) are 6 % of the span off at 200 times, and 20 % at 2000; where nodes face each other, or
there is one point a node, 4 and 2 % at any.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Property, property_from
from contact.half.interface import Interface, Pair, cell_sizes
from contact.half.outlines import cross
from contact.laws import Law, closed_conductance, parse_law
from contact.penalty import in_a_row
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, TrustVerdict, measured

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

NAME = "contact against the cells that meet"
LIMITS = (200.0, np.inf)  # noted; how much of a temperature it spoils hangs on how that varies along the surface
ON_NODE = 1e-3  # of an edge: what is nearer to a node faces it
NEAR = 0.1  # of an edge: what is farther off does not touch it


@dataclass(frozen=True)
class ContactCellsLog:
    """share : the largest conductance over that of the cells, of `pair` at t [s].  h : that conductance [W/m2K]."""

    share: float = 0.0
    pair: str = ""
    t: float = 0.0
    h: float = 0.0


@dataclass(frozen=True)
class _Conductivity:
    """Of a solid, along its two axes."""

    k_1: Property
    k_2: Property

    def at(self, T: float) -> float:
        """Return sqrt(k_1 k_2) [W/mK] at T [K]."""
        at = np.array([T])
        return float(np.sqrt(self.k_1(at) * self.k_2(at))[0])


@dataclass(frozen=True)
class _Side:
    """The cells behind a surface.  edges : (m, 2).  k : (part's conductivity, its edges : (n,)), each once.

    weight : (m,) [1/m], 1/l of the cells, weighted with the lengths of their edges.
    """

    edges: Indices
    k: tuple[tuple[_Conductivity, Indices], ...]
    weight: Array

    def conductance(self, T: float) -> float:
        """Return the mean over the edges of k/l [W/m2K] at T [K]."""
        return sum(k.at(T) * float(self.weight[of].sum()) for k, of in self.k)


@dataclass(frozen=True)
class _Joint:
    """A pair that conducts where it is pressed.  at : (n,) pair nodes of its slave, nodes : (n,) of the mesh."""

    pair: Pair
    law: Law
    at: Indices
    nodes: Indices
    slave: _Side
    master: _Side


class ContactCells:
    """The pairs of a scene whose contact conducts, and the cells behind their surfaces."""

    def __init__(self, interface: Interface, thermal: Mapping[str, Any]) -> None:
        """thermal : model.json of the thermal half; of another kind than `thermal` nothing is known."""
        known = thermal.get("half") == "thermal"
        self._joints = [_joint_of(interface, pair, thermal) for pair in interface.pairs
                        if known and not pair.by_node and pair.slave != pair.master
                        and (thermal.get("pairs", {}).get(pair.name, {}).get("conduction") or {}).get("closed")]

    def __bool__(self) -> bool:
        return bool(self._joints)

    def watched(self, log: ContactCellsLog, now: Level) -> ContactCellsLog:
        """Return the log after one more window."""
        for joint in self._joints:
            p = np.maximum(-now.t_N[joint.at], 0.0)
            touches = (now.covered[joint.at] > 0.0) if joint.pair.tied else p > 0.0
            if not touches.any():
                continue
            T = now.T[joint.nodes]
            h = np.where(touches, closed_conductance(joint.law, p, T)[0], 0.0)
            mean = float(T[touches].mean())
            # fault: contact is held against one side's cells -> cells = joint.slave.conductance(mean) |
            #   coupler/test_contact_cells
            cells = in_a_row(joint.slave.conductance(mean), joint.master.conductance(mean))
            # Only where it is much it matters where the nodes are.
            if not h.max() > max(log.share, LIMITS[0]) * cells:
                continue
            # fault: nodes that face each other are told as others -> beside = touches | coupler/test_contact_cells
            beside = touches & _beside(joint, now.x)
            worst = float(h[beside].max(initial=0.0))
            # fault: contact that conducts far better than cells is not told -> if False: | coupler/test_contact_cells
            if worst > log.share * cells:
                log = ContactCellsLog(worst / cells, joint.pair.name, now.t, worst)
        return log


def _joint_of(interface: Interface, pair: Pair, thermal: Mapping[str, Any]) -> _Joint:
    own = interface.side_of(pair.name, pair.slave)
    slave, master = (_side_of(interface, surface, thermal) for surface in (pair.slave, pair.master))
    law = parse_law(thermal["pairs"][pair.name]["conduction"]["closed"])
    return _Joint(pair, law, np.arange(own.at.start, own.at.stop), own.nodes.astype(np.intp), slave, master)


def _side_of(interface: Interface, surface: str, thermal: Mapping[str, Any]) -> _Side:
    edges = interface.surfaces[surface]
    parts = interface.edge_parts(edges)
    length = np.linalg.norm(interface.nodes[edges[:, 1]] - interface.nodes[edges[:, 0]], axis=1)
    k = tuple((_conductivity(thermal, interface.parts[part]), np.flatnonzero(parts == part))
              for part in np.unique(parts))
    return _Side(edges.astype(np.intp), k, length / length.sum() / cell_sizes(interface, edges))


def _conductivity(thermal: Mapping[str, Any], part: str) -> _Conductivity:
    body, _, region = part.partition(".")
    of = thermal["bodies"][body]
    k = thermal["materials"][(of["regions"][region] if region else of)["material"]]["k"]
    axes = (k["k_1"], k["k_2"]) if isinstance(k, Mapping) and "k_2" in k else (k, k)
    solid = (v["solid"] if isinstance(v, Mapping) and "solid" in v else v for v in axes)
    return _Conductivity(*(property_from(v) for v in solid))


def _beside(joint: _Joint, x: Array) -> NDArray[np.bool_]:
    """Return (n,) which of the slave's nodes lie inside an edge of the master, with a master's node inside one of
    theirs.  x : (n_nodes, 2) [m].
    """
    inside = _inside(x, joint.slave.edges, np.unique(joint.master.edges)).any(axis=1)
    free = np.isin(joint.nodes, joint.slave.edges[inside])
    return np.asarray(free & _inside(x, joint.master.edges, joint.nodes).any(axis=0))


def _inside(x: Array, edges: Indices, nodes: Indices) -> NDArray[np.bool_]:
    """Return (n_edges, n_nodes) which nodes lie on which edges, at none of their ends.  x : (n_nodes, 2) [m]."""
    along = x[edges[:, 1]] - x[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    to = (x[nodes][None] - x[edges[:, 0]][:, None]) / length[:, None, None]
    s = (to * (along / length[:, None])[:, None]).sum(axis=2)
    off = np.abs(cross(along[:, None] / length[:, None, None], to))
    return np.asarray((s > ON_NODE) & (s < 1.0 - ON_NODE) & (off < NEAR))


def check(log: ContactCellsLog, cells: ContactCells) -> Check:
    """Return the check at the end."""
    if not cells:
        return Check(NAME, TrustVerdict.UNCHECKED, what="no pair conducts under pressure inside edges")
    return measured(NAME, log.share, LIMITS, t=log.t,
                    what=f"pair {log.pair} has a conductance of {log.h:.3g} W/m2K at t = {log.t:.6g} s, "
                         f"{log.share:.3g} times that of the cells on both sides, and its nodes do not face "
                         "each other: temperatures that change along "
                         "the surface are as inaccurate as on a mesh without nodes there",
                    remedy="Let nodes face each other, or set form: nodes in the pair, or use a smaller conductance "
                           "or a finer mesh beside the surface")
