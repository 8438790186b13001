"""Rigid motions of bodies that nothing will ever hold: no condition, and no pair that may close."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import inf
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface, Pair
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


def unheld(problem: ElasticProblem, interface: Interface, end: float = inf) -> Iterator[Wrong]:
    """Bodies, and then groups of them, that can move rigidly without end.  With inertia everything may move.

    end : of the run [s].  A condition that is released before it holds nothing for good.
    """
    if problem.inert:
        return
    frames = [_frame(interface, body) for body in interface.bodies]
    lasting = [b for b in problem.boundary if b.until is None or (isinstance(b.until, float) and b.until >= end)]
    held = _held_by_conditions(lasting, problem, interface, frames)
    pairs = [(pair, *(_rows_of(pair, interface, frames))) for pair in interface.pairs
             if pair.slave.partition(".")[0] != pair.master.partition(".")[0]]
    n, found = len(frames), False
    total = np.zeros((3 * n, 3 * n))
    for body in range(n):
        alone, own = held[body].copy(), []
        for pair, bodies, rows in pairs:
            if body in bodies:
                part = rows[:, 3 * bodies.index(body) : 3 * bodies.index(body) + 3]
                alone += part.T @ part
                own.append(pair)
        # fault: motions that nothing holds are not looked for -> loose = np.zeros((3, 0)) | coupler/test_held
        loose = _null(alone)
        if loose.shape[1]:
            found = True
            yield _wrong(interface.bodies[body], name_of(loose[:, 0]), own)
        total[3 * body : 3 * body + 3, 3 * body : 3 * body + 3] += held[body]
    if found:
        return
    for _, (a, b), rows in pairs:
        at = np.r_[3 * a : 3 * a + 3, 3 * b : 3 * b + 3]
        total[np.ix_(at, at)] += rows.T @ rows
    for motion in _null(total).T[:1]:
        parts = motion.reshape(n, 3)
        names = [interface.bodies[i] for i in np.flatnonzero(np.abs(parts).max(axis=1) > 1e-6 * np.abs(motion).max())]
        first = parts[interface.bodies.index(names[0])]
        yield Wrong(("bodies", names[0]), f"nothing will ever hold bodies {' and '.join(names)} together against "
                    f"{name_of(first)}: their pairs hold them only against each other",
                    "Prescribe a displacement of one of them, or add mechanical.elastic.dynamics.")


HOLDS_ALL = 3


def held_by(boundary: Iterable[ElasticBoundary], problem: ElasticProblem, interface: Interface, body: str) -> int:
    """Return how many of the three rigid motions of a body some conditions hold."""
    at = interface.bodies.index(body)
    held = _held_by_conditions(boundary, problem, interface, [_frame(interface, b) for b in interface.bodies])
    return HOLDS_ALL - int(_null(held[at]).shape[1])


def name_of_pairs(pairs: Iterable[Pair]) -> str:
    """Return the names of pairs as a sentence has them."""
    return " and ".join(pair.name for pair in pairs)


def _frame(interface: Interface, body: str) -> tuple[Floats, float]:
    x = interface.nodes[interface.node_body == interface.bodies.index(body)]
    middle = 0.5 * (x.max(axis=0) + x.min(axis=0))
    return middle, max(float(np.abs(x - middle).max()), float(np.finfo(float).tiny))


def _held_by_conditions(boundary: Iterable[ElasticBoundary], problem: ElasticProblem, interface: Interface,
                        frames: list[tuple[Floats, float]]) -> list[Floats]:
    """C'C : (3, 3) of each body."""
    held = [np.zeros((3, 3)) for _ in frames]
    for body, (middle, size) in enumerate(frames):
        if interface.axisymmetric:
            held[body] += np.diag([1.0, 0.0, 1.0])
        for b in boundary:
            for row in _rows_held(b, problem, interface, body, (middle, size)):
                held[body] += row.T @ row
    return held


def _rows_held(b: ElasticBoundary, problem: ElasticProblem, interface: Interface, body: int,
               frame: tuple[Floats, float]) -> Iterator[Floats]:
    if all(getattr(b, key) is None for key in HELD):
        return
    both = b.rotation is not None
    if b.body is not None and b.body in problem.bodies and problem.bodies[b.body].rigid:
        if b.body == interface.bodies[body]:
            keys = ("u_x", "u_y", "angle")
            yield np.eye(3)[[both or getattr(b, key) is not None for key in keys]]
        return
    nodes = nodes_of(b, problem, interface)
    if nodes is None:
        return
    at = motions_at(interface.nodes[nodes[interface.node_body[nodes] == body]], *frame)
    for c, key in enumerate(("u_x", "u_y")):
        if both or getattr(b, key) is not None:
            yield at[:, c]


def _rows_of(pair: Pair, interface: Interface, frames: list[tuple[Floats, float]]) -> tuple[tuple[int, int], Floats]:
    """The bodies of a pair, and (n, 6) what it may hold of their motions."""
    a, b = (interface.bodies.index(surface.partition(".")[0]) for surface in (pair.slave, pair.master))
    rows = []
    for surface in (pair.slave, pair.master):
        ends = interface.nodes[interface.surfaces[surface]]
        t = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
        n = np.stack([t[:, 1], -t[:, 0]], axis=1)
        for x in (ends[:, 0], ends[:, 1]):
            apart = np.concatenate([motions_at(x, *frames[a]), -motions_at(x, *frames[b])], axis=2)
            rows += [np.einsum("ni,nij->nj", d, apart) for d in ((n, t) if pair.mu > 0.0 or pair.tied else (n,))]
    return (a, b), np.concatenate(rows)


def _null(A: Floats) -> Floats:
    values, vectors = np.linalg.eigh(A)
    return np.asarray(vectors[:, values <= RANK * max(float(values[-1]), 1.0)])


def _wrong(body: str, motion: str, pairs: list[Pair]) -> Wrong:
    if not pairs:
        why = "no condition does, and it is in no contact pair"
    else:
        why = (f"no condition does, and contact in {name_of_pairs(pairs)} has no "
               + ("part that faces that way" if any(p.mu > 0.0 for p in pairs) else "friction and faces another way"))
    remedy = f"Prescribe it (on or at a place of {body}, mechanical.elastic.boundary)"
    more = ", give the pair friction" if pairs and not any(p.mu > 0.0 for p in pairs) else ""
    return Wrong(("bodies", body), f"nothing will ever hold body {body!r} against {motion}: {why}",
                 f"{remedy}{more}, or add mechanical.elastic.dynamics.")
