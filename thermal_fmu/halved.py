"""A scene with every edge of its cells halved, and what faces what there without another search.

Values at nodes go to the nodes in between on straight lines, as the cells have them.  Conditions and data over place
stay those of the scene; smaller cells read them in more places.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from contact.half.interface import Interface
from contact.half.start import START_T
from contact.messages import Facing

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

POINTS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)  # where the two points of a piece lie on it
SLIVER = 1e-9  # of a piece: what is cut off is no piece
ON_PIECE = ("xi_s", "xi_m", "gap", "area", "area_m", "wide_s", "wide_m")


@dataclass(frozen=True)
class Halved:
    """of : the scene.  interface : with halved edges.  P : (n_halved, n) values at its nodes by those of the scene.

    parent : (n_cells,) the scene's cell that each cell is of.
    """

    of: Interface
    interface: Interface
    P: csr_matrix
    parent: NDArray[np.intp]

    def at_pair_nodes(self, values: Floats) -> Floats:
        """Return values : (n_q,) of pair nodes, at those with halved edges."""
        sides = zip(self.of.pair_sides, self.interface.pair_sides, strict=True)
        return np.concatenate([np.empty(0), *(self.P[new.nodes][:, old.nodes] @ values[old.at] for old, new in sides)])


def halved(interface: Interface) -> Halved:
    """Halve every edge of every cell of a scene."""
    n, quads, triangles = len(interface.nodes), interface.quads, interface.triangles
    keys, which = np.unique(np.concatenate([_keys(quads, n), _keys(triangles, n)]), return_inverse=True)
    between = (n + which).astype(np.int32)
    of_quads, of_triangles = between[:quads.size].reshape(-1, 4), between[quads.size:].reshape(-1, 3)
    middles = n + keys.size + np.arange(len(quads), dtype=np.int32)
    ends = np.stack([keys // n, keys % n], axis=1)
    rows = np.concatenate([np.arange(n), np.repeat(n + np.arange(keys.size), 2), np.repeat(middles, 4)])
    columns = np.concatenate([np.arange(n), ends.ravel(), quads.ravel()])
    shares = np.concatenate([np.ones(n), np.full(2 * keys.size, 0.5), np.full(quads.size, 0.25)])
    P = csr_matrix((shares, (rows, columns)), shape=(n + keys.size + len(quads), n))

    def edges(of: Ints) -> Ints:
        middle = n + np.searchsorted(keys, np.sort(of, axis=1).astype(np.int64) @ (n, 1))
        return np.stack([of[:, 0], middle, middle, of[:, 1]], axis=1).reshape(-1, 2).astype(np.int32)

    def nodes(of: Ints) -> Ints:
        # fault: between two nodes of a set lies none of it -> inside = np.zeros(len(ends), dtype=bool) |
        #   thermal_fmu/test_halved
        inside = np.isin(ends, of).all(axis=1)
        return np.concatenate([of, n + np.flatnonzero(inside)]).astype(np.int32)

    four = [np.stack([quads[:, k], of_quads[:, k], middles, of_quads[:, k - 1]], axis=1) for k in range(4)]
    three = [np.stack([triangles[:, k], of_triangles[:, k], of_triangles[:, k - 1]], axis=1) for k in range(3)]
    new = replace(
        interface, nodes=P @ interface.nodes, quads=np.stack(four, axis=1).reshape(-1, 4).astype(np.int32),
        triangles=np.stack([*three, of_triangles], axis=1).reshape(-1, 3).astype(np.int32),
        quad_body=np.repeat(interface.quad_body, 4), triangle_body=np.repeat(interface.triangle_body, 4),
        quad_region=None if interface.quad_region is None else np.repeat(interface.quad_region, 4),
        triangle_region=None if interface.triangle_region is None else np.repeat(interface.triangle_region, 4),
        surfaces={name: edges(of) for name, of in interface.surfaces.items()},
        node_sets={name: nodes(of) for name, of in interface.node_sets.items()}, start={}, offset={},
        stiffness={name: np.repeat(of, 2) for name, of in interface.stiffness.items()})
    new = replace(new, start=_start(interface, new, P))
    return Halved(interface, new, P, np.repeat(np.arange(len(quads) + len(triangles)), 4))


def _keys(cells: Ints, n: int) -> NDArray[np.int64]:
    """One number for each edge of each cell, from each corner to the next."""
    edges = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)
    return np.asarray(np.sort(edges, axis=1).astype(np.int64) @ (n, 1))


def _start(old: Interface, new: Interface, P: csr_matrix) -> dict[str, Floats]:
    """What heat reads of another run: "T" of all nodes, "T.BODY" (n_t, n) of a body's at the times "t.BODY"."""
    # fault: halved cells start without what another run left -> found: dict[str, Floats] = {} |
    #   thermal_fmu/test_halved
    found = {START_T: np.asarray(P @ old.start[START_T])} if START_T in old.start else {}
    for b, body in enumerate(old.bodies):
        if f"T.{body}" in old.start:
            at_old, at_new = (np.flatnonzero(of.node_body == b) for of in (old, new))
            found[f"t.{body}"] = old.start[f"t.{body}"]
            found[f"T.{body}"] = np.asarray((P[at_new][:, at_old] @ old.start[f"T.{body}"].T).T)
    return found


def halved_facing(facing: Facing) -> Facing:
    """Cut pieces where halves of edges meet, and put two points on each: what lies on a piece goes straight there.

    Gaps and parts of nodes are left out: heat does not ask for them.
    """
    of_pieces = {name: getattr(facing, name).reshape(-1, 2) for name in ON_PIECE}

    def at(name: str, piece: NDArray[np.intp], s: Floats) -> Floats:
        first, second = of_pieces[name][piece].T
        return np.asarray(first + (second - first) * (s - POINTS[0]) / (POINTS[1] - POINTS[0]))

    every = np.arange(len(facing.pair) // 2)
    cuts = [np.zeros(every.size), np.ones(every.size)]
    for xi in ("xi_s", "xi_m"):
        begin = at(xi, every, np.zeros(every.size))
        way = at(xi, every, np.ones(every.size)) - begin
        cuts.append(np.clip(np.divide(0.5 - begin, way, out=np.zeros(every.size), where=way != 0.0), 0.0, 1.0))
    ends = np.sort(np.stack(cuts, axis=1), axis=1)
    piece, part = np.nonzero(np.diff(ends, axis=1) > SLIVER)
    begin, share = ends[piece, part], np.diff(ends, axis=1)[piece, part]
    of = np.repeat(piece, 2)
    found = {name: at(name, of, (begin[:, None] + share[:, None] * POINTS).ravel()) for name in ON_PIECE}
    edges, xi_of = {}, {}
    for xi, edge in (("xi_s", facing.slave_edge), ("xi_m", facing.master_edge)):
        # fault: all of an edge lies on its first half -> second = np.repeat(at(xi, piece, begin) > 1.0, 2) |
        #   thermal_fmu/test_halved
        second = np.repeat(at(xi, piece, begin + 0.5 * share) > 0.5, 2)
        edges[xi] = (2 * edge[::2][of] + second).astype(np.int32)
        xi_of[xi] = np.clip(2.0 * found[xi] - second, 0.0, 1.0)
    # fault: a part of a piece has the area of all of it -> shares = np.ones(of.size) | thermal_fmu/test_halved
    shares = np.repeat(share, 2)
    area, area_m = (np.maximum(shares * found[name], 0.0) for name in ("area", "area_m"))
    return Facing(facing.pair[::2][of], edges["xi_s"], edges["xi_m"], xi_of["xi_s"], xi_of["xi_m"], found["gap"], area,
                  area_m, found["wide_s"], found["wide_m"], np.empty(0), np.empty(0))
