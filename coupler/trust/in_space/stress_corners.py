"""Places of a drawing at which stress has no bound: with smaller cells it grows and grows.

Corners that go into a body; ends of what is held, unless a line of symmetry ends there; points that are held or loaded;
ends of a contact; corners of two materials on the outside.  Stress there says nothing of how strong a body is.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]

CORNER = np.deg2rad(30.0)  # a body turns in by so much at a corner; less is a part of a curve
CURVE = 2.0  # and by so many times what it turns in at the nodes next to it: a hole of few edges is no corner
# Widest angle at which stress is bounded where a clamped edge meets a free one (Williams 1952).  Where one on rollers
# does, it is as in a body of twice the angle.
CLAMPED = np.deg2rad(61.0)
STRAIGHT = 1e-3  # rad: less is round-off of a straight side
ALONG = 0.1  # of an edge's length: what it may go along the component that is held, and be one of symmetry


def places_without_bound(interface: Interface, model: Mapping[str, Any]) -> dict[int, str]:
    """Return node -> why stress has no bound there, in words.  model : model.json of the mechanical half."""
    found: dict[int, str] = {}
    angle, ahead, behind = _outline(interface)
    on_outside = np.flatnonzero(ahead >= 0)
    if interface.regions:
        parts = [interface.part_nodes(p) for p in range(len(interface.parts))]
        made_of = [m for m in map(_material_of(interface, model), interface.parts)]
        many = np.zeros(len(interface.nodes), dtype=int)
        for material in dict.fromkeys(made_of):
            of = [nodes for nodes, m in zip(parts, made_of, strict=True) if m == material]
            many[np.unique(np.concatenate(of))] += 1
        found |= dict.fromkeys(on_outside[many[on_outside] > 1].tolist(), "two materials meet on the outside")
    found |= dict.fromkeys(interface.contact_nodes.tolist(), "another body presses there: if contact ends there")
    turn = angle - np.pi
    for entry in model.get("boundary", ()):
        at, ends, symmetric = _ends(interface, entry, ahead, behind)
        found |= dict.fromkeys(at, "a single point is held or loaded")
        found |= dict.fromkeys([k for k in ends if angle[k] > CLAMPED], "what is held ends there")
        # A body on rollers is half of one of twice the angle.
        # fault: the end of a line of symmetry is a corner of its body alone -> pass | coupler/test_stress_corners
        turn[symmetric] = 2.0 * angle[symmetric] - np.pi
    for k in on_outside.tolist():
        # fault: the corners of a polygon that stands for a hole are taken for notches -> next_to = 0.0 |
        #   coupler/test_stress_corners
        next_to = max(turn[ahead[k]], turn[behind[k]])
        if turn[k] > CORNER and turn[k] > CURVE * next_to:
            found[k] = "a corner goes into the body"
    return found


def curves(interface: Interface) -> dict[int, tuple[float, int, int]]:
    """Return node -> by how much [rad] a body turns in there, and its neighbours, of nodes on curves and no corners."""
    angle, ahead, behind = _outline(interface)
    turn = angle - np.pi
    # A curve may end at a line of symmetry, and goes on beyond it.
    ends = (ahead >= 0) & (angle < np.pi - CORNER)
    # fault: the tip of an ellipse is a corner beside its line of symmetry -> pass | coupler/test_stress_corners
    turn[ends] = np.maximum(turn[ends], 2.0 * angle[ends] - np.pi)
    return {k: (float(turn[k]), int(ahead[k]), int(behind[k])) for k in np.flatnonzero(ahead >= 0).tolist()
            if not ends[k] and STRAIGHT < turn[k] <= CURVE * max(turn[ahead[k]], turn[behind[k]])}


def curve_centres(interface: Interface) -> Floats:
    """Return (n_nodes, 2) [m] the centres of curves that go into a body, nan of nodes that are on none.

    Of the circle through a node and its neighbours.  A curve may end at a side of its body, as a hole does at a line of
    symmetry: there one neighbour is the mirror image of the other.  Where that would be a corner, it has the circle of
    its neighbour, which it is on.
    """
    X, found = interface.nodes, np.full_like(interface.nodes, np.nan)
    angle, ahead, behind = _outline(interface)
    on = curves(interface)
    for k, (_, one, other) in on.items():
        (a, b), (c, d) = 2.0 * (X[one] - X[k]), 2.0 * (X[other] - X[k])
        p, q = (float(X[j] @ X[j] - X[k] @ X[k]) for j in (one, other))
        # It turns in, so the three are on no line.
        found[k] = np.array([p * d - b * q, a * q - c * p]) / (a * d - b * c)
    for k in np.flatnonzero((ahead >= 0) & (angle < np.pi - CORNER)).tolist():
        # fault: a hole that ends at a line of symmetry is straight there -> next_to: list[int] = [] |
        #   coupler/test_stress_corners
        next_to = [j for j in (int(ahead[k]), int(behind[k])) if j in on]
        if not next_to:
            continue
        other = int(behind[k]) if next_to[0] == ahead[k] else int(ahead[k])
        out, d = (X[k] - X[other]) / np.hypot(*(X[k] - X[other])), X[next_to[0]] - X[k]
        mirrored = 0.0 < 2.0 * angle[k] - np.pi <= CURVE * on[next_to[0]][0] and d @ out > 0.0
        found[k] = X[k] + out * (d @ d) / (2.0 * d @ out) if mirrored else found[next_to[0]]
    return found


def _ends(interface: Interface, entry: Mapping[str, Any], ahead: Ints, behind: Ints
          ) -> tuple[list[int], list[int], list[int]]:
    """Nodes of a boundary condition: points it holds or loads, ends of a clamped surface, ends of one on rollers."""
    held = ({0, 1} if entry.get("rotation") is not None else
            {c for c, key in enumerate(("u_x", "u_y")) if entry.get(key) is not None})
    at = entry.get("at")
    if at is not None and (held or entry.get("f_x") is not None or entry.get("f_y") is not None):
        names = [at] if isinstance(at, str) else at
        return [int(k) for name in names for k in interface.node_sets.get(name, ())], [], []
    edges = interface.surfaces.get(str(entry.get("on")))
    if edges is None or not held:
        return [], [], []
    inside = np.zeros(len(interface.nodes), dtype=bool)
    inside[edges] = True
    ends: list[int] = []
    symmetric: list[int] = []
    for node in np.unique(edges).tolist():
        own = [k for k in (int(ahead[node]), int(behind[node])) if k >= 0 and inside[k]]
        if len(own) != 1:
            continue
        way = interface.nodes[own[0]] - interface.nodes[node]
        # fault: the end of a line of symmetry is taken for the end of a clamp -> rollers = False |
        #   coupler/test_stress_corners
        rollers = len(held) == 1 and abs(way[min(held)]) < ALONG * float(np.hypot(*way))
        (symmetric if rollers else ends).append(node)
    return [], ends, symmetric


def _outline(interface: Interface) -> tuple[Floats, Ints, Ints]:
    """(n_nodes,) the angle [rad] a body has at a node, and its neighbours along the outside; -1 inside."""
    n = len(interface.nodes)
    angle, edges = np.zeros(n), []
    for cells in (interface.quads, interface.triangles):
        X = interface.nodes[cells]
        one, other = np.roll(X, -1, axis=1) - X, np.roll(X, 1, axis=1) - X
        cross = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
        np.add.at(angle, cells, np.arctan2(cross, (one * other).sum(axis=2)))
        edges.append(np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2))
    directed = np.concatenate(edges).astype(np.int64)
    outside = directed[~np.isin(directed @ (n, 1), directed[:, ::-1] @ (n, 1))]
    ahead, behind = np.full(n, -1), np.full(n, -1)
    ahead[outside[:, 0]], behind[outside[:, 1]] = outside[:, 1], outside[:, 0]
    return angle, ahead, behind


def _material_of(interface: Interface, model: Mapping[str, Any]) -> Any:
    """Part -> the name of its material."""
    def of(part: str) -> str:
        body, _, region = part.partition(".")
        about = model["bodies"][body]
        return str(((about.get("regions") or {}).get(region) or about).get("material")) if region else str(
            about.get("material"))

    return of
