"""A rod between a hot end and a cold rigid wall: the scene of cases D9 and D13, written as a scenario.

One-dimensional on purpose: slender and in plane stress, so the rod expands freely to all sides by alpha. In the plane
such a swelling changes neither conduction (a square stays a square) nor heat capacity (mass is kept): what differs
from the closed forms of small strains is the width of the tip, by alpha (T - T_0).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coupler import Results, load_scenario, run

Tree = dict[str, Any]
WIDTH = 0.001  # m, of the rod
WALL = 0.01  # m, width and height of the wall


@dataclass(frozen=True)
class Rod:
    """L, gap [m]; hot, cold, start [K]; k [W/mK], c [J/kgK], rho [kg/m3]; alpha [1/K]; E [Pa]; cells along it,
    grading: last cell over the first."""

    gap: float
    hot: float
    alpha: float
    k: float
    E: float
    rho: float
    c: float
    penalty: float
    L: float = 0.1
    cold: float = 300.0
    start: float = 300.0
    cells: int = 20
    grading: float = 1.0


def rod_scene(rod: Rod, conduction: Tree, coupling: Tree) -> Tree:
    """The scene as a tree: rod from y = 0 (hot) to L, wall above the gap."""
    material = {"rho": rod.rho, "c": rod.c, "k": rod.k, "E": rod.E, "nu": 0.3, "alpha": rod.alpha, "T_ref": rod.start}
    return {
        "slideline": 2, "title": "Rod and wall", "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"rod": material, "wall": {**material, "alpha": 0.0}},
        "bodies": {
            "rod": {"mesh": {"rectangle": {"origin": [0, 0], "size": [WIDTH, rod.L], "cells": [1, rod.cells],
                                           "grading": [1, rod.grading]}}, "material": "rod", "T0": rod.start},
            "wall": {"mesh": {"rectangle": {"origin": [0, rod.L + rod.gap], "size": [WALL, WALL], "cells": [1, 1]}},
                     "material": "wall", "T0": rod.cold}},
        "contact": {"tip": {"slave": "rod.top", "master": "wall.bottom", "gap_max": rod.L, "penalty": rod.penalty,
                            "conduction": conduction}},
        "thermal": {"half": "thermal", "method": "sdirk2", "boundary": [
            {"on": "rod.bottom", "temperature": rod.hot}, {"on": "wall.bottom", "temperature": rod.cold},
            {"on": "wall.top", "temperature": rod.cold}]},
        "mechanical": {"half": "elastic", "elastic": {
            "state": "plane_stress", "bodies": {"wall": {"rigid": True}}, "boundary": [
                {"on": "rod.bottom", "u_y": 0}, {"on": "rod.left", "u_x": 0},
                {"body": "wall", "u_x": 0, "u_y": 0, "angle": 0}]}},
        "coupling": coupling,
        "probes": {"T": {"T": {"mean": "rod.top"}}, "gap": {"gap": {"mean": "rod.top"}},
                   "p": {"p": {"mean": "rod.top"}}},
    }


def solve(folder: Path, tree: Tree, **overrides: Any) -> Results:
    """Run a tree as a file in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.yaml").write_text(json.dumps(tree), encoding="utf-8")
    return run(load_scenario(folder / "scene.yaml", overrides=overrides), out=folder / "run.h5")
