"""Heat between surfaces that slide past each other: the area that faces has kinks which no window before announces."""

from __future__ import annotations

import pytest

from coupler import load_scenario, run

SLIDES = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials: {{st: {{rho: 7800, c: 480, k: 45, alpha: 0}}}}
bodies:
  lo: {{mesh: {{rectangle: {{origin: [0, 0], size: [0.05, 0.01], cells: [10, 1]}}}}, material: st, T0: 900}}
  up: {{mesh: {{rectangle: {{origin: [0, 0.011], size: [0.05, 0.01], cells: [9, 1]}}}}, material: st, T0: 400}}
contact:
  f: {{slave: up.bottom, master: lo.top, gap_max: 0.002, {across}}}
thermal: {{boundary: [{{body: lo, temperature: 900}}, {{body: up, temperature: 400}}]}}
mechanical: {{half: rigid, rigid: {{motion: {{up: {{u_x: {{t: [0, 1], value: [-0.02, 0.08]}}}}}}}}}}
coupling: {{end: 1}}
probes: {{q: {{"heat.pair.f[1]": value}}}}
"""
RAYS = 5.670374419e-8 * (900.0**4 - 400.0**4) / (1 / 0.5 + 1 / 0.8 - 1)
AREA = 0.05 * 0.7 - 0.02**2 / 0.2 - 0.05**2 / 0.2  # m s: from 30 mm over 50 mm at 0.2 s to nothing at 0.7 s


@pytest.mark.parametrize(("across", "q"), [
    ("radiation: {emissivity_slave: 0.5, emissivity_master: 0.8}", RAYS),
    ("conduction: {closed: {law: constant, h: 30}, open: {law: constant, h: 30}}", 30.0 * 500.0)])
def test_their_heat_is_as_exact_as_its_tolerance(tmp_path, across, q):
    file = tmp_path / "slides.yaml"
    file.write_text(SLIDES.format(across=across))
    heat = run(load_scenario(file), tmp_path / "run.h5").probe("q")[1]
    assert heat[-1] == pytest.approx(q * AREA, rel=0.005)
