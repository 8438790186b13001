"""A small good scenario as text, and a way to spoil it in one place."""

from __future__ import annotations

from pathlib import Path

from coupler.errors import ScenarioError
from coupler.scenario import Scenario, load_scenario

ROOT = Path(__file__).resolve().parents[2]

GOOD = """\
slideline: 2
title: Two blocks
units: {temperature: degC}
geometry: plane
signals:
  push: {t: [0, 10, 10, 30], value: [0, 0, -1.0e-4, -2.0e-4]}
  idle: {t: [0, 7], value: [0, 1]}
  oven: {t: [0, 20], value: [20, 400]}
materials:
  steel: {rho: 8000, c: 500, k: 30, E: 2.0e11, nu: 0.3, alpha: 1.2e-5, T_ref: 20}
bodies:
  lower:
    mesh: {rectangle: {origin: [0, 0], size: [2, 1], cells: [4, 2]}}
    material: steel
    T0: 20
  upper:
    mesh: {rectangle: {origin: [0, 1], size: [2, 1], cells: [5, 2]}}
    material: steel
    T0: 100
contact:
  face:
    slave: upper.bottom
    master: lower.top
    gap_max: 0.1
    conduction:
      closed: {law: constant, h: 2000}
      open: {law: gas, k_g: 0.05, g_m: 25.0e-6}
thermal:
  half: thermal
  boundary:
    - {on: lower.bottom, temperature: oven}
    - {on: upper.top, flux: 1000, name: lamp}
    - {on: lower.top, convection: {h: 40, T: 200, gap: {d_cut: 1.0e-3, d_full: 6.0e-3}}}
mechanical:
  half: elastic
  elastic:
    boundary:
      - {on: lower.bottom, u_x: 0, u_y: 0}
      - {on: upper.top, u_y: push}
      - {at: upper.top.left, u_x: 0}
  rigid:
    motion: {upper: {u_y: push}}
    pressure: {face: 1.0e6}
coupling:
  scheme: extrapolated
  end: 40
  kinks: [25]
  windows:
    - {until: 10, size: 1}
    - {until: 40, first: 1, last: 5}
probes:
  face.left: {T: lower.top.left}
  face.centre: {T: upper.bottom.centre}
  face.p: {p: {max: upper.bottom}}
output:
  fields: {every: 5, at: [12.5]}
"""


def load_text(folder: Path, text: str, overrides: dict[str, object] | None = None) -> Scenario:
    """Load a scenario from its text."""
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path, overrides)


def error_of(folder: Path, old: str, new: str, overrides: dict[str, object] | None = None) -> ScenarioError:
    """The error the good scenario gives with one piece of its text replaced."""
    assert GOOD.count(old) == 1, f"{old!r} must stand exactly once in the good scenario"
    try:
        load_text(folder, GOOD.replace(old, new), overrides)
    except ScenarioError as exc:
        return exc
    raise AssertionError(f"{new!r} in place of {old!r} was accepted")


def line_of(piece: str, text: str = GOOD) -> int:
    """1-based line of a piece of text."""
    return text[: text.index(piece)].count("\n") + 1
