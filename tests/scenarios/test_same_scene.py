"""C9 on the whole scene: the sliding blocks moved, mirrored, turned, renumbered or told in inches are the same scene.

What a mesh is called, where it lies and in which units it is written must not show in a result: 1e-9 of the range of
temperatures, and the same facing points touching at the end of every window.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ruamel.yaml import YAML

import coupler.scenario.load as loading
from contact.half.interface import Interface
from coupler import Results, load_scenario, run

pytestmark = pytest.mark.usefixtures("unlooked")

ROOT = Path(__file__).resolve().parents[2]
RANGE, CLOSE = 1000.0, 1e-9
INCH, RANKINE = 1.0 / 0.0254, 1.8
TOUCH = 10000.0  # s
Tree = dict[str, Any]


def scene() -> Tree:
    """The sliding blocks on a coarse mesh with fewer windows, an elastic half that leaves nothing out of balance."""
    tree = YAML(typ="safe").load((ROOT / "scenarios/sliding_blocks.yaml").read_text(encoding="utf-8"))
    for body, cells in (("lower", [6, 5]), ("upper", [8, 4])):
        tree["bodies"][body]["mesh"]["rectangle"]["cells"] = cells
    tree["coupling"]["windows"] = [{"until": 2500, "size": 500}, {"until": 10000, "first": 1000, "last": 20},
                                   {"until": 12500, "size": 250}, {"until": 15000, "size": 40},
                                   {"until": 25000, "size": 2500}]
    tree["mechanical"]["elastic"]["tolerance"] = 1e-12
    return tree


def moved(tree: Tree) -> Tree:
    for body in tree["bodies"].values():
        box = body["mesh"]["rectangle"]
        box["origin"] = [box["origin"][0] + 0.3, box["origin"][1] - 0.2]
    return tree


def renamed(value: Any, names: dict[str, str]) -> Any:
    """Every text of the form body.side(.end) with its words exchanged."""
    if isinstance(value, dict):
        return {key: renamed(inner, names) for key, inner in value.items()}
    if isinstance(value, list):
        return [renamed(inner, names) for inner in value]
    if isinstance(value, str) and value.split(".")[0] in ("lower", "upper"):
        return ".".join(names.get(word, word) for word in value.split("."))
    return value


def negated(signal: Tree) -> Tree:
    return {"t": signal["t"], "value": [-v for v in signal["value"]]}


def mirrored(tree: Tree) -> Tree:
    for body in tree["bodies"].values():
        box = body["mesh"]["rectangle"]
        box["origin"] = [-box["origin"][0] - box["size"][0], box["origin"][1]]
    tree["signals"]["slide"] = negated(tree["signals"]["slide"])
    return renamed(tree, {"left": "right", "right": "left"})


def turned(tree: Tree) -> Tree:
    """By 90 degrees, (x, y) -> (-y, x)."""
    for body in tree["bodies"].values():
        box = body["mesh"]["rectangle"]
        (x, y), (w, h), (n, m) = box["origin"], box["size"], box["cells"]
        body["mesh"]["rectangle"] = {"origin": [-y - h, x], "size": [h, w], "cells": [m, n]}
    tree["signals"]["stroke"] = negated(tree["signals"]["stroke"])
    boundary = tree["mechanical"]["elastic"]["boundary"]
    for entry in boundary:
        for old, new in (("u_x", "_"), ("u_y", "u_x"), ("_", "u_y")):
            if old in entry:
                entry[new] = entry.pop(old)
    tree["probes"].pop("upper.bottom.u_y")
    return renamed(tree, {"bottom": "right", "right": "top", "top": "left", "left": "bottom"})


def in_inches(tree: Tree) -> Tree:
    """Lengths in inches and temperatures 1.8 times as large; kg and s stay, so every number follows its dimension."""
    def scaled(holder: Tree, powers: dict[str, tuple[float, float]]) -> None:
        for key, (length, temperature) in powers.items():
            if key in holder:
                holder[key] = holder[key] * INCH**length * RANKINE**temperature

    for material in tree["materials"].values():
        scaled(material, {"rho": (-3, 0), "c": (2, -1), "k": (1, -1), "E": (-1, 0)})
    for body in tree["bodies"].values():
        box = body["mesh"]["rectangle"]
        box["origin"], box["size"] = ([v * INCH for v in box[key]] for key in ("origin", "size"))
        body["T0"] *= RANKINE
    for name, power in (("stroke", 1), ("slide", 1), ("squeeze", -1)):
        tree["signals"][name]["value"] = [v * INCH**power for v in tree["signals"][name]["value"]]
    pair = tree["contact"]["interface"]
    scaled(pair, {"gap_max": (1, 0), "penalty": (-2, 0)})
    scaled(pair["conduction"]["closed"], {"h0": (0, -1), "h1": (0, -1), "p0": (-1, 0), "p_max": (-1, 0)})
    scaled(pair["conduction"]["open"], {"k_g": (1, -1), "g_m": (1, 0)})
    for entry in tree["thermal"]["boundary"]:
        scaled(entry, {"temperature": (0, 1)})
        if "convection" in entry:
            scaled(entry["convection"], {"h": (0, -1), "T": (0, 1)})
            scaled(entry["convection"]["gap"], {"d_cut": (1, 0), "d_full": (1, 0)})
    return tree


def renumbered(interface: Interface) -> Interface:
    """Nodes, cells and edges in another order; the first node of every edge and cell stays first."""
    random = np.random.default_rng(7)
    node = random.permutation(len(interface.nodes)).astype(np.int32)
    cell = random.permutation(len(interface.quads))
    nodes = np.empty_like(interface.nodes)
    nodes[node] = interface.nodes
    surfaces = {name: node[edges][random.permutation(len(edges))] for name, edges in interface.surfaces.items()}
    sets = {name: node[members] for name, members in interface.node_sets.items()}
    return replace(interface, nodes=nodes, quads=node[interface.quads][cell], quad_body=interface.quad_body[cell],
                   surfaces=surfaces, node_sets=sets)


def solve(folder: Path, tree: Tree, half: str) -> Results:
    path = folder / "scene.yaml"
    tree["mechanical"]["half"] = half
    path.write_text(json.dumps(tree), encoding="utf-8")
    return run(load_scenario(path), out=folder / "run.h5")


@pytest.fixture(scope="module")
def original(tmp_path_factory) -> Results:
    return solve(tmp_path_factory.mktemp("original"), scene(), "elastic")


def assert_same(one: Results, other: Results, scale: float = 1.0) -> None:
    np.testing.assert_allclose(other.t, one.t, rtol=1e-12)
    for name in (n for n in one.probe_names if n.endswith(("left", "centre", "right"))):
        T, copied = one.probe(name, unit="degC")[1], other.probe(name, unit="degC")[1] / scale
        assert np.abs(T - copied).max() <= CLOSE * RANGE, name
    # At the very instant of touch the gap is zero to round-off, and either answer is right.
    settled = np.abs(one.t[1:] - TOUCH) > 1e-6
    np.testing.assert_array_equal(one.windows.touching[settled], other.windows.touching[settled])


@pytest.mark.few("mirrored")
@pytest.mark.parametrize("change", [moved, mirrored, turned, in_inches], ids=lambda f: f.__name__)
def test_a_copy_of_the_scene_is_the_scene(original, change: Callable[[Tree], Tree], tmp_path):
    copied = solve(tmp_path, change(copy.deepcopy(scene())), "elastic")
    assert_same(original, copied, RANKINE if change is in_inches else 1.0)


@pytest.mark.slow
def test_a_rigid_scene_in_a_mirror(tmp_path):
    (tmp_path / "one").mkdir()
    assert_same(solve(tmp_path / "one", scene(), "rigid"), solve(tmp_path, mirrored(scene()), "rigid"))


def test_renumbered(original, monkeypatch, tmp_path):
    scene_of = loading.scene_of

    def other(*given: Any) -> Any:
        found = scene_of(*given)
        return replace(found, interface=renumbered(found.interface))

    monkeypatch.setattr(loading, "scene_of", other)
    assert_same(original, solve(tmp_path, scene(), "elastic"))
