"""Which points of the surfaces face each other: the reply to a Project request."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel
from contact.geometry import face_pass
from contact.normals import edge_frames
from contact.surfaces import Surfaces, checked_reals
from contact.wire import Facing, Floats, Ints

BEHIND_AXIS = 1e-9  # an axisymmetric node may lie this share of the scene's radius beyond the axis: round-off


@dataclass(frozen=True)
class Cut:
    """All facing points of a scene, in one table, and what was worked out on the way.

    number : (n_p,) of the pass.  met : (n_p, 2) slave and master edge.
    values : (n_p, 5) xi_s, xi_m, gap [m], area, area_m [m2].
    normal : (n_edges, 3, 2) as from contact.normals.  node_gap, node_covered : (n_s,) as in Facing.
    The two points of a piece are neighbours.
    """

    number: Ints
    met: Ints
    values: Floats
    normal: Floats
    node_gap: Floats
    node_covered: Floats


def project(surfaces: Surfaces, x: Floats) -> Facing:
    """Facing points at coordinates x : (n_s, 2) [m].  Raises ValueError where x is no possible geometry."""
    c = cut_surfaces(surfaces, x)
    slave_edge, master_edge = np.ascontiguousarray(c.met.T)
    xi_s, xi_m, gap, area, area_m = np.ascontiguousarray(c.values.T)
    return Facing(surfaces.passes.pair[c.number], slave_edge, master_edge, xi_s, xi_m, gap, area, area_m, c.node_gap,
                  c.node_covered)


def cut_surfaces(surfaces: Surfaces, x: Floats) -> Cut:
    """Cut the slave edges of every pass at x : (n_s, 2) [m].  Raises ValueError."""
    r = surfaces.register
    x = checked_reals("x", x, (r.n_nodes, 2))
    length, normal = edge_frames(x, r.edges, surfaces.previous, surfaces.following)
    _check_geometry(surfaces, x, length)
    passes = surfaces.passes
    node_gap = np.full(r.n_nodes, passes.gap_max.max(initial=0.0))
    tables = [_pass(surfaces, x, length, normal, i, node_gap) for i in range(passes.slave.size)]
    counts = [len(values) for _, values in tables]
    number = np.repeat(np.arange(len(tables), dtype=np.int32), counts)
    if len(tables) == 1:
        met, values = tables[0]
    else:
        met = np.concatenate([np.empty((0, 2), dtype=np.int32), *(m for m, _ in tables)])
        values = np.concatenate([np.empty((0, 5)), *(v for _, v in tables)])
    covered = covered_shares(x, r.edges, length, surfaces.in_pair, r.axisymmetric, met, values)
    return Cut(number, met, values, normal, node_gap, covered)


def _pass(surfaces: Surfaces, x: Floats, length: Floats, normal: Floats, i: int,
          node_gap: Floats) -> tuple[Ints, Floats]:
    """Facing points of pass i, (n, 2) edges and (n, 5) values; lowers node_gap where the pass's is less."""
    r, p, start = surfaces.register, surfaces.passes, surfaces.start
    slave, master = p.slave[i], p.master[i]
    first, last = int(start[slave]), int(start[slave + 1])
    masters = surfaces.chain[start[master] : start[master + 1]]
    capacity = 4 * (last - first + masters.size)
    near = np.full(r.n_nodes, np.inf)
    form = (r.axisymmetric, bool(slave == master), bool(p.by_node[i]))
    while True:
        met, values = np.empty((capacity, 2), dtype=np.int32), np.empty((capacity, 5))
        n = face_pass(x, r.edges, length, normal, (first, last), masters, float(p.gap_max[i]), form, met, values, near)
        if n <= capacity:
            np.minimum(node_gap, near, out=node_gap)
            if p.weight[i] != 1.0:
                values[:n, 3:] *= p.weight[i]
            return met[:n], values[:n]
        capacity = n


def _check_geometry(surfaces: Surfaces, x: Floats, length: Floats) -> None:
    if length.size and not length.min() > 0.0:
        e = int(np.argmin(length))
        raise ValueError(f"edge {e} (nodes {surfaces.register.edges[e].tolist()}) has no length")
    if surfaces.register.axisymmetric and x.size and x[:, 0].min() < -BEHIND_AXIS * np.abs(x[:, 0]).max():
        node = int(np.argmin(x[:, 0]))
        raise ValueError(f"node {node} lies beyond the axis, r = {x[node, 0]!r}")


@kernel
def covered_shares(x: Floats, edges: Ints, length: Floats, in_pair: NDArray[np.bool_], axisymmetric: bool,
                   met: Ints, values: Floats) -> Floats:
    """(n_s,) share in [0, 1] of each node's surface, by its shape functions, that faces something."""
    whole, faced = np.zeros(x.shape[0]), np.zeros(x.shape[0])
    for e in range(edges.shape[0]):
        if in_pair[e]:
            a, b = edges[e, 0], edges[e, 1]
            r_a = 2.0 * np.pi * max(x[a, 0], 0.0) if axisymmetric else 1.0
            r_b = 2.0 * np.pi * max(x[b, 0], 0.0) if axisymmetric else 1.0
            whole[a] += length[e] * (2.0 * r_a + r_b) / 6.0
            whole[b] += length[e] * (r_a + 2.0 * r_b) / 6.0
    for i in range(met.shape[0]):
        for side in range(2):
            a, b = edges[met[i, side], 0], edges[met[i, side], 1]
            # fault: covered share by the other node's shape function -> faced[a] += values[i, side] * values[i, 3 +
            #   side] | contact/test_facing
            faced[a] += (1.0 - values[i, side]) * values[i, 3 + side]
            faced[b] += values[i, side] * values[i, 3 + side]
    for s in range(x.shape[0]):
        # Surfaces that fold over each other are met twice: more than all is all.
        faced[s] = min(faced[s] / whole[s], 1.0) if whole[s] > 0.0 else 0.0
    return faced
