"""Which cell a point lies in, and with what weights its nodes make up the value there."""

from __future__ import annotations

import numpy as np

from contact.half.interface import Interface
from coupler.scenario.body_mesh import Floats, Ints

# A point this far outside a cell, as a share of its size, still counts as inside: points on edges, round-off.
SLACK = 1e-9
NEWTON_STEPS = 30


def locate(interface: Interface, body: str, at: Floats) -> tuple[Ints, Floats] | None:
    """Nodes and weights of a point of a body's reference mesh; None where it is off the mesh.

    at : (2,) [m].  Weights are the cell's shape functions there; nodes with weight 0 are left out.
    """
    index = interface.bodies.index(body)
    for cells, owner in (
        (interface.quads, interface.quad_body),
        (interface.triangles, interface.triangle_body),
    ):
        own = cells[owner == index]
        if not len(own):
            continue
        x = interface.nodes[own]
        low, high = x.min(axis=1), x.max(axis=1)
        slack = SLACK * (high - low).max(axis=1, keepdims=True)
        for cell in np.flatnonzero(((at >= low - slack) & (at <= high + slack)).all(axis=1)):
            weights = _quad_weights(x[cell], at) if x.shape[1] == 4 else _triangle_weights(x[cell], at)
            if weights is not None and weights.min() >= -SLACK:
                return _cleaned(own[cell], weights)
    return None


def _cleaned(nodes: Ints, weights: Floats) -> tuple[Ints, Floats]:
    kept = weights > SLACK
    # fault: probe takes the first node of its cell -> return nodes[kept][:1], np.ones(1) | coupler/test_scenario_probes
    return nodes[kept], weights[kept] / weights[kept].sum()


def _triangle_weights(x: Floats, at: Floats) -> Floats:
    """(3,) barycentric coordinates."""
    edges = (x[1:] - x[0]).T
    b = np.linalg.solve(edges, at - x[0])
    return np.array([1.0 - b.sum(), *b])


def _quad_weights(x: Floats, at: Floats) -> Floats | None:
    """(4,) bilinear shape functions at a point, by Newton on the map from the unit square; None: outside."""
    xi = np.full(2, 0.5)
    size = float(np.ptp(x, axis=0).max())
    for _ in range(NEWTON_STEPS):
        a, b = xi
        N = np.array([(1 - a) * (1 - b), a * (1 - b), a * b, (1 - a) * b])
        miss = at - N @ x
        if np.abs(miss).max() <= 1e-14 * size:
            return N
        dN = np.array([[b - 1, 1 - b, b, -b], [a - 1, -a, a, 1 - a]])
        J = (dN @ x).T
        if abs(np.linalg.det(J)) < 1e-30 * size**2:
            return None
        xi = np.clip(xi + np.linalg.solve(J, miss), -1.0, 2.0)
    # Round-off may keep the last digits from settling; a point not reached lies outside.
    return N if np.abs(miss).max() <= SLACK * size else None
