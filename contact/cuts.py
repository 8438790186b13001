"""Slave edges cut at the nodes of the other side, and the master edge that each piece faces.

Arrays as contact.search says.
"""

from __future__ import annotations

import numpy as np

from contact.arcs import across, feet, tilted
from contact.compiled import inner
from contact.faced import NODE_TOLERANCE, Rise, added, faced, nearer, note_node, ray
from contact.messages import Floats, Ints
from contact.surfaces import END_TOLERANCE, FACING_COS, Frame, frame_of

CUT_TOLERANCE = 1e-13  # of an edge: cuts closer than this are one cut


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
def overlaps(x: Floats, edges: Ints, frame: Frame, offset: Floats, bulge: Floats, e: int, m: int, low: float,
             high: float, back: float) -> bool:
    """Return whether one end of piece low..high of a slave edge [1] is inside master edge m, no deeper than back [m].

    The middle of a long tilted edge may be out of reach when its corner has long been in.  x : (n_s, 2) [m].
    edges : (n_edges, 2).
    """
    for k in range(2):
        xi = low if k == 0 else high
        xi_m, g, facing = ray(frame, xi, x, edges, m)
        g += added(offset, bulge, e, xi, m, xi_m)
        # fault: a corner is in unseen while the middle of its edge is out of reach -> if False: | contact/test_leaning
        if -CUT_TOLERANCE <= xi_m <= 1.0 + CUT_TOLERANCE and facing < -FACING_COS and -back <= g < 0.0:
            return True
    return False


@inner
def meet(x: Floats, edges: Ints, normal: Floats, rise: Rise, frame: Frame, offset: Floats, bulge: Floats, e: int,
         hits: Ints, count: int, cuts: Floats, n_cuts: int, spans: Floats, back: float, ahead: float, met: Ints,
         met_gap: Floats) -> None:
    """Find the nearest master edge that the middle of each piece of a slave edge faces, or one of its ends overlaps.

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
            if rise is None and not hit and g >= ahead and facing < -FACING_COS:
                hit = overlaps(x, edges, frame, offset, bulge, e, m, cuts[i], cuts[i + 1], back)
            if hit and (met[i] < 0 or nearer(g, m, met_gap[i], met[i], slack)):
                met[i], met_gap[i] = m, g
            i += 1
