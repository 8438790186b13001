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

from typing import Any, TypeAlias

import numpy as np

from contact.arcs import across, normal_tree, opposite, reached, tilted
from contact.arcs import feet as feet  # for those who search by rays
from contact.compiled import inner, kernel
from contact.messages import Floats, Ints
from contact.surfaces import (
    END_TOLERANCE,
    FACING_COS,
    Frame,
    RegisteredSurfaces,
    box_tree,
    candidates,
    frame_of,
)

Rise: TypeAlias = Floats | None

# A node's own gap is for records and events only; a node whose slightly tilted normal passes the end of the other
# surface, as at an axis or a plane of symmetry, still has one.
NODE_TOLERANCE = 1e-3  # of an edge
CUT_TOLERANCE = 1e-13  # of an edge: cuts closer than this are one cut
MIN_MAPPED_LENGTH = 1e-6  # of an edge: shorter master pieces are weighted as if the map were linear
SELF_CONTACT_DEPTH = 0.25  # of an edge: how deep into the body a surface that faces itself is searched
# fault: a step beside a body is met through it -> NEAREST = 100.0 | mechanical_fmu/test_passing
NEAREST = 1.5  # a ray that meets what is nearest is longer by 1/cos of the tilt, up to 48 degrees
# fault: Gauss points of a piece nearer to its ends -> GAUSS = 0.35 | scenarios/test_contact_robust
GAUSS = 0.28867513459481287  # half the distance of the two Gauss points of a unit interval


@inner
def ray(frame: Frame, xi: float, x: Floats, edges: Ints, m: int) -> tuple[float, float, float]:
    """Intersect the ray of slave coordinate xi with the line of edge m; return the coordinate on it, gap [m], n . n_m.

    x : (n_s, 2) [m].  edges : (n_edges, 2).
    """
    x1, y1, x2, y2, u1, v1, u2, v2 = frame
    ax, ay = x[edges[m, 0], 0], x[edges[m, 0], 1]
    px, py = x1 + xi * (x2 - x1), y1 + xi * (y2 - y1)
    nx, ny = u1 + xi * (u2 - u1), v1 + xi * (v2 - v1)
    size = np.sqrt(nx * nx + ny * ny)
    nx, ny = nx / size, ny / size
    ex, ey = x[edges[m, 1], 0] - ax, x[edges[m, 1], 1] - ay
    cross = ex * ny - ey * nx
    if cross == 0.0:
        return np.nan, np.nan, 0.0
    rx, ry = px - ax, py - ay
    return (rx * ny - ry * nx) / cross, (rx * ey - ry * ex) / cross, -cross / np.sqrt(ex * ex + ey * ey)


@inner
def faced(frame: Frame, xi: float, x: Floats, edges: Ints, normal: Floats, rise: Rise, e: int,
          m: int) -> tuple[float, float, float]:
    """Find what slave coordinate xi of edge e faces on the line of edge m; return as ray does.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  normal : (n_edges, 3, 2) [1].  rise : (n_edges,) [m] or None.
    """
    if rise is None:
        return ray(frame, xi, x, edges, m)
    return opposite(frame, frame_of(x, edges, normal, m), rise[e], rise[m], xi, NODE_TOLERANCE)


@inner
def added(offset: Floats, bulge: Floats, e: int, xi: float, m: int, eta: float) -> float:
    """Return what is added to the gap [m] between xi of slave edge e and eta of master edge m.

    offset : (n_edges, 2) [m].  bulge : (n_edges,) [m].
    """
    # fault: what is added to a gap is that of one node -> fit = offset[e, 0] | contact/test_offset
    fit = offset[e, 0] + xi * (offset[e, 1] - offset[e, 0])
    # fault: of a smooth pair the master has straight edges -> return fit - bulge[e] * xi * (1.0 - xi) |
    #   contact/test_smooth
    return fit - bulge[e] * xi * (1.0 - xi) - bulge[m] * eta * (1.0 - eta)


@inner
def nearer(g: float, m: int, best: float, best_m: int, slack: float) -> bool:
    """Return whether gap g [m] of master edge m is preferred to the best so far: the nearest, then the lower number."""
    # fault: the farther of two master edges met -> return abs(g) > abs(best) + slack or (m < best_m and abs(g) <=
    #   abs(best) + slack) | contact/test_facing
    # fault: of two branches the farther one is faced -> return abs(g) > abs(best) - slack or (m < best_m and abs(g) <=
    #   abs(best) + slack) | scenarios/test_contact_robust
    return abs(g) < abs(best) - slack or (m < best_m and abs(g) <= abs(best) + slack)


@inner
def note_node(near: Floats, node: int, g: float, back: float, ahead: float) -> None:
    """Keep the nearest gap g [m] of a node in near : (n_s,) [m]."""
    if -back <= g < ahead and abs(g) < abs(near[node]):
        near[node] = g


@inner
def cut_edge(x: Floats, edges: Ints, normal: Floats, rise: Rise, frame: Frame, offset: Floats, bulge: Floats, e: int,
             hits: Ints, count: int, cuts: Floats, spans: Floats, near: Floats, back: float, ahead: float) -> int:
    """Cut a slave edge at the feet of its candidates' nodes; return the number of cuts.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  normal : (n_edges, 3, 2) [1].  rise : (n_edges,) [m] or None.
    hits : (>= count,) master edges.  Fills cuts : (>= 4 count + 2,) [1],
    ascending from 0 to 1, and spans : (>= count, 2) [1], the range of xi in which each candidate can be met;
    near : (n_s,) [m], the gaps of those nodes, is updated.
    """
    cuts[0], n = 0.0, 1
    for k in range(count):
        m = hits[k]
        spans[k, 0], spans[k, 1] = np.inf, -np.inf
        for end in range(1, -1, -1):
            s = edges[m, end]
            if rise is None:
                first, second = feet(frame, x[s, 0], x[s, 1])
            else:
                # fault: edges cut where the slave's rays pass the master's nodes -> tilt = frame | contact/test_arcs
                tilt = tilted(frame, normal[m, 1 + end, 0], normal[m, 1 + end, 1])
                first, second = feet(tilt, x[s, 0], x[s, 1])
            wide = np.isnan(first) or 0.0 < second < 1.0
            spans[k, 0] = 0.0 if wide else min(spans[k, 0], first)
            spans[k, 1] = 1.0 if wide else max(spans[k, 1], first)
            for root in range(2):
                xi = first if root == 0 else second
                if -NODE_TOLERANCE <= xi <= 1.0 + NODE_TOLERANCE:
                    if rise is None:
                        _, g, facing = ray(frame, xi, x, edges, m)
                    else:
                        g, facing = across(frame, frame_of(x, edges, normal, m), rise[e], rise[m], xi, float(end))
                    if facing < -FACING_COS:
                        note_node(near, s, g + added(offset, bulge, e, xi, m, float(end)), back, ahead)
                # fault: slave edges cut at some of the master's nodes only -> if 0.4 < xi < 0.6: | contact/test_facing
                if 0.0 < xi < 1.0:
                    i = n
                    while cuts[i - 1] > xi:
                        cuts[i] = cuts[i - 1]
                        i -= 1
                    cuts[i] = xi
                    n += 1
    n_kept = 1
    for i in range(1, n):
        if cuts[i] - cuts[n_kept - 1] > CUT_TOLERANCE and 1.0 - cuts[i] > CUT_TOLERANCE:
            cuts[n_kept] = cuts[i]
            n_kept += 1
    cuts[n_kept] = 1.0
    return n_kept + 1


@inner
def meet(x: Floats, edges: Ints, normal: Floats, rise: Rise, frame: Frame, offset: Floats, bulge: Floats, e: int,
         hits: Ints, count: int, cuts: Floats, n_cuts: int, spans: Floats, back: float, ahead: float, met: Ints,
         met_gap: Floats) -> None:
    """Find the nearest master edge that the middle of each piece of a slave edge faces.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  normal : (n_edges, 3, 2) [1].  rise : (n_edges,) [m] or None.
    hits : (>= count,).  cuts : (>= n_cuts,) [1].  spans : (>= count, 2) [1].  Fills met : (>= n_cuts - 1,), -1: none,
    and met_gap : (>= n_cuts - 1,) [m].
    """
    slack = END_TOLERANCE * np.sqrt((frame[2] - frame[0]) ** 2 + (frame[3] - frame[1]) ** 2)
    for i in range(n_cuts - 1):
        met[i], met_gap[i] = -1, np.inf
    for k in range(count):
        m = hits[k]
        i, end = 0, n_cuts - 1
        while end - i > 1:  # the last cut before the candidate's range
            half = (i + end) // 2
            if cuts[half] < spans[k, 0] - CUT_TOLERANCE:
                i = half
            else:
                end = half
        while i < n_cuts - 1 and cuts[i] < spans[k, 1]:
            middle = 0.5 * (cuts[i] + cuts[i + 1])
            xi_m, g, facing = faced(frame, middle, x, edges, normal, rise, e, m)
            g += added(offset, bulge, e, middle, m, xi_m)
            # fault: areas not clipped at the master's end -> hit = -0.5 <= xi_m <= 1.5 and facing < -FACING_COS and
            #   -back <= g < ahead | contact/test_facing
            hit = -CUT_TOLERANCE <= xi_m <= 1.0 + CUT_TOLERANCE and facing < -FACING_COS and -back <= g < ahead
            if hit and (met[i] < 0 or nearer(g, m, met_gap[i], met[i], slack)):
                met[i], met_gap[i] = m, g
            i += 1


@inner
def master_weights(xi_1: float, xi_2: float, low: float, high: float, size: float, r_low: float,
                   r_high: float) -> tuple[float, float]:
    """Return weights at master coordinates xi_1, xi_2 that integrate linear functions over the piece low..high exactly.

    So the pieces of an edge add up to the whole edge for each of its shape functions, though the map from the
    slave is not linear.  size : length of the piece [m].  r_low, r_high : 2 pi r at its ends [m], or 1.
    """
    m0, m1 = 0.5 * (r_low + r_high), r_low / 6.0 + r_high / 3.0
    s0, s1 = 0.5 - GAUSS, 0.5 + GAUSS
    if abs(high - low) > MIN_MAPPED_LENGTH:
        t0, t1 = (xi_1 - low) / (high - low), (xi_2 - low) / (high - low)
        # fault: master pieces weighted as if the map were linear -> if t0 < m1 / m0 < t0: | contact/test_facing
        if t0 < m1 / m0 < t1:  # outside of that a weight would be negative
            s0, s1 = t0, t1
    second = (m1 - s0 * m0) / (s1 - s0)
    return size * (m0 - second), size * second


@inner
def ring(r_1: float, r_2: float, xi: float, axisymmetric: bool) -> float:
    """Return 2 pi r [m] at xi of an edge whose ends have radii r_1 and r_2 [m], or 1 for unit depth."""
    # fault: 2 pi r dropped from the areas -> return max(r_1 + xi * (r_2 - r_1), 0.0) if axisymmetric else 1.0 |
    #   contact/test_facing
    return 2.0 * np.pi * max(r_1 + xi * (r_2 - r_1), 0.0) if axisymmetric else 1.0


@inner
def widened(rise: float, length: float, xi: float) -> float:
    """Return by how much [1] an edge of `length` [m] that rises `rise` [m] (contact.rounding) is longer at xi."""
    slope = rise * (1.0 - 2.0 * xi) / length
    return np.sqrt(1.0 + slope * slope)


@inner
def round_area(frame: Frame, length: float, rise: float, xi: float, axisymmetric: bool) -> float:
    """Return the area [1] of a round surface at xi of its edge, as a part of the edge's own; length, rise [m]."""
    # fault: areas of chords for those of arcs -> wider = 1.0 | contact/test_arcs
    wider = widened(rise, length, xi)
    r = frame[0] + xi * (frame[2] - frame[0])
    if axisymmetric and r > 0.0:
        # fault: rings of round surfaces as far from the axis as their edges -> wider *= 1.0 | contact/test_arcs
        wider *= max(1.0 + rise * xi * (1.0 - xi) * (frame[3] - frame[1]) / (length * r), 0.0)
    return wider


@inner
def place(x: Floats, edges: Ints, normal: Floats, rise: Rise, frame: Frame, offset: Floats, bulge: Floats, e: int,
          length_s: float, length_m: float, m: int, low: float, high: float, axisymmetric: bool, values: Floats,
          i: int) -> None:
    """Put the two quadrature points of piece low..high of a slave edge on master edge m into rows i, i + 1 of values.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  normal : (n_edges, 3, 2) [1].  rise : (n_edges,) [m] or None.
    values : (capacity, 5 or 7).  length_s, length_m : of the edges [m].
    """
    r_1, r_2 = x[edges[m, 0], 0], x[edges[m, 1], 0]
    for k in range(4):  # the two points, then the two ends, whose columns are put in order below
        xi = 0.5 * (low + high) + (2 * k - 1) * GAUSS * (high - low) if k < 2 else (low if k == 2 else high)
        xi_m, g, _ = faced(frame, xi, x, edges, normal, rise, e, m)
        xi_m = min(max(xi_m, 0.0), 1.0)
        if k < 2:
            values[i + k, 0], values[i + k, 1] = xi, xi_m
            values[i + k, 2] = g + added(offset, bulge, e, xi, m, xi_m)
            # fault: area of contact halved -> values[i + k, 3] = 0.25 * (high - low) * length_s * ring(frame[0],
            #   frame[2], xi, axisymmetric) | mechanical_fmu/test_hertz contact/test_traction
            values[i + k, 3] = 0.5 * (high - low) * length_s * ring(frame[0], frame[2], xi, axisymmetric)
            # fault: forces of round surfaces act on chords -> values[i + k, 3] *= 1.0 | contact/test_smooth
            values[i + k, 3] *= widened(bulge[e], length_s, xi)
            if rise is not None:
                values[i + k, 5] = round_area(frame, length_s, rise[e], xi, axisymmetric)
                values[i + k, 6] = round_area(frame_of(x, edges, normal, m), length_m, rise[m], xi_m, axisymmetric)
        else:
            values[i + k - 2, 4] = xi_m
    m_low, m_high = values[i, 4], values[i + 1, 4]
    r_low, r_high = ring(r_1, r_2, m_low, axisymmetric), ring(r_1, r_2, m_high, axisymmetric)
    values[i, 4] = values[i + 1, 4] = 0.0
    if r_low + r_high > 0.0:
        values[i, 4], values[i + 1, 4] = master_weights(values[i, 1], values[i + 1, 1], m_low, m_high,
                                                        abs(m_high - m_low) * length_m, r_low, r_high)


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
def faced_part(cuts: Floats, n_cuts: int, met: Ints, end: int) -> tuple[float, float, int]:
    """Return from where to where [1] the half of a slave edge at its node `end` faces something, and what is met.

    cuts : (>= n_cuts,) [1].  met : (>= n_cuts - 1,) master edges, -1: none.  From the place nearest the node, which is
    the node itself where that faces something, as far as there is no break, to the middle at most.  -1: nothing.
    """
    node, outer, inner_end, first = float(end), float(end), float(end), -1
    for k in range(n_cuts - 1):
        i = k if end == 0 else n_cuts - 2 - k
        near, far = (cuts[i], cuts[i + 1]) if end == 0 else (cuts[i + 1], cuts[i])
        if abs(near - node) >= 0.5 or (met[i] < 0 and first >= 0):
            break
        if met[i] < 0:
            continue
        if first < 0:
            first, outer = met[i], near
        inner_end = far if abs(far - node) < 0.5 else 0.5
    return outer, inner_end, first


@inner
def place_node(x: Floats, edges: Ints, normal: Floats, rise: Rise, frame: Frame, offset: Floats, bulge: Floats, e: int,
               length_s: float, hits: Ints, count: int, end: int, cuts: Floats, n_cuts: int, met: Ints, back: float,
               ahead: float, axisymmetric: bool, met_edges: Ints, values: Floats, i: int) -> bool:
    """Put the point of the slave's node `end` into row i; row i + 1 is where its part of the edge ends, without area.

    So a piece has two rows in this form too.  The point has what its half of the edge faces for weight, and lies as
    near to the node as that reaches: at the node, until it slides off an end.  x : (n_s, 2) [m].  edges : (n_edges, 2).
    normal : (n_edges, 3, 2) [1].  rise : (n_edges,) [m] or None.  hits : (>= count,).  cuts, met : as of faced_part.
    back, ahead : reach [m].  Fills met_edges : (capacity, 2), the master edge, and values : (capacity, 5 or 7).
    Returns False where the half faces nothing.
    """
    # fault: a node that slides off lets go of all it presses -> outer, inner_end, first = float(end), 0.5, -1 |
    #   contact/test_nodes_at_ends
    outer, inner_end, first = faced_part(cuts, n_cuts, met, end)
    if first < 0:
        return False
    best, best_m, best_xi = np.inf, -1, 0.0
    for k in range(count):
        xi_m, g, facing = faced(frame, outer, x, edges, normal, rise, e, hits[k])
        g += added(offset, bulge, e, outer, hits[k], xi_m)
        hit = -END_TOLERANCE <= xi_m <= 1.0 + END_TOLERANCE and facing < -FACING_COS and -back <= g < ahead
        if hit and (best_m < 0 or nearer(g, hits[k], best, best_m, END_TOLERANCE * length_s)):
            best, best_m, best_xi = g, hits[k], min(max(xi_m, 0.0), 1.0)
    if best_m < 0 or outer != float(end):
        xi_m, g, _ = faced(frame, outer, x, edges, normal, rise, e, first)
        best_m, best_xi = first, min(max(xi_m, 0.0), 1.0)
        best = g + added(offset, bulge, e, outer, first, best_xi)
    # Nodes that are drawn on each other lie there to round-off: the master's other node has no part in that.
    # fault: a point on a node of the master is partly the other one's by round-off -> on_node = -1.0 |
    #   contact/test_nodes_at_ends
    on_node = np.round(best_xi)
    if abs(best_xi - on_node) <= END_TOLERANCE:
        best_xi = on_node
    for q in range(2):
        met_edges[i + q, 1] = best_m
        values[i + q, 0], values[i + q, 1], values[i + q, 2] = outer if q == 0 else inner_end, best_xi, best
        part = abs(inner_end - outer) * length_s if q == 0 else 0.0
        values[i + q, 3] = values[i + q, 4] = part * ring(frame[0], frame[2], outer, axisymmetric)
        if rise is not None:
            values[i + q, 5], values[i + q, 6] = 1.0, 1.0
    return True


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


@kernel
def face_pass(x: Floats, edges: Ints, length: Floats, normal: Floats, rise: Rise, ranges: Floats | None, offset: Floats,
              bulge: Floats, first: int, last: int, masters: Ints, gap_max: float, depth: float, axisymmetric: bool,
              itself: bool, by_node: bool, met_edges: Ints, values: Floats, near: Floats) -> int:
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
            if n_points + 2 <= values.shape[0]:
                for q in range(n_points, n_points + 2):
                    met_edges[q, 0], met_edges[q, 1] = e, met[i]
                place(x, edges, normal, rise, frame, offset, bulge, e, length[e], length[met[i]], met[i], cuts[i],
                      cuts[i + 1], axisymmetric, values, n_points)
            n_points += 2
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
                      float(p.gap_max[i]), float(depth[i]), r.axisymmetric, itself, by_node, met, values, near)
        if n <= capacity:
            if p.weight[i] != 1.0:
                values[:n, 3:5] *= p.weight[i]
            return met[:n], values[:n], near
        capacity = n
