"""Interfaces of the same bodies on different meshes, and scenarios whose thermal half has one of its own."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from several_scenes import BLOCKS, TWO, blocks, ran

from contact.half.interface import Interface, Pair
from coupler.scenario.mesh import Rectangle, rectangle_mesh
from coupler.trust.checks import Check

Floats = np.ndarray
SIZES = {"low": ((0.3, -0.2), (1.0, 0.2)), "up": ((0.5, 0.0), (0.6, 0.4))}


def rectangles(cells: Mapping[str, tuple[int, int]], geometry: str = "plane", triangles: tuple[str, ...] = (),
               grading: tuple[float, float] = (1.0, 1.0), swapped: bool = False) -> Interface:
    """Two rectangles on each other.  triangles : bodies whose cells are cut in two.  swapped : the pair's roles."""
    meshes = {n: rectangle_mesh(Rectangle(origin=SIZES[n][0], size=SIZES[n][1], cells=c, triangles=n in triangles,
                                          grading=grading)) for n, c in cells.items()}
    return interface_of(meshes, geometry, ("low.top", "up.bottom") if swapped else ("up.bottom", "low.top"))


def rings(n: Mapping[str, int], layers: int = 2) -> Interface:
    """A disc with a hole in a ring, n cells around each: curved surfaces that the meshes cut short."""
    radii = {"shaft": (0.3, 1.0), "hub": (1.0, 1.6)}
    found = {}
    for name, (inner, outer) in radii.items():
        around = np.linspace(0.0, 2 * np.pi, n[name], endpoint=False)
        r = np.linspace(inner, outer, layers + 1)
        nodes = (r[:, None, None] * np.stack([np.cos(around), np.sin(around)], axis=1)).reshape(-1, 2)
        k = np.arange(n[name])
        ahead = (k + 1) % n[name]
        quads = np.concatenate([np.stack([m * n[name] + k, (m + 1) * n[name] + k, (m + 1) * n[name] + ahead,
                                          m * n[name] + ahead], axis=1) for m in range(layers)])
        last = layers * n[name]
        found[name] = Ring(nodes, quads.astype(np.int32), np.empty((0, 3), np.int32), {
            "inner": np.stack([ahead, k], axis=1).astype(np.int32),
            "outer": np.stack([last + k, last + ahead], axis=1).astype(np.int32)})
    return interface_of(found, "plane", ("shaft.outer", "hub.inner"))


class Ring:
    """As coupler.scenario.mesh.BodyMesh."""

    def __init__(self, nodes: Floats, quads: Floats, triangles: Floats, surfaces: Mapping[str, Floats]) -> None:
        self.nodes, self.quads, self.triangles, self.surfaces = nodes, quads, triangles, surfaces


def interface_of(meshes: Mapping[str, Any], geometry: str, pair: tuple[str, str]) -> Interface:
    first = np.concatenate([[0], np.cumsum([len(m.nodes) for m in meshes.values()])])
    parts = list(zip(meshes.items(), first[:-1], strict=True))
    return Interface(
        geometry, np.concatenate([m.nodes for m in meshes.values()]),
        *(np.concatenate([getattr(m, kind) + at for (_, m), at in parts]).astype(np.int32)
          for kind in ("quads", "triangles")),
        *(np.repeat(np.arange(len(meshes)), [len(getattr(m, kind)) for m in meshes.values()]).astype(np.int32)
          for kind in ("quads", "triangles")),
        tuple(meshes), ("steel",) * len(meshes),
        {f"{name}.{s}": (e + at).astype(np.int32) for (name, m), at in parts for s, e in m.surfaces.items()},
        pairs=(Pair("face", *pair, gap_max=0.1, eps_N=1e9),))


def turned(interface: Interface, angle: float, shift: tuple[float, float]) -> Interface:
    """The same bodies elsewhere."""
    c, s = np.cos(angle), np.sin(angle)
    return Interface(**{**vars_of(interface), "nodes": interface.nodes @ np.array([[c, s], [-s, c]]) + shift})


def vars_of(interface: Interface) -> dict[str, Any]:
    return {n: getattr(interface, n) for n in interface.__dataclass_fields__}


def box(origin: tuple[float, float], size: tuple[float, float], cells: tuple[int, int], **more: Any) -> dict[str, Any]:
    return {"rectangle": {"origin": list(origin), "size": list(size), "cells": list(cells), **more}}


def block_meshes(lower: tuple[int, int], middle: tuple[int, int], upper: tuple[int, int]) -> dict[str, Any]:
    """Meshes of the three blocks of several_scenes."""
    side = (0.02, 0.02)
    return {"lower": box((0, -0.021), side, lower), "middle": box((0, 0), side, middle),
            "upper": box((0.005, 0.022), side, upper)}


DIVIDED = [pytest.param({"thermal.halves": TWO}, id="several halves"),
           pytest.param({"thermal.meshes": block_meshes((3, 4), (4, 4), (5, 4))}, id="a mesh of its own")]
SHORT = {"coupling.end": 24, "coupling.windows": [{"until": 24, "size": 4}], "output.checkpoint": 0}


def trust_whole_and_divided(folder: Path, more: Mapping[str, Any]) -> list[tuple[Check, ...]]:
    """The trust tables of a short run of the three blocks by one thermal half, and with such changes (DIVIDED)."""
    file = blocks(folder)
    return [ran(file, folder / f"{n}.h5", SHORT | changes).trust for n, changes in (("one", {}), ("other", more))]


def as_bodies(meshes: Mapping[str, Any]) -> dict[str, Any]:
    """The same meshes as those of the scene."""
    return {f"bodies.{name}.mesh.rectangle.cells": mesh["rectangle"]["cells"] for name, mesh in meshes.items()}


assert "middle.bottom" in BLOCKS
