"""The same run embedded, through bytes, and in three processes over zenoh: the same bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario, run

pytestmark = pytest.mark.usefixtures("unlooked")

ROOT = Path(__file__).resolve().parents[2]
SMALL = {"bodies.lower.mesh.rectangle.cells": [6, 6], "bodies.upper.mesh.rectangle.cells": [7, 7], "coupling.windows": [
    {"until": 2500, "size": 500}, {"until": 10000, "first": 1000, "last": 20}, {"until": 12500, "size": 500},
    {"until": 15000, "size": 125}, {"until": 25000, "size": 2500}]}


def solve(folder: Path, name: str, **how: object) -> Results:
    processes = bool(how.pop("processes", False))
    return run(load_scenario(ROOT / "scenarios/sliding_blocks.yaml", overrides={**SMALL, **how}),
               out=folder / f"{name}.h5", processes=processes)


def assert_same_bits(a: Results, b: Results) -> None:
    assert a.outcome == b.outcome == "completed"
    np.testing.assert_array_equal(a.t, b.t)
    for name in a.probe_names:
        np.testing.assert_array_equal(a.probe(name)[1], b.probe(name)[1], err_msg=name)
    assert a.ledger == b.ledger
    for column in ("verdict", "solves", "thermal_iterations", "mechanical_iterations", "touching", "max_T", "max_p"):
        np.testing.assert_array_equal(a.windows[column], b.windows[column], err_msg=column)


@pytest.mark.few("rigid")
@pytest.mark.parametrize("mechanical", ["elastic", "rigid"])
def test_embedded_codec_and_processes_give_the_same_bits(tmp_path, mechanical):
    embedded = solve(tmp_path, "embedded", **{"mechanical.half": mechanical})
    assert embedded.windows.touching.max() > 5
    assert_same_bits(embedded, solve(tmp_path, "codec", **{"mechanical.half": mechanical, "coupling.link": "codec"}))
    assert_same_bits(embedded, solve(tmp_path, "hosted", **{"mechanical.half": mechanical}, processes=True))


@pytest.mark.slow
def test_a_run_repeats_to_the_bit(tmp_path):
    assert_same_bits(solve(tmp_path, "first"), solve(tmp_path, "second"))
