"""Slip that turns round within a window is an event, and what comes to rest stays at rest: a block put on a belt."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupler import load_scenario, run

MU, G, SIDE, HEIGHT, RHO, SPEED = 0.3, 9.81, 0.1, 0.05, 1000.0, 1.0

BELT = f"""
slideline: 2
units: {{temperature: K}}
geometry: plane
materials: {{m: {{rho: {RHO}, k: 45, c: 480, E: 2e11, nu: 0.3, alpha: 0}}}}
bodies:
  belt: {{mesh: {{rectangle: {{origin: [-0.5, -0.05], size: [2, 0.05], cells: [40, 2]}}}}, material: m, T0: 300}}
  b: {{mesh: {{rectangle: {{origin: [0, 0], size: [{SIDE}, {HEIGHT}], cells: [4, 2]}}}}, material: m, T0: 300}}
thermal: {{}}
mechanical:
  half: elastic
  elastic:
    dynamics: DYNAMICS
    boundary: [{{body: belt, u_x: {{t: [0, 10], value: [0, 10]}}, u_y: 0, angle: 0}}]
    gravity: {{y: {-G}}}
    bodies: {{belt: {{rigid: true}}, b: {{rigid: true}}}}
coupling: {{end: 0.6}}
contact: {{p: {{slave: SLAVE, master: MASTER, gap_max: 0.01, friction: {{mu: {MU}}}}}}}
probes: {{x: {{u_x: {{mean: b}}}}, q1: {{"heat.pair.p[1]": value}}, q2: {{"heat.pair.p[2]": value}}}}
"""


@pytest.mark.parametrize(("dynamics", "sides"), [("{}", ("b.bottom", "belt.top")), ("{}", ("belt.top", "b.bottom")),
                                                 ("{rho_inf: 0.8}", ("b.bottom", "belt.top"))])
def test_a_block_on_a_belt_slips_until_it_goes_along(tmp_path: Path, dynamics: str, sides: tuple[str, str]) -> None:
    """It took 113 windows and exit 4: from slip on it swung about the speed of the belt, to the end."""
    file = tmp_path / "belt.yaml"
    file.write_text(BELT.replace("DYNAMICS", dynamics).replace("SLAVE", sides[0]).replace("MASTER", sides[1]))
    results = run(load_scenario(file), tmp_path / "r.h5")
    assert not results.broken
    assert len(results.windows) < 30
    t, x = (np.asarray(values) for values in results.probe("x"))
    meets = SPEED / (MU * G)
    exact = np.where(t < meets, 0.5 * MU * G * t**2, 0.5 * SPEED * meets + SPEED * (t - meets))
    assert np.abs(x - exact).max() < 1e-4
    assert np.abs(t - meets).min() < 1e-4
    made = sum(float(results.probe(q)[1][-1]) for q in ("q1", "q2"))
    assert made == pytest.approx(0.5 * RHO * SIDE * HEIGHT * SPEED**2, rel=3e-3)
