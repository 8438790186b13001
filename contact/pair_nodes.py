"""Pair nodes: what contact tells of a node belongs to a pair and a side of it, not to the node alone.

A node at a corner is on the surfaces of several pairs.  Each presses, drags and covers it on its own, so that every
pair has a value of its own there: pressure, shear, gap, share that is faced.  They are numbered q = 0, 1, ...: pair by
pair, of each the nodes of its slave, ascending, then those of its master; a surface that faces itself comes once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.compiled import kernel
from contact.messages import Ints, Register


@dataclass(frozen=True)
class PairLayout:
    """The pair nodes of registered surfaces, n_q of them.

    node : (n_q,) index s.  pair : (n_q,) number of the pair.  searched : (n_q,) 1 where its side is searched from, else
    0.  first, last : (n_passes, 2) first pair node, and last + 1, of the slave's and of the master's side of each pass.
    place : (n_edges, 2) place of an edge's nodes among those of its surface.  sides : (n_sides, 2) surface and first
    pair node of each side.  tied : (n_t,) pair nodes of the slave sides of tied pairs.
    """

    node: Ints
    pair: Ints
    searched: Ints
    first: Ints
    last: Ints
    place: Ints
    sides: Ints
    tied: Ints

    @property
    def size(self) -> int:
        """Return n_q."""
        return self.node.size

    @property
    def n_multipliers(self) -> int:
        """Return n_m = n_q + 2 n_t."""
        return self.node.size + 2 * self.tied.size


def pair_layout_of(register: Register) -> PairLayout:
    """Number the pair nodes of a scene.  Raises ValueError where the passes of a pair are of different surfaces."""
    p = register.passes
    n_surfaces = int(register.edge_surface[-1]) + 1 if register.edge_surface.size else 0
    of_surface, place = [], np.empty(register.edges.shape, dtype=np.int32)
    for k in range(n_surfaces):
        own = register.edge_surface == k
        nodes, at = np.unique(register.edges[own], return_inverse=True)
        of_surface.append(nodes)
        place[own] = at.reshape(-1, 2)
    begins: dict[tuple[int, int], int] = {}
    node, pair, searched = [], [], []
    n = 0
    for k in np.unique(p.pair).tolist():
        own = np.flatnonzero(p.pair == k)
        surfaces = list(dict.fromkeys((int(p.slave[own[0]]), int(p.master[own[0]]))))
        if set(p.slave[own].tolist()) | set(p.master[own].tolist()) != set(surfaces):
            raise ValueError(f"the passes of pair {k} are not all between surfaces {surfaces}")
        for surface in surfaces:
            begins[k, surface] = n
            size = of_surface[surface].size
            node.append(of_surface[surface])
            pair.append(np.full(size, k))
            searched.append(np.full(size, surface in p.slave[own]))
            n += size
    sizes = [nodes.size for nodes in of_surface]
    spans = [[(begins[k, side], begins[k, side] + sizes[side]) for side in both]
             for k, *both in np.column_stack([p.pair, p.slave, p.master]).tolist()]
    first, last = np.ascontiguousarray(np.array(spans, dtype=np.int32).reshape(-1, 2, 2).transpose(2, 0, 1))
    sides = [[surface, begin] for (_, surface), begin in begins.items()]
    of_pair, own_side = _whole(pair), _whole(searched)
    tied = np.zeros(0, dtype=np.int32) if p.tied is None else np.unique(p.pair[np.asarray(p.tied) == 1])
    bonded = np.flatnonzero(np.isin(of_pair, tied) & (own_side == 1)).astype(np.int32)
    return PairLayout(_whole(node), of_pair, own_side, first, last, place,
                      np.array(sides, dtype=np.int32).reshape(-1, 2), bonded)


def _whole(parts: list[Ints]) -> Ints:
    return np.concatenate([np.empty(0, dtype=np.int32), *parts]).astype(np.int32)


@kernel
def pair_nodes_at(number: Ints, met: Ints, first: Ints, place: Ints) -> Ints:
    """Return (n_p, 4) the pair nodes of contact quadrature points: the slave edge's two, then the master edge's two.

    number : (n_p,) of the pass.  met : (n_p, 2) slave and master edge.  first : (n_passes, 2) and place : (n_edges, 2)
    as in PairLayout.
    """
    at = np.empty((met.shape[0], 4), dtype=np.int32)
    for i in range(met.shape[0]):
        for side in range(2):
            for end in range(2):
                # fault: a node that two pairs share has one value for both -> at[i, 2 * side + end] = first[0, side] +
                #   place[met[i, side], end] | contact/test_pair_nodes
                at[i, 2 * side + end] = first[number[i], side] + place[met[i, side], end]
    return at

