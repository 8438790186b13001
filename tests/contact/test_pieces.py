"""Meshes whose nodes are not joined: which pieces they have, and what is told of them."""

from dataclasses import replace

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from contact.half.pieces import connected, piece_notes, pieces_of

# Two squares side by side; nodes 6 and 7 double 1 and 4, on the line between them.
NODES = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [1, 0], [1, 1]], dtype=float)


def mesh(second: list[int], nodes: np.ndarray = NODES, pairs: tuple[Pair, ...] = ()) -> Interface:
    """One body of two quads."""
    quads = np.array([[0, 1, 4, 3], second], dtype=np.int32)
    surfaces = {"plate.left": np.array([[1, 4]], dtype=np.int32), "plate.right": np.array([[7, 6]], dtype=np.int32)}
    return Interface("plane", nodes, quads, np.empty((0, 3), np.int32), np.zeros(2, np.int32), np.empty(0, np.int32),
                     ("plate",), ("steel",), surfaces, pairs=pairs)


JOINED, APART, CORNER = [1, 2, 5, 4], [6, 2, 5, 7], [1, 2, 5, 7]
SEAM = Pair("seam", "plate.left", "plate.right", 0.1, 1e9)


@pytest.mark.parametrize(("second", "n"), [(JOINED, 1), (CORNER, 1), (APART, 2)])
def test_pieces_are_what_shares_nodes(second: list[int], n: int) -> None:
    plate = mesh(second)
    used = np.unique(plate.quads)
    assert len(np.unique(connected(plate)[used])) == n
    pieces = pieces_of(plate)
    assert len(pieces) == n
    assert (np.sum([piece.nodes for piece in pieces], axis=0)[used] == 1).all()
    assert len(pieces_of(plate, rigid=["plate"])) == 1


@pytest.mark.parametrize(("second", "text"), [
    (APART, "body plate is 2 pieces that share no node, one of 4 nodes around (0.5, 0.5) m: no heat and no force "
            "passes between them; 2 nodes lie where another one does, at (1, 0) m for one: join them in the mesh"),
    (CORNER, "body plate is slit: 1 node lies where another one does, at (1, 1) m for one, and no heat or force"),
])
def test_what_is_not_joined_is_told(second: list[int], text: str) -> None:
    told, = piece_notes(mesh(second))
    assert told.startswith(text)


def test_pieces_apart_are_told() -> None:
    told, = piece_notes(mesh(APART, NODES + np.where(np.arange(8)[:, None] > 5, [0.1, 0.0], 0.0)))
    assert told.endswith("passes between them. Make each a body of its own (`region`) if that is meant")


@pytest.mark.parametrize("good", [mesh(JOINED), mesh(APART, pairs=(SEAM,)),
                                  mesh(APART, pairs=(replace(SEAM, slave="plate.right", master="plate.left"),))])
def test_what_is_joined_or_in_contact_is_not_told(good: Interface) -> None:
    assert piece_notes(good) == []
