"""A scene as a half of ours and as one of another package are told it."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import load_scenario
from coupler.scenario import Scenario, kinds

# Square cells: on others our half integrates conduction elsewhere (contact.half.gradients).
TEXT = """
slideline: 2
title: Two blocks
units: {temperature: K}
geometry: plane
materials:
  steel: {rho: 8000, c: 500, k: 30, E: 2.0e11, nu: 0.3, alpha: 1.2e-5, T_ref: 293.15}
  brass: {rho: 8500, c: 380, k: 110, E: 1.0e11, nu: 0.34, alpha: 1.9e-5, T_ref: 293.15}
bodies:
  lower: {mesh: {rectangle: {origin: [0, 0], size: [0.02, 0.01], cells: [4, 2]}}, material: steel, T0: 300, Q_T: 1.0e6}
  upper: {mesh: {rectangle: {origin: [0, 0.01], size: [0.02, 0.02], cells: [3, 3]}}, material: brass, T0: 500}
contact:
  joint:
    slave: upper.bottom
    master: lower.top
    gap_max: 0.002
    penalty: 1.0e14
    conduction: {closed: {law: power, h0: 500, h1: 5000, p0: 1.0e7, exponent: 0.95, p_max: 1.0e8}, open: null}
thermal:
  boundary:
    - {on: lower.bottom, temperature: 300}
    - {on: upper.top, convection: {h: 200, T: 350}}
    - {on: upper.left, flux: 1000}
mechanical:
  half: elastic
  elastic:
    boundary:
      - {on: lower.bottom, u_x: 0, u_y: 0}
      - {on: upper.top, u_x: 0, u_y: {t: [0, 3], value: [0, -2.0e-6]}}
coupling: {scheme: staggered, end: 3, windows: [{until: 3, size: 1}]}
"""


def install_mine(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a half called `mine` of a package `mine_half` be found, as if it was installed."""
    known = kinds.entry_points
    entry = EntryPoint("mine", "mine_half.build", kinds.GROUP)
    monkeypatch.setattr(kinds, "entry_points", lambda group: [*known(group=group), entry])


def scenes(folder: Path, role: str, monkeypatch: pytest.MonkeyPatch, **overrides: Any) -> tuple[Scenario, Scenario]:
    """The scene with our half in a role, and with one called `mine`."""
    install_mine(monkeypatch)
    (folder / "s.yaml").write_text(TEXT)
    own = load_scenario(folder / "s.yaml", overrides=overrides)
    return own, load_scenario(folder / "s.yaml", overrides={**overrides, f"{role}.half": "mine"})


def first_inputs(half: Any) -> dict[str, Any]:
    """What a half begins with."""
    return {v.name: np.broadcast_to(np.asarray(v.start), v.shape) if v.kind == "Real" else v.start
            for v in half.variables if v.causality == "input"}
