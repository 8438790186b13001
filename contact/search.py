"""The search of contact: what faces what, cuts of slave edges at the master's nodes, quadrature points of pieces.

For forces a slave point faces the nearest master point on the ray along its normal (contact.surfaces), which is what
presses it and turns with it.  For heat it faces the nearest on an arc that is normal to both sides
(contact.arcs), so that no side is preferred, of surfaces that are round (contact.rounding).  Between flat parallel
sides both are the same.

Arrays of all kernels: x (n_s, 2) coordinates [m]; edges (n_edges, 2) indices s; normal (n_edges, 3, 2) unit normals of
an edge, and at its first and second node; length (n_edges,) [m]; met (n_p, 2) slave and master edge of each point;
values (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2] of each point, two rows a piece, for heat (n_p, 7) with
wide_s, wide_m [1]; offset (n_edges, 2) [m], is added to the gaps of a pass at the ends of its edges, gaps are those
with it; rise (n_edges,) [m], what the surface lies outside of its edges (contact.rounding), for heat, and None for
forces: numba compiles either on its own, so that neither pays for the other; bulge (n_edges,) [m], the same for the
forces of smooth pairs, which hang on it along the slave's rays: 0 for heat and for pairs with straight edges.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from contact.arcs import normal_tree, reached
from contact.compiled import inner, kernel
from contact.cuts import cut_edge, meet
from contact.faced import NODE_TOLERANCE, Rise, added, faced, note_node, ray
from contact.messages import Floats, Ints
from contact.quadrature import place, place_node
from contact.surfaces import FACING_COS, Frame, RegisteredSurfaces, box_tree, candidates, frame_of

SELF_CONTACT_DEPTH = 0.25  # of an edge: how deep into the body a surface that faces itself is searched
FLAT = 1e-9  # of an edge: smaller gaps at both ends of a piece are none
ROUND = 1e-12  # of the gaps beside it: what a gap may be where surfaces part
SLIVER = 1e-8  # of a piece: where less is open, or closed, it is not cut
# fault: a step beside a body is met through it -> NEAREST = 100.0 | mechanical_fmu/test_passing
NEAREST = 1.5  # a ray that meets what is nearest is longer by 1/cos of the tilt, up to 48 degrees


@inner
def drop_neighbours(edges: Ints, e: int, hits: Ints, count: int) -> int:
    """Remove the edge e itself and the edges that share a node with it from hits; return how many remain.

    edges : (n_edges, 2).  hits : (>= count,).
    """
    n_left = 0
    for k in range(count):
        m = hits[k]
        shared = False
        for i in range(2):
            for j in range(2):
                shared = shared or edges[e, i] == edges[m, j]
        if not shared:
            hits[n_left] = m
            n_left += 1
    return n_left


@inner
def meets_middle(x: Floats, edges: Ints, normal: Floats, rise: Rise, frame: Frame, offset: Floats, bulge: Floats,
                 e: int, hits: Ints, count: int, back: float, ahead: float) -> bool:
    """Say whether the middle of a slave edge faces a candidate; x : (n_s, 2) [m], back, ahead : its reach [m].

    edges : (n_edges, 2).  normal : (n_edges, 3, 2) [1].  rise : (n_edges,) [m] or None.  hits : (>= count,).
    """
    for k in range(count):
        xi_m, g, facing = faced(frame, 0.5, x, edges, normal, rise, e, hits[k])
        g += added(offset, bulge, e, 0.5, hits[k], xi_m)
        if 0.0 <= xi_m <= 1.0 and facing < -FACING_COS and -back <= g < ahead:
            return True
    return False


@inner
def distance_to(x: Floats, edges: Ints, frame: Frame, masters: Ints) -> float:
    """Return the distance [m] of the middle of a slave edge from the nearest master edge.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  masters : (m,).
    """
    px, py, least = 0.5 * (frame[0] + frame[2]), 0.5 * (frame[1] + frame[3]), np.inf
    for m in masters:
        ax, ay = x[edges[m, 0], 0], x[edges[m, 0], 1]
        ex, ey = x[edges[m, 1], 0] - ax, x[edges[m, 1], 1] - ay
        s = min(max(((px - ax) * ex + (py - ay) * ey) / (ex * ex + ey * ey), 0.0), 1.0)
        dx, dy = px - ax - s * ex, py - ay - s * ey
        least = min(least, dx * dx + dy * dy)
    return np.sqrt(least)


@kernel
def near_edges(boxes: Floats, ranges: Floats | None, masters: Ints, normal: Floats, frame: Frame, back: float,
               ahead: float, hits: Ints) -> int:
    """Put into hits the edges that the rays or arcs of a slave edge may reach, and that face it; return how many.

    boxes : (2 P, 4) [m] and, for arcs, ranges : (2 P, 4) [1] over the chain masters : (m,).
    normal : (n_edges, 3, 2) [1].  back, ahead : reach [m].  hits : (m,) out.
    """
    if ranges is None:
        return candidates(boxes, masters, normal, frame, back, ahead, hits)
    return reached(boxes, ranges, masters, normal, frame, back, ahead, hits)


@inner
def gap_at(x: Floats, edges: Ints, frame: Frame, offset: Floats, bulge: Floats, e: int, m: int, xi: float) -> float:
    """Return the gap [m] along the ray of xi of slave edge e to master edge m; arrays as of face_pass."""
    xi_m, g, _ = ray(frame, xi, x, edges, m)
    return g + added(offset, bulge, e, xi, m, xi_m)


@inner
def opens_between(x: Floats, edges: Ints, frame: Frame, offset: Floats, bulge: Floats, e: int, m: int, a: float,
                  b: float, g_a: float, g_b: float) -> float:
    """Return where between a and b, with gaps g_a and g_b [m] of unlike signs, the gap is 0; arrays as of face_pass."""
    at, most, side = a, max(abs(g_a), abs(g_b)), 0
    for _ in range(30):
        at = a + (b - a) * g_a / (g_a - g_b)
        g = gap_at(x, edges, frame, offset, bulge, e, m, at)
        if abs(g) <= ROUND * most:
            break
        # The Illinois method: an end that stays twice counts half.
        if (g < 0.0) == (g_a < 0.0):
            a, g_a = at, g
            g_b = 0.5 * g_b if side == 1 else g_b
            side = 1
        else:
            b, g_b = at, g
            g_a = 0.5 * g_a if side == -1 else g_a
            side = -1
    return at


@inner
def openings(x: Floats, edges: Ints, frame: Frame, offset: Floats, bulge: Floats, e: int, length: float, m: int,
             low: float, high: float) -> tuple[float, float]:
    """Return where on piece low..high of a slave edge [1] the gap to master edge m is 0 between its ends; 2: nowhere.

    A pressure is integrated as it is up to there: between two points a corner, or the crown of a round surface, would
    dig in unseen, and force and energy of its springs would hang on where the other side has its nodes.
    length : of the edge [m]; arrays as of face_pass.
    """
    g_low = gap_at(x, edges, frame, offset, bulge, e, m, low)
    g_high = gap_at(x, edges, frame, offset, bulge, e, m, high)
    first, second, sliver = 2.0, 2.0, SLIVER * (high - low)
    if max(abs(g_low), abs(g_high)) < FLAT * length:
        # What touches all over is rounded to either side.
        return first, second
    if g_low < 0.0 < g_high or g_high < 0.0 < g_low:
        first = opens_between(x, edges, frame, offset, bulge, e, m, low, high, g_low, g_high)
    elif bulge[e] != 0.0 or bulge[m] != 0.0:
        # Round: a parabola, whose crown may be on the other side.
        middle = 0.5 * (low + high)
        bend = g_low + g_high - 2.0 * gap_at(x, edges, frame, offset, bulge, e, m, middle)
        crown = middle - 0.25 * (high - low) * (g_high - g_low) / bend if bend != 0.0 else low
        if low < crown < high:
            g = gap_at(x, edges, frame, offset, bulge, e, m, crown)
            # fault: the crown of a round surface between two points digs in unseen -> if False: | contact/test_opening
            if g < 0.0 < g_low or g_low < 0.0 < g:
                first = opens_between(x, edges, frame, offset, bulge, e, m, low, crown, g_low, g)
                second = opens_between(x, edges, frame, offset, bulge, e, m, crown, high, g, g_high)
    if not low + sliver < first < high - sliver:
        first = 2.0
    if not (second < high - sliver and (first > 1.0 or first + sliver < second)):
        second = 2.0
    return (first, second) if first < 1.0 else (second, 2.0)


@kernel
def face_pass(x: Floats, edges: Ints, length: Floats, normal: Floats, rise: Rise, ranges: Floats | None, offset: Floats,
              bulge: Floats, first: int, last: int, masters: Ints, gap_max: float, depth: float, axisymmetric: bool,
              itself: bool, by_node: bool, parting: bool, met_edges: Ints, values: Floats, near: Floats) -> int:
    """Search one pass; return how many points there are, which may be more than the capacity.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  length : (n_edges,) [m].  normal : (n_edges, 3, 2) [1].
    rise : (n_edges,) [m] and ranges : (2 P, 4) [1] of the normals along masters: by arcs; None: by rays.  first, last :
    first and last + 1 of the slave's edges.  masters : (m,) the master's edges as a chain.  gap_max, depth : how far
    and how deep is looked [m], no less deep than an edge's length.  itself : slave is master.  by_node : one point a
    slave node.  Fills met_edges : (capacity, 2), slave and master edge, values : (capacity, 5 or 7), two rows a piece,
    and near : (n_s,) [m], the nearest gap of each node.
    """
    boxes, longest, highest, roundest = box_tree(x, edges, masters), 0.0, 0.0, 0.0
    for m in masters:
        longest, roundest = max(longest, length[m]), max(roundest, abs(bulge[m]))
        if rise is not None:
            highest = max(highest, abs(rise[m]))
    hits, spans = np.empty(masters.size, dtype=np.int32), np.empty((masters.size, 2))
    cuts, met_gap = np.empty(4 * masters.size + 2), np.empty(4 * masters.size + 2)
    met = np.empty(4 * masters.size + 2, dtype=np.int32)
    n_points: Any = np.int64(0)  # typed: a bare 0 would have every kernel it is passed to compiled twice
    for e in range(first, last):
        # A body thinner than its edges are long must not meet its own far side.
        back = SELF_CONTACT_DEPTH * length[e] if itself else max(length[e], longest)
        frame = frame_of(x, edges, normal, e)
        # Limits are of gaps as told; rays reach farther by what is added to them.
        more, less = max(offset[e, 0], offset[e, 1], 0.0), max(-offset[e, 0], -offset[e, 1], 0.0)
        rounder = 0.25 * (abs(bulge[e]) + roundest)
        more, less = more + rounder, less + rounder
        if rise is not None:
            less += 0.25 * (abs(rise[e]) + highest)
        count = near_edges(boxes, ranges, masters, normal, frame, back + more, gap_max + less, hits)
        if (depth > back
                and not meets_middle(x, edges, normal, rise, frame, offset, bulge, e, hits, count, back, gap_max)
                and near_edges(boxes, ranges, masters, normal, frame, depth + more, less, hits) > 0):
            # What is met deep behind must be about the nearest there is: a step beside the body is not.
            back = max(back, min(depth, NEAREST * (distance_to(x, edges, frame, masters) + less)))
            count = near_edges(boxes, ranges, masters, normal, frame, back + more, gap_max + less, hits)
        if itself:
            count = drop_neighbours(edges, e, hits, count)
        n_cuts = cut_edge(x, edges, normal, rise, frame, offset, bulge, e, hits, count, cuts, spans, near, back,
                          gap_max)
        for k in range(count):
            for end in range(2):
                xi_m, g, facing = faced(frame, float(end), x, edges, normal, rise, e, hits[k])
                if -NODE_TOLERANCE <= xi_m <= 1.0 + NODE_TOLERANCE and facing < -FACING_COS:
                    g += added(offset, bulge, e, float(end), hits[k], xi_m)
                    note_node(near, edges[e, end], g, back, gap_max)
        meet(x, edges, normal, rise, frame, offset, bulge, e, hits, count, cuts, n_cuts, spans, back, gap_max, met,
             met_gap)
        if by_node:
            for end in range(2):
                if n_points + 2 <= values.shape[0]:
                    met_edges[n_points, 0], met_edges[n_points + 1, 0] = e, e
                    if place_node(x, edges, normal, rise, frame, offset, bulge, e, length[e], hits, count, end, cuts,
                                  n_cuts, met, back, gap_max, axisymmetric, met_edges, values, n_points):
                        n_points += 2
                else:
                    n_points += 2
            continue
        for i in range(n_cuts - 1):
            if met[i] < 0:
                continue
            low, first_cut, second_cut = cuts[i], 2.0, 2.0
            if rise is None and parting:
                # fault: a corner between two points digs in unseen -> pass | contact/test_opening
                first_cut, second_cut = openings(x, edges, frame, offset, bulge, e, length[e], met[i], low, cuts[i + 1])
            while low < cuts[i + 1]:
                high = first_cut if low < first_cut < 1.0 else (second_cut if low < second_cut < 1.0 else cuts[i + 1])
                if n_points + 2 <= values.shape[0]:
                    for q in range(n_points, n_points + 2):
                        met_edges[q, 0], met_edges[q, 1] = e, met[i]
                    place(x, edges, normal, rise, frame, offset, bulge, e, length[e], length[met[i]], met[i], low,
                          high, axisymmetric, values, n_points)
                n_points += 2
                low = high
    return n_points


def pass_points(surfaces: RegisteredSurfaces, x: Floats, length: Floats, normal: Floats, rise: Rise, bulge: Floats,
                i: int) -> tuple[Ints, Floats, Floats]:
    """Search pass i at x : (n_s, 2) [m]; return (n, 2) edges, (n, 5) values and near : (n_s,) [m], as of face_pass.

    length : (n_edges,) [m].  normal : (n_edges, 3, 2) [1].  rise : (n_edges,) [m] for heat, with (n, 7) values; None
    for forces.  bulge : (n_edges,) [m].
    """
    r, p, start = surfaces.register, surfaces.passes, surfaces.start
    slave, master = p.slave[i], p.master[i]
    first, last = int(start[slave]), int(start[slave + 1])
    masters = surfaces.chain[start[master] : start[master + 1]]
    depth = np.zeros(p.slave.size) if p.depth is None else p.depth
    capacity = 4 * (last - first + masters.size)
    ranges, columns = (None, 5) if rise is None else (normal_tree(normal, masters), 7)
    near = np.full(r.n_nodes, np.inf)
    itself, by_node = bool(slave == master), bool(p.by_node[i])
    if rise is not None and surfaces.offsets[i].any():
        rise = np.zeros_like(rise)  # a stated fit is that of the edges: of what they are drawn apart nothing counts
    while True:
        met, values = np.empty((capacity, 2), dtype=np.int32), np.empty((capacity, columns))
        n = face_pass(x, r.edges, length, normal, rise, ranges, surfaces.offsets[i], bulge, first, last, masters,
                      float(p.gap_max[i]), float(depth[i]), r.axisymmetric, itself, by_node,
                      bool(surfaces.parting[i]), met, values, near)
        if n <= capacity:
            if p.weight[i] != 1.0:
                values[:n, 3:5] *= p.weight[i]
            return met[:n], values[:n], near
        capacity = n
