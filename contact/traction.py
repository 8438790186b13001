"""Frictionless contact forces at the facing points: the reply to a Traction request.  Eqs. (17)-(20).

p_N = max(-lambda - eps_N g_N, 0) at each point, lambda interpolated from the slave's nodes; a point touches where
p_N > 0.  It pushes the slave with -N p_N n A and the master with +M p_N n A, along the ray n that joins the two
points, so forces and moments balance to round-off.

The stiffness keeps what is of order eps_N: d(g_N) with the normals held, by which a point slides along a tilted
master edge (hence n_m/(n . n_m), not symmetric there; forgetting it is an error of eps_N tan(tilt), which a stiff
penalty does not forgive).  Left out are the terms of order p_N: turning of the normals, change of the areas, of the
cuts, and of the master coordinate.  Against what is kept they are |g_N|/edge length.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from contact.facing import cut_surfaces
from contact.surfaces import Surfaces, checked_reals
from contact.wire import Floats, Ints, Tractions


def traction(surfaces: Surfaces, x: Floats, multipliers: Floats) -> Tractions:
    """Contact forces at x : (n_s, 2) [m] with multipliers : (n_s,) [Pa], <= 0.  Raises ValueError."""
    r = surfaces.register
    multipliers = checked_reals("multipliers", multipliers, (r.n_nodes,))
    if multipliers.size and multipliers.max() > 0.0:
        raise ValueError(f"multipliers must be <= 0, got {multipliers.max()!r} at node {multipliers.argmax()}")
    cut = cut_surfaces(surfaces, x)
    eps_N = r.eps_N[cut.pair]
    p_N = pressures(r.edges, cut.met, cut.values, eps_N, multipliers)
    force, t_N = nodal_forces(r.edges, cut.met, cut.values, cut.normal, p_N, r.n_nodes)
    nodes, blocks = stiffness(r.edges, cut.met, cut.values, cut.normal, p_N, eps_N)
    new = np.where(surfaces.on_slave, t_N, 0.0)
    return Tractions(force, nodes, blocks, t_N, cut.node_gap, cut.node_covered, new, int(np.count_nonzero(p_N)))


@njit(cache=True, error_model="numpy")
def pressures(edges: Ints, met: Ints, values: Floats, eps_N: Floats, multipliers: Floats) -> Floats:
    """p_N : (n_p,) [Pa] = max(-lambda - eps_N g_N, 0)."""
    p_N = np.empty(met.shape[0])
    for i in range(met.shape[0]):
        a, b, xi = edges[met[i, 0], 0], edges[met[i, 0], 1], values[i, 0]
        given = (1.0 - xi) * multipliers[a] + xi * multipliers[b]
        p_N[i] = max(-given - eps_N[i] * values[i, 2], 0.0)
    return p_N


@njit(cache=True, error_model="numpy")
def nodal_forces(edges: Ints, met: Ints, values: Floats, normal: Floats, p_N: Floats,
                 n_nodes: int) -> tuple[Floats, Floats]:
    """force : (n_nodes, 2) [N], and t_N : (n_nodes,) [Pa] = -sum(A N p_N)/sum(A N) over what each node faces."""
    force, pushed, faced = np.zeros((n_nodes, 2)), np.zeros(n_nodes), np.zeros(n_nodes)
    for i in range(met.shape[0]):
        n_x, n_y = _ray_normal(normal[met[i, 0]], values[i, 0])
        for side in range(2):
            for end in range(2):
                s = edges[met[i, side], end]
                N = values[i, side] if end == 1 else 1.0 - values[i, side]
                weight = N * values[i, 3]
                load = weight * p_N[i]
                sign = -1.0 if side == 0 else 1.0
                force[s, 0] += sign * load * n_x
                force[s, 1] += sign * load * n_y
                pushed[s] += load
                faced[s] += weight
    for s in range(n_nodes):
        pushed[s] = -pushed[s] / faced[s] if pushed[s] > 0.0 else 0.0
    return force, pushed


@njit(cache=True, error_model="numpy")
def stiffness(edges: Ints, met: Ints, values: Floats, normal: Floats, p_N: Floats,
              eps_N: Floats) -> tuple[Ints, Floats]:
    """block_nodes : (n_b, 4) and blocks : (n_b, 8, 8) [N/m], one block a touching piece.

    eps_N A (G n)(G n_m/(n . n_m))^T with G = (-N_1, -N_2, M_1, M_2): symmetric where the two edges are parallel.
    """
    n_blocks = 0
    for i in range(0, met.shape[0], 2):
        n_blocks += p_N[i] > 0.0 or p_N[i + 1] > 0.0
    nodes, blocks = np.empty((n_blocks, 4), dtype=np.int32), np.zeros((n_blocks, 8, 8))
    b = 0
    for i in range(0, met.shape[0], 2):
        if not (p_N[i] > 0.0 or p_N[i + 1] > 0.0):
            continue
        for k in range(4):
            nodes[b, k] = edges[met[i, k // 2], k % 2]
        for q in range(i, i + 2):
            if p_N[q] > 0.0:
                _add_point(blocks[b], values[q], normal[met[q, 0]], normal[met[q, 1], 0], eps_N[q])
        b += 1
    return nodes, blocks


@njit(cache=True, error_model="numpy")
def _ray_normal(normal: Floats, xi: float) -> tuple[float, float]:
    """Unit normal at xi of an edge whose field normals are normal[1] and normal[2]."""
    n_x = normal[1, 0] + xi * (normal[2, 0] - normal[1, 0])
    n_y = normal[1, 1] + xi * (normal[2, 1] - normal[1, 1])
    size = np.sqrt(n_x * n_x + n_y * n_y)
    return n_x / size, n_y / size


@njit(cache=True, error_model="numpy")
def _add_point(block: Floats, value: Floats, normal: Floats, n_m: Floats, eps_N: float) -> None:
    """Add eps_N A (G n)(G n_m/(n . n_m))^T of one point to its block : (8, 8)."""
    n_x, n_y = _ray_normal(normal, value[0])
    facing = n_x * n_m[0] + n_y * n_m[1]
    k_N = eps_N * value[3] / facing
    G = (value[0] - 1.0, -value[0], 1.0 - value[1], value[1])
    for j in range(4):
        for k in range(4):
            K = k_N * G[j] * G[k]
            block[2 * j, 2 * k] += K * n_x * n_m[0]
            block[2 * j, 2 * k + 1] += K * n_x * n_m[1]
            block[2 * j + 1, 2 * k] += K * n_y * n_m[0]
            block[2 * j + 1, 2 * k + 1] += K * n_y * n_m[1]
