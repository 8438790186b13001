"""What friction remembers: the mobilised friction tau/p_N [1] of the slave's material points.

It is +-mu wherever all slips, so nothing is lost by taking it linear between points, and what is held right at the
bound stays there.  It is kept at the contact quadrature points of the step before, where Coulomb's law acted: a step
whose surfaces have not moved meets the same points and finds the very shear it left, so nothing slips.  (Carried by
nodes alone, a mean over points that slip and points that stick loses shear, and a surface at rest slips again to regain
it, step after step.)  Between the points of an edge it is linear, beyond the outermost ones constant; where an edge has
none, as after a start from another mesh's run, it is linear between its nodes, the mean over what they touch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.compiled import kernel
from contact.messages import Floats, Ints
from contact.surfaces import checked_reals

COLUMNS = 3  # the pair node of the slave edge's first end, place along the edge [1], mobilised friction [1]


@dataclass(frozen=True)
class ShearHistory:
    """Mobilised friction of a request, checked.

    nodes : (n_q,) [1].  points : (n_h, 3) rows of COLUMNS, ascending.  start : (n_q + 1,) first rows of the edges.
    """

    nodes: Floats
    points: Floats
    start: Ints


def checked_history(mobilised: object, mobilised_at: object, n_q: int) -> ShearHistory:
    """Check the history of friction of a request; n_q pair nodes.  Raises ValueError."""
    nodes = checked_reals("mobilised", mobilised, (n_q,))
    if mobilised_at is None:
        return ShearHistory(nodes, np.empty((0, COLUMNS)), np.zeros(n_q + 1, dtype=np.int32))
    given = np.asarray(mobilised_at)
    points = checked_reals("mobilised_at", given, (given.shape[0] if given.ndim == 2 else 0, COLUMNS))
    of, xi = points[:, 0], points[:, 1]
    # fault: friction remembered of edges that are not there -> wrong = np.empty(0, dtype=np.intp) |
    #   contact/test_shear_history
    wrong = np.flatnonzero((of != np.floor(of)) | (of < 0) | (of >= n_q) | (xi < 0.0) | (xi > 1.0))
    if wrong.size:
        raise ValueError(f"mobilised_at: row {int(wrong[0])} is no place on an edge of the {n_q} pair nodes")
    later = np.flatnonzero((of[1:] < of[:-1]) | ((of[1:] == of[:-1]) & (xi[1:] < xi[:-1])))
    if later.size:
        raise ValueError(f"mobilised_at: row {int(later[0]) + 1} comes before the row above it; sort rows by edge, "
                         "then by place")
    return ShearHistory(nodes, points, np.searchsorted(of, np.arange(n_q + 1)).astype(np.int32))


@kernel
def remembered(nodes: Floats, points: Floats, start: Ints, a: int, b: int, xi: float) -> tuple[float, float]:
    """Return the mobilised friction [1] of point xi of the slave edge from pair node a to b, and its derivative by xi.

    nodes : (n_q,) [1].  points : (n_h, 3).  start : (n_q + 1,).
    """
    first, last = start[a], start[a + 1] - 1
    # fault: friction is remembered at nodes alone -> if True: | contact/test_shear_history mechanical_fmu/test_rest
    if last < first:
        return nodes[a] + xi * (nodes[b] - nodes[a]), nodes[b] - nodes[a]
    # Not on to the nodes: a point may lie a hair from one, and nothing may jump over a hair.
    if xi <= points[first, 1] or xi >= points[last, 1]:
        return points[first if xi <= points[first, 1] else last, 2], 0.0
    k = first
    while points[k + 1, 1] <= xi:
        k += 1
    slope = (points[k + 1, 2] - points[k, 2]) / (points[k + 1, 1] - points[k, 1])
    return points[k, 2] + (xi - points[k, 1]) * slope, slope


def noted(at: Ints, values: Floats, mu: Floats, p_N: Floats, tau: Floats) -> Floats:
    """Return what friction remembers of the points that touch: (n_h, 3) rows of COLUMNS, ascending.

    at : (n_p, 4) pair nodes, the slave edge's two first.  values : (n_p, 5) xi_s, xi_m [1], gap [m], area, area_m [m2].
    mu : (n_p,) [1].  p_N, tau : (n_p,) [Pa].
    """
    rubs = np.flatnonzero((p_N > 0.0) & (mu > 0.0))
    rubs = rubs[np.lexsort((values[rubs, 0], at[rubs, 0]))]
    return np.column_stack([at[rubs, 0].astype(np.float64), values[rubs, 0], tau[rubs] / p_N[rubs]])
