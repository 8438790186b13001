"""Scenes made by hand on which invariants are tried: a plate, two blocks, a block in a corner."""

from __future__ import annotations

from typing import Any

from random_scenes.scene import Scene

STEEL = {"rho": 7800, "c": 480, "k": 45, "E": 2.0e11, "nu": 0.3, "alpha": 1.2e-5, "T_ref": 300}
HELD = {"u_x": 0, "u_y": 0}
# A law is tried on runs that mend nothing by themselves.
PLAIN = {"scheme": "staggered", "on_unstable": "warn"}


def box(x: float, y: float, width: float, height: float, cells: tuple[int, int], **more: Any) -> dict[str, Any]:
    """The recipe of a rectangle with its lower left corner at (x, y) [m]."""
    return {"patch": [[x, y], [x + width, y], [x + width, y + height], [x, y + height]], "cells": list(cells), **more}


def plate(*boundary: dict[str, Any], size: float, end: float, cells: tuple[int, int] = (4, 4),
          method: str = "backward_euler", T0: float = 300, **recipe: Any) -> Scene:
    """A plate of 40 x 40 mm in windows of `size` [s]."""
    doc = {"slideline": 2, "units": {"temperature": "K"}, "geometry": "plane", "materials": {"steel": STEEL},
           "bodies": {"plate": {"material": "steel", "T0": T0}},
           "thermal": {"half": "thermal", "method": method, "boundary": list(boundary)},
           "mechanical": {"half": "rigid"},
           "coupling": {**PLAIN, "end": end, "windows": [{"until": end, "size": size}]}}
    return Scene(doc, {"plate": box(0, 0, 0.04, 0.04, cells, **recipe)})


def two_blocks(gap: float = 0.0, push: float | dict[str, Any] = -2e-5, *, end: float = 8.0, size: float = 1.0,
               pair: dict[str, Any] | None = None, **values: Any) -> Scene:
    """A block (400 K) over another (300 K), `gap` [m] apart, its top moved by `push` [m] over the first half."""
    move = {"t": [0, end / 2], "value": [0, push]} if isinstance(push, float) else push
    doc = {"slideline": 2, "units": {"temperature": "K"}, "geometry": "plane", "materials": {"steel": STEEL},
           "bodies": {"lower": {"material": "steel", "T0": 300}, "upper": {"material": "steel", "T0": 400}},
           "contact": {"face": {"slave": "upper.bottom", "master": "lower.top", "gap_max": 0.01, "conduction": {
               "closed": {"law": "constant", "h": 2000}, "open": {"law": "constant", "h": 50}}, **(pair or {})}},
           "thermal": {"half": "thermal", "method": "sdirk2"},
           "mechanical": {"half": "elastic", "elastic": {"boundary": [
               {"on": "lower.bottom", **HELD}, {"on": "upper.top", "u_x": 0, "u_y": move}]}},
           "coupling": {**PLAIN, "end": end, "windows": [{"until": end, "size": size}]}}
    recipes = {"lower": box(0, 0, 0.04, 0.02, (6, 3)), "upper": box(0.005, 0.02 + gap, 0.03, 0.02, (5, 3))}
    return Scene(doc, recipes).edited(**values)


def corner(gap: float, *, end: float = 8.0, size: float = 1.0, gap_max: float = 0.01) -> Scene:
    """A block (600 K) on a floor and `gap` [m] beside a wall (300 K both): two pairs share its corner."""
    doc = {"slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
           "materials": {"steel": {**STEEL, "alpha": 0}},
           "bodies": {"floor": {"material": "steel", "T0": 300}, "wall": {"material": "steel", "T0": 300},
                      "block": {"material": "steel", "T0": 600}},
           "contact": {name: {"slave": f"block.{side}", "master": master, "gap_max": gap_max, "conduction": {
               "closed": {"law": "constant", "h": 2e4}, "open": {"law": "constant", "h": 20}}}
               for name, side, master in (("below", "bottom", "floor.top"), ("beside", "left", "wall.right"))},
           "thermal": {"half": "thermal", "method": "backward_euler"},
           "mechanical": {"half": "elastic", "elastic": {"boundary": [
               {"on": "floor.bottom", **HELD}, {"on": "wall.left", **HELD},
               {"on": "block.top", "u_x": 0, "u_y": {"t": [0, end / 2], "value": [0, -2e-6]}}]}},
           "coupling": {**PLAIN, "end": end, "windows": [{"until": end, "size": size}]}}
    recipes = {"floor": box(0, -0.01, 0.05, 0.01, (5, 2)), "wall": box(-0.01 - gap, 0, 0.01, 0.04, (2, 4)),
               "block": box(0, 0, 0.04, 0.03, (4, 3))}
    return Scene(doc, recipes)
