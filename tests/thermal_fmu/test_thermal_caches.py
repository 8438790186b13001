"""What is kept from step to step: the same bits with it and without it, and nothing kept that changed."""

from __future__ import annotations

import copy
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from test_thermal_space import distorted, fixed_to
from thermal_scenes import EXPECTED, Box, FlatContact, inputs_of, run, scene, spec

from contact.half.interface import Pair
from contact.half.model import Done
from thermal_fmu import cells
from thermal_fmu.half import load


def blocks(**more):
    mesh = scene(Box(0, 1, 0, 1, 5, 5), Box(0, 1, 1, 2, 5, 4, triangles=True),
                 pairs=(Pair("p", "b.bottom", "a.top", 0.5, 0.0),))
    model = spec([{"on": "a.bottom", "temperature": 300.0}], rho=10.0,
                 pairs={"p": {"conduction": {"closed": None, "open": {"law": "gas", "k_g": 1.0, "g_m": 0.1}}}}, **more)
    model["bodies"] = {"a": {"material": "m", "T0": 300.0}, "b": {"material": "m", "T0": 600.0}}
    return mesh, model


SKEW = {"k_1": 4.0, "k_2": 1.0, "angle": 0.4, "turns": True}


@pytest.mark.parametrize("k", [2.0, {"polynomial": [2.0, 1e-3]}, SKEW], ids=["constant", "of T", "skewed"])
def test_hot_and_cold_give_the_same_bits_while_one_body_moves(k):
    """At rest, one body moved, steps of two lengths, back again: a half that has kept nothing does the same."""
    mesh, model = blocks(k=k)
    hot, link = load(mesh, model), FlatContact()
    given = inputs_of(mesh, hot)
    state, _ = hot.start(given, 0.0, link)
    t = 0.0
    for up, dt in ((0.0, 0.1), (0.0, 0.1), (0.05, 0.1), (0.05, 0.2), (0.0, 0.2), (0.0, 0.1)):
        x = mesh.nodes * np.array([1.0 + up, 1.0])
        x[mesh.node_body == 1, 1] += up
        x[mesh.node_body == 0] = mesh.nodes[mesh.node_body == 0]
        cold, before = load(mesh, model), copy.deepcopy(state)
        done = hot.step(state, given | {"x": x}, t, dt, link)
        again = cold.step(before, given | {"x": x}, t, dt, FlatContact())
        assert isinstance(done, Done), done
        assert isinstance(again, Done), again
        for name, value in done.outputs.items():
            assert np.array_equal(value, again.outputs[name]), name
        state, t = done.state, t + dt


def test_a_scene_at_rest_works_its_cells_out_once(monkeypatch):
    """Shapes once a block; matrices once a block and slope (damped quarter steps, then whole ones)."""
    mesh, model = blocks(k=2.0)
    made = {"shapes": 0, "matrices": 0}
    for name, function in (("shapes", "with_turn"), ("matrices", "_entries")):
        original = getattr(cells, function)

        def counted(*arguments, name=name, original=original):
            made[name] += 1
            return original(*arguments)

        monkeypatch.setattr(cells, function, counted)
    ran = run(mesh, model, 0.1, 6)
    assert made == {"shapes": 2, "matrices": 4}
    moved = mesh.nodes + np.where(mesh.node_body[:, None] == 1, [0.0, 0.01], 0.0)
    half = load(mesh, model)
    for x in (mesh.nodes, mesh.nodes, moved, moved):
        half.step(ran.state, inputs_of(mesh, half, x=x), 0.6, 0.1, FlatContact())
    assert made == {"shapes": 2 + 3, "matrices": 4 + 3}


def test_a_body_of_quads_and_triangles():
    """The patch of A13, storage too: where two blocks share nodes neither is kept apart."""
    mesh = scene(Box(0.5, 1.5, 0, 1, 4, 4), move=distorted)
    cut, whole = mesh.quads[::2], mesh.quads[1::2]
    triangles = np.concatenate([cut[:, [0, 1, 2]], cut[:, [0, 2, 3]]])
    mixed = replace(mesh, quads=whole, triangles=triangles, quad_body=np.zeros(len(whole), np.int32),
                    triangle_body=np.zeros(len(triangles), np.int32))
    exact = 300.0 + mixed.nodes @ np.array([30.0, -17.0])
    for method, dt in (("steady", 1.0), ("backward_euler", 1e6)):
        ran = run(mixed, spec(fixed_to(mixed, exact), k=12.0, method=method, T0=300.0), dt, 2)
        assert np.abs(ran.T[-1] - exact).max() < EXPECTED["A13"]["tolerance"] * (1 if method == "steady" else 100)
