"""Two blocks, one hot: heat decides where they touch, and where they touch decides where the heat goes.

The bottom of the lower block is 600 K at its left end and 380 K at its right; it swells towards a cold block above a
gap of 90 (times the scale) micrometres and meets it on its left half only. Where it does, pressure lets the heat out;
where it does not, a film of gas does. The answer is compared with one that solves both fields at once (monolithic.py).
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from contact_rods import Tree, solve
from monolithic import Held, Line, Matter, Monolithic

from coupler import Results, load_scenario

pytestmark = pytest.mark.usefixtures("unlooked")

# Expansion, gaps and compliance are all so many times smaller than in a real pair: the reference knows small strains.
SCALE = 1e-3
GAP, SIZE, COLD = 90e-6 * SCALE, 0.02, 300.0  # m, m, K
HOT = (600.0, 380.0)  # K, left and right
MATTER = Matter(k=10.0, rho_c=1e6, E=2e9 / SCALE, nu=0.3, alpha=2e-5 * SCALE, T_ref=COLD)
PENALTY = 1e13 / SCALE  # Pa/m, some twenty times E/h
H_0, P_0, G_M = 2000.0, 1e6, 25e-6 * SCALE
LEFT, MIDDLE, RIGHT = "cold.bottom.left", "cold.bottom.centre", "cold.bottom.right"
PROBES = (LEFT, MIDDLE, RIGHT, "hot.top.left", "hot.top.centre", "hot.top.right")


def blocks(scheme: str, windows: list[Tree]) -> Tree:
    m = MATTER
    body = {"material": "m", "T0": COLD}
    box = {"size": [SIZE, SIZE], "cells": [6, 4], "triangles": True}
    return {
        "slideline": 2, "title": "Two blocks", "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"m": {"rho": 1000, "c": m.rho_c / 1000, "k": m.k, "E": m.E, "nu": m.nu, "alpha": m.alpha,
                            "T_ref": m.T_ref}},
        "bodies": {"hot": {"mesh": {"rectangle": {"origin": [0, 0], **box}}, **body},
                   "cold": {"mesh": {"rectangle": {"origin": [0, SIZE + GAP], **box}}, **body}},
        "contact": {"line": {"slave": "cold.bottom", "master": "hot.top", "gap_max": 0.01, "penalty": PENALTY,
                             "augmented": None,  # the one system has the penalty alone
                             "conduction": {
                                 "closed": {"law": "power", "h0": H_0, "h1": H_0, "p0": P_0, "exponent": 1.0},
                                 "open": {"law": "gas", "k_g": H_0 * G_M, "g_m": G_M}}}},
        "thermal": {"half": "thermal", "method": "backward_euler", "boundary": [
            {"on": "hot.bottom", "temperature": {"terms": [{"x": {"at": [0, SIZE], "value": list(HOT)}}]}},
            {"on": "cold.top", "temperature": COLD}]},
        "mechanical": {"half": "elastic", "elastic": {"boundary": [
            {"on": "hot.bottom", "u_y": 0}, {"at": "hot.bottom.left", "u_x": 0}, {"on": "cold.top", "u_y": 0},
            {"at": "cold.top.left", "u_x": 0}]}},
        "coupling": {"scheme": scheme, "end": windows[-1]["until"], "windows": windows},
        "probes": {**{name: {"T": name} for name in PROBES}, "p": {"p": {"max": "cold.bottom"}},
                   "gap": {"gap": {"max": "cold.bottom"}}},
    }


def both_at_once(folder: Path) -> tuple[Monolithic, dict[str, int]]:
    """The same scene, mesh and all, as one system; and the nodes of the probes."""
    interface = load_scenario(folder / "scene.yaml").interface
    X, of = interface.nodes, {name: np.unique(edges) for name, edges in interface.surfaces.items()}
    sets = interface.node_sets
    held = Held(np.concatenate([of["hot.bottom"], of["cold.top"]]),
                np.concatenate([np.interp(X[of["hot.bottom"], 0], [0.0, SIZE], HOT),
                                np.full(of["cold.top"].size, COLD)]),
                np.concatenate([2 * of["hot.bottom"] + 1, 2 * of["cold.top"] + 1, 2 * sets["hot.bottom.left"],
                                2 * sets["cold.top.left"]]))
    line = Line(of["cold.bottom"], of["hot.top"], PENALTY, lambda p: H_0 * (1.0 + p / P_0),
                lambda g: H_0 * G_M / (g + G_M))
    return Monolithic(interface, MATTER, line, held), {name: int(sets[name][0]) for name in PROBES}


def start(system: Monolithic) -> np.ndarray:
    return np.concatenate([np.full(system.n, COLD), np.zeros(2 * system.n)])


KEPT: dict[tuple[float, int], tuple[dict[str, int], np.ndarray]] = {}


def monolithic(folder: Path, dt: float, steps: int) -> tuple[dict[str, int], np.ndarray]:
    """The nodes of the probes, and the one system's answer after each of so many steps; made once for all schemes."""
    if (dt, steps) not in KEPT:
        system, node = both_at_once(folder)
        z = [start(system)]
        for _ in range(steps):
            z.append(system.step(z[-1], dt))
        KEPT[dt, steps] = node, np.array(z)
    return KEPT[dt, steps]


def worst(results: Results, folder: Path, dt: float) -> float:
    """Largest difference [K] of a probe from the monolithic answer with steps of the same size."""
    node, T = monolithic(folder, dt, len(results.t) - 1)
    return max(float(np.abs(results.probe(name)[1] - T[:, node[name]]).max()) for name in PROBES)


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "cap"), [("staggered", 1.7), ("extrapolated", 1.4)])
def test_what_staggering_costs_falls_with_the_window(scheme: str, cap: float, tmp_path: Path) -> None:
    """Both take backward Euler, so only the exchange differs.  A node touches in one window or the next, and with it
    the heat of its edges jumps: 3.7, 2.6, 1.6 and 1.0 K in windows of 4, 2, 1 and 0.5 s, extrapolated 2.1 to 0.9.
    """
    found = []
    for dt in (4.0, 1.0):
        folder = tmp_path / f"{dt}"
        found.append(worst(solve(folder, blocks(scheme, [{"until": 60, "size": dt}])), folder, dt))
    assert found[1] < cap
    assert 1.5 < found[0] / found[1] < 4.5


def test_iterated_windows_that_see_the_end_are_the_one_system(tmp_path: Path) -> None:
    """Backward Euler on both fields at once is what they iterate to: only the size of the strain is left."""
    scene = blocks("iterated", [{"until": 60, "size": 2}])
    scene["coupling"]["iteration"] = {"level": "end"}
    found = solve(tmp_path, scene)
    assert worst(found, tmp_path, 2.0) < 2e-3
    assert found.probe("p")[1][-1] > P_0


@pytest.mark.slow
def test_the_steady_state_is_that_of_both_fields_at_once(tmp_path: Path) -> None:
    """Where all is steady no scheme is left in the answer: both agree to the size of the strain."""
    windows = [{"until": 60, "size": 4}, {"until": 600, "first": 4, "last": 60}]
    results = solve(tmp_path, blocks("staggered", windows))
    system, node = both_at_once(tmp_path)
    z = start(system)
    for dt in [4.0] * 15 + [60.0] * 5 + [np.inf]:
        z = system.step(z, dt)
    for name in PROBES:
        assert results.probe(name)[1][-1] == pytest.approx(z[node[name]], abs=2e-3)
    at = system.line
    gap = system.X[at.slave, 1] - system.X[at.master, 1] + z[system.at[2]] - z[system.at[3]]
    assert results.probe("gap")[1][-1] == pytest.approx(gap.max(), rel=1e-4)
    assert 0 < (gap < 0.0).sum() < gap.size, "they touch on a part of their sides only"
    assert results.probe(LEFT)[1][-1] - results.probe(RIGHT)[1][-1] > 10.0
    assert results.probe("p")[1][-1] > P_0, "pressure more than doubles the conductance"
