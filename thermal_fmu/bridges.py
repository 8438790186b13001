"""Takes off what an exchange between two surfaces couples with the wrong sign, where a node left its data by it.

At a contact quadrature point the exchange W (T_s - T_m) is shared by the shape functions of either side, and so carries
W N_1 N_2 (T_1 - T_2) from the colder node of an edge to the warmer one.  Conduction along the edge makes up for it up
to a cell Biot number of 1 or so; beyond, a node may rise above all that pulls it.  Heat that goes from node to node has
no wrong sign, but is less accurate (F1 with 24 cells: 2.7 K of 473) and, on meshes that do not match, not exact where
the temperature is linear along the surface; no linear exchange is both, as in transport (Godunov).  So a step that
shows a node beyond all temperatures there were is taken again with as much from node to node there as makes the sign
right: the idea of flux correction (Kuzmin, J. Comput. Appl. Math. 236 (2012) 2317), with the places found afterwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from thermal_fmu.cells import MatrixEntries, conduct
from thermal_fmu.exchange import ConductionGroup
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.scene import SubstepData, ThermalScene

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Of the range of temperatures: what is seen of a node's rise, of its way out of all temperatures there were, and of
# what wrong signs do to it.
LEAST = 1e-9


@dataclass(frozen=True)
class StepEnd:
    """A step at its end.  start : (n,) its T at the start [K], None in a steady state.  at : fields at the end.

    flow : (n,) heat into each node [W].  diagonal : (n,) of the derivative of -flow by T and of storage [W/K].
    around : (k,) temperatures of the surroundings [K].
    """

    start: Floats | None
    at: NodalFields
    flow: Floats
    diagonal: Floats
    around: Floats


@dataclass(frozen=True)
class SharedEdges:
    """Edges of surfaces that exchange heat.

    nodes : (m, 2).  strength : (m,) sum of W N_1 N_2 over its points [W/K], left : (m,) what of it is not from node to
    node.  keys : (m,) ascending, edge_keys of nodes.
    """

    nodes: NDArray[np.int64]
    strength: Floats
    left: Floats
    keys: NDArray[np.int64]


def edge_keys(group: ConductionGroup, n: int) -> NDArray[np.int64]:
    """Return (n_p, 2) a number of the edges of slave and master at each point, the same from either end."""
    pairs = group.nodes.reshape(-1, 2, 2).astype(np.int64)
    return np.asarray(pairs.min(axis=2) * n + pairs.max(axis=2))


def shared_edges(groups: Sequence[ConductionGroup], factors: Sequence[float], T: Floats) -> SharedEdges:
    """Collect the edges at T : (n,) [K]; factors : of the groups' conductances [1]."""
    keys: list[NDArray[np.int64]] = []
    strength: list[Floats] = []
    left: list[Floats] = []
    for group, factor in zip(groups, factors, strict=True):
        shared = np.stack([group.N_s.prod(axis=1), group.N_m.prod(axis=1)], axis=1)
        keys.append(edge_keys(group, T.size).ravel())
        strength.append((group.strength(factor, T)[0][:, None] * shared).ravel())
        left.append(strength[-1] if group.by_node is None else strength[-1] * np.repeat(1.0 - group.by_node, 2))
    found, of = np.unique(np.concatenate(keys), return_inverse=True)
    total, rest = (np.bincount(of, np.concatenate(v), found.size).astype(np.float64, copy=False)
                   for v in (strength, left))
    some = total > 0.0
    return SharedEdges(np.stack(np.divmod(found[some], T.size), axis=1), total[some], rest[some], found[some])


@njit(cache=True)
def extreme(indptr: Ints, indices: Ints, T: Floats, nodes: Ints, kind: NDArray[np.int64]) -> None:
    """Put into kind : (n,) 1 at those of nodes that are as warm as their warmest neighbour, -1 as cold as the coldest.

    indptr, indices : neighbours of each node.  T : (n,) [K].
    """
    for i in nodes.flat:
        above, below = True, True
        for at in range(indptr[i], indptr[i + 1]):
            above = above and T[indices[at]] <= T[i]
            below = below and T[indices[at]] >= T[i]
        if above != below:
            kind[i] = 1 if above else -1


def bridged(scene: ThermalScene, substep: SubstepData, factors: Sequence[float], end: StepEnd) -> SubstepData | None:
    """Return the substep without the wrong signs that moved a node beyond all there was; None where none did.

    factors : of substep.conduction_groups [1].  Such a node is as warm as its warmest neighbour in its body and rose,
    though without them heat would flow out of it (or the other way round).
    """
    T, pattern = end.at.T, scene.volume.pattern
    kind, span = np.zeros(T.size, np.int64), float(np.ptp(T))
    for group in substep.conduction_groups:
        extreme(pattern.indptr, pattern.indices, T, group.nodes, kind)
    kind[scene.fixed] = 0
    seen = LEAST * span
    if end.start is not None:
        kind[kind * (T - end.start) <= seen] = 0
        # Within what there was the exchange stays as it is: else it changed with the windows, and with it their order.
        known = np.concatenate([end.start, T[scene.fixed], end.around])
        kind[np.maximum(T - known.max(), known.min() - T) <= seen] = 0
    if not kind.any():
        return None
    # At an extreme all edges carry one way: where all that they carry does not show, the wrong part of it does not.
    if not _beyond(end, _carried(substep.conduction_groups, factors, T), kind, seen).any():
        return None
    edges = shared_edges(substep.conduction_groups, factors, T)
    # Where conduction has the wrong sign itself all of the exchange is taken off, and no more.
    # fault: conduction's own wrong sign is made up for by contact -> wrong = np.maximum(edges.left +
    #   _conduction_between(scene, substep, end.at, edges.nodes), 0.0) | random_scenes/test_random_scenes
    wrong = np.clip(edges.left + _conduction_between(scene, substep, end.at, edges.nodes), 0.0, edges.left)
    first, last = edges.nodes.T
    carried = wrong * (T[first] - T[last])
    by_edges = np.asarray(np.bincount(first, carried, T.size) - np.bincount(last, carried, T.size), dtype=np.float64)
    beyond = _beyond(end, by_edges, kind, seen)
    # fault: wrong signs between surfaces stay -> touched = np.zeros(wrong.size, dtype=np.bool_) |
    #   thermal_fmu/test_thermal_exchange
    touched = beyond[edges.nodes].any(axis=1) & (wrong > 0.0)
    if not touched.any():
        return None
    share = np.where(touched, 1.0 - (edges.left - wrong) / edges.strength, 0.0)
    return replace(substep, conduction_groups=tuple(
        _by_node(group, edges.keys, share, T.size) for group in substep.conduction_groups))


def _carried(groups: Sequence[ConductionGroup], factors: Sequence[float], T: Floats) -> Floats:
    """Return (n,) what the exchange carries along edges into each node [W] at T : (n,) [K]."""
    into = np.zeros(T.size)
    for group, factor in zip(groups, factors, strict=True):
        W = group.strength(factor, T)[0]
        W = W if group.by_node is None else W * (1.0 - group.by_node)
        for nodes, N in ((group.nodes[:, :2], group.N_s), (group.nodes[:, 2:], group.N_m)):
            flow = W * N[:, 0] * N[:, 1] * (T[nodes[:, 0]] - T[nodes[:, 1]])
            into += np.bincount(nodes[:, 0], flow, T.size) - np.bincount(nodes[:, 1], flow, T.size)
    return into


def _beyond(end: StepEnd, carried: Floats, kind: NDArray[np.int64], seen: float) -> NDArray[np.bool_]:
    """Return (n,) nodes that would not be extreme, kind : (n,), but for what is carried : (n,) into them [W].

    seen : the least that it must do to them [K].
    """
    return np.asarray((kind * carried > seen * end.diagonal) & (kind * (end.flow - carried) < 0.0))


def _by_node(group: ConductionGroup, keys: NDArray[np.int64], share: Floats, n: int) -> ConductionGroup:
    """Give the points of a group the share of their edges; what they have stays where it is more."""
    own = edge_keys(group, n)
    at = np.minimum(np.searchsorted(keys, own), keys.size - 1)
    wanted = np.where(keys[at] == own, share[at], 0.0).max(axis=1)
    if not wanted.any():
        return group
    return replace(group, by_node=wanted if group.by_node is None else np.maximum(group.by_node, wanted))


def _conduction_between(scene: ThermalScene, substep: SubstepData, at: NodalFields, nodes: NDArray[np.int64]) -> Floats:
    """Return (m,) the entries of the conduction matrix between the two nodes of edges : (m, 2) [W/K], < 0 where right.
    """
    pattern, n = scene.volume.pattern, at.T.size
    entries = np.zeros(pattern.indices.size)
    conduct(scene.volume, substep.shapes, scene.model.parts, at, np.zeros(n), MatrixEntries(entries, 1.0))
    rows = np.repeat(np.arange(n, dtype=np.int64), np.diff(pattern.indptr))
    return np.asarray(entries[np.searchsorted(rows * n + pattern.indices, nodes[:, 0] * n + nodes[:, 1])])
