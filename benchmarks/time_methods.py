"""Time methods side by side: what each costs and how far it is off, on scenes that jump and scenes that do not.

    python benchmarks/time_methods.py [--rounds 3] [--scenes bars D2 casting sliding can]

Every scene runs by every method in windows of three lengths, halves in this process (no FMU), method after method in
each round; CPU seconds are the least of the rounds, solves the linear ones of the thermal half in the whole run.  Off
is the largest difference of the named temperatures from the same scene by sdirk2 in windows eight times shorter than
the shortest (the can: four times), over the ends of the longest windows but for the first two after a jump: what
remains of it.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scene import pin, table

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from coupler import load_scenario, run  # noqa: E402

METHODS = ("midpoint", "sdirk2", "backward_euler")
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """A scene.  doc : (method, window [s]) -> scenario.  windows : lengths [s].  watched : probes.

    from_t : [s], compared from there on.  finer : windows of the reference, as a part of the shortest.
    """

    name: str
    doc: Callable[[str, float], Any]
    windows: tuple[float, ...]
    watched: tuple[str, ...]
    from_t: float
    end: float
    finer: int = 8


def bars(method: str, window: float) -> dict[str, Any]:
    """Two aluminium bars of 500 and 300 K that touch at 50 s."""
    def bar(x: float, T: float) -> dict[str, Any]:
        return {"mesh": {"rectangle": {"origin": [x, 0], "size": [0.1, 0.01], "cells": [40, 1]}}, "material": "al",
                "T0": T}

    return {"materials": {"al": {"rho": 2700, "c": 900, "k": 210}},
            "bodies": {"a": bar(0.0, 500), "b": bar(0.101, 300)},
            "contact": {"p": {"slave": "a.right", "master": "b.left", "gap_max": 0.02,
                              "conduction": {"closed": {"law": "constant", "h": 1e5}, "open": None}}},
            "thermal": {"method": method},
            "mechanical": {"half": "rigid", "rigid": {
                "motion": {"a": {"u_x": {"t": [0, 50], "value": [0, 1.0001e-3]}}}, "pressure": {"p": 1e6}}},
            "coupling": {"end": 70, "windows": [{"until": 50, "size": 5}, {"until": 70, "size": window}]},
            "probes": {"hot": {"T": {"max": "a.right"}}, "cold": {"T": {"max": "b.left"}}}}


def half_spaces(method: str, window: float) -> dict[str, Any]:
    """D2: two half-spaces of 500 and 300 K through h = 2000 W/m2K."""
    def side(x: float, grading: list[float], material: str, T: float) -> dict[str, Any]:
        return {"mesh": {"rectangle": {"origin": [x, 0], "size": [0.3, 0.01], "cells": [60, 1], "grading": grading}},
                "material": material, "T0": T}

    return {"materials": {"al": {"rho": 2750, "c": 1000, "k": 210}, "st": {"rho": 7800, "c": 480, "k": 45}},
            "bodies": {"a": side(0.0, [0.02, 1], "al", 500), "b": side(0.3, [50, 1], "st", 300)},
            "contact": {"p": {"slave": "a.right", "master": "b.left", "gap_max": 0.02,
                              "conduction": {"closed": {"law": "constant", "h": 2000}, "open": None}}},
            "thermal": {"method": method},
            "mechanical": {"half": "rigid", "rigid": {"pressure": {"p": 1e6}}},
            "coupling": {"end": 20, "windows": [{"until": 20, "size": window}]},
            "probes": {"hot": {"T": {"max": "a.right"}}, "cold": {"T": {"max": "b.left"}}}}


def casting(method: str, window: float) -> dict[str, Any]:
    """Overrides of casting_1d.yaml."""
    return {"thermal.method": method, "coupling.windows": [{"until": 60, "size": window}], "coupling.end": 60}


def sliding(method: str, window: float) -> dict[str, Any]:
    """Overrides of sliding_blocks.yaml, the rigid half: to the middle of the slide."""
    return {"thermal.method": method, "mechanical.half": "rigid", "coupling.end": 14000, "coupling.windows": [
        {"until": 2500, "first": 5, "last": 100}, {"until": 9900, "first": 120, "last": 10},
        {"until": 10000, "first": 10, "last": 0.5}, {"until": 12500, "first": 1, "last": 100},
        {"until": 14000, "size": window}]}


def can(method: str, window: float) -> dict[str, Any]:
    """Overrides of aluminium_can.yaml: the melt freezes to the wall and leaves it."""
    return {"thermal.method": method, "coupling.end": 40, "coupling.windows": [
        {"until": 10, "first": 0.1, "last": 0.5}, {"until": 40, "size": window}]}


CASES = (
    Case("two bars that meet", bars, (4.0, 2.0, 1.0), ("hot", "cold"), 58.0, 70.0),
    Case("D2", half_spaces, (2.0, 1.0, 0.5), ("hot", "cold"), 4.0, 20.0),
    Case("casting_1d", casting, (4.0, 2.0, 1.0), ("rod.right",), 8.0, 60.0),
    Case("sliding_blocks", sliding, (30.0, 15.0, 7.5), ("lower.top.left", "lower.top.centre", "lower.top.right"),
         12600.0, 14000.0),
    Case("aluminium_can", can, (4.0, 2.0, 1.0), ("wall.T", "melt.centre"), 18.0, 38.0, 4),
)
FILES = {name: f"{name}.yaml" for name in ("casting_1d", "sliding_blocks", "aluminium_can")}


@dataclass(frozen=True)
class Cost:
    """windows : tried.  solves : linear ones of the thermal half.  seconds : CPU of the run."""

    windows: int
    solves: int
    seconds: float


def solved(case: Case, method: str, window: float, folder: Path) -> tuple[Floats, Cost]:
    """Return (probes, times) temperatures [K] at the ends of the longest windows, and what the run cost."""
    from random_scenes.direct_half import without_fmus

    doc = case.doc(method, window)
    if case.name in FILES:
        scenario = load_scenario(ROOT / "scenarios" / FILES[case.name], overrides=doc)
    else:
        from ruamel.yaml import YAML

        path = folder / "scene.yaml"
        with path.open("w", encoding="utf-8") as f:
            head = {"slideline": 2, "units": {"temperature": "K"}, "geometry": "plane"}
            YAML(typ="safe", pure=True).dump({**head, **doc}, f)
        scenario = load_scenario(path)
    began = time.process_time()
    with without_fmus():
        results = run(scenario, out=Path(tempfile.mkdtemp(dir=folder)) / "run.h5")
    seconds = time.process_time() - began
    times = np.arange(case.from_t, case.end + 1e-9, case.windows[0])
    cost = Cost(len(results.windows.H), int(results.windows.thermal_iterations.sum()), seconds)
    return np.array([np.interp(times, *results.probe(name)) for name in case.watched]), cost


def main(rounds: int, scenes: list[str]) -> None:
    """Run all and print the table."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for case in (one for one in CASES if any(word in one.name for word in scenes)):
            right, _ = solved(case, "sdirk2", case.windows[-1] / case.finer, folder)
            for window in case.windows:
                off: dict[str, float] = {}
                costs: dict[str, list[Cost]] = {method: [] for method in METHODS}
                for _ in range(rounds):
                    for method in METHODS:
                        T, cost = solved(case, method, window, folder)
                        off[method] = float(np.abs(T - right).max())
                        costs[method].append(cost)
                least = {method: min(cost.seconds for cost in costs[method]) for method in METHODS}
                rows.append({"scene": case.name, "window s": f"{window:g}",
                             **{f"{m} K": f"{off[m]:.2g}" for m in METHODS},
                             "windows": "/".join(str(costs[m][0].windows) for m in METHODS),
                             "solves": "/".join(str(costs[m][0].solves) for m in METHODS),
                             "midpoint CPU s": f"{least['midpoint']:.2f}",
                             **{f"{m}/midpoint CPU": f"{least[m] / least['midpoint']:.2f}" for m in METHODS[1:]}})
                print(rows[-1], file=sys.stderr, flush=True)
    print(table(rows))


if __name__ == "__main__":
    pin()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--scenes", nargs="+", default=["bars", "D2", "casting", "sliding", "can"])
    given = parser.parse_args()
    main(given.rounds, given.scenes)
