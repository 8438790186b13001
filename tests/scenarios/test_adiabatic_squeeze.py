"""A block squeezed between walls by the scheme adiabatic: it warms at once, is stiffer for it, and stays as it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupler import Results, ScenarioError, load_scenario, run

pytestmark = pytest.mark.usefixtures("unlooked")

E, NU, ALPHA, RHO, C, T_0 = 2e11, 0.3, 1e-4, 7800.0, 460.0, 300.0
M, BETA = E * (1 - NU) / ((1 + NU) * (1 - 2 * NU)), E / (1 - 2 * NU) * ALPHA
DELTA = BETA**2 * T_0 / (RHO * C * M)  # .77
P, SIDE = 1e6, 0.01
SCENE = f"""
slideline: 2
units: {{temperature: K}}
geometry: plane
signals:
  press: {{t: [0, 1], value: [0, {P}]}}
materials:
  m: {{rho: {RHO}, c: {C}, k: 30, E: {E}, nu: {NU}, alpha: {ALPHA}, T_ref: {T_0}}}
bodies:
  b: {{mesh: {{rectangle: {{origin: [0, 0], size: [{SIDE}, {SIDE}], cells: [2, 2]}}}}, material: m, T0: {T_0}}}
thermal: {{half: thermal}}
mechanical:
  half: elastic
  elastic:
    boundary:
      [{{on: b.bottom, u_y: 0}}, {{on: b.left, u_x: 0}}, {{on: b.right, u_x: 0}}, {{on: b.top, pressure: press}}]
    adiabatic: true
coupling: {{scheme: adiabatic, end: 4, windows: [{{until: 4, size: 1}}]}}
probes:
  T: {{T: {{at: [0.004, 0.004], body: b}}}}
  u: {{u_y: {{mean: b.top}}}}
"""


def squeezed(folder: Path, **overrides: object) -> Results:
    file = folder / "squeezed.yaml"
    file.write_text(SCENE, encoding="utf-8")
    return run(load_scenario(file, overrides=overrides), out=folder / "run.h5")


def test_it_warms_at_once_and_is_stiffer_by_one_plus_delta(tmp_path: Path) -> None:
    """strain = p/(M (1 + delta)); rise = beta T strain/(rho c).  No heat leaves, so both stay."""
    found = squeezed(tmp_path)
    strain = P / (M * (1 + DELTA))
    u, T = found.probe("u")[1], found.probe("T")[1]
    assert DELTA > 0.5
    # Small strains: 1e-5 of them is left out by the closed form.
    assert u[1:] == pytest.approx(-SIDE * strain, rel=1e-4)
    assert T[1:] - T_0 == pytest.approx(BETA * T_0 * strain / (RHO * C), rel=1e-4)
    moved = found.totals["entropy_part"]
    assert (moved["carried"], moved["delivered"]) == (0.0, pytest.approx(moved["made"]))
    assert found.ledger["entropy"] == pytest.approx(found.ledger["stored.b"], rel=1e-10)


def test_a_half_that_cannot_is_told_before_anything_is_built(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"scheme: the scheme adiabatic needs .*elastic: \{adiabatic: true\}"):
        squeezed(tmp_path, **{"mechanical.elastic.adiabatic": False})
