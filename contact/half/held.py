"""Rigid motions of bodies that nothing will ever hold: no condition, and no pair that may close."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface, Pair
from contact.half.pieces import Piece, pieces_of
from contact.half.prescribed import nodes_of
from contact.problem.boundary import HELD
from contact.problem.errors import Wrong

if TYPE_CHECKING:
    from contact.problem.mechanical import ElasticBoundary, ElasticProblem

Floats = NDArray[np.float64]

# Each body has three small motions: along x, along y, and a turn about its middle by 1/size.  What holds it are rows: a
# condition's is its component at a node, a pair's the normal (with friction also the tangent) of each of its edges,
# times the difference of the two bodies' motions there.  All of a pair's edges count, on either side, whatever they
# face today: what is left without any row is held by nothing at any time.

MOTIONS = ("moving along x", "moving along y", "turning")
# Rank of what holds a body, relative to the best held motion.
RANK = 1e-10
ALL_OF_IT = 1e-6


def motions_at(x: Floats, middle: Floats, size: float) -> Floats:
    """Compute (n, 2, 3) [1], how points x : (n, 2) [m] go in the three motions of a body."""
    out = np.zeros((len(x), 2, 3))
    out[:, 0, 0] = out[:, 1, 1] = 1.0
    out[:, 0, 2], out[:, 1, 2] = -(x - middle)[:, 1] / size, (x - middle)[:, 0] / size
    return out


def name_of(motion: Floats) -> str:
    """Say what a motion : (3,) is called.  Turning about a held point moves the middle too: any turning is turning."""
    size = np.abs(motion)
    return MOTIONS[2 if size[2] > 0.1 * size.max() else int(np.argmax(size[:2]))]


def names_of(loose: Floats) -> str:
    """Say what motions : (3, k), orthonormal, are called, all that are among them."""
    # Translations that are wholly among them; what turns at all may turn.
    size = np.linalg.norm(loose, axis=1)
    free = [MOTIONS[i] for i in (0, 1) if size[i] > 1.0 - ALL_OF_IT] + [MOTIONS[2]] * bool(size[2] > 0.1 * size.max())
    # fault: of several motions that nothing holds one is told -> return name_of(loose[:, 0]) | coupler/test_held
    return ", ".join(free[:-1]) + " and " * (len(free) > 1) + free[-1] if free else name_of(loose[:, 0])


def unheld(problem: ElasticProblem, interface: Interface, end: float = inf) -> Iterator[Wrong]:
    """Bodies, or pieces of them, and then groups, that can move rigidly without end.  With inertia everything may move.

    end : of the run [s].  A condition that is released before it holds nothing for good.
    """
    if problem.inert:
        return
    pieces = pieces_of(interface, [name for name, body in problem.bodies.items() if body.rigid])
    frames = [_frame(interface, piece.nodes) for piece in pieces]
    lasting = [b for b in problem.boundary if b.until is None or (isinstance(b.until, float) and b.until >= end)]
    held = _held_by_conditions(lasting, problem, interface, pieces, frames)
    pairs = [(pair, *found) for pair in interface.pairs for found in _rows_of(pair, interface, pieces, frames)]
    n, found = len(frames), False
    total = np.zeros((3 * n, 3 * n))
    for at, piece in enumerate(pieces):
        alone, own = held[at].copy(), []
        for pair, sides, rows in pairs:
            if at in sides:
                part = rows[:, 3 * sides.index(at) : 3 * sides.index(at) + 3]
                alone += part.T @ part
                own.append(pair)
        # fault: motions that nothing holds are not looked for -> loose = np.zeros((3, 0)) | coupler/test_held
        loose = _null(alone)
        if loose.shape[1]:
            found = True
            yield _wrong(interface.bodies[piece.body], piece, names_of(loose), list(dict.fromkeys(own)))
        total[3 * at : 3 * at + 3, 3 * at : 3 * at + 3] += held[at]
    if found:
        return
    for _, (a, b), rows in pairs:
        at_both = np.r_[3 * a : 3 * a + 3, 3 * b : 3 * b + 3]
        total[np.ix_(at_both, at_both)] += rows.T @ rows
    motions = _null(total)
    if motions.shape[1]:
        parts = motions.reshape(n, 3, -1)
        free = np.flatnonzero(np.abs(parts).max(axis=(1, 2)) > 1e-6 * np.abs(motions).max())
        names = list(dict.fromkeys(interface.bodies[pieces[i].body] for i in free))
        spanned, share, _ = np.linalg.svd(parts[free[0]], full_matrices=False)
        yield Wrong(("bodies", names[0]), f"nothing will ever hold bodies {' and '.join(names)} together against "
                    f"{names_of(spanned[:, share > 1e-6 * share[0]])}: their pairs hold them only against each other",
                    "Prescribe a displacement of one of them, or add mechanical.elastic.dynamics.")


HOLDS_ALL = 3


def held_by(boundary: Iterable[ElasticBoundary], problem: ElasticProblem, interface: Interface, body: str) -> int:
    """Return how many of the three rigid motions of a body some conditions hold."""
    at = interface.bodies.index(body)
    whole = Piece(at, interface.node_body == at, f"body {body!r}")
    held = _held_by_conditions(boundary, problem, interface, [whole], [_frame(interface, whole.nodes)])
    return HOLDS_ALL - int(_null(held[0]).shape[1])


def name_of_pairs(pairs: Iterable[Pair]) -> str:
    """Return the names of pairs as a sentence has them."""
    return " and ".join(pair.name for pair in pairs)


def _frame(interface: Interface, nodes: NDArray[np.bool_]) -> tuple[Floats, float]:
    x = interface.nodes[nodes]
    middle = 0.5 * (x.max(axis=0) + x.min(axis=0))
    return middle, max(float(np.abs(x - middle).max()), float(np.finfo(float).tiny))


def _held_by_conditions(boundary: Iterable[ElasticBoundary], problem: ElasticProblem, interface: Interface,
                        pieces: list[Piece], frames: list[tuple[Floats, float]]) -> list[Floats]:
    """C'C : (3, 3) of each piece."""
    held, boundary = [np.zeros((3, 3)) for _ in frames], list(boundary)
    for k, (piece, frame) in enumerate(zip(pieces, frames, strict=True)):
        if interface.axisymmetric:
            held[k] += np.diag([1.0, 0.0, 1.0])
        for b in boundary:
            for row in _rows_held(b, problem, interface, piece, frame):
                held[k] += row.T @ row
    return held


def _rows_held(b: ElasticBoundary, problem: ElasticProblem, interface: Interface, piece: Piece,
               frame: tuple[Floats, float]) -> Iterator[Floats]:
    if all(getattr(b, key) is None for key in HELD):
        return
    both = b.rotation is not None
    if b.body is not None and b.body in problem.bodies and problem.bodies[b.body].rigid:
        if b.body == interface.bodies[piece.body]:
            keys = ("u_x", "u_y", "angle")
            yield np.eye(3)[[both or getattr(b, key) is not None for key in keys]]
        return
    nodes = nodes_of(b, problem, interface)
    if nodes is None:
        return
    at = motions_at(interface.nodes[nodes[piece.nodes[nodes]]], *frame)
    for c, key in enumerate(("u_x", "u_y")):
        if both or getattr(b, key) is not None:
            yield at[:, c]


def _rows_of(pair: Pair, interface: Interface, pieces: list[Piece],
             frames: list[tuple[Floats, float]]) -> Iterator[tuple[tuple[int, int], Floats]]:
    """Yield two pieces that a pair joins, and (n, 6) what it may hold of their motions."""
    slave, master = interface.surfaces[pair.slave], interface.surfaces[pair.master]
    for a, one in enumerate(pieces):
        own = slave[one.nodes[slave[:, 0]]]
        for b, other in enumerate(pieces):
            theirs = master[other.nodes[master[:, 0]]]
            if a == b or not len(own) or not len(theirs):
                continue
            rows = []
            for ends in (interface.nodes[own], interface.nodes[theirs]):
                t = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
                n = np.stack([t[:, 1], -t[:, 0]], axis=1)
                for x in (ends[:, 0], ends[:, 1]):
                    apart = np.concatenate([motions_at(x, *frames[a]), -motions_at(x, *frames[b])], axis=2)
                    rows += [np.einsum("ni,nij->nj", d, apart)
                             for d in ((n, t) if pair.mu > 0.0 or pair.tied else (n,))]
            yield (a, b), np.concatenate(rows)


def _null(A: Floats) -> Floats:
    values, vectors = np.linalg.eigh(A)
    return np.asarray(vectors[:, values <= RANK * max(float(values[-1]), 1.0)])


def _wrong(body: str, piece: Piece, motion: str, pairs: list[Pair]) -> Wrong:
    if not pairs:
        why = "no condition does, and it is in no contact pair"
    else:
        why = (f"no condition does, and contact in {name_of_pairs(pairs)} has no "
               + ("part that faces that way" if any(p.mu > 0.0 for p in pairs) else "friction and faces another way"))
    remedy = f"Prescribe it (on or at a place of {body}, mechanical.elastic.boundary)"
    if piece.name != f"body {body!r}":
        remedy = "Join the pieces in the mesh, or hold each of them"
    more = ", give the pair friction" if pairs and not any(p.mu > 0.0 for p in pairs) else ""
    return Wrong(("bodies", body), f"nothing will ever hold {piece.name} against {motion}: {why}",
                 f"{remedy}{more}, or add mechanical.elastic.dynamics.")
