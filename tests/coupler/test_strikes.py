"""Something strikes a scene in which nothing happened: no window before it tells of its error."""

from __future__ import annotations

import numpy as np

from coupler import load_scenario, run

STRIP = """
slideline: 2
units: {temperature: K}
geometry: plane
materials: {st: {rho: 7800, c: 480, k: 1.0e-3, alpha: 0}}
bodies:
  strip:
    mesh: {rectangle: {origin: [0, 0], size: [0.05, 0.004], cells: [25, 1]}}
    material: st
    T0: 300
    Q_T: {terms: [{t: 1.0e8, x: {at: [0.08, 0.1, 0.12], value: [0, 1, 0]}}]}
thermal: {}
mechanical: {half: rigid, rigid: {motion: {strip: {u_x: {t: [0, 10], value: [0, 0.2]}}}}}
coupling: {end: 10}
"""
PASSED = 1e8 * 0.02 / 0.02 / (7800 * 480)  # K: a coil of 20 mm at its mean, at 20 mm/s


def test_a_strip_that_enters_a_coil_after_a_long_rest_is_heated_evenly(tmp_path):
    file = tmp_path / "strip.yaml"
    file.write_text(STRIP)
    result = run(load_scenario(file), tmp_path / "run.h5")
    T = result.field("thermal.T")[1]
    assert np.allclose(T[-1] - T[0], PASSED, rtol=0.02), (T[-1] - T[0]) / PASSED
