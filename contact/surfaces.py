"""Registered surfaces of a scene: checked, hashed, their edges put into chains; normals, and boxes of edges.

All but normals and boxes follows from connectivity alone and is computed once, so every later request costs O(n log n).
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from contact.compiled import inner, kernel
from contact.messages import Floats, Ints, Passes, Register
from contact.pair_nodes import PairLayout, pair_layout_of

LIMIT = 1e100  # [m, Pa]: no number beyond this is meant; products of smaller ones do not overflow


@dataclass(frozen=True)
class RegisteredSurfaces:
    """Registered surfaces.

    register : the message, in canonical dtypes.  passes : its passes.  key : content hash.
    start : (n_surfaces + 1,) the edges of surface k are start[k]..start[k+1]-1.
    chain : (n_edges,) edge numbers, surface by surface, in the order in which one walks along the surface.
    previous, following : (n_edges,) neighbour within the surface at the edge's first, second node; -1: none.
    pair_nodes : as numbered by contact.pair_nodes.  found : what follows from all this alone and is worked out once
    elsewhere, by name.
    """

    register: Register
    passes: Passes
    key: str
    start: Ints
    chain: Ints
    previous: Ints
    following: Ints
    pair_nodes: PairLayout
    found: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @property
    def stiffness(self) -> Floats:
        """Return (n_edges,) [Pa/m] as registered."""
        assert self.register.stiffness is not None
        return self.register.stiffness

    @cached_property
    def offsets(self) -> Floats:
        """Return (n_passes, n_edges, 2) [m], what is added to gaps at the ends of each edge that a pass searches from.
        """
        assert self.register.offset is not None
        of, found = self.pair_nodes, np.zeros((self.passes.slave.size, len(self.register.edges), 2))
        for i, slave in enumerate(self.passes.slave):
            own = slice(int(self.start[slave]), int(self.start[slave + 1]))
            found[i, own] = self.register.offset[of.first[i, 0] + of.place[own]]
        return found

    @property
    def tied(self) -> Ints:
        """Return (n_passes,) 1 where the sides of a pass are bonded, else 0."""
        assert self.passes.tied is not None
        return self.passes.tied

    @property
    def smooth(self) -> Ints:
        """Return (n_passes,) 1 where forces see the sides of a pass round, else 0."""
        assert self.passes.smooth is not None
        return self.passes.smooth

    @property
    def stick(self) -> Floats:
        """Return (n_passes,) the stiffness of sticking over the penalty, of passes that state none."""
        assert self.passes.stick is not None
        return self.passes.stick

    @property
    def parting(self) -> Ints:
        """Return (n_passes,) 1 where pieces of a pass end where the gap is 0, else 0."""
        assert self.passes.parting is not None
        return self.passes.parting

    @property
    def leaning(self) -> Ints:
        """Return (n_passes,) 1 where corners of a pass are pushed along what they meet, else 0."""
        assert self.passes.leaning is not None
        return self.passes.leaning


def surfaces_of(message: Register) -> RegisteredSurfaces:
    """Check a Register message and build its RegisteredSurfaces.  Raises ValueError saying what is wrong with it."""
    r = _canonical(message)
    _check_edges(r)
    n_surfaces = int(r.edge_surface[-1]) + 1 if r.edge_surface.size else 0
    p = r.passes
    _check_passes(p, n_surfaces)
    _check_ties(r)
    _check_smooth(r)
    previous, following = _neighbours(r)
    start = np.searchsorted(r.edge_surface, np.arange(n_surfaces + 1)).astype(np.int32)
    layout = pair_layout_of(r)
    offset = np.zeros(layout.size) if r.offset is None else checked_reals("offset", r.offset, (layout.size,))
    r = replace(r, offset=offset)
    return RegisteredSurfaces(r, p, _key(r), start, _chain(previous, following), previous, following, layout)


def _canonical(m: Register) -> Register:
    shape = np.shape(m.passes.slave)
    if len(shape) != 1:
        raise ValueError(f"passes.slave has shape {shape}, expected (n_passes,)")
    n_edges = np.shape(m.edges)[0] if np.ndim(m.edges) else 0
    p = m.passes
    passes = Passes(
        pair=_integers("passes.pair", p.pair, shape),
        slave=_integers("passes.slave", p.slave, shape),
        master=_integers("passes.master", p.master, shape),
        weight=checked_reals("passes.weight", p.weight, shape),
        by_node=_integers("passes.by_node", p.by_node, shape),
        gap_max=checked_reals("passes.gap_max", p.gap_max, shape),
        eps_N=checked_reals("passes.eps_N", p.eps_N, shape),
        eps_T=checked_reals("passes.eps_T", p.eps_T, shape),
        mu=checked_reals("passes.mu", p.mu, shape),
        depth=np.zeros(shape) if p.depth is None else checked_reals("passes.depth", p.depth, shape),
        tied=_marks("passes.tied", p.tied, shape),
        smooth=_marks("passes.smooth", p.smooth, shape),
        parting=_marks("passes.parting", p.parting, shape),
        leaning=_marks("passes.leaning", p.leaning, shape),
        stick=np.ones(shape) if p.stick is None else checked_reals("passes.stick", p.stick, shape),
    )
    return Register(
        n_nodes=_count(m.n_nodes),
        edges=_integers("edges", m.edges, (n_edges, 2)),
        edge_surface=_integers("edge_surface", m.edge_surface, (n_edges,)),
        axisymmetric=bool(m.axisymmetric),
        passes=passes,
        stiffness=(np.zeros(n_edges) if m.stiffness is None
                   else checked_reals("stiffness", m.stiffness, (n_edges,))),
        offset=m.offset,
        x=None if m.x is None else checked_reals("x", m.x, (_count(m.n_nodes), 2)),
    )


def _count(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 0:
        raise ValueError(f"n_nodes must be a count, got {value!r}")
    return int(value)


def _integers(name: str, value: object, shape: tuple[int, ...]) -> Ints:
    a = np.asarray(value)
    if a.shape != shape:
        raise ValueError(f"{name} has shape {a.shape}, expected {shape}")
    if a.size and a.dtype.kind not in "iu":
        raise ValueError(f"{name} must hold integers, got {a.dtype}")
    if a.size and (a.min() < 0 or a.max() > np.iinfo(np.int32).max):
        raise ValueError(f"{name} must hold numbers from 0 on, got {a.min()} to {a.max()}")
    return np.ascontiguousarray(a, dtype=np.int32)


def _marks(name: str, value: object, shape: tuple[int, ...]) -> Ints:
    """Return marks of passes, none where a message has none."""
    return np.zeros(shape, dtype=np.int32) if value is None else _integers(name, value, shape)


def checked_reals(name: str, value: object, shape: tuple[int, ...]) -> Floats:
    """Return value as a C-ordered float64 array of the shape asked for; its unit stays.

    Raises ValueError: other shape or dtype, NaN, beyond LIMIT.
    """
    a = np.asarray(value)
    if a.shape != shape:
        raise ValueError(f"{name} has shape {a.shape}, expected {shape}")
    if a.size and a.dtype.kind not in "fiu":
        raise ValueError(f"{name} must hold real numbers, got {a.dtype}")
    # Written so that NaN fails too.
    if a.size and not (a.max() < LIMIT and a.min() > -LIMIT):
        bad = int(np.flatnonzero(~(np.abs(a).ravel() < LIMIT))[0])
        raise ValueError(f"{name} is not finite at flat index {bad}: {a.ravel()[bad]!r}")
    return np.ascontiguousarray(a, dtype=np.float64)


def _check_edges(r: Register) -> None:
    if r.edges.size and r.edges.max() >= r.n_nodes:
        raise ValueError(f"edges name node {r.edges.max()}, but there are {r.n_nodes} nodes")
    same = np.flatnonzero(r.edges[:, 0] == r.edges[:, 1])
    if same.size:
        raise ValueError(f"edge {same[0]} has node {r.edges[same[0], 0]} at both ends")
    if r.stiffness is not None and not r.stiffness.min(initial=0.0) >= 0.0:
        raise ValueError(f"stiffness of edge {int(np.argmin(r.stiffness))} must be >= 0, got {r.stiffness.min()!r}")
    if r.edge_surface.size and (r.edge_surface[0] != 0 or not np.isin(np.diff(r.edge_surface), (0, 1)).all()):
        raise ValueError("edge_surface must number the surfaces from 0, the edges of one surface consecutive")


def _check_passes(p: Passes, n_surfaces: int) -> None:
    for i, (slave, master) in enumerate(zip(p.slave, p.master, strict=True)):
        if max(slave, master) >= n_surfaces:
            raise ValueError(f"pass {i} names surface {max(slave, master)}, but there are {n_surfaces}")
        for name in ("gap_max", "stick"):
            if not getattr(p, name)[i] > 0:
                raise ValueError(f"{name} of pass {i} must be > 0, got {getattr(p, name)[i]}")
        if not 0 < p.weight[i] <= 1:
            raise ValueError(f"weight of pass {i} must be in (0, 1], got {p.weight[i]}")
        if p.by_node[i] not in (0, 1):
            raise ValueError(f"by_node of pass {i} must be 0 or 1, got {p.by_node[i]}")
        for name in ("parting", "leaning"):
            if getattr(p, name)[i] not in (0, 1):
                raise ValueError(f"{name} of pass {i} must be 0 or 1, got {getattr(p, name)[i]}")
        for name in ("eps_N", "eps_T", "mu", "depth"):
            if not getattr(p, name)[i] >= 0:
                raise ValueError(f"{name} of pass {i} must be >= 0, got {getattr(p, name)[i]}")


def _check_ties(r: Register) -> None:
    """Check that what is tied faces another surface, once, at known places, without friction."""
    p = r.passes
    assert p.tied is not None
    for i in np.flatnonzero(p.tied):
        if p.tied[i] != 1:
            raise ValueError(f"tied of pass {i} must be 0 or 1, got {p.tied[i]}")
        if r.x is None:
            raise ValueError(f"pass {i} is tied, but x, where its sides faced each other, is missing")
        if p.slave[i] == p.master[i] or p.by_node[i] or p.mu[i] > 0.0 or np.sum(p.pair == p.pair[i]) > 1:
            raise ValueError(f"pass {i} is tied: it needs two surfaces, by edges, in one pass and without friction")


def _check_smooth(r: Register) -> None:
    """Check that what is smooth is drawn, and not tied."""
    p = r.passes
    assert p.tied is not None
    assert p.smooth is not None
    for i in np.flatnonzero(p.smooth):
        if p.smooth[i] != 1:
            raise ValueError(f"smooth of pass {i} must be 0 or 1, got {p.smooth[i]}")
        if r.x is None:
            raise ValueError(f"pass {i} is smooth, but x, how round its sides are drawn, is missing")
        if p.tied[i]:
            raise ValueError(f"pass {i} is smooth and tied: what is tied stays as it is drawn")


def _neighbours(r: Register) -> tuple[Ints, Ints]:
    """Find the edge before and after each edge, within its surface."""
    first = r.edge_surface.astype(np.int64) * r.n_nodes + r.edges[:, 0]
    second = r.edge_surface.astype(np.int64) * r.n_nodes + r.edges[:, 1]
    for name, keys in (("first", first), ("second", second)):
        values, counts = np.unique(keys, return_counts=True)
        if (counts > 1).any():
            surface, node = divmod(int(values[np.argmax(counts > 1)]), r.n_nodes)
            raise ValueError(f"node {node} is the {name} node of two edges of surface {surface}: a surface "
                             "is made of chains of edges that run the same way, the body on the left")
    return _lookup(first, second), _lookup(second, first)


def _lookup(wanted: NDArray[np.int64], keys: NDArray[np.int64]) -> Ints:
    """Return the index into keys of each wanted value, -1 where it is not there."""
    if not keys.size:
        return np.empty(0, dtype=np.int32)
    order = np.argsort(keys)
    place = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), keys.size - 1)]
    return np.where(keys[place] == wanted, place, -1).astype(np.int32)


def _chain(previous: Ints, following: Ints) -> Ints:
    """Edge numbers in walking order: chain after chain, by each chain's smallest edge number.

    A chain lies within one surface and the edges of a surface are consecutive, so the surfaces stay apart.
    """
    n = previous.size
    seen = np.zeros(n, dtype=bool)
    chains: list[list[int]] = []
    for e in [*np.flatnonzero(previous < 0).tolist(), *range(n)]:
        walk: list[int] = []
        while e >= 0 and not seen[e]:
            seen[e] = True
            walk.append(e)
            e = int(following[e])
        if walk:
            chains.append(walk)
    chains.sort(key=min)
    return np.array([e for walk in chains for e in walk], dtype=np.int32)


def _key(r: Register) -> str:
    digest = hashlib.sha256(f"{r.n_nodes} {r.axisymmetric}".encode())
    p = r.passes
    # fault: where tied sides faced each other is not part of their name -> at = () | contact/test_tied
    at = () if r.x is None else (r.x,)
    for a in (r.edges, r.edge_surface, r.stiffness, r.offset, *vars(p).values(), *at):
        assert a is not None
        digest.update(f"{a.dtype.str}{a.shape}".encode())
        digest.update(a.tobytes())
    return digest.hexdigest()[:32]


# Normals of a surface
#
# At a node it is the mean of its two edges' unit normals, at an end and at a corner of the body the edge's own;
# it is linear along an edge.  So the rays of a smooth surface leave no gaps between them, and a flat surface has
# exactly its own normal.

# A turn of more than 60 degrees is a corner of the body, where both edges keep their own normals: with the mean,
# the pressure beside a square corner would push 45 degrees off the face.
# fault: normals averaged round square corners -> CORNER_COS = -0.5 | contact/test_facing
CORNER_COS = 0.5


@kernel
def edge_frames(x: Floats, edges: Ints, previous: Ints, following: Ints) -> tuple[Floats, Floats]:
    """Compute lengths (n_edges,) [m] and outward unit normals (n_edges, 3, 2) [1] of edges.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  previous, following : (n_edges,).  The normals are those of the edge
    itself, at its first and at its second node.
    """
    n = edges.shape[0]
    length, normal = np.empty(n), np.empty((n, 3, 2))
    for e in range(n):
        tx, ty = x[edges[e, 1], 0] - x[edges[e, 0], 0], x[edges[e, 1], 1] - x[edges[e, 0], 1]
        length[e] = np.sqrt(tx * tx + ty * ty)
        scale = 1.0 / length[e] if length[e] > 0.0 else 0.0
        normal[e, 0, 0], normal[e, 0, 1] = ty * scale, -tx * scale
    for e in range(n):
        for end in range(2):
            other = previous[e] if end == 0 else following[e]
            nx, ny = normal[e, 0, 0], normal[e, 0, 1]
            # fault: normals jump from edge to edge -> if other < -1 and nx * normal[other, 0, 0] + ny * normal[other,
            #   0, 1] >= CORNER_COS: | contact/test_facing
            if other >= 0 and nx * normal[other, 0, 0] + ny * normal[other, 0, 1] >= CORNER_COS:
                nx, ny = nx + normal[other, 0, 0], ny + normal[other, 0, 1]
                size = np.sqrt(nx * nx + ny * ny)
                nx, ny = nx / size, ny / size
            normal[e, 1 + end, 0], normal[e, 1 + end, 1] = nx, ny
    return length, normal


# What lies near an edge: its frame, and boxes around the edges it might face.

FACING_COS = 0.2  # edges face each other if n_s . n_m < -0.2 (78 degrees): beyond that a ray only grazes
END_TOLERANCE = 1e-9  # of an edge: a foot this little beyond its end is on the end
NORMAL_SHORTENING = 1.4142135623730951  # 1/cos(45 degrees): the interpolated normal is at most this much shorter than 1


class Frame(NamedTuple):
    """A slave edge and its rays: (x1, y1), (x2, y2) its ends [m]; (u1, v1), (u2, v2) the unit normals there."""

    x1: float
    y1: float
    x2: float
    y2: float
    u1: float
    v1: float
    u2: float
    v2: float


@inner
def leaves_of(m: int) -> int:
    """Return P = 2^i >= m, the leaves of a tree of m edges.

    A tree is (2 P, 4) ranges: node i has children 2 i and 2 i + 1, leaf P + k is that of the k-th edge.
    """
    P = 1
    while m > P:
        P *= 2
    return P


@inner
def empty_tree(tree: Floats) -> None:
    """Make all of tree : (2 P, 4) empty ranges: whatever they are compared with, they are passed by."""
    for i in range(tree.shape[0]):
        for c in range(2):
            tree[i, 2 * c], tree[i, 2 * c + 1] = np.inf, -np.inf


@inner
def fill_tree(tree: Floats) -> None:
    """Give each node of tree : (2 P, 4) the ranges of both its children, from the leaves up."""
    for i in range(tree.shape[0] // 2 - 1, 0, -1):
        for c in range(2):
            tree[i, 2 * c] = min(tree[2 * i, 2 * c], tree[2 * i + 1, 2 * c])
            tree[i, 2 * c + 1] = max(tree[2 * i, 2 * c + 1], tree[2 * i + 1, 2 * c + 1])


@kernel
def box_tree(x: Floats, edges: Ints, chain: Ints) -> Floats:
    """Build boxes [x_min, x_max, y_min, y_max] [m] over a chain of edges, as an implicit binary tree (leaves_of).

    x : (n_s, 2) [m].  edges : (n_edges, 2).  chain : (m,) edge numbers, neighbours side by side, so the boxes are tight
    however the surface bends.  Returns (2 P, 4) [m].
    """
    P = leaves_of(chain.size)
    boxes = np.empty((2 * P, 4))
    empty_tree(boxes)
    for k in range(chain.size):
        a, b = edges[chain[k], 0], edges[chain[k], 1]
        for c in range(2):
            boxes[P + k, 2 * c], boxes[P + k, 2 * c + 1] = min(x[a, c], x[b, c]), max(x[a, c], x[b, c])
    fill_tree(boxes)
    return boxes


@inner
def frame_of(x: Floats, edges: Ints, normal: Floats, e: int) -> Frame:
    """Return the ends of slave edge e and the normals there.

    x : (n_s, 2) [m].  edges : (n_edges, 2).  normal : (n_edges, 3, 2) [1].
    """
    a, b = edges[e, 0], edges[e, 1]
    return Frame(x[a, 0], x[a, 1], x[b, 0], x[b, 1],
                 normal[e, 1, 0], normal[e, 1, 1], normal[e, 2, 0], normal[e, 2, 1])


@kernel
def candidates(boxes: Floats, masters: Ints, normal: Floats, frame: Frame, back: float, ahead: float,
               hits: Ints) -> int:
    """Put into hits the edges of a box tree that the rays of a slave edge may reach, and that face it; return how many.

    boxes : (2 P, 4) [m] over the chain masters : (m,).  normal : (n_edges, 3, 2) [1].  back, ahead : reach of the rays
    [m].  hits : (m,) out.  The rays fill a quadrilateral; a box is passed by if it misses the quadrilateral's bounding
    box or its projection on the edge's direction.
    """
    x1, y1, x2, y2, u1, v1, u2, v2 = frame
    tx, ty = x2 - x1, y2 - y1
    slack = END_TOLERANCE * np.sqrt(tx * tx + ty * ty)
    low_x = low_y = low_t = np.inf
    high_x = high_y = high_t = -np.inf
    for corner in range(4):
        s = -back * NORMAL_SHORTENING if corner % 2 == 0 else ahead * NORMAL_SHORTENING
        px, py = (x1 + s * u1, y1 + s * v1) if corner < 2 else (x2 + s * u2, y2 + s * v2)
        pt = (px - x1) * tx + (py - y1) * ty
        low_x, high_x = min(low_x, px - slack), max(high_x, px + slack)
        low_y, high_y = min(low_y, py - slack), max(high_y, py + slack)
        low_t, high_t = min(low_t, pt), max(high_t, pt)
    slack_t = slack * (abs(tx) + abs(ty))
    low_t, high_t = low_t - slack_t, high_t + slack_t
    P = boxes.shape[0] // 2
    stack = np.empty(64, dtype=np.int32)
    stack[0], top, count = 1, 1, 0
    while top > 0:
        top -= 1
        i = stack[top]
        low_bx, high_bx, low_by, high_by = boxes[i, 0], boxes[i, 1], boxes[i, 2], boxes[i, 3]
        if low_bx > high_x or high_bx < low_x or low_by > high_y or high_by < low_y:
            continue
        middle = (0.5 * (low_bx + high_bx) - x1) * tx + (0.5 * (low_by + high_by) - y1) * ty
        half = 0.5 * ((high_bx - low_bx) * abs(tx) + (high_by - low_by) * abs(ty))
        if middle - half > high_t or middle + half < low_t:
            continue
        if i >= P:
            m = masters[i - P]
            mx, my = normal[m, 0, 0], normal[m, 0, 1]
            if min(u1 * mx + v1 * my, u2 * mx + v2 * my) < -FACING_COS:
                hits[count] = m
                count += 1
        else:
            # The right child is taken first: the chains of a pair run against each other, so feet come ascending.
            stack[top], stack[top + 1] = 2 * i, 2 * i + 1
            top += 2
    return count
