"""The field of normals of a surface.

At a node it is the mean of its two edges' unit normals, at an end and at a corner of the body the edge's own;
it is linear along an edge.  So the rays of a smooth surface leave no gaps between them, and a flat surface has
exactly its own normal.
"""

from __future__ import annotations

import numpy as np

from contact.compiled import kernel
from contact.wire import Floats, Ints

# A turn of more than 60 degrees is a corner of the body, where both edges keep their own normals: with the mean,
# the pressure beside a square corner would push 45 degrees off the face.
# fault: normals averaged round square corners -> CORNER_COS = -0.5 | contact/test_facing
CORNER_COS = 0.5


@kernel
def edge_frames(x: Floats, edges: Ints, previous: Ints, following: Ints) -> tuple[Floats, Floats]:
    """Outward normals and lengths of edges.

    x : (n_s, 2) [m].  Returns length : (n_edges,) [m] and normal : (n_edges, 3, 2), the edge's own unit
    normal, and those of the field at its first and second node.
    """
    n = edges.shape[0]
    length, normal = np.empty(n), np.empty((n, 3, 2))
    for e in range(n):
        tx, ty = x[edges[e, 1], 0] - x[edges[e, 0], 0], x[edges[e, 1], 1] - x[edges[e, 0], 1]
        length[e] = np.sqrt(tx * tx + ty * ty)
        scale = 1.0 / length[e] if length[e] > 0.0 else 0.0
        normal[e, 0, 0], normal[e, 0, 1] = ty * scale, -tx * scale
    for e in range(n):
        for end in range(2):
            other = previous[e] if end == 0 else following[e]
            nx, ny = normal[e, 0, 0], normal[e, 0, 1]
            # fault: normals jump from edge to edge -> if other < -1 and nx * normal[other, 0, 0] + ny * normal[other,
            #   0, 1] >= CORNER_COS: | contact/test_facing
            if other >= 0 and nx * normal[other, 0, 0] + ny * normal[other, 0, 1] >= CORNER_COS:
                nx, ny = nx + normal[other, 0, 0], ny + normal[other, 0, 1]
                size = np.sqrt(nx * nx + ny * ny)
                nx, ny = nx / size, ny / size
            normal[e, 1 + end, 0], normal[e, 1 + end, 1] = nx, ny
    return length, normal
