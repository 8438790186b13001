"""Least and largest values of fields: of every window, not of the frames that happen to be kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario
from coupler.report.page import extreme_rows
from coupler.running.run import Run

SCENARIOS = Path(__file__).parents[2] / "scenarios"
ELASTIC = SCENARIOS / "sliding_blocks.yaml"
COARSE = {"bodies.lower.mesh.rectangle.cells": [3, 3], "bodies.upper.mesh.rectangle.cells": [3, 3],
          "output.fields": {"every": 1}}


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """All frames kept, 10 windows gone back over and solved in others."""
    out = tmp_path_factory.mktemp("extremes") / "run.h5"
    with Run(load_scenario(ELASTIC, overrides=COARSE), out) as r:
        for _ in r.windows(until=300.0):
            pass
        there = r.keep()
        for _ in r.windows(until=700.0):
            pass
        r.rewind(there)
        r.change(substeps={"thermal": 2})
        for _ in r.windows(until=600.0):
            pass
    return Results(out)


def test_extremes_are_those_of_every_window(ran: Results) -> None:
    assert {"thermal.T", "thermal.q", "mechanical.u", "mechanical.sigma_v"} <= set(ran.extremes)
    for name, course in ran.extremes.items():
        t, values = ran.field(name)
        assert np.array_equal(t, ran.t)
        size = np.linalg.norm(values, axis=2) if values.ndim == 3 else values
        assert np.array_equal(course[:, 0], size.min(axis=1)), name
        assert np.array_equal(course[:, 1], size.max(axis=1)), name
    assert ran.extremes["thermal.q"][:, 1].max() > 0


def test_the_table_of_the_page_has_them_with_their_times(ran: Results) -> None:
    row = next(r for r in extreme_rows(ran) if r.field == "heat flux (size)")
    course = ran.extremes["thermal.q"]
    number, unit = row.largest.split()
    factor = {"W/m²": 1.0, "kW/m²": 1e3, "MW/m²": 1e6}[unit]
    assert float(number) * factor == pytest.approx(course[:, 1].max(), rel=1e-4)
    assert float(row.largest_at) == pytest.approx(ran.t[int(course[:, 1].argmax())], rel=1e-5)
    cold = next(r for r in extreme_rows(ran) if r.field == "temperature")
    # The lower block is coldest at the start: not at the end.
    assert (cold.least, cold.least_at) == ("0 °C", "0")


def test_extremes_do_not_depend_on_what_is_kept(ran: Results, tmp_path: Path) -> None:
    with Run(load_scenario(ELASTIC, overrides=COARSE | {"output.fields": {"most": 3}}), tmp_path / "run.h5") as r:
        for _ in r.windows(until=300.0):
            pass
    few = Results(tmp_path / "run.h5")
    assert 2 <= len(few.field("thermal.T")[0]) <= 5
    n = len(few.t)
    for name, course in few.extremes.items():
        assert np.array_equal(course, ran.extremes[name][:n]), name


def test_the_mesh_is_that_of_the_scenario(ran: Results) -> None:
    mesh, scene = ran.mesh(), load_scenario(ELASTIC, overrides=COARSE).interface
    assert np.array_equal(mesh.nodes, scene.nodes)
    assert mesh.bodies == scene.bodies
    assert np.array_equal(mesh.node_body, scene.node_body)
    assert len(mesh.outline()) == 24
