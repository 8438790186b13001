"""Exchange by jumps averaged around nodes: what contact conducts beyond what pointwise exchange may.

Pointwise, W (T_s - T_m) at every point asks two piecewise linear temperatures to agree everywhere as W grows; where the
edges of the sides end at different places they can only if they are linear along the whole surface.  Averaged,

    J_a = sum_p V_p N_a(p) (T_s - T_m)_p / W_a,    W_a = sum_p V_p N_a(p),

over what faces each node a of the side the points were searched from, it asks for as many things as that side has nodes
(a mortar: Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989).  The energy 1/2 sum_a W_a J_a^2 is never more than the
pointwise one (Jensen), and the same where the jump is even, whatever V is: heat that flows evenly is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.compiled import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Places = NDArray[np.int64]


@dataclass(frozen=True)
class Patches:
    """What is averaged around each of n_a nodes.

    nodes : (n_a, k) of the mesh that the average has to do with, short rows filled up with their first.  of : (n, 2)
    numbers of the two averages that each point counts in.  place : (n, 2, 4) where its four nodes are among those.
    """

    nodes: Ints
    of: Places
    place: Places


@dataclass(frozen=True)
class NodeAverages:
    """What averages are taken over.

    searched : (n, 2) pair nodes of the side each point was searched from.  N : (n, 2) their shape functions [1].
    nodes : (n, 4) of the mesh, those that a point's temperatures are taken from.
    """

    searched: Ints
    N: Floats
    nodes: Ints

    @cached_property
    def patches(self) -> Patches:
        """The nodes around each; found where contact conducts that much, and not before."""
        averaged, of = np.unique(self.searched, return_inverse=True)
        of = of.reshape(self.searched.shape).astype(np.int64)
        nodes = self.nodes.astype(np.int64)
        many = int(nodes.max()) + 1
        keys, back = np.unique(of[:, :, None] * many + nodes[:, None, :], return_inverse=True)
        first = np.searchsorted(keys, np.arange(averaged.size) * many)
        row = keys // many
        column = np.arange(keys.size) - first[row]
        around = np.repeat((keys[first] % many)[:, None], int(column.max()) + 1, axis=1)
        around[row, column] = keys % many
        return Patches(around.astype(np.int32), of, column[back.reshape(*of.shape, nodes.shape[1])])

    def summed(self, values: Floats) -> Floats:
        """Return (n_a,) the sums of values : (n,) of points around each node, weighted with its shape function."""
        patches = self.patches
        return np.asarray(np.bincount(patches.of.ravel(), (values[:, None] * self.N).ravel(), len(patches.nodes)))


@dataclass(frozen=True)
class Relief:
    """How far averages are taken off (monotone.py).

    much : (n_a,) of each [1].  ratio : (n_a,) what it conducts over what else holds its nodes in a step [1].
    """

    much: Floats
    ratio: Floats

    @property
    def kept(self) -> Floats:
        """(n_a,) what is left of each [1]: one that conducts much lets the sides differ in proportion to much."""
        left = 1.0 - self.much
        return np.divide(left, left + self.ratio * self.much, out=np.zeros(left.size), where=left > 0.0)


@dataclass(frozen=True)
class AveragedExchange:
    """Heat by averaged jumps.

    flow : (n, 4) that leaves the nodes of each point [W].  nodes : (m, k), slope : (m, k, k) its derivative [W/K].
    """

    flow: Floats
    nodes: Ints
    slope: Floats


def averaged_exchange(over: NodeAverages, relief: Relief | None, V: Floats, dV: Floats, jump: Floats,
                      D: Floats) -> AveragedExchange:
    """Exchange heat by averaged jumps.

    V : (n,) conductance of the points [W/K], dV : (n,) its derivative by the mean of the sides [W/K2].  jump : (n,) [K]
    D : (n, 4) derivative of the jump by the nodes' temperatures [1].
    """
    patches = over.patches
    q, W, _, slope = _exchange(V, dV, jump, D, _weights(over, relief), patches.of, patches.place, *patches.nodes.shape)
    some = W > 0.0
    return AveragedExchange(q[:, None] * D, patches.nodes[some], slope[some])


def averaged(over: NodeAverages, relief: Relief | None, V: Floats, D: Floats) -> tuple[Floats, Floats]:
    """Return W : (n_a,) the conductance around each node [W/K], and (n_a, k) the mean of D : (n, 4) [1] there."""
    patches, zero = over.patches, np.zeros(V.size)
    _, W, mean, _ = _exchange(V, zero, zero, D, _weights(over, relief), patches.of, patches.place,
                              *patches.nodes.shape)
    return W, mean


def _weights(over: NodeAverages, relief: Relief | None) -> Floats:
    return over.N if relief is None else over.N * relief.kept[over.patches.of]


@kernel
def _exchange(V: Floats, dV: Floats, jump: Floats, D: Floats, N: Floats, of: Places, place: Places, n_a: int,
              k: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Return q : (n,) heat across each point [W], W : (n_a,) [W/K], mean D : (n_a, k) [1] and the slope (n_a, k, k)."""
    W, J, mean = np.zeros(n_a), np.zeros(n_a), np.zeros((n_a, k))
    for p in range(V.size):
        for i in range(2):
            a, w = of[p, i], V[p] * N[p, i]
            W[a] += w
            J[a] += w * jump[p]
            for j in range(4):
                mean[a, place[p, i, j]] += w * D[p, j]
    slope = np.zeros((n_a, k, k))
    for a in range(n_a):
        if W[a] > 0.0:
            J[a] /= W[a]
            for i in range(k):
                mean[a, i] /= W[a]
            for i in range(k):
                for j in range(k):
                    slope[a, i, j] = W[a] * mean[a, i] * mean[a, j]
    q = np.zeros(V.size)
    for p in range(V.size):
        for i in range(2):
            a = of[p, i]
            q[p] += V[p] * N[p, i] * J[a]
            if dV[p] == 0.0:
                continue
            for j in range(4):
                # V changes with the mean of the sides, and with V the heat and the average.
                # fault: averages do not know that they change with T -> by_T = 0.0 * dV[p] |
                #   thermal_fmu/test_thermal_stiff
                by_T = 0.5 * abs(D[p, j]) * dV[p] * N[p, i]
                for at in range(4):
                    slope[a, place[p, i, at], place[p, i, j]] += by_T * J[a] * D[p, at]
                for at in range(k):
                    slope[a, at, place[p, i, j]] += by_T * (jump[p] - J[a]) * mean[a, at]
    return q, W, mean, slope
