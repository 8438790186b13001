"""A block upset far beyond yield warms by its plastic work: through both halves, on a mesh that moves.  B11, A16."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from coupler import Results, load_scenario, run
from coupler.record.vtkhdf import FieldReader

pytestmark = pytest.mark.usefixtures("unlooked")

EXPECTED = tomllib.loads((Path(__file__).parent.parent / "expected.toml").read_text(encoding="utf-8"))
E, NU, S_Y, CHI, RHO, C = 210e9, 0.3, 250e6, 0.85, 7000.0, 450.0
UPSET = 0.4  # logarithmic
SCENE = f"""
slideline: 2
units: {{temperature: K}}
geometry: GEOMETRY
signals:
  stroke: {{t: [0, 1], value: [0, {0.02 * np.expm1(-UPSET)}]}}
materials:
  m: {{rho: {RHO}, c: {C}, k: 30, E: {E}, nu: {NU}, alpha: 0, plastic: {{s_y: {S_Y}, chi: {CHI}}}}}
bodies:
  b: {{mesh: {{rectangle: {{origin: [0, 0], size: [0.01, 0.02], cells: [2, 3]}}}}, material: m, T0: 300}}
thermal: {{half: thermal}}
mechanical:
  half: elastic
  elastic:
    boundary: [{{on: b.bottom, u_y: 0}}, {{on: b.top, u_y: stroke}}, {{on: b.left, u_x: 0}}]
coupling: {{scheme: SCHEME, end: 1.1, windows: [{{until: 1.1, size: 0.05}}]}}
probes:
  T: {{T: {{at: [0.005, 0.01], body: b}}}}
"""


def upset(folder: Path, geometry: str, scheme: str) -> Results:
    file = folder / "upset.yaml"
    file.write_text(SCENE.replace("GEOMETRY", geometry).replace("SCHEME", scheme), encoding="utf-8")
    return run(load_scenario(file), out=folder / "run.h5")


@pytest.mark.parametrize(("geometry", "scheme"), [("axisymmetric", "staggered"), ("plane", "extrapolated")])
def test_all_plastic_work_arrives_as_heat(tmp_path: Path, geometry: str, scheme: str) -> None:
    found = upset(tmp_path, geometry, scheme)
    # Plane strain: e = 2/sqrt(3) times the upsetting.  Less the elastic strain, deviatoric: s_y/(3 G).
    e_p = UPSET * (1.0 if geometry == "axisymmetric" else 2.0 / np.sqrt(3.0)) - S_Y * 2.0 * (1.0 + NU) / (3.0 * E)
    rise = CHI * S_Y * e_p / (RHO * C)
    # Plane strain first yields a little off the direction it flows in later: 1e-3 of e_p.
    assert found.probe("T")[1][-1] - 300.0 == pytest.approx(rise, rel=2e-3)
    account, ledger = found.totals["mechanical_heat"], found.ledger
    # Nothing is made in the last windows, so nothing is carried.
    assert account["carried"] == pytest.approx(0.0, abs=1e-12 * account["made"])
    assert ledger["mechanical"] == pytest.approx(account["made"], rel=1e-12)
    assert ledger["stored.b"] == pytest.approx(account["made"], rel=1e-10)
    assert found.heat_imbalance <= EXPECTED["A16"]["tolerance"]
    with FieldReader(found.field_files["mechanical"]) as fields:
        sigma = fields.cell_field("sigma", len(fields.times) - 1)
    # XX, YY, ZZ, XY, YZ, XZ; plane strain holds the thickness by half of the pressure.
    flow = np.array([0, -1, 0, 0, 0, 0] if geometry == "axisymmetric" else [0, -2, -1, 0, 0, 0])
    flow = flow / (1.0 if geometry == "axisymmetric" else np.sqrt(3.0))
    assert np.abs(sigma / S_Y - flow).max() <= 5e-3
    volume = 0.02 * (np.pi * 0.01**2 if geometry == "axisymmetric" else 0.01)
    assert account["made"] == pytest.approx(RHO * C * volume * rise, rel=2e-3)
