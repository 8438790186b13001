"""What has frozen is said by the thermal half: at one temperature of melting, T alone could not tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from coupler import Results, load_scenario, run
from coupler.record.vtkhdf import FieldReader

SHRINKAGE = 0.01
# Soft and slow enough that a cell has the volume it likes: shrinkage alone says it.
SCENE = f"""
slideline: 2
units: {{temperature: K}}
geometry: plane
materials:
  m: {{rho: 2500, c: 1000, k: 200, E: 1.0e6, nu: 0.3, alpha: 0, latent: {{L: 3.0e5, T_m: 930}},
      liquid: {{eta: 1.0e2, bulk: 1.0e6, T_s: 930, T_l: 930, shrinkage: {SHRINKAGE}}}}}
bodies:
  b: {{mesh: {{rectangle: {{origin: [0, 0], size: [0.002, 0.02], cells: [1, 8]}}}}, material: m, T0: 932}}
thermal: {{half: thermal, method: sdirk2, boundary: [{{on: b.bottom, convection: {{h: 5000, T: 500}}}}]}}
mechanical: {{half: elastic, elastic: {{boundary: [{{on: b.bottom, u_y: 0}}, {{on: b.left, u_x: 0}}]}}}}
coupling: {{scheme: staggered, end: 4, windows: [{{until: 4, size: 0.25}}]}}
output: {{fields: {{every: 4}}}}
"""


def frozen(folder: Path) -> Results:
    file = folder / "column.yaml"
    file.write_text(SCENE, encoding="utf-8")
    return run(load_scenario(file), out=folder / "run.h5")


def test_the_column_shrinks_as_the_thermal_half_freezes_it(tmp_path: Path) -> None:
    found = frozen(tmp_path)
    with FieldReader(found.field_files["thermal"]) as fields:
        f_s = fields.point_field("f_s", -1 % len(fields.times))[fields.quads].mean(axis=1)
        T = fields.point_field("T", len(fields.times) - 1)
    with FieldReader(found.field_files["mechanical"]) as fields:
        x = fields.points(len(fields.times) - 1)[fields.quads]
    diagonals = x[:, 2] - x[:, 0], x[:, 3] - x[:, 1]
    area = 0.5 * np.abs(diagonals[0][:, 0] * diagonals[1][:, 1] - diagonals[0][:, 1] * diagonals[1][:, 0])
    # Somewhere it is half frozen, at a temperature that tells nothing.
    assert ((f_s > 0.1) & (f_s < 0.9)).any()
    assert np.abs(T - 930.0).min() <= 1e-6
    expected = ((1.0 + SHRINKAGE * (1.0 - f_s)) / (1.0 + SHRINKAGE)) ** 3  # drawn as poured
    # The solid resists being narrower than the liquid beside it: a tenth of the 3 %.
    assert np.abs(area / (0.002 * 0.0025) - expected).max() <= 0.1 * 3.0 * SHRINKAGE
