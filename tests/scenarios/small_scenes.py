"""Scenarios of rods and lumped bodies as texts, and where installed halves are looked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from coupler import Results, load_scenario, run

ROOT = Path(__file__).resolve().parents[2]


def solve(folder: Path, text: str, **overrides: object) -> Results:
    """The run of a scenario given as text."""
    path = folder / "scenario.yaml"
    path.write_text(text, encoding="utf-8")
    return run(load_scenario(path, overrides=overrides), out=folder / "run.h5")


def at(results: Results, probe: str, times: list[float]) -> np.ndarray:
    """Values of a probe at window ends nearest to these times."""
    t, value = results.probe(probe)
    return np.array([value[np.argmin(np.abs(t - time))] for time in times])


# E4: C 82500 = 2750 * 1000 * .03, G 5000 as a film on the left end, a wall of 400 K that the shrinking body leaves.
# The body's temperature falls below 850 K, where its length is just that of the room it has.
LUMPED_GAP = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials:
  metal: {{rho: 2750, c: 1000, k: 200, alpha: 7.5e-5, T_ref: 850, E: 7.0e10}}
  wall: {{rho: 2750, c: 1000, k: 200, alpha: 0}}
bodies:
  body: {{mesh: {{rectangle: {{origin: [0, 0], size: [0.03, 0.02], cells: [1, 1]}}}}, material: metal, T0: {T0}}}
  wall: {{mesh: {{rectangle: {{origin: [0.03, 0], size: [0.01, 0.02], cells: [1, 1]}}}}, material: wall, T0: 400}}
contact:
  gap:
    slave: body.right
    master: wall.left
    gap_max: 0.01
    conduction: {{closed: {{law: constant, h: 6000}}, open: {{law: gas, k_g: 0.06, g_m: 10.0e-6}}}}
thermal:
  half: lumped
  method: {method}
  boundary:
    - {{on: body.left, convection: {{h: 5000, T: 933}}}}
    - {{on: wall.right, temperature: 400}}
mechanical:
  half: rod
  rod: {{held: {{body: {{left: 0}}, wall: {{left: 0, right: 0}}}}}}
coupling:
  scheme: {scheme}
  end: {end}
  windows: [{{until: {end}, size: {size}}}]
probes:
  T: {{T: body.right.centre}}
  gap: {{gap: {{mean: body.right}}}}
"""

# D9: the clearance closes as the rod warms, and with it the heat crosses that cools it.
CLEARANCE = """
slideline: 2
units: {units: K}
geometry: plane
materials:
  metal: {rho: 1000, c: 1000, k: 10, alpha: 2.0e-5, T_ref: 300, E: 7.0e10}
  wall: {rho: 1000, c: 1000, k: 10, alpha: 0}
bodies:
  rod: {mesh: {rectangle: {origin: [0, 0], size: [0.1, 0.01], cells: [10, 1]}}, material: metal, T0: 300}
  wall: {mesh: {rectangle: {origin: [0.101, 0], size: [0.01, 0.01], cells: [1, 1]}}, material: wall, T0: 300}
contact:
  gap:
    slave: rod.right
    master: wall.left
    gap_max: 0.01
    conduction: {closed: {law: constant, h: 500}, open: {law: table, x: [0, 1.0e-3], h: [500, 0]}}
thermal:
  half: rod
  method: backward_euler
  boundary:
    - {on: rod.left, temperature: 600}
    - {on: wall.top, temperature: 300}
mechanical:
  half: rod
  rod: {held: {rod: {left: 0}, wall: {left: 0, right: 0}}}
coupling:
  scheme: staggered
  end: 2.0e5
  windows: [{until: 1000, size: 50}, {until: 2.0e5, size: 5000}]
probes:
  T: {T: rod.right.centre}
  gap: {gap: {mean: rod.right}}
""".replace("{units: K}", "{temperature: K}")

# D13: a rod grows into contact with a wall and presses against it; the more it presses the better it is cooled.
CLOSING = """
slideline: 2
units: {temperature: K}
geometry: plane
materials:
  metal: {rho: 7850, c: 460, k: 45, alpha: 1.2e-5, T_ref: 300, E: 2.0e9}
  wall: {rho: 7850, c: 460, k: 45, alpha: 0}
bodies:
  rod: {mesh: {rectangle: {origin: [0, 0], size: [0.1, 0.01], cells: [40, 1]}}, material: metal, T0: 300}
  wall: {mesh: {rectangle: {origin: [0.10006, 0], size: [0.01, 0.01], cells: [1, 1]}}, material: wall, T0: 300}
contact:
  tip:
    slave: rod.right
    master: wall.left
    gap_max: 0.01
    conduction: {closed: {law: power, h0: 1000, h1: 2.0e-4, p0: 1, exponent: 1}, open: null}
thermal:
  half: rod
  method: sdirk2
  boundary:
    - {on: rod.left, temperature: 500}
    - {on: wall.top, temperature: 300}
mechanical:
  half: rod
  rod: {held: {rod: {left: 0}, wall: {left: 0, right: 0}}}
coupling:
  scheme: extrapolated
  end: 400
  windows: [{until: 400, size: 1}]
probes:
  T: {T: rod.right.centre}
  p: {p: {max: rod.right}}
  gap: {gap: {mean: rod.right}}
"""
