"""Pieces of bodies: cells that share nodes.  What a mesh does not join passes neither heat nor force."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from contact.half.interface import Interface

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Flags = NDArray[np.bool_]

SAME_PLACE = 1e-6  # of the shortest edge: nodes nearer to each other than this were meant to be one


@dataclass(frozen=True)
class Piece:
    """A part of a body that shares no node with the rest of it.

    body : index.  nodes : (n_nodes,) whether each is of it.  name : of the body, with a place where it has more pieces.
    """

    body: int
    nodes: Flags
    name: str


def pieces_of(interface: Interface, rigid: Collection[str] = ()) -> list[Piece]:
    """Return the pieces of all bodies, in their order.  rigid : bodies that move as one, whatever their pieces."""
    label, found = connected(interface), []
    for body, name in enumerate(interface.bodies):
        own = interface.node_body == body
        of = np.unique(label[own])
        # fault: a body is taken for one piece whatever its mesh -> if True: | contact/test_pieces coupler/test_held
        if len(of) == 1 or name in rigid:
            found.append(Piece(body, own, f"body {name!r}"))
            continue
        for k in of:
            nodes = label == k
            x, y = interface.nodes[nodes].mean(axis=0)
            found.append(Piece(body, nodes, f"the piece of body {name!r} around ({x:.4g}, {y:.4g}) m"))
    return found


def connected(interface: Interface) -> Ints:
    """Return (n_nodes,) one number for all nodes that cells join; a node that no cell uses has its own."""
    n = len(interface.nodes)
    rows = [cells[:, 0].repeat(cells.shape[1] - 1) for cells in (interface.quads, interface.triangles)]
    columns = [cells[:, 1:].ravel() for cells in (interface.quads, interface.triangles)]
    row, column = np.concatenate(rows), np.concatenate(columns)
    joined = coo_array((np.ones(len(row), dtype=np.int8), (row, column)), shape=(n, n))
    return np.asarray(connected_components(joined, directed=False)[1], dtype=np.int32)


def piece_notes(interface: Interface) -> list[str]:
    """One sentence a body that the mesh leaves in pieces or slit, where no pair says that this is meant."""
    label, notes = connected(interface), []
    paired = _paired(interface)
    for body, name in enumerate(interface.bodies):
        own = np.flatnonzero(interface.node_body == body)
        of, count = np.unique(label[own], return_counts=True)
        # fault: sides of a pair that touch as drawn are told to be a slit -> slit = list(_same_place(interface, body,
        #   own)) | contact/test_pieces
        slit = [(a, b) for a, b in _same_place(interface, body, own) if not _facing(interface, a, b)]
        doubled = ""
        if slit:
            x, y = interface.nodes[slit[0][0]]
            doubled = (f"{len(slit)} node{'s lie' if len(slit) > 1 else ' lies'} where another one does, "
                       f"at ({x:.4g}, {y:.4g}) m for one")
        apart = len(of) > 1 and not all(paired[own[label[own] == k]].any() for k in of)
        if apart or (len(of) > 1 and slit):
            least = of[np.argmin(count)]
            x, y = interface.nodes[own[label[own] == least]].mean(axis=0)
            notes.append(f"body {name} is {len(of)} pieces that share no node, one of {count.min()} nodes around "
                         f"({x:.4g}, {y:.4g}) m: no heat and no force passes between them"
                         + (f"; {doubled}: join them in the mesh (gmsh: Coherence, or fragments of the shapes)"
                            if slit else ". Make each a body of its own (`region`) if that is meant"))
        elif slit:
            notes.append(f"body {name} is slit: {doubled}, and no heat or force passes between them; join them in the "
                         "mesh (gmsh: Coherence, or fragments of the shapes), or name both sides in a contact pair")
    return notes


def _paired(interface: Interface) -> Flags:
    found = np.zeros(len(interface.nodes), dtype=bool)
    found[interface.contact_nodes] = True
    return found


def _facing(interface: Interface, a: int, b: int) -> bool:
    """Whether two nodes are of the two sides of a pair."""
    return any((a in interface.surfaces[one]) and (b in interface.surfaces[other]) for pair in interface.pairs
               for one, other in ((pair.slave, pair.master), (pair.master, pair.slave)))


def _same_place(interface: Interface, body: int, own: NDArray[np.intp]) -> Iterator[tuple[int, int]]:
    """Yield pairs of nodes of a body that lie at the same place."""
    shortest = min((float(np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).min())
                    for cells, of in ((interface.quads, interface.quad_body),
                                      (interface.triangles, interface.triangle_body))
                    if len(x := interface.nodes[cells[of == body]])), default=0.0)
    for a, b in cKDTree(interface.nodes[own]).query_pairs(SAME_PLACE * shortest, output_type="ndarray"):
        yield int(own[a]), int(own[b])
