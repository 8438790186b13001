"""Scenes whose thermal bodies are divided among several halves, and how far two runs of them are apart."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from coupler import Results, load_scenario, run

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"

# Three blocks: the upper one closes on the middle one and is pressed, past the middle one and the lower there is gas.
# A source, a named condition and a conductivity that falls with T: each must be counted once.
BLOCKS = """
slideline: 2
units: {temperature: K}
geometry: plane
signals:
  stroke: {t: [0, 40, 80], value: [0, -2.0e-3, -2.0e-3]}
  squeeze: {t: [0, 40, 80], value: [0, 0, 1.0e7]}
materials:
  steel: {rho: 8000, c: 500, k: {T: [300, 1300], value: [40, 20]}, alpha: 0}
bodies:
  lower: {mesh: {rectangle: {origin: [0, -0.021], size: [0.02, 0.02], cells: [3, 4]}}, material: steel, T0: 400,
          Q_T: 2.0e6}
  middle: {mesh: {rectangle: {origin: [0, 0], size: [0.02, 0.02], cells: [4, 4]}}, material: steel, T0: 300}
  upper: {mesh: {rectangle: {origin: [0.005, 0.022], size: [0.02, 0.02], cells: [5, 4]}}, material: steel, T0: 1000}
contact:
  gas:
    slave: lower.top
    master: middle.bottom
    gap_max: 0.1
    conduction: {closed: {law: constant, h: 2000}, open: {law: gas, k_g: 0.05, g_m: 25.0e-6}}
    radiation: {emissivity_slave: 0.8, emissivity_master: 0.6}
  face:
    slave: upper.bottom
    master: middle.top
    gap_max: 0.1
    conduction:
      closed: {law: power, h0: 2000, h1: 6000, p0: 1.0e7, exponent: 0.95, p_max: 1.0e7}
      open: {law: gas, k_g: 0.05, g_m: 25.0e-6}
thermal:
  half: thermal
  method: midpoint
  boundary:
    - {on: upper.top, temperature: 1000, name: hot}
    - {on: middle.left, convection: {h: 200, T: 300}, name: air}
mechanical:
  half: rigid
  rigid: {motion: {lower: {}, middle: {}, upper: {u_y: stroke}}, pressure: {face: squeeze, gas: 0}}
coupling:
  scheme: extrapolated
  end: 80
  windows: [{until: 80, size: 8}]
probes:
  upper.T: {T: upper.bottom.centre}
output: {fields: {every: 1}}
"""
TWO = {"a": {"bodies": ["upper", "lower"]}, "b": {"bodies": ["middle"]}}
THREE = {"top": {"bodies": ["upper"]}, "mid": {"bodies": ["middle"]}, "low": {"bodies": ["lower"]}}


def blocks(folder: Path, text: str = BLOCKS) -> Path:
    """Write the three blocks down."""
    file = folder / "blocks.yaml"
    file.write_text(text)
    return file


def ran(file: Path, out: Path, changes: Mapping[str, Any], **options: Any) -> Results:
    return run(load_scenario(file, dict(changes)), out, **options)


def apart(one: Results, other: Results) -> dict[str, float]:
    """The largest difference of each field, and of each term of the ledger as a share of the largest."""
    found = {}
    assert list(one.fields) == list(other.fields)
    for name in one.fields:
        mine, theirs = one.field(name)[1], other.field(name)[1]
        assert mine.shape == theirs.shape, name
        # What no half tells is no number in both.
        assert (np.isnan(mine) == np.isnan(theirs)).all(), name
        found[name] = float(np.nanmax(np.abs(mine - theirs), initial=0.0))
    assert list(one.conditions) == list(other.conditions)
    for name in one.conditions:
        mine, theirs = one.condition(name)[1], other.condition(name)[1]
        found[name] = float(np.abs(mine - theirs).max() / max(np.abs(mine).max(), 1.0))
    largest = max(abs(J) for J in one.ledger.values())
    assert one.ledger.keys() == other.ledger.keys()
    return found | {f"heat.{n}": abs(J - other.ledger[n]) / largest for n, J in one.ledger.items()}
