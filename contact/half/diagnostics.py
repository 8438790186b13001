"""What happens to contact while a run goes on that nobody asked about but should know.

A node that pressed at the end of one window and faces nothing at the end of the next has slid off the end, has been
lifted off farther than gap_max, or has been pushed through: deeper behind the other surface than the search looks,
where nothing pushes it back.  The last must not go by in silence.  Only such nodes are looked at: a window in which
there are none costs a few comparisons.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface
from contact.notes import edge_lengths, nearest
from contact.wire import Floats

Flags = NDArray[np.bool_]

# Rays reach an edge's length behind a surface, but along tilted normals; a node at the very end, sunk in by what the
# penalty takes, is far from this.
OUT_OF_REACH = 0.5


@dataclass(frozen=True)
class Contact:
    """x : (n_nodes, 2) [m].  t_N : (n_s,) [Pa], covered : (n_s,) share that faces something, of surface nodes."""

    x: Floats
    t_N: Floats
    covered: Floats


@dataclass(frozen=True)
class Slid:
    """Nodes that slid off an end: how many, and when the first one did [s]."""

    nodes: int
    first: float


@dataclass(frozen=True)
class Seen:
    """What was seen so far.

    faced : pairs of which something faced something.  slid : pair -> slave nodes that slid off.  lost : pairs of
    which a node went through.
    """

    faced: frozenset[str] = frozenset()
    slid: Mapping[str, Slid] = field(default_factory=dict)
    lost: frozenset[str] = frozenset()


class Watch:
    """Watches the pairs of a scene."""

    def __init__(self, interface: Interface) -> None:
        self.interface = interface

    @cached_property
    def sides(self) -> dict[str, tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Pair -> indices s of the nodes of its slave and of its master."""
        s = self.interface.contact_nodes
        surfaces = self.interface.surfaces
        return {p.name: (np.searchsorted(s, np.unique(surfaces[p.slave])),
                         np.searchsorted(s, np.unique(surfaces[p.master]))) for p in self.interface.pairs}

    def after(self, seen: Seen, t: float, before: Contact, now: Contact) -> tuple[Seen, tuple[str, ...]]:
        """What has been seen when a window ended at t [s], and what to say of it at once."""
        notes: list[str] = []
        # A rigid half tells the pressure of the whole surface, of nodes that have left long ago too.
        gone = (before.t_N < 0.0) & (before.covered > 0.0) & (now.covered == 0.0)
        for pair in self.interface.pairs:
            slave, master = self.sides[pair.name]
            if pair.name not in seen.faced and now.covered[slave].any() and now.covered[master].any():
                seen = replace(seen, faced=seen.faced | {pair.name})
            if gone.any():
                for own, nodes, other in ((pair.slave, slave, pair.master), (pair.master, master, pair.slave)):
                    suspects = nodes[gone[nodes]]
                    if suspects.size:
                        seen, said = self._judge(seen, pair.name, t, (own, suspects, other), now)
                        notes += said
        return seen, tuple(notes)

    def at_end(self, seen: Seen, x: Floats) -> list[str]:
        """What to say when a run has ended with the nodes at x : (n_nodes, 2) [m]."""
        notes = []
        for pair in self.interface.pairs:
            if pair.name not in seen.faced and pair.slave != pair.master:
                notes.append(f"pair {pair.name}: {pair.slave} and {pair.master} never faced each other; in the end "
                             f"their nearest nodes are {nearest(self.interface, pair, x):.3g} m apart (gap_max "
                             f"{pair.gap_max:.3g} m)")
            if pair.name in seen.slid:
                slid = seen.slid[pair.name]
                notes.append(f"pair {pair.name}: {_nodes(slid.nodes)} of {pair.slave} slid off the end of "
                             f"{pair.master}, the first by t = {slid.first:.6g} s")
        return notes

    def _judge(self, seen: Seen, name: str, t: float, who: tuple[str, NDArray[np.intp], str],
               now: Contact) -> tuple[Seen, list[str]]:
        """Nodes of one side that pressed and now face nothing: who : (surface, indices s, the other surface)."""
        own, suspects, other = who
        x = now.x[self.interface.contact_nodes[suspects]]
        depth, beside = behind(now.x[self.interface.surfaces[other]], x)
        reach = float(max(edge_lengths(self.interface, own).max(), edge_lengths(self.interface, other).max()))
        # fault: nodes pushed through go by in silence -> through = beside & (depth > OUT_OF_REACH * reach) |
        #   contact/test_notes
        through = ~beside & (depth > OUT_OF_REACH * reach)
        notes = []
        if through.any() and name not in seen.lost:
            seen = replace(seen, lost=seen.lost | {name})
            notes.append(f"pair {name}: by t = {t:.6g} s {_nodes(int(through.sum()))} of {own} went through {other}, "
                         f"up to {depth[through].max():.3g} m deep, where contact (it looks {reach:.3g} m deep) no "
                         "longer pushes back: take smaller windows or a larger penalty")
        slave = next(p.slave for p in self.interface.pairs if p.name == name)
        if own == slave and beside.any():
            known = seen.slid.get(name, Slid(0, t))
            seen = replace(seen, slid={**seen.slid, name: Slid(known.nodes + int(beside.sum()), known.first)})
        return seen, notes


def _nodes(n: int) -> str:
    return f"{n} nodes" if n > 1 else "1 node"


def behind(edges: Floats, points: Floats) -> tuple[Floats, Flags]:
    """How far points lie behind a surface [m] (< 0: before it), and whether they lie beside it, beyond an end.

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
