"""E2, Danilovskaya's problem: a half-space whose surface is warmed at once, with inertia, uncoupled.

Lengths in D/c, times in D/c^2, stresses in beta theta_0: unit data make all of them 1.  The strip is held across, so
its strain is uniaxial, and ends where no wave returns from within the time looked at.
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.special import erfc

from coupler import load_scenario, run
from coupler.record.vtkhdf import FieldReader

E2 = tomllib.loads((Path(__file__).resolve().parents[1] / "expected.toml").read_text(encoding="utf-8"))["E2"]
STRAIN = 1e-3  # beta theta_0 over the modulus: small, so that the linear answer holds to this share
TIMES = (0.5, 1.5, 2.5, 3.0)
# rho_inf = 0 damps what is as fast as a step: without it the front rings long after it has passed.
SCENE = f"""
slideline: 2
units: {{temperature: K}}
geometry: plane
materials: {{m: {{rho: 1, k: 1, c: 1, E: 1, nu: 0, alpha: {STRAIN}, T_ref: 300}}}}
bodies: {{bar: {{mesh: {{rectangle: {{origin: [0, 0], size: [8, 0.04], cells: [200, 1]}}}}, material: m, T0: 300}}}}
thermal: {{boundary: [{{on: bar.left, temperature: 301}}]}}
mechanical:
  half: elastic
  elastic:
    dynamics: {{rho_inf: 0}}
    boundary: [{{on: bar.top, u_y: 0}}, {{on: bar.bottom, u_y: 0}}, {{on: bar.right, u_x: 0}}]
coupling: {{end: 3, windows: [{{until: 3, size: 0.01}}]}}
output: {{fields: {{at: [{", ".join(map(str, TIMES))}]}}}}
"""


def exact(xi, tau):
    """Stress over beta theta_0: the inverse Laplace transform of (exp(-xi sqrt s) - exp(-xi s))/(1 - s)."""
    root = np.sqrt(tau)
    diffused = np.exp(-xi) * erfc(xi / (2 * root) - root) + np.exp(xi) * erfc(xi / (2 * root) + root)
    return np.where(tau > xi, np.exp(tau - xi), 0.0) - 0.5 * np.exp(tau) * diffused


@pytest.fixture(scope="module")
def stress(tmp_path_factory):
    """Time -> places of the cells' middles and stresses there."""
    folder = tmp_path_factory.mktemp("wave")
    (folder / "wave.yaml").write_text(SCENE, encoding="utf-8")
    results = run(load_scenario(folder / "wave.yaml"), out=folder / "run.h5")
    found = {}
    with FieldReader(results.field_files["mechanical"]) as fields:
        xi = fields.points(0)[fields.quads][:, :, 0].mean(axis=1)
        for frame, t in enumerate(fields.times):
            found[round(float(t), 9)] = xi, fields.cell_field("sigma", frame)[:, 0] / STRAIN
    return found


@pytest.mark.parametrize(("xi", "tau", "value"), E2["stress"])
def test_the_stress_of_the_page(stress, xi, tau, value):
    assert exact(xi, tau) == pytest.approx(value, abs=1e-8)
    assert np.interp(xi, *stress[tau]) == pytest.approx(value, rel=E2["tolerance"])


@pytest.mark.parametrize("tau", TIMES)
def test_the_stress_away_from_the_front(stress, tau):
    """Of all places: the front, a jump of height 1, is smeared over a dozen cells."""
    xi, found = stress[tau]
    far = (np.abs(xi - tau) > 0.5) & (xi < 6.0)
    assert np.abs(found - exact(xi, tau))[far].max() < E2["tolerance"] * np.abs(exact(xi, tau)).max()
