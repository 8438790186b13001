"""What a place of a slave edge faces on a master edge, along its ray or its arc, and the gap there.

Arrays as contact.search says.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from contact.arcs import opposite
from contact.compiled import inner
from contact.messages import Floats, Ints
from contact.surfaces import Frame, frame_of

Rise: TypeAlias = Floats | None

# A node's own gap is for records and events only; a node whose slightly tilted normal passes the end of the other
# surface, as at an axis or a plane of symmetry, still has one.
NODE_TOLERANCE = 1e-3  # of an edge


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
