"""A rectangle meshed by rows and columns, its four surfaces and its named points."""

from __future__ import annotations

import numpy as np
from skfem import MeshQuad

from coupler.scenario.body_mesh import BodyMesh, Floats, Ints, anticlockwise
from coupler.scenario.schema_scene import Rectangle

# A node this near (as a share of the rectangle's side) to a named point is that point.
NEAR = 1e-9
# surface -> (axis it runs along, is it at the far end of the other axis, does it run backwards with the body
# on its left, names of its points in ascending order of the axis)
SIDES = {
    "bottom": (0, False, False, ("left", "centre", "right")),
    "right": (1, True, False, ("bottom", "centre", "top")),
    # fault: top surface runs the wrong way -> "top": (0, True, False, ("left", "centre", "right")), |
    #   coupler/test_scenario_mesh
    "top": (0, True, True, ("left", "centre", "right")),
    "left": (1, False, True, ("bottom", "centre", "top")),
}


def rectangle_mesh(rectangle: Rectangle) -> BodyMesh:
    """Mesh a rectangle with quads, or with triangles by cutting each quad in two."""
    axes = [_ticks(o, s, n, g) for o, s, n, g in zip(
        rectangle.origin, rectangle.size, rectangle.cells, rectangle.grading, strict=True)]
    mesh = MeshQuad.init_tensor(*axes)
    nodes = np.ascontiguousarray(mesh.p.T)
    quads = anticlockwise(nodes, mesh.t.T, "quad")
    triangles = np.empty((0, 3), dtype=np.int32)
    if rectangle.triangles:
        triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
        quads = np.empty((0, 4), dtype=np.int32)
    surfaces = {side: _surface(nodes, axes, side) for side in SIDES}
    points = _points(axes)
    sets = {name: found for name, at in points.items() if (found := _node_at(nodes, at, rectangle.size)).size}
    return BodyMesh(nodes, quads, triangles, surfaces, sets, points)


def _ticks(origin: float, size: float, cells: int, grading: float) -> Floats:
    """(cells + 1,) coordinates; cells grow geometrically, the last over the first is `grading`."""
    ratio = grading ** (1.0 / (cells - 1)) if cells > 1 else 1.0
    share = np.concatenate([[0.0], np.cumsum(ratio ** np.arange(cells))])
    ticks = origin + size * (share / share[-1])
    ticks[-1] = origin + size
    return ticks


def _surface(nodes: Floats, axes: list[Floats], side: str) -> Ints:
    along, far, backwards, _ = SIDES[side]
    across = 1 - along
    on = np.flatnonzero(nodes[:, across] == axes[across][-1 if far else 0])
    chain = on[np.argsort(nodes[on, along])]
    if backwards:
        chain = chain[::-1]
    return np.stack([chain[:-1], chain[1:]], axis=1).astype(np.int32)


def _points(axes: list[Floats]) -> dict[str, Floats]:
    points = {}
    for side, (along, far, _, names) in SIDES.items():
        ends = axes[along]
        for name, value in zip(names, (ends[0], (ends[0] + ends[-1]) / 2, ends[-1]), strict=True):
            at = np.empty(2)
            at[along], at[1 - along] = value, axes[1 - along][-1 if far else 0]
            points[f"{side}.{name}"] = at
    return points


def _node_at(nodes: Floats, at: Floats, size: tuple[float, float]) -> Ints:
    return np.flatnonzero((np.abs(nodes - at) <= NEAR * np.asarray(size)).all(axis=1)).astype(np.int32)
