"""Normals at corners: where a corner of the slave meets a face, it is pushed along the face's normal.

At a corner the slave has all normals between those of its two edges (a cone), and the face has one: that one the two
share.  With an edge's own normal a corner that stands tilted on a floor without friction is pushed sideways by the sine
of its tilt, and a bouncing block gains or loses energy by it.  So the rays at a corner lean to the face it is nearest
to, as far as the cone goes, and turn with that face; they go back to the edge's own along the edge, which is long
beside what digs in.  (The corner law of nonsmooth contact: Pandolfi, Kane, Marsden & Ortiz 2002.)

Only passes of a penalty alone whose master does not deform do so.  A face that deforms comes to fit what presses on it,
so that both have one normal where its edges are fine enough; at the corner itself its normals jump, and the rays would.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner, kernel
from contact.messages import Floats, Ints
from contact.surfaces import CORNER_COS, END_TOLERANCE, RegisteredSurfaces

Follows = NDArray[np.int32]

# What the normal at an end of an edge turns with: its edge, or with its neighbour if they take the mean of both; the
# edge alone; the neighbour alone; or the master's edge of this number.
AS_DRAWN, OWN, NEIGHBOUR, FACE = -3, -2, -1, 0

# Of straight edges a turn of more than 20 degrees is a corner here: with the mean of its normals an octagon would be
# pushed sideways by up to 0.4 of what presses.
LEAN_COS = 0.9396926207859084
# A face that an edge sees steeper than this (88.9 degrees) has no say, so that an edge on a floor does not look at the
# wall beside it.
STEEPEST = 0.02


@inner
def is_corner(previous: Ints, following: Ints, normal: Floats, e: int, end: int, corner_cos: float) -> bool:
    """Return whether the body has a corner at an end of edge e, which it stands on: no print, but the end of a chain.

    previous, following : (n_edges,).  normal : (n_edges, 3, 2) [1].  corner_cos : of the least turn of a corner.
    """
    other = previous[e] if end == 0 else following[e]
    if other < 0:
        return True
    nx, ny, ox, oy = normal[e, 0, 0], normal[e, 0, 1], normal[other, 0, 0], normal[other, 0, 1]
    # fault: the print of a punch counts as a corner -> goes_out = True | coupler/test_trust_askew
    goes_out = (nx * oy - ny * ox) * (2 * end - 1) > 0.0
    return goes_out and nx * ox + ny * oy < corner_cos


@kernel
def corners(previous: Ints, following: Ints, normal: Floats, corner_cos: float) -> NDArray[np.bool_]:
    """Return (n_edges, 2) whether the body has a corner at the ends of its edges; arrays as of is_corner."""
    found = np.empty((previous.size, 2), dtype=np.bool_)
    for e in range(previous.size):
        for end in range(2):
            found[e, end] = is_corner(previous, following, normal, e, end, corner_cos)
    return found


@kernel
def lean(x: Floats, edges: Ints, previous: Ints, following: Ints, length: Floats, normal: Floats, first: int, last: int,
         masters: Ints, gap_max: float, corner_cos: float, leaned: Floats, follows: Follows) -> None:
    """Lean the normals at the corners of a slave to the faces of a master.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  previous, following, length : (n_edges,) [m].  normal : (n_edges, 3, 2)
    [1].  first, last : first and last + 1 of the slave's edges.  masters : (m,).  gap_max : how far is looked [m].
    corner_cos : of the least turn of a corner.  leaned : (n_edges, 3, 2) [1] and follows : (n_edges, 2) are changed
    where there are corners.
    """
    for e in range(first, last):
        nx, ny = normal[e, 0, 0], normal[e, 0, 1]
        for end in range(2):
            if not is_corner(previous, following, normal, e, end, corner_cos):
                continue
            other = previous[e] if end == 0 else following[e]
            outward = -1.0 if end == 0 else 1.0
            ox, oy = -outward * ny, outward * nx  # an end is the corner of a square
            if other >= 0:
                ox, oy = normal[other, 0, 0], normal[other, 0, 1]
            s = edges[e, end]
            nearest, vx, vy, face = np.inf, 0.0, 0.0, FACE
            for m in masters:
                mx, my = normal[m, 0, 0], normal[m, 0, 1]
                seen = -(nx * mx + ny * my)
                if seen <= STEEPEST:
                    continue
                rx, ry = x[s, 0] - x[edges[m, 0], 0], x[s, 1] - x[edges[m, 0], 1]
                d, at = rx * mx + ry * my, ry * mx - rx * my
                beyond = max(-at, at - length[m], 0.0)
                if beyond > abs(d) + END_TOLERANCE * length[m] or not -max(length[e], length[m]) <= d < gap_max:
                    continue
                away = np.sqrt(d * d + beyond * beyond) / seen
                if away < nearest:
                    nearest, vx, vy, face = away, -mx, -my, m
            if nearest == np.inf:
                continue
            if outward * (nx * vy - ny * vx) <= 0.0:
                leaned[e, 1 + end, 0], leaned[e, 1 + end, 1] = nx, ny
                follows[e, end] = OWN
            elif outward * (vx * oy - vy * ox) >= 0.0 or other < 0:
                # fault: corners push along their edges' normals -> leaned[e, 1 + end, 0] += 0.0 | contact/test_leaning
                leaned[e, 1 + end, 0], leaned[e, 1 + end, 1], follows[e, end] = vx, vy, face
            else:
                # fault: a corner that leans over does not follow its other edge -> leaned[e, 1 + end, 0] += 0.0 |
                #   contact/test_leaning
                leaned[e, 1 + end, 0], leaned[e, 1 + end, 1], follows[e, end] = ox, oy, NEIGHBOUR


def leaned_normals(surfaces: RegisteredSurfaces, x: Floats, length: Floats, normal: Floats, base: Floats,
                   i: int) -> tuple[Floats, Follows]:
    """Return the normals (n_edges, 3, 2) [1] of pass i, and what they turn with, (n_edges, 2).

    x : (n_s, 2) [m].  length : (n_edges,) [m].  normal, base : (n_edges, 3, 2) [1] those of the edges, and of the pass
    if no corner leaned.
    """
    r, p, start = surfaces.register, surfaces.passes, surfaces.start
    slave, master = p.slave[i], p.master[i]
    leaned, follows = base.copy(), np.full((len(base), 2), AS_DRAWN, dtype=np.int32)
    # What is round is so up to its corners.
    corner_cos = CORNER_COS if surfaces.smooth[i] else LEAN_COS
    lean(x, r.edges, surfaces.previous, surfaces.following, length, normal, int(start[slave]), int(start[slave + 1]),
         surfaces.chain[start[master]:start[master + 1]], float(p.gap_max[i]), corner_cos, leaned, follows)
    return leaned, follows


@kernel
def by_face(x: Floats, edges: Ints, face: int, piece: Ints, turned: Floats, nodes: Ints, block: Floats) -> None:
    """Fill nodes : (6,) and block : (12, 12) [N/m], what the turn of a face does to the forces of a piece.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  piece : (6,) nodes as of contact.piece.  turned : (12,) [N] what comes of
    a turn of 1.  The nodes are those of the piece's two edges, then those of the face.
    """
    nodes[0], nodes[1], nodes[2], nodes[3] = piece[0], piece[1], piece[4], piece[5]
    nodes[4], nodes[5] = edges[face, 0], edges[face, 1]
    tx, ty = x[nodes[5], 0] - x[nodes[4], 0], x[nodes[5], 1] - x[nodes[4], 1]
    size = tx * tx + ty * ty
    block[:] = 0.0
    for k in range(8):
        per = turned[k if k < 4 else k + 4] / size
        block[k, 8], block[k, 9], block[k, 10], block[k, 11] = per * ty, -per * tx, -per * ty, per * tx


@kernel
def shares_normal(normal: Floats, e: int, other: int) -> bool:
    """Return whether two neighbours take the mean of their normals at their node, as contact.surfaces.edge_frames does.

    normal : (n_edges, 3, 2) [1].  Not seen from the mean itself: on a flat surface it may round to the edge's own.
    """
    # fault: on flat surfaces normals that turn are left out where round-off says so -> return normal[e, 0, 0] ==
    #   normal[other, 0, 0] and normal[e, 0, 1] == normal[other, 0, 1] | contact/test_pair_nodes
    return normal[e, 0, 0] * normal[other, 0, 0] + normal[e, 0, 1] * normal[other, 0, 1] >= CORNER_COS


@kernel
def ways_of(normal: Floats, follows: Follows, previous: Ints, following: Ints, e: int, ways: Floats) -> None:
    """Fill ways : (2, 3) [1], the shares by which edge, neighbour and a face turn the normals at e's nodes.

    normal : (n_edges, 3, 2) [1].  follows : (n_edges, 2), of contact.leaning.  previous, following : (n_edges,).
    """
    ways[:] = 0.0
    for k in range(2):
        other, way = previous[e] if k == 0 else following[e], follows[e, k]
        if way >= FACE:
            ways[k, 2] = 1.0
        elif way == NEIGHBOUR:
            ways[k, 1] = 1.0
        elif way == AS_DRAWN and other >= 0 and shares_normal(normal, e, other):
            ways[k, 0], ways[k, 1] = 0.5, 0.5
        else:
            ways[k, 0] = 1.0
