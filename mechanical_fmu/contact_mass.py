"""Mass off the surfaces of contact: their nodes are moved by the bodies behind them, and carry none.

A node with mass that meets a surface is thrown back by it, whatever the step: it rattles at the frequency of the
penalty, or of the step, and the trapezoidal rule gains energy from that.  Without mass it follows the body in
equilibrium, the pressure is a continuous function of how the body moves, and multipliers are determined (Khenous,
Laborde and Renard, Eur. J. Mech. A 27, 2008; Hager, Hueber and Wohlmuth, IJNME 73, 2008).

Here the velocity of such a node is taken from nodes behind it, v_a = sum_b w_ab v_b with sum w_ab = 1 and sum w_ab X_b
= X_a: with T the matrix of all w the kinetic energy is that of M' = T^T M T, which is symmetric and positive wherever M
is.  T reproduces every linear field, so mass, centre, all second moments of the reference shape, and with them the
momentum and the moment of inertia are those of M to round-off, and so is the energy of any uniform stretching: waves
notice it in the second order of the cells' size only.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

# Rings of cells around a node in which those are sought that move it: one ring holds a single row along a surface.
FIRST_RING, LAST_RING = 2, 5
# Sum of |w| up to which a node is moved by others: two rows of like cells have 3.  Beyond, they lie too much in line.
MAX_WEIGHTS = 8.0
# Weights fall with this power of the distance: the nearest two rows do nearly all of it.
NEARNESS = 4


def taken_along(X: Floats, cells: Iterable[NDArray[np.int32]], massless: Flags, n: int) -> tuple[csr_matrix, Flags]:
    """Make T : (n, n) and say, (n,), which nodes have no mass of their own by it.

    X : (n_nodes, 2) [m] reference coordinates.  cells : (n_e, nn) node numbers, a kind each.  massless : (n_nodes,)
    which should have none.  n : rows of the nodal arrays, at least n_nodes.  A node with too few nodes behind it, as of
    a strip one or two cells thick between surfaces, keeps its mass.
    """
    near = _neighbours(len(X), cells)
    rows, columns, values = [], [], []
    without = np.zeros(n, dtype=np.bool_)
    for a in np.flatnonzero(massless):
        found = _weights(X, near, massless, int(a))
        if found is None:
            continue
        nodes, w = found
        without[a] = True
        rows.append(np.full(len(nodes), a))
        columns.append(nodes)
        values.append(w)
    own = np.flatnonzero(~without)
    where = (np.concatenate([own, *rows]), np.concatenate([own, *columns]))
    T = coo_matrix((np.concatenate([np.ones(own.size), *values]), where), shape=(n, n))
    return csr_matrix(T), without


def _neighbours(n: int, cells: Iterable[NDArray[np.int32]]) -> csr_matrix:
    """(n, n) with an entry for nodes of one cell."""
    rows, columns = [np.empty(0, np.intp)], [np.empty(0, np.intp)]
    for cell_nodes in cells:
        nodes = cell_nodes.astype(np.intp)
        rows.append(np.repeat(nodes, nodes.shape[1], axis=1).ravel())
        columns.append(np.tile(nodes, (1, nodes.shape[1])).ravel())
    i, j = np.concatenate(rows), np.concatenate(columns)
    return csr_matrix(coo_matrix((np.ones(i.size), (i, j)), shape=(n, n)))


def _weights(X: Floats, near: csr_matrix, massless: Flags, a: int) -> tuple[NDArray[np.intp], Floats] | None:
    """The nodes that move node a, and their weights: of least sum w2 r^NEARNESS among those that are exact."""
    reached = np.array([a])
    for ring in range(1, LAST_RING + 1):
        reached = np.unique(near[reached].indices)
        if ring < FIRST_RING:
            continue
        nodes = reached[~massless[reached]]
        if nodes.size < 3:
            continue
        arm = X[nodes] - X[a]
        r = np.hypot(*arm.T)
        arm, r = arm / r.min(), r / r.min()
        P = np.column_stack([np.ones(nodes.size), arm])
        D = P * r[:, None] ** -NEARNESS
        A = P.T @ D
        if np.linalg.cond(A) > 1.0 / np.finfo(float).eps ** 0.5:
            continue
        w = D @ np.linalg.solve(A, [1.0, 0.0, 0.0])
        if np.abs(w).sum() <= MAX_WEIGHTS:
            return nodes, w
    return None
