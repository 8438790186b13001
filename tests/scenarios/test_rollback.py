"""Rollback of the real FMUs while the blocks slide in contact: the same bits again, whatever the caches hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupler import Run, load_scenario
from coupler.fmu.fmi import FmuHalf
from coupler.fmu.launch import launch

ROOT = Path(__file__).resolve().parents[2]
SMALL = {"bodies.lower.mesh.rectangle.cells": [6, 6], "bodies.upper.mesh.rectangle.cells": [7, 7],
         "coupling.end": 13000, "coupling.windows": [
             {"until": 2500, "size": 500}, {"until": 10000, "first": 1000, "last": 20}, {"until": 12500, "size": 250},
             {"until": 13000, "size": 40}]}
H = 30.0


def steps(half: FmuHalf, inputs: dict[str, np.ndarray], outputs: tuple[str, ...]) -> list[dict[str, np.ndarray]]:
    """Outputs of three steps on from 13000 s."""
    return [half.advance(13000.0 + i * H, H, inputs if i == 0 else {}, outputs).outputs for i in range(3)]


def assert_same(a: list[dict[str, np.ndarray]], b: list[dict[str, np.ndarray]]) -> None:
    for one, other in zip(a, b, strict=True):
        assert one.keys() == other.keys()
        for name in one:
            np.testing.assert_array_equal(one[name], other[name], err_msg=name)


@pytest.mark.few("elastic")
@pytest.mark.parametrize("mechanical", ["elastic", "rigid"])
def test_step_restore_step_in_contact(tmp_path, mechanical):
    scenario = load_scenario(ROOT / "scenarios/sliding_blocks.yaml", overrides={**SMALL, "mechanical.half": mechanical})
    with Run(scenario, tmp_path / "run.h5") as run, launch(scenario, processes=False) as fresh:
        for _ in run.windows():
            pass
        assert run.state.now.t_N.min() < -1e6
        now = run.state.now
        for half, cold, inputs, outputs in (
                (run.halves.thermal, fresh.thermal, {"x": now.x + np.array([1e-5, 0.0])}, run.halves.thermal_outputs),
                (run.halves.mechanical, fresh.mechanical, {"T": now.T + 1.0}, run.halves.mechanical_outputs)):
            inputs = {name: value for name, value in inputs.items() if name in half.blocks}
            token = half.save()
            kept = half.serialise(token)
            first = steps(half, inputs, outputs)
            assert not np.array_equal(first[0][outputs[0]], first[2][outputs[0]])
            half.restore(token)
            assert_same(first, steps(half, inputs, outputs))  # caches as the steps left them
            start = {"x": scenario.interface.nodes} if half is run.halves.thermal else {
                "T": np.full(len(now.T), 300.0)} if "T" in half.blocks else {}
            cold.initialise(0.0, 13000.0, {"contact.link": "direct"}, start, ())
            cold.restore(cold.deserialise(kept))
            assert_same(first, steps(cold, inputs, outputs))  # caches that have seen nothing of it
