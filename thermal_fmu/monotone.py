"""Takes off what couples two nodes with the wrong sign, where temperatures left their data by it.

Where every node exchanges heat with others by couplings of one sign, its temperature is a mean, with weights that are
not negative, of what it was, of its neighbours and of its surroundings: so it stays within them, in steps of any
number.  Two things make couplings of the other sign.  Skewed cells and skewed axes of conductivity do in conduction
itself.  And at a contact quadrature point the exchange W (T_s - T_m) is shared by the shape functions of either side,
and so carries W N_1 N_2 (T_1 - T_2) from the colder node of an edge to the warmer one; conduction along the edge makes
up for it up to a cell Biot number of 1 or so.

A form without wrong signs is less accurate everywhere (F1 with 24 cells: 2.7 K of 473), and no linear form is both free
of them and exact where the temperature is linear (Godunov).  So a step that shows nodes beyond all temperatures there
were is taken again without the wrong signs of these nodes: flux correction (Kuzmin, J. Comput. Appl. Math. 236 (2012)
2317), with the places found afterwards.  Contact goes from node to node there (exchange.between_nodes), which moves
heat least along the surface; what is left is made up for by conduction along the edges of cells (discrete upwinding).

What contact conducts by averages (averages.py) couples nodes of one side with the wrong sign, too.  From node to node
it would hold all of a surface at one temperature, and so would conduction that makes up for it: it is taken off, and
contact conducts there as much as points exchange by themselves, which is far more than the cells do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from contact.compiled import kernel
from thermal_fmu.averages import Relief, averaged
from thermal_fmu.cells import MatrixEntries
from thermal_fmu.edges import AddedConduction, Couplings
from thermal_fmu.exchange import ConductionGroup, radiated_along_edges
from thermal_fmu.known import DataRange, Signs, least_seen
from thermal_fmu.phase_change import NodalFields
from thermal_fmu.scene import SubstepData, ThermalScene
from thermal_fmu.surface_terms import at_nodes

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

@kernel
def extremes(indptr: Ints, indices: Ints, T: Floats, sign: Signs) -> Signs:
    """Return sign : (n,), 1 or -1, at those of its nodes that are as warm as their warmest neighbour, or as cold; else

    0.  indptr, indices : neighbours of each node.  T : (n,) [K].
    """
    out = np.zeros_like(sign)
    for i in np.flatnonzero(sign):
        out[i] = sign[i]
        for at in range(indptr[i], indptr[i + 1]):
            if sign[i] * (T[indices[at]] - T[i]) > 0.0:
                out[i] = 0
                break
    return out


# The step without their wrong signs

# Times what nodes beside a contact store, of what holds them in a step: how far sides differ then goes about as much.
# Windows of 1e-2 and 0.1 h^2/a matter by 0.7 % of the span at most with 30, by 2.2 % with 10 and by 21 % with 100.
AS_STORED = 30.0


@dataclass(frozen=True)
class StepEnd:
    """A step at its end.  at : fields there.  left : (n,) which nodes left their data (DataRange.left_by).

    flow : (n,) heat into each node [W].  given : (n,) the part of it that comes whatever the surroundings are [W].
    diagonal : (n,) of the derivative of -flow by T and of storage, storage : (n,) the part of it that is that [W/K].
    """

    at: NodalFields
    left: Signs
    flow: Floats
    given: Floats
    diagonal: Floats
    storage: Floats


def monotone(scene: ThermalScene, substep: SubstepData, factors: Sequence[float], end: StepEnd) -> SubstepData | None:
    """Return the substep without the wrong signs by which nodes left their data; None where none did.

    factors : of substep.conduction_groups [1].  It is seen at a node that is as warm as its warmest neighbour, where no
    source heats: but for wrong signs heat would flow out of it (or the other way round).  With it go the nodes beside
    it that left their data the same way.
    """
    T, pattern = end.at.T, scene.volume.pattern
    kind = extremes(pattern.indptr, pattern.indices, T, end.left)
    kind[kind * end.given > 0.0] = 0
    if not kind.any():
        return None
    couplings, groups = scene.couplings, substep.conduction_groups
    off = couplings.row != couplings.column
    shared, strength = _along_edges(couplings, groups, factors, T)
    # fault: only contact's wrong signs are seen -> others = np.minimum(_others(scene, substep, end.at), 0.0) |
    #   thermal_fmu/test_thermal_monotone
    others = _others(scene, substep, end.at)
    wrong = np.where(off, np.maximum(shared + others, 0.0), 0.0)
    # fault: wrong signs stay -> carried = np.zeros(T.size) | thermal_fmu/test_thermal_exchange
    carried: Floats = np.asarray(np.bincount(couplings.row, wrong * (T[couplings.row] - T[couplings.column]), T.size))
    by_averages = [_by_averages(group, factor, T, end.storage) for group, factor in zip(groups, factors, strict=True)]
    for one in by_averages:
        if one is not None:
            # fault: wrong signs of averages stay -> carried += 0.0 * one.carried | thermal_fmu/test_thermal_stiff
            carried = carried + one.carried
    beyond = (kind * carried > least_seen(T) * end.diagonal) & (kind * (end.flow - carried) < 0.0)
    if not beyond.any():
        return None
    nodes = _with_neighbours(couplings, end.left, beyond)
    wrong[~(nodes[couplings.row] | nodes[couplings.column])] = 0.0
    by_node = np.minimum(wrong, shared)  # what contact can do; the rest is added to conduction
    if by_node.any():
        share = np.divide(strength - (shared - by_node), strength, out=np.zeros(wrong.size), where=by_node > 0.0)
        groups = tuple(_by_node(group, couplings, share) for group in groups)
    groups = tuple(group if one is None else _relieved(group, one, nodes)
                   for group, one in zip(groups, by_averages, strict=True))
    return replace(substep, conduction_groups=groups, added=_added(couplings, substep.added, wrong - by_node))


def _along_edges(couplings: Couplings, groups: Sequence[ConductionGroup], factors: Sequence[float],
                 T: Floats) -> tuple[Floats, Floats]:
    """Return (nnz,) what contact couples along edges with the wrong sign, and what it would by shape functions [W/K].

    T : (n,) [K].  factors : of the conductances [1].
    """
    left, whole = np.zeros(couplings.keys.size), np.zeros(couplings.keys.size)
    for group, factor in zip(groups, factors, strict=True):
        W = group.split(*group.strength(factor, T))[0]
        rest = W if group.by_node is None else W * (1.0 - group.by_node)
        for nodes, N in ((group.nodes[:, :2], group.N_s), (group.nodes[:, 2:], group.N_m)):
            left += couplings.between(nodes, rest * N.prod(axis=1))
            whole += couplings.between(nodes, W * N.prod(axis=1))
    return left, whole


@dataclass(frozen=True)
class _ByAverages:
    """What a group exchanges by averages.

    carried : (n,) heat it brings nodes from others of their side [W].  around : (n_a, k) the nodes of each average that
    has wrong signs, -1 in place of others.  ratio : as Relief has it.
    """

    carried: Floats
    around: Ints
    ratio: Floats


def _by_averages(group: ConductionGroup, factor: float, T: Floats, storage: Floats) -> _ByAverages | None:
    """Find the wrong signs of exchange by averages at T : (n,) [K]; None without any.

    factor : of conductance [1].  storage : (n,) [W/K].
    """
    own, _, by_averages = group.split(*group.strength(factor, T))
    if by_averages is None:
        return None
    over, V = by_averages.over, by_averages.V
    W, mean = averaged(over, group.relief, V, np.concatenate([group.N_s, -group.N_m], axis=1))
    nodes = over.patches.nodes
    T_a, carried = T[nodes] - T[nodes[:, :1]], np.zeros(T.size)
    for side in (np.maximum(mean, 0.0), np.maximum(-mean, 0.0)):
        heat = side * (side.sum(axis=1)[:, None] * T_a - (side * T_a).sum(axis=1)[:, None])
        carried += at_nodes(nodes, W[:, None] * heat, T.size)
    beside = over.summed(own + AS_STORED * _stored_beside(group, storage))
    ratio = 1.0 + np.divide(over.summed(V), beside, out=np.zeros(W.size), where=beside > 0.0)
    return _ByAverages(carried, np.where((mean != 0.0) & (W > 0.0)[:, None], nodes, -1), ratio)


def _stored_beside(group: ConductionGroup, storage: Floats) -> Floats:
    """Return (n,) [W/K] what nodes of both sides store in a step, storage : (n_nodes,) [W/K], shared by the points that
    face them, one side behind the other.
    """
    sides = []
    for nodes, N in ((group.nodes[:, :2], group.N_s), (group.nodes[:, 2:], group.N_m)):
        area = np.bincount(nodes.ravel(), (group.area[:, None] * N).ravel(), storage.size)
        by_area = np.divide(storage, area, out=np.zeros(storage.size), where=area > 0.0)
        sides.append((N * by_area[nodes]).sum(axis=1))
    both = sides[0] + sides[1]
    return np.asarray(group.area * np.divide(sides[0] * sides[1], both, out=np.zeros(both.size), where=both > 0.0))


def _relieved(group: ConductionGroup, by_averages: _ByAverages, nodes: NDArray[np.bool_]) -> ConductionGroup:
    """Take off all averages that have to do with nodes : (n,)."""
    around = by_averages.around
    much = np.asarray(((around >= 0) & nodes[around]).any(axis=1), dtype=np.float64)
    if not much.any():
        return group
    if group.relief is not None:
        much = np.asarray(np.maximum(much, group.relief.much), dtype=np.float64)
    return replace(group, relief=Relief(much, by_averages.ratio))


def _others(scene: ThermalScene, substep: SubstepData, at: NodalFields) -> Floats:
    """Return (nnz,) what else couples nodes: conduction of cells, added conduction, near radiation; < 0 where right."""
    entries = np.zeros(scene.couplings.keys.size)
    scene.bulk.conduct(substep, at, np.zeros(at.T.size), MatrixEntries(entries, 1.0, secant=True))
    if substep.added is not None:
        entries -= scene.couplings.between(substep.added.nodes, substep.added.strength)
    for nodes, strength in radiated_along_edges(substep.radiation_groups, substep.sigma_SB, at.T):
        entries += scene.couplings.between(nodes, strength)
    return entries


def _with_neighbours(couplings: Couplings, left: Signs, beyond: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (n,) the nodes that left their data the same way as one of beyond : (n,), node beside node."""
    same = (left[couplings.row] != 0) & (left[couplings.row] == left[couplings.column])
    row, column = couplings.row[same], couplings.column[same]
    graph = csr_matrix((np.ones(row.size, np.int8), (row, column)), shape=(left.size, left.size))
    of = connected_components(graph, directed=False)[1]
    return np.asarray(np.isin(of, of[beyond]))


def _by_node(group: ConductionGroup, couplings: Couplings, share: Floats) -> ConductionGroup:
    """Give the points of a group the share of their edges, (nnz,); what they have stays where it is more."""
    slots = np.stack([couplings.slots(nodes)[:, 0, 1] for nodes in (group.nodes[:, :2], group.nodes[:, 2:])])
    wanted = share[slots].max(axis=0)
    if not wanted.any():
        return group
    return replace(group, by_node=wanted if group.by_node is None else np.maximum(group.by_node, wanted))


def _added(couplings: Couplings, before: AddedConduction | None, more: Floats) -> AddedConduction | None:
    """Add more : (nnz,) [W/K] to what is added between nodes."""
    strength = more + (0.0 if before is None else couplings.between(before.nodes, before.strength))
    some = np.flatnonzero((strength > 0.0) & (couplings.row < couplings.column))
    if some.size == 0:
        return None
    nodes = np.stack([couplings.row[some], couplings.column[some]], axis=1).astype(np.int32)
    return AddedConduction(nodes, strength[some], couplings.slots(nodes))


# As much of it as is needed

# Of what a straight line through two tries says is missing, and of all of it: nodes beside each other draw each other.
AMPLE, MORE = 1.1, 0.02


@dataclass(frozen=True)
class Try:
    """How much of the correction a step was taken with, much : (n,) of nodes [1], and where it led, T : (n,) [K]."""

    much: Floats
    T: Floats


def needed(data: DataRange, last: Try, other: Try, full_T: Floats) -> Floats:
    """Return (n,) how much of the correction takes each node back to where its data end [1].

    Along a straight line through the last two tries at nodes that both left outside, else from the last one to full_T :
    (n,) [K], with all of it.  All of it in one step and none in the next would make nodes at their bound go up and
    down.
    """
    left = data.left_by(last.T)
    bound = np.where(left > 0, data.high, data.low)
    change, back = last.much - other.much, left * (other.T - last.T)
    known = (data.left_by(other.T) == left) & (change > 0.0) & (back > 0.0)
    change, back = np.where(known, change, 1.0 - last.much), np.where(known, back, left * (last.T - full_T))
    missing = left * (last.T - bound) * change
    more = np.divide(missing, back, out=np.zeros(back.size), where=(left != 0) & (back > 0.0))
    # fault: all of the correction or none -> more = np.where(left != 0, 1.0, 0.0) | thermal_fmu/test_thermal_monotone
    more = np.where((last.much > 0.0) & (left != 0), AMPLE * more + MORE, more)
    return np.asarray(np.minimum(last.much + more, 1.0))


# Of what a node was taken too far back, what is left: a straight line is hit that well, and beyond is outside again.
LEFT_INSIDE = 0.02
# Of what the correction moved a node by: what it may be inside by.
INSIDE = 1e-6


def to_the_bound(data: DataRange, inside: Try, other: Try) -> Floats | None:
    """Return (n,) how much of the correction takes nodes to where their data end and no farther [1]; None: as it is.

    Along a straight line through two tries; inside : one that left none outside.  A node that is taken back farther by
    a share of its way, whatever the step, gains heat by steps and not by time: what crosses a contact would depend on
    steps however short they are.
    """
    less, way = inside.much - other.much, inside.T - other.T
    side = np.where(less * way > 0.0, 1.0, -1.0)
    too_far = np.where(side > 0.0, inside.T - data.low, data.high - inside.T)
    way = side * way * np.sign(less)
    on = (inside.much > 0.0) & (way > 0.0) & (too_far > np.maximum(INSIDE * way, least_seen(inside.T)))
    if not on.any():
        return None
    much = inside.much.copy()
    much[on] -= (1.0 - LEFT_INSIDE) * too_far[on] * np.abs(less[on]) / way[on]
    return np.asarray(np.maximum(much, 0.0))


def eased(full: SubstepData, much: Floats) -> SubstepData:
    """Return the substep with so much of the correction, much : (n,) [1] of nodes, the more of an edge's two."""
    added = full.added
    if added is not None:
        added = replace(added, strength=added.strength * much[added.nodes].max(axis=1))
    return replace(full, conduction_groups=tuple(_eased(group, much) for group in full.conduction_groups), added=added)


def _eased(group: ConductionGroup, much: Floats) -> ConductionGroup:
    by_node, relief = group.by_node, group.relief
    if by_node is not None:
        by_node = by_node * much[group.nodes].max(axis=1)
    if relief is not None and group.averages is not None:
        relief = replace(relief, much=relief.much * much[group.averages.patches.nodes].max(axis=1))
    return group if by_node is group.by_node and relief is group.relief else replace(group, by_node=by_node,
                                                                                      relief=relief)
