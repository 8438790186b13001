"""Surfaces as heat sees them, and forces of smooth pairs: round where edges are chords of an arc, with normals at ends.

Other forces act on the edges as they are.  But a gap of 1 mm between edges of 5 mm on a radius of 50 mm is 6 % of
itself farther, or nearer, than that between the arcs; and a surface that ends at a plane of symmetry goes on beyond it:
with its last edge's own normal there, the rays of half an edge are lost.  How round a surface is, is asked of it as
drawn (contact.facing); its normals, where it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.compiled import inner, kernel
from contact.messages import Floats, Ints
from contact.surfaces import CORNER_COS

# An edge that turns against the next by more than this may be a bevel: it is no chord of an arc to heat either.  In
# between it is one in part, so that nothing jumps as surfaces deform.  [rad]
ROUND_TURN, BEVEL_TURN = np.pi / 8, np.pi / 4
# So many times longer than its neighbour an edge may be, and its end still be told from the turn between them: a long
# flat edge beside a fillet of short ones is flat.
ALIKE, UNLIKE = 2.0, 3.0
ON_AXIS = 1e-9  # of an edge: cos(90 degrees) is 6e-17


@dataclass(frozen=True)
class Rounding:
    """normal : (n_edges, 3, 2) unit normals [1] of an edge, at its first and at its second node.

    rise : (n_edges,) [m]: the surface lies rise xi (1 - xi) outside of its edge, four times what it does in the middle.
    """

    normal: Floats
    rise: Floats


@inner
def turn_between(ax: float, ay: float, bx: float, by: float) -> float:
    """Return the angle from unit vector a to unit vector b [rad], positive to the left."""
    cross, dot = ax * by - ay * bx, ax * bx + ay * by
    return np.arctan2(cross, dot) if cross != 0.0 else 0.0


@inner
def bend(turn: float, own: float, other: float) -> float:
    """Return the part of a turn [rad] between neighbours of lengths own, other [m] that an arc makes along its half."""
    # fault: bevels are round -> if abs(turn) >= 10.0: | contact/test_rounding
    if abs(turn) >= BEVEL_TURN:
        return 0.0
    certain = min((BEVEL_TURN - abs(turn)) / (BEVEL_TURN - ROUND_TURN), 1.0)
    # fault: long flat edges beside a fillet are round -> alike = 1.0 | contact/test_rounding
    alike = min(max((UNLIKE - own / other) / (UNLIKE - ALIKE), 0.0), 1.0)
    return turn * own / (own + other) * certain * alike


@kernel
def round_frames(x: Floats, edges: Ints, previous: Ints, following: Ints, axisymmetric: bool, length: Floats,
                 normal: Floats, rise: Floats) -> None:
    """Turn the normals where chains end, and find how far the surface lies outside of its edges.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  previous, following : (n_edges,).  length : (n_edges,) [m].
    normal : (n_edges, 3, 2) [1] as from contact.surfaces.edge_frames, changed.  Fills rise : (n_edges,) [m].

    An arc turns alike at both ends of its chord; so what an edge turns at one end is what it would at the other, where
    the chain ends or has a corner.  On the axis of revolution its neighbour is its own mirror image.  Where the two
    ends turn unlike, the lesser holds, and an edge that turns to both ways is straight.
    """
    smooth, bends = np.zeros(2, dtype=np.bool_), np.zeros(2)
    for e in range(edges.shape[0]):
        nx, ny = normal[e, 0, 0], normal[e, 0, 1]
        smooth[:], bends[:] = False, 0.0
        for end in range(2):
            other, way = previous[e] if end == 0 else following[e], -1.0 if end == 0 else 1.0
            if other >= 0:
                mx, my, beyond = normal[other, 0, 0], normal[other, 0, 1], length[other]
            # fault: on the axis no neighbour -> elif axisymmetric and x[edges[e, end], 0] < -1.0: |
            #   contact/test_rounding
            elif axisymmetric and x[edges[e, end], 0] <= ON_AXIS * length[e]:
                mx, my, beyond = -nx, ny, length[e]
            else:
                continue
            if nx * mx + ny * my < CORNER_COS:
                continue
            smooth[end] = True
            bends[end] = bend(way * turn_between(nx, ny, mx, my), length[e], beyond)
            if other < 0:
                normal[e, 1 + end, 0], normal[e, 1 + end, 1] = 0.0, 1.0 if ny > 0.0 else -1.0
        for end in range(2):
            if smooth[1 - end] and not smooth[end]:
                bends[end] = bends[1 - end]
                # fault: a surface ends with the normal of its last edge -> angle = 0.0 * bends[end] |
                #   contact/test_rounding
                angle = bends[end] if end == 1 else -bends[end]
                c, s = np.cos(angle), np.sin(angle)
                normal[e, 1 + end, 0], normal[e, 1 + end, 1] = c * nx - s * ny, s * nx + c * ny
        rise[e] = 0.0
        # fault: an edge that turns both ways is round -> if bends[0] != 0.0: | contact/test_rounding
        if bends[0] * bends[1] > 0.0:
            # The parabola with this slope at its ends; the body is on the left, so a convex one turns to the left.
            rise[e] = length[e] * (bends[0] if abs(bends[0]) < abs(bends[1]) else bends[1])


def rounding_of(x: Floats, edges: Ints, previous: Ints, following: Ints, axisymmetric: bool, length: Floats,
                normal: Floats) -> Rounding:
    """Return the Rounding of edges : (n_edges, 2) at x : (n_s, 2) [m].

    previous, following : (n_edges,).  length : (n_edges,) [m] and normal : (n_edges, 3, 2) [1] as from
    contact.surfaces.edge_frames.
    """
    turned, rise = normal.copy(), np.empty(len(edges))
    round_frames(x, edges, previous, following, axisymmetric, length, turned, rise)
    return Rounding(turned, rise)


@kernel
def end_turns(normal: Floats, turned: Floats) -> Floats:
    """Return the angles (n_edges, 2) [rad] from the normals at the ends of edges to those turned by round_frames.

    normal, turned : (n_edges, 3, 2) [1].
    """
    angle = np.zeros((normal.shape[0], 2))
    for e in range(normal.shape[0]):
        for end in range(2):
            angle[e, end] = turn_between(normal[e, 1 + end, 0], normal[e, 1 + end, 1], turned[e, 1 + end, 0],
                                         turned[e, 1 + end, 1])
    return angle


@kernel
def turned_ends(normal: Floats, angle: Floats) -> Floats:
    """Return normals (n_edges, 3, 2) [1] turned at the ends of their edges; angle : (n_edges, 2) [rad]."""
    turned = normal.copy()
    for e in range(normal.shape[0]):
        for end in range(2):
            if angle[e, end] != 0.0:
                c, s = np.cos(angle[e, end]), np.sin(angle[e, end])
                nx, ny = normal[e, 1 + end, 0], normal[e, 1 + end, 1]
                # fault: to forces a round surface ends with the normal of its last edge -> c, s = 1.0, 0.0 |
                #   contact/test_smooth
                turned[e, 1 + end, 0], turned[e, 1 + end, 1] = c * nx - s * ny, s * nx + c * ny
    return turned
