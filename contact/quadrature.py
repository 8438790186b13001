"""Contact quadrature points: two a piece of a slave edge, or one a slave node, with their gaps and areas.

Arrays as contact.search says.
"""

from __future__ import annotations

import numpy as np

from contact.compiled import inner
from contact.faced import Rise, added, faced, nearer
from contact.messages import Floats, Ints
from contact.surfaces import END_TOLERANCE, FACING_COS, Frame, frame_of

MIN_MAPPED_LENGTH = 1e-6  # of an edge: shorter master pieces are weighted as if the map were linear
# fault: Gauss points of a piece nearer to its ends -> GAUSS = 0.35 | scenarios/test_contact_robust
GAUSS = 0.28867513459481287  # half the distance of the two Gauss points of a unit interval


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
