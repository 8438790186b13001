"""The trust row on the energy of motion, and a pendulum that a damping method brakes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coupler import Results, run
from coupler.scenario.load import scenario_from
from coupler.trust.checks import Check, TrustVerdict
from coupler.trust.laws.energy import NAME, EnergyLog, checks, watched

HOLDS, NOTED, BROKEN, _ = TrustVerdict


def judged(made: list[float], kinetic: list[float]) -> tuple[Check, ...]:
    log = EnergyLog()
    for k, (m, T) in enumerate(zip(made, kinetic, strict=True)):
        log = watched(log, {"mechanical.energy.made": m, "mechanical.energy.kinetic": T}, float(k))
    return checks(log)


@pytest.mark.parametrize(("made", "verdict", "number"), [
    ([0.0, 0.01, -0.02], HOLDS, 0.02), ([0.0, 0.05, 0.0], NOTED, 0.05), ([0.0, 0.2, 0.1], BROKEN, 0.2),
    ([0.0, -0.5, -0.6], NOTED, 0.6), ([0.0, 0.15, -0.6], BROKEN, 0.15)])
def test_what_is_gained_breaks_and_what_is_lost_is_noted(made: list[float], verdict: TrustVerdict,
                                                         number: float) -> None:
    row, = judged(made, [0.2, 1.0, 0.5])
    assert row.verdict is verdict
    assert row.number == pytest.approx(number)


def test_there_is_no_row_where_nobody_tells_or_nothing_moves() -> None:
    assert checks(watched(EnergyLog(), {}, 1.0)) == () == judged([0.0, 0.0], [0.0, 0.0])


def test_a_pendulum_that_its_method_brakes_is_noted(tmp_path: Path) -> None:
    """`rho_inf: 0` and default windows: of 1 m a quarter of its energy is gone after 3 s."""
    doc = {
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"m": {"rho": 7800, "c": 480, "k": 45, "E": 2e11, "nu": 0.3, "alpha": 0}},
        "bodies": {"rod": {"mesh": {"rectangle": {"origin": [0, 0], "size": [1, 0.05], "cells": [4, 1]}},
                           "material": "m", "T0": 300}},
        "thermal": {}, "mechanical": {"half": "elastic", "elastic": {
            "dynamics": {"rho_inf": 0.0}, "element": "enhanced", "gravity": {"y": -9.81},
            "boundary": [{"at": "rod.left.centre", "u_x": 0, "u_y": 0}]}},
        "coupling": {"end": 1.2}, "probes": {"y": {"u_y": "rod.right.centre"}}}
    run(scenario_from(json.dumps(doc), tmp_path / "rod.yaml", {}), tmp_path / "run.h5")
    row = next(check for check in Results(tmp_path / "run.h5").trust if check.name == NAME)
    assert row.verdict is NOTED
    assert 0.05 < row.number < 0.4
