"""What faces what across a gap, from neither side: arcs that leave both surfaces at right angles.

Rays along one side's normals meet the other side aslant where the two are not parallel, and the rays of the other side
are other rays.  Here a slave point P and a master point Q face each other if the way from P to Q runs along n_s(P) -
n_m(Q): it makes equal angles with both normals, so a circular arc joins the two that is normal to both surfaces.  Its
length is the gap.  Either side finds the same points, so slave and master may be exchanged; between the sides of a
wedge, between concentric circles and between parallels these arcs are the lines of heat flow.
"""

from __future__ import annotations

import numpy as np

from contact.compiled import inner, kernel
from contact.messages import Floats, Ints
from contact.surfaces import END_TOLERANCE, FACING_COS, Frame, empty_tree, fill_tree, leaves_of

# |n_s - n_m| at least, of normals that face each other and are shortened by being interpolated.
LEAST_SPREAD = 1.3
PARALLEL = 1e-15  # sine squared of an angle so small that an arc is its chord
# What a surface rises above its edges changes a gap at most so many times: of a gap as small as that rise the edges are
# no measure, and a gap must close where the edges meet.
MOST_RISE = 4.0


@inner
def feet(frame: Frame, X: float, Y: float) -> tuple[float, float]:
    """Find the slave coordinates xi whose rays pass through (X, Y) [m], roots of (X - x(xi)) x n(xi) = 0; NaN: none.

    The first root is the one that stays finite as the normals become parallel.
    """
    x1, y1, x2, y2, u1, v1, u2, v2 = frame
    dx, dy, ex, ey = x2 - x1, y2 - y1, u2 - u1, v2 - v1
    rx, ry = X - x1, Y - y1
    c0 = rx * v1 - ry * u1
    c1 = (rx * ey - ry * ex) - (dx * v1 - dy * u1)
    c2 = -(dx * ey - dy * ex)
    inner = c1 * c1 - 4.0 * c2 * c0
    if inner < 0.0:
        return np.nan, np.nan
    q = -0.5 * (c1 + np.sqrt(inner)) if c1 >= 0.0 else -0.5 * (c1 - np.sqrt(inner))
    return (c0 / q if q != 0.0 else np.nan), (q / c2 if c2 != 0.0 else np.nan)


@inner
def tilted(frame: Frame, nx: float, ny: float) -> Frame:
    """Return an edge whose rays run along its normals less n, that of a point it is to face."""
    x1, y1, x2, y2, u1, v1, u2, v2 = frame
    return Frame(x1, y1, x2, y2, u1 - nx, v1 - ny, u2 - nx, v2 - ny)


@inner
def across(frame: Frame, other: Frame, rise_s: float, rise_m: float, xi: float, eta: float) -> tuple[float, float]:
    """Return the gap [m] between point xi of the slave edge and eta of the master edge, which face, and n_s . n_m.

    rise_s, rise_m : of the two edges, as in contact.rounding [m].  The gap is the arc's length, less what the surfaces
    rise above their edges.
    """
    x1, y1, x2, y2, u1, v1, u2, v2 = frame
    a1, b1, a2, b2, s1, t1, s2, t2 = other
    nx, ny = u1 + xi * (u2 - u1), v1 + xi * (v2 - v1)
    mx, my = s1 + eta * (s2 - s1), t1 + eta * (t2 - t1)
    n, m = 1.0 / np.sqrt(nx * nx + ny * ny), 1.0 / np.sqrt(mx * mx + my * my)
    facing = (nx * mx + ny * my) * n * m
    dx, dy = nx * n - mx * m, ny * n - my * m
    cx, cy = a1 + eta * (a2 - a1) - x1 - xi * (x2 - x1), b1 + eta * (b2 - b1) - y1 - xi * (y2 - y1)
    g = (cx * dx + cy * dy) / np.sqrt(dx * dx + dy * dy)
    # The arc turns by twice the angle whose sine this is the square of.
    half = 0.5 * (1.0 + facing)
    if half > PARALLEL:
        # fault: a gap is as long as its chord -> g *= 1.0 | contact/test_arcs
        g *= np.arcsin(np.sqrt(min(half, 1.0))) / np.sqrt(half)
    if g > 0.0:
        # fault: gaps are those of chords -> above = 0.0 * rise_s | contact/test_arcs
        above = rise_s * xi * (1.0 - xi) + rise_m * eta * (1.0 - eta)
        # fault: round surfaces close a gap before their edges meet -> g = g - above | contact/test_arcs
        g = min(max(g - above, g / MOST_RISE), g * MOST_RISE)
    return g, facing


@inner
def opposite(frame: Frame, other: Frame, rise_s: float, rise_m: float, xi: float,
             slack: float) -> tuple[float, float, float]:
    """Find what slave coordinate xi faces on a master edge; return the coordinate on it, gap [m], n_s . n_m.

    rise_s, rise_m : as in contact.rounding [m].  slack : how far beyond its ends the edge is taken to reach [1]; what
    it faces beyond that has no gap, and n_s . n_m is 0.
    """
    x1, y1, x2, y2, u1, v1, u2, v2 = frame
    # fault: the way to what is faced runs along the slave's normal -> bare = Frame(other[0], other[1], other[2],
    #   other[3], 0.0, 0.0, 0.0, 0.0) | contact/test_arcs
    bare = other
    of = tilted(bare, u1 + xi * (u2 - u1), v1 + xi * (v2 - v1))
    first, second = feet(of, x1 + xi * (x2 - x1), y1 + xi * (y2 - y1))
    if np.isnan(first):
        return np.nan, np.nan, 0.0
    if not -slack <= first <= 1.0 + slack:
        if not -slack <= second <= 1.0 + slack:
            return first, np.nan, 0.0
        first = second
    g, facing = across(frame, other, rise_s, rise_m, xi, first)
    return first, g, facing


@kernel
def normal_tree(normal: Floats, chain: Ints) -> Floats:
    """Return (2 P, 4) ranges [u_min, u_max, v_min, v_max] [1] of the normals at the ends of a chain of edges.

    normal : (n_edges, 3, 2) [1].  chain : (m,) edge numbers.  Numbered as the boxes of contact.surfaces.box_tree.
    """
    P = leaves_of(chain.size)
    ranges = np.empty((2 * P, 4))
    empty_tree(ranges)
    for k in range(chain.size):
        for c in range(2):
            one, two = normal[chain[k], 1, c], normal[chain[k], 2, c]
            ranges[P + k, 2 * c], ranges[P + k, 2 * c + 1] = min(one, two), max(one, two)
    fill_tree(ranges)
    return ranges


@inner
def widest(low: float, high: float) -> tuple[float, float]:
    """Return the range of a component [1] of the unit vector along n_s - n_m, from that of the difference."""
    lower = max(low / LEAST_SPREAD, -1.0) if low < 0.0 else 0.5 * low
    upper = min(high / LEAST_SPREAD, 1.0) if high > 0.0 else 0.5 * high
    return lower, upper


@kernel
def reached(boxes: Floats, ranges: Floats, masters: Ints, normal: Floats, frame: Frame, back: float, ahead: float,
            hits: Ints) -> int:
    """Put into hits the edges of a box tree that a slave edge may face by arcs; return how many.

    boxes : (2 P, 4) [m] and ranges : (2 P, 4) [1] over the chain masters : (m,).  normal : (n_edges, 3, 2) [1].
    back, ahead : reach [m].  hits : (m,) out.  As contact.surfaces.candidates does it for rays; the way leaves the
    slave's normal by half of what the other side is tilted, so a flat opposite widens nothing.
    """
    x1, y1, x2, y2, u1, v1, u2, v2 = frame
    tx, ty = x2 - x1, y2 - y1
    size = np.sqrt(tx * tx + ty * ty)
    slack = END_TOLERANCE * size
    P = boxes.shape[0] // 2
    stack = np.empty(64, dtype=np.int32)
    stack[0], top, count = 1, 1, 0
    while top > 0:
        top -= 1
        i = stack[top]
        if ranges[i, 0] > ranges[i, 1]:
            continue  # an empty box
        d1, d2 = min(u1, u2) - ranges[i, 1], max(u1, u2) - ranges[i, 0]
        d3, d4 = min(v1, v2) - ranges[i, 3], max(v1, v2) - ranges[i, 2]
        low, high = widest(d1, d2)
        if boxes[i, 0] > max(x1, x2) + max(ahead * high, -back * low) + slack:
            continue
        if boxes[i, 1] < min(x1, x2) + min(ahead * low, -back * high) - slack:
            continue
        low, high = widest(d3, d4)
        if boxes[i, 2] > max(y1, y2) + max(ahead * high, -back * low) + slack:
            continue
        if boxes[i, 3] < min(y1, y2) + min(ahead * low, -back * high) - slack:
            continue
        low, high = widest((min(tx * d1, tx * d2) + min(ty * d3, ty * d4)) / size,
                           (max(tx * d1, tx * d2) + max(ty * d3, ty * d4)) / size)
        middle = ((0.5 * (boxes[i, 0] + boxes[i, 1]) - x1) * tx + (0.5 * (boxes[i, 2] + boxes[i, 3]) - y1) * ty) / size
        half = 0.5 * ((boxes[i, 1] - boxes[i, 0]) * abs(tx) + (boxes[i, 3] - boxes[i, 2]) * abs(ty)) / size
        # fault: what arcs reach is sought along the slave's normals alone -> low, high = 0.0 * low, 0.0 * high |
        #   contact/test_arcs
        low, high = low, high
        if middle - half > size + max(ahead * high, -back * low) + slack:
            continue
        if middle + half < min(ahead * low, -back * high) - slack:
            continue
        if i >= P:
            m = masters[i - P]
            least = 1.0
            for k in range(3):
                mx, my = normal[m, k, 0], normal[m, k, 1]
                least = min(least, u1 * mx + v1 * my, u2 * mx + v2 * my)
            if least < -FACING_COS:
                hits[count] = m
                count += 1
        else:
            stack[top], stack[top + 1] = 2 * i, 2 * i + 1
            top += 2
    return count
