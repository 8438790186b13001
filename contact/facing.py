"""What faces what at coordinates x: the contact quadrature points of all passes, and the reply to a Project request."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.compiled import kernel
from contact.faced import Rise
from contact.leaning import AS_DRAWN, Follows, leaned_normals
from contact.messages import Facing, Floats, Ints
from contact.pair_nodes import pair_nodes_at
from contact.rounding import end_turns, rounding_of, turned_ends
from contact.search import pass_points
from contact.surfaces import RegisteredSurfaces, checked_reals, edge_frames
from contact.tied import points_now

AXIS_TOLERANCE = 1e-9  # of the scene's radius: how far beyond the axis a node may lie


@dataclass(frozen=True)
class Cut:
    """All contact quadrature points of a scene, in one table, and what was computed on the way.

    number : (n_p,) of the pass.  met : (n_p, 2) slave and master edge.
    at : (n_p, 4) pair nodes, the slave edge's two, then the master edge's two.  shape : (n_p,) which of normals.
    values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2]; (n_p, 7) with wide_s, wide_m [1] where mutual.
    normals : (k, n_edges, 3, 2) [1] as from contact.surfaces, then those of Shapes, or contact.rounding where mutual.
    follows : (k, n_edges, 2) what the normals at the ends of edges turn with, as in contact.leaning.
    node_gap : (n_q,) [m] and node_covered : (n_q,) [1] as in Facing.  The two points of a piece are neighbours.
    """

    number: Ints
    met: Ints
    at: Ints
    shape: Ints
    values: Floats
    normals: Floats
    follows: Follows
    node_gap: Floats
    node_covered: Floats


@dataclass(frozen=True)
class Shapes:
    """How forces see edges: row 0 straight, row 1, where a pair is smooth, as round as they are drawn, and a row for
    each pass whose corners lean to what they meet.

    of : (n_passes,) the row of each pass.  rise : (k, n_edges) [m] and angle : (n_edges, 2) [rad], where a pair is
    smooth, as in contact.rounding.  leaning : the passes of the last rows.
    """

    of: Ints
    rise: Floats
    angle: Floats | None
    leaning: Ints

    def normals(self, surfaces: RegisteredSurfaces, x: Floats, length: Floats,
                normal: Floats) -> tuple[Floats, Follows]:
        """Return the normals (k, n_edges, 3, 2) [1] and what they turn with, (k, n_edges, 2), as in contact.leaning.

        x : (n_s, 2) [m].  length : (n_edges,) [m] and normal : (n_edges, 3, 2) [1] those of the edges.
        """
        rows = [normal] if self.angle is None else [normal, turned_ends(normal, self.angle)]
        follows = np.full((len(self.rise), len(normal), 2), AS_DRAWN, dtype=np.int32)
        for i in self.leaning:
            leaned, follows[len(rows)] = leaned_normals(surfaces, x, length, normal, rows[surfaces.smooth[i]], int(i))
            rows.append(leaned)
        return rows[0][None] if len(rows) == 1 else np.stack(rows), follows


def shapes_of(surfaces: RegisteredSurfaces) -> Shapes:
    """Return how forces see the edges of these surfaces, found once."""
    if "shapes" not in surfaces.found:
        of, p, angle = surfaces.smooth.copy(), surfaces.passes, None
        rise = [np.zeros(len(surfaces.register.edges))]
        if of.any():
            drawn, angle = _drawn(surfaces)
            rise.append(drawn)
        leaning = np.flatnonzero((surfaces.leaning == 1) & (surfaces.tied == 0) & (p.slave != p.master))
        for i in leaning:
            rise.append(rise[of[i]])
            of[i] = len(rise) - 1
        surfaces.found["shapes"] = Shapes(of, np.stack(rise), angle, leaning.astype(np.int32))
    shapes = surfaces.found["shapes"]
    assert isinstance(shapes, Shapes)
    return shapes


def project(surfaces: RegisteredSurfaces, x: Floats) -> Facing:
    """Find the contact quadrature points at coordinates x : (n_s, 2) [m].

    Raises ValueError where x is no possible geometry.
    """
    c = cut_surfaces(surfaces, x, mutual=True)
    slave_edge, master_edge = np.ascontiguousarray(c.met.T)
    xi_s, xi_m, gap, area, area_m, wide_s, wide_m = np.ascontiguousarray(c.values.T)
    return Facing(surfaces.passes.pair[c.number], slave_edge, master_edge, xi_s, xi_m, gap, area, area_m, wide_s,
                  wide_m, c.node_gap, c.node_covered)


def cut_surfaces(surfaces: RegisteredSurfaces, x: Floats, mutual: bool = False) -> Cut:
    """Cut the slave edges of every pass at x : (n_s, 2) [m], by arcs if mutual, else by rays.  Raises ValueError."""
    r = surfaces.register
    x = checked_reals("x", x, (r.n_nodes, 2))
    length, normal = edge_frames(x, r.edges, surfaces.previous, surfaces.following)
    _check_geometry(surfaces, x, length)
    rise: Rise = None
    shapes = shapes_of(surfaces)
    normals, follows = ((normal[None], np.full((1, len(normal), 2), AS_DRAWN, dtype=np.int32)) if mutual
                        else shapes.normals(surfaces, x, length, normal))
    if mutual:
        rounding = rounding_of(x, r.edges, surfaces.previous, surfaces.following, r.axisymmetric, length, normal)
        # fault: edges that bend are round to heat -> normals, rise = rounding.normal[None],
        #   rounding.rise |
        #   scenarios/test_contact_two_way
        normals, rise = rounding.normal[None], rounding.rise if r.x is None else _drawn(surfaces)[0]
    passes, of = surfaces.passes, surfaces.pair_nodes
    node_gap = np.full(of.size, np.inf)
    row = np.zeros_like(shapes.of) if mutual else shapes.of
    tables = [_pass(surfaces, x, length, normals[row[i]], rise, shapes.rise[row[i]], i, node_gap)
              for i in range(passes.slave.size)]
    counts = [len(values) for _, values in tables]
    number = np.repeat(np.arange(len(tables), dtype=np.int32), counts)
    if len(tables) == 1:
        met, values = tables[0]
    else:
        met = np.concatenate([np.empty((0, 2), dtype=np.int32), *(m for m, _ in tables)])
        values = np.concatenate([np.empty((0, 5 if rise is None else 7)), *(v for _, v in tables)])
    at = pair_nodes_at(number, met, of.first, of.place)
    covered = covered_fractions(x, r.edges, length, of.sides, surfaces.start, of.place, r.axisymmetric, at, values,
                                of.size)
    # fault: a node a hair beyond the other side's end is as far off as can be -> pass | contact/test_facing
    beyond_ends(node_gap, at, values)
    reach = np.empty(int(passes.pair.max(initial=-1)) + 1)
    reach[passes.pair] = passes.gap_max
    node_gap = np.minimum(node_gap, reach[of.pair])
    return Cut(number, met, at, row[number], values, normals, follows, node_gap, covered)


def _drawn(surfaces: RegisteredSurfaces) -> tuple[Floats, Floats]:
    """Return what surfaces as drawn rise, (n_edges,) [m], and turn where chains end, (n_edges, 2) [rad], found once.

    Edges that bend under load stay the edges they are to forces, which close gaps: so they do to heat.
    """
    if "drawn" not in surfaces.found:
        r = surfaces.register
        assert r.x is not None
        length, normal = edge_frames(r.x, r.edges, surfaces.previous, surfaces.following)
        _check_geometry(surfaces, r.x, length)
        drawn = rounding_of(r.x, r.edges, surfaces.previous, surfaces.following, r.axisymmetric, length, normal)
        surfaces.found["drawn"] = drawn.rise, end_turns(normal, drawn.normal)
    rise, angle = surfaces.found["drawn"]
    return rise, angle


def _pass(surfaces: RegisteredSurfaces, x: Floats, length: Floats, normal: Floats, rise: Rise, bulge: Floats, i: int,
          node_gap: Floats) -> tuple[Ints, Floats]:
    """Search pass i; return (n, 2) edges and values as in Cut, and lower node_gap : (n_q,) [m] to what the pass's is.
    """
    of = surfaces.pair_nodes
    if surfaces.tied[i]:
        # fault: what is tied is searched for anew -> met, values, _ = pass_points(surfaces, x, length, normal, None,
        #   bulge, i) | contact/test_tied
        met, values = points_now(surfaces, x, length, i)
        if rise is not None:
            values = np.concatenate([values, np.ones((len(values), 2))], axis=1)  # what is tied is as wide as its edges
        near = np.full(surfaces.register.n_nodes, np.inf)
        for side in range(2):
            near[surfaces.register.edges[met[:, side]]] = 0.0
    else:
        met, values, near = pass_points(surfaces, x, length, normal, rise, bulge, i)
    lower_gaps(node_gap, near, of.node, of.first[i], of.last[i])
    return met, values


def _check_geometry(surfaces: RegisteredSurfaces, x: Floats, length: Floats) -> None:
    if length.size and not length.min() > 0.0:
        e = int(np.argmin(length))
        raise ValueError(f"edge {e} (nodes {surfaces.register.edges[e].tolist()}) has no length")
    if surfaces.register.axisymmetric and x.size and x[:, 0].min() < -AXIS_TOLERANCE * np.abs(x[:, 0]).max():
        node = int(np.argmin(x[:, 0]))
        raise ValueError(f"node {node} lies beyond the axis, r = {x[node, 0]!r}")


@kernel
def lower_gaps(node_gap: Floats, near: Floats, node: Ints, first: Ints, last: Ints) -> None:
    """Lower node_gap : (n_q,) [m] of a pass's sides to the gaps its nodes have, near : (n_s,) [m].

    node : (n_q,) index s.  first, last : (2,) pair nodes of the slave's and of the master's side.
    """
    for side in range(2):
        for q in range(first[side], last[side]):
            node_gap[q] = min(node_gap[q], near[node[q]])


@kernel
def beyond_ends(node_gap: Floats, at: Ints, values: Floats) -> None:
    """Give nodes that lie beyond the other side's end, but whose edges still face it, the gap of that end.

    As bodies slide or expand past each other's ends a node's gap so goes on until nothing of its part faces anything:
    a node a hair beyond the end is no farther off than its neighbour.

    node_gap : (n_q,) [m], infinite where a node itself faces nothing.  at : (n_p, 4) pair nodes.
    values : (n_p, 5 or 7), xi_s, xi_m [1], gap [m]; the two Gauss points of a piece are neighbours.
    """
    nearest, gap = np.zeros(node_gap.size), np.zeros(node_gap.size)
    for i in range(at.shape[0]):
        twin = i + 1 - 2 * (i % 2)
        for side in range(2):
            for end in range(2):
                q = at[i, 2 * side + end]
                N = values[i, side] if end == 1 else 1.0 - values[i, side]
                if nearest[q] < N:
                    nearest[q] = N
                    # On from the two points, (1 -+ 1/sqrt 3)/2 of the piece, to where it ends.
                    gap[q] = values[i, 2] + 0.5 * (np.sqrt(3.0) - 1.0) * (values[i, 2] - values[twin, 2])
    for q in range(node_gap.size):
        if node_gap[q] == np.inf and nearest[q] > 0.0:
            node_gap[q] = gap[q]


@kernel
def covered_fractions(x: Floats, edges: Ints, length: Floats, sides: Ints, start: Ints, place: Ints, axisymmetric: bool,
                      at: Ints, values: Floats, n_q: int) -> Floats:
    """Return (n_q,) the part in [0, 1] of each pair node's side, by its shape function, that faces the other side.

    x : (n_s, 2) [m].  edges, place : (n_edges, 2).  length : (n_edges,) [m].  sides : (n_sides, 2) surface and first
    pair node.  start : (n_surfaces + 1,) first edges.  at : (n_p, 4) pair nodes.
    values : (n_p, 5 or 7), xi_s, xi_m [1], gap [m], area, area_m [m2].
    """
    whole, faced = np.zeros(n_q), np.zeros(n_q)
    for k in range(sides.shape[0]):
        surface, first = sides[k, 0], sides[k, 1]
        for e in range(start[surface], start[surface + 1]):
            a, b = edges[e, 0], edges[e, 1]
            r_a = 2.0 * np.pi * max(x[a, 0], 0.0) if axisymmetric else 1.0
            r_b = 2.0 * np.pi * max(x[b, 0], 0.0) if axisymmetric else 1.0
            whole[first + place[e, 0]] += length[e] * (2.0 * r_a + r_b) / 6.0
            whole[first + place[e, 1]] += length[e] * (r_a + 2.0 * r_b) / 6.0
    for i in range(at.shape[0]):
        for side in range(2):
            a, b = at[i, 2 * side], at[i, 2 * side + 1]
            # fault: covered share by the other node's shape function -> faced[a] += values[i, side] * values[i, 3 +
            #   side] | contact/test_facing
            faced[a] += (1.0 - values[i, side]) * values[i, 3 + side]
            faced[b] += values[i, side] * values[i, 3 + side]
    for q in range(n_q):
        # Surfaces that fold over each other are met twice: more than all is all.
        faced[q] = min(faced[q] / whole[q], 1.0) if whole[q] > 0.0 else 0.0
    return faced
