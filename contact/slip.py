"""Slip of a pair since its history was noted, measured along the surfaces: nothing of it is a motion of both together.

A slave's material point faces one master point now and faced another before.  Slip is the length of the master's
surface between the two, in the shape it had before, positive where the slave moved along t (its normal turned to the
left).  The present enters by material coordinates alone, so no superposed rigid motion, however large, is a slip.
(Convected coordinates of contact: Laursen & Simo 1993; Wriggers 2006, sec. 4.)
"""

from __future__ import annotations

import numpy as np

from contact.compiled import kernel
from contact.cuts import CUT_TOLERANCE
from contact.faced import ray
from contact.messages import Floats, Ints
from contact.piece import field_normal
from contact.quadrature import widened
from contact.surfaces import FACING_COS, Frame, frame_of


@kernel
def slip_since(before: Floats, edges: Ints, previous: Ints, following: Ints, normal: Floats, rise: Floats, e: int,
               xi: float, m: int, eta: float) -> tuple[float, float, float, float, float, int]:
    """Return the slip [m] of point xi of slave edge e, which faces eta of master edge m now, and its derivatives.

    before : (n_s, 2) [m].  edges : (n_edges, 2).  previous, following : (n_edges,).  normal : (n_edges, 3, 2) [1],
    those of `before`.  rise : (n_edges,) [m], of smooth pairs: slip is along the round surface.  Returns slip, its
    derivatives by xi and by eta [m], the gap [m] that xi had before and its derivative by xi [m], and the edge it
    faced; the gap is inf where the point faced nothing.

    From m one walks edge by edge to the point faced before.  Where the master ends on the way, or no longer faces the
    slave, the rest is measured along t.
    """
    frame = frame_of(before, edges, normal, e)
    slip, edge, at, way = 0.0, m, eta, 0
    by_eta, xi_f, g, facing = -speed_at(before, edges, m, rise[m], eta), 0.0, np.inf, 0.0
    found = False
    for _ in range(edges.shape[0]):
        xi_f, g, facing = ray(frame, xi, before, edges, edge)
        if not facing < -FACING_COS:
            break
        if xi_f > 1.0 + CUT_TOLERANCE and way >= 0:
            way = 1
        elif xi_f < -CUT_TOLERANCE and way <= 0:
            way = -1
        else:
            found = True
            xi_f = min(max(xi_f, 0.0), 1.0)
            # fault: slip forgets the way to where the point was faced -> slip += (xi_f - eta) * length_of(before,
            #   edges, edge) | contact/test_slip mechanical_fmu/test_friction
            slip += along(before, edges, edge, rise[edge], at, xi_f)
            break
        end = 1.0 if way > 0 else 0.0
        slip += along(before, edges, edge, rise[edge], at, end)
        at, other = end, following[edge] if way > 0 else previous[edge]
        if other < 0 or not faces(frame, xi, before, edges, other):
            break
        edge, at = other, 1.0 - end
    a, b, c, d = edges[e, 0], edges[e, 1], edges[edge, 0], edges[edge, 1]
    nx, ny, _, _, turn = field_normal(normal[e, 1:], xi)
    sx, sy, ex, ey = (before[b, 0] - before[a, 0], before[b, 1] - before[a, 1], before[d, 0] - before[c, 0],
                      before[d, 1] - before[c, 1])
    # By xi the normal n turns to t and t to -n, at the rate `turn`.
    if found:
        d_foot = (nx * sy - ny * sx + g * turn) / (nx * ey - ny * ex)
        by_xi = speed_at(before, edges, edge, rise[edge], xi_f) * d_foot
        g_xi = nx * (ex * d_foot - sx) + ny * (ey * d_foot - sy)
        g -= rise[e] * xi * (1.0 - xi) + rise[edge] * xi_f * (1.0 - xi_f)
        g_xi -= rise[e] * (1.0 - 2.0 * xi) + rise[edge] * (1.0 - 2.0 * xi_f) * d_foot
        return slip, by_xi, by_eta, g, g_xi, edge
    vx = before[c, 0] + at * ex - before[a, 0] - xi * sx
    vy = before[c, 1] + at * ey - before[a, 1] - xi * sy
    slip += nx * vy - ny * vx
    if way == 0:
        by_eta = nx * ey - ny * ex
    return slip, ny * sx - nx * sy - turn * (nx * vx + ny * vy), by_eta, np.inf, 0.0, edge


@kernel
def length_of(x: Floats, edges: Ints, e: int) -> float:
    """Return the length [m] of edge e.  x : (n_s, 2) [m].  edges : (n_edges, 2)."""
    tx, ty = x[edges[e, 1], 0] - x[edges[e, 0], 0], x[edges[e, 1], 1] - x[edges[e, 0], 1]
    return np.sqrt(tx * tx + ty * ty)


@kernel
def along(x: Floats, edges: Ints, e: int, rise: float, first: float, last: float) -> float:
    """Return the length [m] from `first` to `last` [1] along edge e, or along the parabola that rises [m] above it.

    x : (n_s, 2) [m].  edges : (n_edges, 2).
    """
    length = length_of(x, edges, e)
    if rise == 0.0:
        return (last - first) * length
    a, total = rise / length, 0.0
    for k in range(2):
        s = a * (1.0 - 2.0 * (first if k == 0 else last))
        total += (0.25 if k == 0 else -0.25) * (s * np.sqrt(1.0 + s * s) + np.arcsinh(s)) / a
    # fault: slip is along the chords of round surfaces -> return (last - first) * length | contact/test_smooth
    return total * length


@kernel
def speed_at(x: Floats, edges: Ints, e: int, rise: float, at: float) -> float:
    """Return the derivative of that length [m] by its upper end, at `at`.  x : (n_s, 2) [m].  edges : (n_edges, 2)."""
    length = length_of(x, edges, e)
    return length * widened(rise, length, at)


@kernel
def faces(frame: Frame, xi: float, x: Floats, edges: Ints, m: int) -> bool:
    """Return whether edge m has its outside turned to the ray of xi.  x : (n_s, 2) [m].  edges : (n_edges, 2)."""
    return ray(frame, xi, x, edges, m)[2] < -FACING_COS
