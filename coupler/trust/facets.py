"""Whether the straight edges of curved surfaces are fine enough for the pressure between them.

Forces act between the edges as they are, unless a pair is `smooth`.  Where edges are chords of an arc, the gap between
two surfaces is not that of the arcs: an edge lies inside of a convex one by up to rise/4, outside of a hollow one.  On
meshes that match the two cancel; on others some places press and others are apart.  Beside what the bodies yield (see
penetration.py), or the interference of a fit if that is more, this is the share of a pressure that the edges made: of a
fit whose edges stray as far as it overlaps single pressures go from nothing to several times the mean, and the mean
hangs on which side is the slave.

The stray of a pair that states its fit is that between the slave's nodes alone: at these the gap is what is stated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.facing import Cut, cut_surfaces
from contact.half.interface import Interface, register_message, surface_names
from contact.rounding import rounding_of
from contact.surfaces import edge_frames, surfaces_of
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, measured
from coupler.trust.penetration import PairYield, Yields

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SHARES = (0.05, 0.5)
NAME = "edges fine enough for pressure"
FLAT = 1e-9  # of an edge: how numbers of what is straight are written
ALONE = 1e-30  # weight of a slave that faces nothing as drawn


@dataclass(frozen=True)
class FacetLog:
    """share : the largest stray over what matters, of `pair` at t [s]; stray : that stray [m].

    fit : whether what matters there was the interference at the start.
    """

    share: float = 0.0
    pair: str = ""
    t: float = 0.0
    stray: float = 0.0
    fit: bool = False


class Facets:
    """The pairs of a scene that press along straight edges which were drawn as chords."""

    def __init__(self, interface: Interface, yields: Yields) -> None:
        smooth = {pair.name for pair in interface.pairs if pair.smooth}
        rows = [pair for pair in yields.pairs if pair.name not in smooth]
        if not rows:
            self._pairs: list[tuple[PairYield, Array, float]] = []
            return
        strays, gap = strays_of(interface)
        depth = np.maximum(-gap, 0.0)
        self._pairs = [(pair, strays[pair.at], pair.drawn or float(depth[pair.at].mean())) for pair in rows
                       if strays[pair.at].any()]

    def __bool__(self) -> bool:
        return bool(self._pairs)

    def watched(self, log: FacetLog, now: Level) -> FacetLog:
        """Return the log after one more window."""
        for pair, strays, fit in self._pairs:
            load = pair.load(now)
            if not load.sum() > 0.0:
                continue
            stray = float(np.sqrt(load @ strays**2 / load.sum()))
            gives = pair.gives(now, load)
            # fault: the stray of edges is held against a metre -> matters = 1.0 + fit | coupler/test_trust_facets
            matters = max(gives, fit)
            if stray > log.share * matters:
                log = FacetLog(stray / matters, pair.name, now.t, stray, fit > gives)
        return log


def strays_of(interface: Interface) -> tuple[Array, Array]:
    """Return how far the gap strays from that between the arcs, (n_q,) [m] at pair nodes of slaves, 0 elsewhere, and
    the gap (n_q,) [m] at the start.

    The root of the mean square over what a node stands for, as drawn; where it faces nothing, that of the slave alone.
    """
    surfaces = surfaces_of(register_message(interface))
    r, x = surfaces.register, interface.nodes[interface.contact_nodes]
    length, normal = edge_frames(x, r.edges, surfaces.previous, surfaces.following)
    rise = rounding_of(x, r.edges, surfaces.previous, surfaces.following, r.axisymmetric, length, normal).rise
    rise[np.abs(rise) <= FLAT * length] = 0.0
    square, weight = np.zeros(interface.pair_nodes.size), np.zeros(interface.pair_nodes.size)
    cut = cut_surfaces(surfaces, x)
    if not rise.any():
        return square, cut.node_gap
    of = surfaces.pair_nodes
    for side in (side for side in interface.pair_sides if side.own):
        # The mean square of rise xi (1 - xi) is rise^2/30; it counts where there is nothing else.
        edges = np.searchsorted(side.nodes, interface.surfaces[side.surface])
        own = np.flatnonzero(r.edge_surface == surface_names(interface).index(side.surface))
        for end in range(2):
            np.add.at(square, side.at.start + edges[:, end], ALONE * length[own] * rise[own] ** 2 / 30.0)
            np.add.at(weight, side.at.start + edges[:, end], ALONE * length[own])
    xi, eta = cut.values[:, 0], cut.values[:, 1]
    # fault: the two sides' chords are not held against each other -> stray = rise[cut.met[:, 0]] * xi * (1.0 - xi) |
    #   coupler/test_trust_facets
    stray = rise[cut.met[:, 0]] * xi * (1.0 - xi) + rise[cut.met[:, 1]] * eta * (1.0 - eta)
    stated = np.isin(of.pair[cut.at[:, 0]], [k for k, p in enumerate(interface.pairs) if p.name in interface.offset])
    stray -= np.where(stated, _at_nodes(cut, rise), 0.0)
    for end, share in ((0, 1.0 - xi), (1, xi)):
        np.add.at(square, cut.at[:, end], share * cut.values[:, 3] * stray**2)
        np.add.at(weight, cut.at[:, end], share * cut.values[:, 3])
    return np.sqrt(np.divide(square, weight, out=np.zeros_like(square), where=weight > 0.0)), cut.node_gap


def _at_nodes(cut: Cut, rise: Array) -> Array:
    """Return the stray (n_p,) [m] that is linear along the edges of the slave, as it is at their nodes."""
    first, last = cut.values[::2], cut.values[1::2]
    _, edge = np.unique(np.column_stack([cut.number, cut.met[:, 0]])[::2], axis=0, return_inverse=True)
    edge = edge.ravel()
    slope = (last[:, 1] - first[:, 1]) / (last[:, 0] - first[:, 0])
    ends = np.empty((2, len(edge)))
    for end, order in ((0, np.argsort(-first[:, 0])), (1, np.argsort(first[:, 0]))):
        eta = np.clip(first + slope[:, None] * (end - first[:, :1]), 0.0, 1.0)[:, 1]
        found = np.empty(int(edge.max(initial=-1)) + 1)
        # The piece at this end of the edge comes last, and stays.
        found[edge[order]] = (rise[cut.met[::2, 1]] * eta * (1.0 - eta))[order]
        ends[end] = found[edge]
    xi = cut.values[:, 0]
    at = np.repeat(ends, 2, axis=1)
    return np.asarray((1.0 - xi) * at[0] + xi * at[1])


def checks(log: FacetLog, facets: Facets) -> tuple[Check, ...]:
    """Return the row at the end, where pairs press along chords."""
    if not facets:
        return ()
    by = "the interference of the fit" if log.fit else "the compression of the bodies over the contact zone"
    return (measured(NAME, log.share, SHARES, t=log.t,
                     what=f"pair {log.pair}: the straight edges of its curved surfaces stray from the arcs they are "
                          f"chords of by {log.stray:.3g} m, {100.0 * log.share:.3g} % of {by}, at t = {log.t:.6g} s; "
                          "single pressures are off by about this share or more, and hang on which side is the slave",
                     remedy="Set smooth: true in the pair, or use shorter edges"),)
