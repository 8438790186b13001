"""Small meshes from recipes: patches of four corners, rings and sectors of rings, in quads, triangles or both.

A recipe is a plain mapping, so that a scene that was found can be kept as text:

    {patch: [[0, 0], [0.1, 0], [0.1, 0.05], [0, 0.05]], cells: [4, 2]}      corners anticlockwise from the lower left
    {ring: [0.02, 0.03], centre: [0, 0], angles: [0, 90], cells: [2, 6]}     radii [m], degrees; 360 apart: closed

and for both `grading: [a, b]` (last cell over first), `triangles: true`, `jitter: 0.2` (of a cell, inner nodes)
with `seed`.  Surfaces of a patch are bottom, right, top, left; of a ring inner, outer, and start, end where it is open.
Points are the corners: bottom_left, bottom_right, ...; inner_start, outer_start, outer_end, inner_end.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Shape:
    """The mesh of one body.

    nodes : (n, 2) [m].  quads : (n_q, 4), triangles : (n_t, 3), anticlockwise.  surfaces : name -> (n_e, 2) nodes of
    edges.  points : name -> node.
    """

    nodes: Floats
    quads: Ints
    triangles: Ints
    surfaces: Mapping[str, Ints]
    points: Mapping[str, int]

    def at(self, nodes: Floats, flip: bool = False) -> Shape:
        """The same mesh with its nodes (n, 2) [m] elsewhere; flip : cells turned over, after a mirror."""
        quads, triangles = (self.quads[:, ::-1], self.triangles[:, ::-1]) if flip else (self.quads, self.triangles)
        return replace(self, nodes=nodes, quads=quads, triangles=triangles)

    def renumbered(self, rng: np.random.Generator) -> tuple[Shape, Ints]:
        """The same mesh in another order, and where (n,) each old node went."""
        new = rng.permutation(len(self.nodes))
        nodes = np.empty_like(self.nodes)
        nodes[new] = self.nodes

        def cells(old: Ints) -> Ints:
            rows = new[old][rng.permutation(len(old))]
            return np.array([np.roll(row, rng.integers(rows.shape[1])) for row in rows]).reshape(old.shape)

        edges = {name: new[rows][rng.permutation(len(rows))] for name, rows in self.surfaces.items()}
        return Shape(nodes, cells(self.quads), cells(self.triangles), edges,
                     {name: int(new[k]) for name, k in self.points.items()}), new

    @property
    def size(self) -> float:
        """Diagonal of the box around it [m]."""
        return float(np.linalg.norm(np.ptp(self.nodes, axis=0)))

    @property
    def cell_size(self) -> float:
        """Length of its shortest edge [m]."""
        return float(self._edge_lengths().min())

    @property
    def longest_edge(self) -> float:
        """[m]"""
        return float(self._edge_lengths().max())

    def _edge_lengths(self) -> Floats:
        edges = [self.nodes[np.roll(c, -1, axis=1)] - self.nodes[c] for c in (self.quads, self.triangles) if len(c)]
        return np.concatenate([np.linalg.norm(e, axis=2).ravel() for e in edges])

    def write(self, path: Path) -> None:
        """Write it as a gmsh file (2.2, text) with named groups."""
        cells: list[tuple[str, Ints]] = []
        tags: list[Ints] = []
        names: dict[str, Ints] = {}
        blocks = [("quad", self.quads, "cells", 2), ("triangle", self.triangles, "cells", 2),
                  *(("line", rows, name, 1) for name, rows in self.surfaces.items()),
                  *(("vertex", np.array([[k]]), name, 0) for name, k in self.points.items())]
        for kind, rows, name, dimension in blocks:
            if len(rows):
                number = names.setdefault(name, np.array([len(names) + 1, dimension]))[0]
                cells.append((kind, rows))
                tags.append(np.full(len(rows), number))
        mesh = meshio.Mesh(np.column_stack([self.nodes, np.zeros(len(self.nodes))]), cells, field_data=names,
                           cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags})
        meshio.write(path, mesh, file_format="gmsh22", binary=False)


def shape_of(recipe: Mapping[str, Any]) -> Shape:
    """The mesh of a recipe.  Raises KeyError for one of neither kind."""
    if "ring" in recipe:
        return _ring(recipe)
    return _patch(recipe)


def _steps(n: int, grading: float) -> Floats:
    """n + 1 places from 0 to 1, the last step `grading` times the first."""
    steps = grading ** (np.arange(n) / max(n - 1, 1))
    return np.append(0.0, np.cumsum(steps) / steps.sum())


def _grid(recipe: Mapping[str, Any]) -> tuple[Floats, Floats, int, int]:
    n, m = recipe["cells"]
    a, b = recipe.get("grading", (1.0, 1.0))
    s, t = np.meshgrid(_steps(n, a), _steps(m, b), indexing="xy")  # row by row
    if recipe.get("jitter"):
        rng = np.random.default_rng(recipe.get("seed", 0))
        move = float(recipe["jitter"]) * rng.uniform(-0.5, 0.5, (2, m + 1, n + 1))
        move[:, [0, -1], :] = move[:, :, [0, -1]] = 0.0
        s, t = s + move[0] / n, t + move[1] / m
    return s, t, n, m


def _cells(n: int, m: int, closed: bool, recipe: Mapping[str, Any]) -> tuple[Ints, Ints]:
    """Quads and triangles of n x m cells; closed : the last row of nodes is the first."""
    rows = m if closed else m + 1
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(m), indexing="xy"))
    up = (j + 1) % rows
    quads = np.column_stack([j * (n + 1) + i, j * (n + 1) + i + 1, up * (n + 1) + i + 1, up * (n + 1) + i])
    none = np.empty((0, 3), dtype=np.int64)
    how = recipe.get("triangles", False)
    if not how:
        return quads, none
    cut = np.ones(len(quads), dtype=bool) if how is True else (i + j) % 2 == 0  # "mixed": every other one
    a, b, c, d = quads[cut].T
    other = ((i + j) // 2 % 2 == 0)[cut][:, None]  # either diagonal, by turns
    first = np.where(other, np.column_stack([a, b, c]), np.column_stack([a, b, d]))
    second = np.where(other, np.column_stack([a, c, d]), np.column_stack([b, c, d]))
    return quads[~cut], np.vstack([first, second])


def _chain(nodes: Ints) -> Ints:
    return np.column_stack([nodes[:-1], nodes[1:]])


def _patch(recipe: Mapping[str, Any]) -> Shape:
    s, t, n, m = _grid(recipe)
    a, b, c, d = (np.array(p, dtype=float) for p in recipe["patch"])
    s, t = s.ravel()[:, None], t.ravel()[:, None]
    nodes = (1 - s) * (1 - t) * a + s * (1 - t) * b + s * t * c + (1 - s) * t * d
    number = np.arange((n + 1) * (m + 1)).reshape(m + 1, n + 1)
    quads, triangles = _cells(n, m, False, recipe)
    edges = {"bottom": _chain(number[0]), "right": _chain(number[:, -1]), "top": _chain(number[-1, ::-1]),
             "left": _chain(number[::-1, 0])}
    points = {"bottom_left": number[0, 0], "bottom_right": number[0, -1], "top_right": number[-1, -1],
              "top_left": number[-1, 0]}
    return Shape(nodes, quads, triangles, edges, {k: int(v) for k, v in points.items()})


def _ring(recipe: Mapping[str, Any]) -> Shape:
    s, t, n, m = _grid(recipe)
    r0, r1 = recipe["ring"]
    first, last = recipe.get("angles", (0.0, 360.0))
    closed = abs(last - first) >= 360.0
    if closed:
        s, t = s[:-1], t[:-1]
    r = (r0 + (r1 - r0) * s).ravel()
    angle = np.radians(first + (last - first) * t).ravel()
    nodes = np.array(recipe.get("centre", (0.0, 0.0)), dtype=float) + np.column_stack([r * np.cos(angle),
                                                                                       r * np.sin(angle)])
    number = np.arange(s.size).reshape(s.shape)
    quads, triangles = _cells(n, m, closed, recipe)
    around = np.vstack([number, number[:1]]) if closed else number
    edges = {"inner": _chain(around[::-1, 0]), "outer": _chain(around[:, -1])}
    points = {}
    if not closed:
        edges |= {"start": _chain(number[0]), "end": _chain(number[-1, ::-1])}
        points = {"inner_start": number[0, 0], "outer_start": number[0, -1], "outer_end": number[-1, -1],
                  "inner_end": number[-1, 0]}
    return Shape(nodes, quads, triangles, edges, {k: int(v) for k, v in points.items()})
