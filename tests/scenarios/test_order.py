"""Order of the coupling on the slide of the sliding blocks (case F1, rigid half): staggered 1, extrapolated 2."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from coupler import load_scenario, run

pytestmark = pytest.mark.usefixtures("unlooked")

ROOT = Path(__file__).resolve().parents[2]
F1 = tomllib.loads((ROOT / "tests/expected.toml").read_text(encoding="utf-8"))["F1"]
# The slide is eleven pieces of this length, so that windows of PIECE/k end at 14772.7 s and at 15000 s.  The order
# is seen in the first five.
PIECE = 15000.0 - (12500.0 + 2500.0 / 1.1)
TIMES = 12500.0 + PIECE * np.arange(1, 6)
APPROACH = [{"until": 2500, "first": 5, "last": 250}, {"until": 9900, "first": 250, "last": 20},
            {"until": 10000, "first": 20, "last": 1}, {"until": 12500, "first": 2, "last": 200}]


def probes(folder: Path, scheme: str, cells: int, k: int) -> np.ndarray:
    """Left and centre probe at the ends of the pieces : (2, 5) [K]."""
    scenario = load_scenario(ROOT / "scenarios/sliding_blocks.yaml", overrides={
        "mechanical.half": "rigid", "coupling.scheme": scheme, "coupling.end": float(TIMES[-1]),
        "coupling.windows": [*APPROACH, {"until": 15000, "size": PIECE / k}],
        "bodies.lower.mesh.rectangle.cells": [cells, cells], "bodies.upper.mesh.rectangle.cells": [cells, cells],
        "output.fields": {"every": 100_000}})
    results = run(scenario, out=folder / f"{scheme}_{k}.h5")
    return np.array([np.interp(TIMES, *results.probe(f"lower.top.{name}")) for name in ("left", "centre")])


def observed_order(folder: Path, scheme: str, cells: int, coarsest: int) -> tuple[float, float]:
    """Order from three runs, each with windows half as long, and the change the last halving made [K]."""
    coarse, middle, fine = (probes(folder, scheme, cells, coarsest * 2**i) for i in range(3))
    last = np.abs(fine - middle).max()
    return float(np.log2(np.abs(middle - coarse).max() / last)), float(last)


def check(folder: Path, cells: int, coarsest: int) -> None:
    order, change = observed_order(folder, "staggered", cells, coarsest // 2)
    assert order == pytest.approx(F1["order_staggered"]["expected"], abs=F1["order_staggered"]["tolerance"])
    assert change < 2.0
    order, change = observed_order(folder, "extrapolated", cells, coarsest)
    assert order >= F1["order_extrapolated_least"]
    assert change < 0.05


# Windows start at a twentieth of the time the edge takes to cross a cell: larger ones ring, and that has no order.
@pytest.mark.slow
def test_order_on_a_coarse_mesh(tmp_path):
    check(tmp_path, cells=8, coarsest=16)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_order_at_24_cells(tmp_path):
    check(tmp_path, cells=24, coarsest=48)
