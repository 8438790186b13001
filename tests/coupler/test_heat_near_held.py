"""`heat warms a body` asks bodies with a prescribed temperature too, away from it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupler import load_scenario
from coupler.verify.bench import Bench, settled
from coupler.verify.border import CheckVerdict
from coupler.verify.heat import warms
from coupler.verify.verdicts import border_of
from thermal_fmu.half import load

sys.path.insert(0, str(Path(__file__).parent))
from model_half import ModelHalf
from wrong_laws import Model, materials

CHECK = "heat warms a body"
SCENE = """
slideline: 2
title: One bar, held at both ends
units: {temperature: K}
geometry: plane
materials: {steel: {rho: 8000, c: 500, k: 30}}
bodies: {bar: {mesh: {rectangle: {origin: [0, 0], size: [0.1, 0.01], cells: [CELLS, 2]}}, material: steel, T0: 300}}
thermal: {boundary: [{on: bar.left, temperature: 500}, {on: bar.right, temperature: 300}]}
mechanical: {half: rigid, rigid: {}}
coupling: {scheme: staggered, end: 12, windows: [{until: 12, size: 1}]}
"""


def bench_of(folder: Path, cells: int, *changes: object) -> Bench:
    (folder / "s.yaml").write_text(SCENE.replace("CELLS", str(cells)))
    scenario = load_scenario(folder / "s.yaml")
    model: Model = scenario.models["thermal"]
    for change in changes:
        change(model)  # type: ignore[operator]
    half = load(scenario.interface, model)
    border = border_of(load_scenario(folder / "s.yaml"), "thermal")
    return settled(lambda: ModelHalf(half), 1.0, border)


@pytest.mark.parametrize("factor", [0.5, 1.05, 2.0])
def test_a_wrong_capacity_is_named_between_two_held_ends(factor: float, tmp_path: Path) -> None:
    finding = warms(bench_of(tmp_path, 8, materials(c=lambda c: factor * c)), CHECK)
    assert finding.verdict is CheckVerdict.FAIL
    assert "in body 'bar' warm it by" in finding.reason


def test_the_right_one_passes_and_where_no_cell_is_far_enough_nothing_is_said(tmp_path: Path) -> None:
    assert warms(bench_of(tmp_path, 8), CHECK).verdict is CheckVerdict.PASS
    near = warms(bench_of(tmp_path, 6), CHECK)
    assert near.verdict is CheckVerdict.NOT_APPLICABLE


def test_what_the_whole_body_holds_is_counted(tmp_path: Path) -> None:
    """One layer of cells is heated: half of it warms the nodes of its neighbours."""
    bench = bench_of(tmp_path, 7)
    assert bench.starts["E_M"].shape == (14,)
    assert np.isfinite(bench.starts["E_M"]).all()
    assert warms(bench, CHECK).verdict is CheckVerdict.PASS
