"""The thermal half `ccx`, where CalculiX is installed."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from contact.half.program import Program
from contact.half.volume import VolumeMesh
from contact.rpc.link import open_link
from thermal_fmu import HeatTask, VolumeMaterial, calculix

sys.path.append(str(Path(__file__).parent.parent / "coupler"))
from foreign_scenes import first_inputs, scenes

from contact.half.functions import property_from

needs_ccx = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX is not installed (calculix-ccx)")


def test_no_ccx_is_one_error_with_its_remedy(tmp_path, monkeypatch):
    _, foreign = scenes(tmp_path, "thermal", monkeypatch)
    model = {**foreign.models["thermal"], "options": {"program": "no_such_ccx"}}
    with pytest.raises(ValueError, match=re.escape("no_such_ccx is not on the PATH. Install CalculiX (Debian")):
        calculix.load(foreign.interface, model)


@needs_ccx
def test_a_body_that_is_heated_holds_its_heat_where_it_has_grown_too():
    """Two triangles and a quad, 3 W for 2 s on 1 m2 of 5 J/m3K that has grown by a fifth: mass is of the reference."""
    X = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [2.0, 0.0], [2.0, 1.0]])
    mesh = VolumeMesh(X, np.array([[0, 1, 2, 3]], np.int32), np.array([[1, 4, 5], [1, 5, 2]], np.int32),
                      np.array([0], np.int32), np.array([1, 1], np.int32), ("a", "b"), False)
    k = property_from({"T": [200.0, 400.0], "value": [1e6, 2e6]})
    program = calculix.CalculixHeat(Program("ccx", Path(str(shutil.which("ccx")))))
    program.start(mesh, (VolumeMaterial(2.5, k, property_from(2.0)), VolumeMaterial(5.0, k, property_from(1.0))))
    heat = np.array([3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    answer = program.step(HeatTask(X * [1.2, 1.0], X, 2.0, np.full(6, 300.0), heat, np.empty(0, np.intp), np.empty(0)))
    np.testing.assert_allclose(answer.T, 300.0 + 6.0 / 10.0, rtol=0.0, atol=1e-4)


@needs_ccx
def test_bars_in_series_come_to_the_steady_flux(tmp_path, monkeypatch):
    """Two steps so long that all is steady: what the layers and the film let through, by hand."""
    still = {"thermal.method": "backward_euler", "bodies.lower.Q_T": 0.0,
             "thermal.boundary": [{"on": "lower.bottom", "temperature": 300},
                                  {"on": "upper.top", "convection": {"h": 200, "T": 350}}]}
    _, foreign = scenes(tmp_path, "thermal", monkeypatch, **still)
    half = calculix.load(foreign.interface, foreign.models["thermal"])
    link, inputs = open_link("direct"), first_inputs(half)
    given = {**inputs, "contact.t_N": np.full(np.shape(inputs["contact.t_N"]), -1.0e7)}
    state, _ = half.start(given, 0.0, link)
    for k in range(2):
        done = half.step(state, given, 1e8 * k, 1e8, link)
        state = done.state
    q = 50.0 / (0.01 / 30 + 1 / 5500 + 0.02 / 110 + 1 / 200)
    T, y, body = done.outputs["T"], foreign.interface.nodes[:, 1], foreign.interface.node_body
    assert T[(body == 0) & (y == 0.01)] == pytest.approx(np.full(5, 300 + q * 0.01 / 30), abs=1e-3)
    assert T[(body == 1) & (y == 0.03)] == pytest.approx(np.full(4, 350 - q / 200), abs=1e-3)
    assert done.outputs["heat.convection"] == pytest.approx(q * 0.02 * 1e8, rel=1e-4)
