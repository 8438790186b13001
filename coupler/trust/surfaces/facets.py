"""Whether the straight edges of curved surfaces are fine enough for the pressure between them, and for their gap.

Forces act between the edges as they are, unless a pair is `smooth`.  Where edges are chords of an arc, the gap between
two surfaces is not that of the arcs: an edge lies inside of a convex one by up to rise/4, outside of a hollow one.  On
meshes that match the two cancel; on others some places press and others are apart.  Beside what the bodies yield (see
penetration.py), or the interference of a fit if that is more, this is the share of a pressure that the edges made: of a
fit whose edges stray as far as it overlaps single pressures go from nothing to several times the mean, and the mean
hangs on which side is the slave.  That share of the pressure then, over the largest mean pressure of the pair in the
run, is the number.

The stray of a pair that states its fit is that between the slave's nodes alone: at these the gap is what is stated, as
long as they face what they face in the drawing.  Meshes that match no longer do once a shaft has turned by half an edge
in its hub, so the stray is that at the end of each window.

The gap at the slave's nodes strays, too, where the master's edges are chords.  Heat allows for it (rounding.py of
contact); probes and rules of gaps do not, and surfaces touch too early or too late.  Of pairs that press, the pressure
tells it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.facing import Cut, cut_surfaces
from contact.half.interface import Interface
from contact.half.register import register_message, surface_names
from contact.rounding import rounding_of
from contact.surfaces import edge_frames, surfaces_of
from coupler.schemes.levels import Level
from coupler.trust.checks import Check, measured
from coupler.trust.surfaces.penetration import PairYield, Yields

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

SHARES = (0.05, 0.5)
NAME = "edges fine enough for pressure"
GAPS = "edges fine enough for gaps"
REMEDY = "Set smooth: true in the pair, or use shorter edges"
FLAT = 1e-9  # of an edge: how numbers of what is straight are written
ALONE = 1e-30  # weight of a slave that faces nothing as drawn


@dataclass(frozen=True)
class Strayed:
    """The window in which the edges of a pair made most pressure of their own.

    p [Pa]: so much.  stray [m]: of the edges, over what matters it is `share`.  fit : whether what matters was the
    interference at the start.  t [s]: the end of that window.
    """

    p: float = 0.0
    stray: float = 0.0
    share: float = 0.0
    fit: bool = False
    t: float = 0.0


@dataclass(frozen=True)
class FacetLog:
    """worst : pair -> where its edges made most pressure of their own.  most : pair -> its largest mean pressure [Pa].

    gap, gap_t : pair -> its largest mean gap between the arcs until it first pressed [m], and when [s].  pressed :
    pairs that did.
    """

    worst: Mapping[str, Strayed] = field(default_factory=dict)
    most: Mapping[str, float] = field(default_factory=dict)
    gap: Mapping[str, float] = field(default_factory=dict)
    gap_t: Mapping[str, float] = field(default_factory=dict)
    pressed: tuple[str, ...] = ()


class Facets:
    """The pairs of a scene that press along straight edges which were drawn as chords."""

    def __init__(self, interface: Interface, yields: Yields) -> None:
        smooth = {pair.name for pair in interface.pairs if pair.smooth}
        rows = [pair for pair in yields.pairs if pair.name not in smooth]
        self._pairs: list[tuple[PairYield, float]] = []
        self._strays: Mapping[str, Array] = {}
        if not rows:
            return
        self._chords = Chords(interface)
        if not self._chords.curved:
            return
        _, at_nodes, gap = self._chords.strays(interface.nodes)
        depth = np.maximum(-gap, 0.0)
        self._pairs = [(pair, pair.drawn or float(depth[pair.at].mean())) for pair in rows
                       if pair.name in self._chords.curved]
        self._strays = {pair.name: at_nodes[pair.at] for pair, _ in self._pairs if pair.name not in interface.offset}

    def __bool__(self) -> bool:
        return bool(self._pairs)

    def watched(self, log: FacetLog, now: Level) -> FacetLog:
        """Return the log after one more window."""
        at: Array | None = None
        for pair, fit in self._pairs:
            load = pair.load(now)
            if not load.sum() > 0.0:
                log = self._open(log, pair, now)
                continue
            log = log if pair.name in log.pressed else replace(log, pressed=(*log.pressed, pair.name))
            # Edges that face each other as drawn may have turned to face each other's nodes.
            # fault: edges stray as drawn, however a body turned -> at = self._chords.strays(self._chords.drawn)[0] |
            #   coupler/test_trust_facets::test_edges_that_match_stray_as_a_body_turns
            at = self._chords.strays(now.x)[0] if at is None else at
            strays = at[pair.at]
            stray = float(np.sqrt(load @ strays**2 / load.sum()))
            gives = pair.gives(now, load)
            # fault: the stray of edges is held against a metre -> matters = 1.0 + fit | coupler/test_trust_facets
            matters = max(gives, fit)
            p = float(load @ np.maximum(-now.t_N[pair.at], 0.0) / load.sum())
            log = replace(log, most={**log.most, pair.name: max(p, log.most.get(pair.name, 0.0))})
            found = Strayed(p * stray / matters, stray, stray / matters, fit > gives, now.t)
            if found.p > log.worst.get(pair.name, Strayed()).p:
                log = replace(log, worst={**log.worst, pair.name: found})
        return log

    def _open(self, log: FacetLog, pair: PairYield, now: Level) -> FacetLog:
        if pair.name not in self._strays or pair.name in log.pressed:
            return log
        gap = now.gap[pair.at] - self._strays[pair.name]
        facing = np.isfinite(gap)
        mean = float(gap[facing].mean()) if facing.any() else 0.0
        if mean <= log.gap.get(pair.name, 0.0):
            return log
        return replace(log, gap={**log.gap, pair.name: mean}, gap_t={**log.gap_t, pair.name: now.t})

    def off(self, log: FacetLog) -> tuple[float, str, float, float]:
        """Return the largest share of its largest gap that the gap of a pair strays by, the pair, its stray [m], t [s].

        Of pairs that never pressed; ("", 0) without any.
        """
        strays = {name: float(np.abs(self._strays[name]).mean()) for name in log.gap if name not in log.pressed}
        return max(((stray / log.gap[name], name, stray, log.gap_t[name]) for name, stray in strays.items()),
                   default=(0.0, "", 0.0, 0.0))


class Chords:
    """The edges of a scene's pairs beside the arcs that they are chords of, as drawn.

    drawn : (n_nodes, 2) [m].  curved : names of the pairs of which a side has an edge that was drawn as a chord.
    """

    def __init__(self, interface: Interface) -> None:
        self._interface, self._surfaces = interface, surfaces_of(register_message(interface))
        self.drawn = interface.nodes
        surfaces, r = self._surfaces, self._surfaces.register
        x = interface.nodes[interface.contact_nodes]
        length, normal = edge_frames(x, r.edges, surfaces.previous, surfaces.following)
        rise = rounding_of(x, r.edges, surfaces.previous, surfaces.following, r.axisymmetric, length, normal).rise
        rise[np.abs(rise) <= FLAT * length] = 0.0
        self._rise = rise
        # The mean square of rise xi (1 - xi) is rise^2/30; it counts where there is nothing else.
        self._alone = np.zeros((2, interface.pair_nodes.size))
        for side in (side for side in interface.pair_sides if side.own):
            edges = np.searchsorted(side.nodes, interface.surfaces[side.surface])
            own = np.flatnonzero(r.edge_surface == surface_names(interface).index(side.surface))
            for end in range(2):
                at = side.at.start + edges[:, end]
                np.add.at(self._alone[0], at, ALONE * length[own] * rise[own] ** 2 / 30.0)
                np.add.at(self._alone[1], at, ALONE * length[own])
        self._fits = [k for k, pair in enumerate(interface.pairs) if pair.name in interface.offset]
        names = surface_names(interface)
        round_ones = {names[k] for k in np.unique(r.edge_surface[rise != 0.0])}
        self.curved = frozenset(pair.name for pair in interface.pairs if round_ones & {pair.slave, pair.master})
        cut = cut_surfaces(surfaces, x)
        self._stated = self._nodal(cut, _at_ends(cut, rise))

    def strays(self, x: Array) -> tuple[Array, Array, Array]:
        """Return how far the gap strays from that between the arcs, (n_q,) [m] at pair nodes of slaves, 0 elsewhere; by
        how much it is larger at the nodes themselves, (n_q,) [m]; and the gap (n_q,) [m]; x : (n_nodes, 2) [m].

        The first is the root of the mean square over what a node stands for; where it faces nothing, that of the slave
        alone.  Of a pair that states its fit, what its nodes were off by as drawn is in the statement.
        """
        rise, (square, weight) = self._rise, self._alone.copy()
        cut = cut_surfaces(self._surfaces, x[self._interface.contact_nodes])
        xi, eta = cut.values[:, 0], cut.values[:, 1]
        # fault: the two sides' chords are not held against each other -> stray = rise[cut.met[:, 0]] * xi * (1.0 - xi)
        #   | coupler/test_trust_facets
        stray = rise[cut.met[:, 0]] * xi * (1.0 - xi) + rise[cut.met[:, 1]] * eta * (1.0 - eta)
        stated = np.isin(self._surfaces.pair_nodes.pair[cut.at[:, 0]], self._fits)
        along = self._stated[cut.at]
        stray -= np.where(stated, (1.0 - xi) * along[:, 0] + xi * along[:, 1], 0.0)
        for end, share in ((0, 1.0 - xi), (1, xi)):
            np.add.at(square, cut.at[:, end], share * cut.values[:, 3] * stray**2)
            np.add.at(weight, cut.at[:, end], share * cut.values[:, 3])
        rms = np.sqrt(np.divide(square, weight, out=np.zeros_like(square), where=weight > 0.0))
        return rms, self._nodal(cut, _at_ends(cut, rise)), cut.node_gap

    def above(self, x: Array) -> tuple[Cut, Array, NDArray[np.integer[Any]]]:
        """Return what faces what at x : (n_nodes, 2) [m] between edges, how far arcs are above these there, (n_p,) [m],
        and the pair of each point.
        """
        cut = cut_surfaces(self._surfaces, x[self._interface.contact_nodes])
        xi, eta = cut.values[:, 0], cut.values[:, 1]
        rise = self._rise[cut.met[:, 0]] * xi * (1.0 - xi) + self._rise[cut.met[:, 1]] * eta * (1.0 - eta)
        return cut, rise, self._surfaces.pair_nodes.pair[cut.at[:, 0]]

    def _nodal(self, cut: Cut, at_ends: Array) -> Array:
        nodal, pieces = np.zeros(self._interface.pair_nodes.size), np.zeros(self._interface.pair_nodes.size)
        for end in range(2):
            np.add.at(nodal, cut.at[::2, end], at_ends[end])
            np.add.at(pieces, cut.at[::2, end], 1.0)
        return nodal / np.maximum(pieces, 1.0)


def _at_ends(cut: Cut, rise: Array) -> Array:
    """Return the stray (2, n_pieces) [m] at both nodes of the slave's edge of each piece."""
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
    return ends


def checks(log: FacetLog, facets: Facets) -> tuple[Check, ...]:
    """Return the rows at the end, where pairs press along chords, and where gaps are those of chords."""
    if not facets:
        return ()
    # Where a ball touches, one edge presses, and faintly: most of that is the edge's doing, and nothing of the answer.
    # fault: an edge that makes the first touch is told -> off = {name: of.share for name, of in log.worst.items()} |
    #   coupler/test_trust_facets::test_the_first_touch_of_a_ball_counts_by_its_pressure
    off = {name: of.p / log.most[name] for name, of in log.worst.items()}
    name = max(off, key=lambda one: off[one], default="")
    of, share = log.worst.get(name, Strayed()), off.get(name, 0.0)
    by = "the interference of the fit" if of.fit else "the compression of the bodies over the contact zone"
    rows = [measured(NAME, share, SHARES, t=of.t,
                     what=f"pair {name}: the straight edges of its curved surfaces stray from the arcs they are "
                          f"chords of by {of.stray:.3g} m, {100.0 * of.share:.3g} % of {by}, at t = {of.t:.6g} s; "
                          f"single pressures are off by {100.0 * share:.3g} % of the largest mean pressure of the pair "
                          "or more, and hang on which side is the slave",
                     remedy=REMEDY)]
    share, pair, stray, t = facets.off(log)
    # fault: gaps of chords are not told -> if not pair and facets: | coupler/test_trust_facets
    if pair:
        rows.append(measured(GAPS, share, SHARES, t=t,
                             what=f"pair {pair}: the gaps at its nodes are those to straight edges, which stray from "
                                  f"their arcs by {stray:.3g} m, {100.0 * share:.3g} % of the pair's largest gap: gaps "
                                  "are off by as much, and surfaces touch too early or too late; the heat across the "
                                  "gap allows for it", remedy=REMEDY))
    return tuple(rows)
