"""The check of stable equilibria: when it looks, what it says, and that a run under too much load does not pass."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coupler import run
from coupler.scenario.load import scenario_from
from coupler.trust.checks import TrustVerdict
from coupler.trust.equilibrium import NAME, EquilibriumLog, checks, due, watched


def log_of(*told: float) -> EquilibriumLog:
    log = EquilibriumLog()
    for k, directions in enumerate(told):
        log = watched(log, directions, float(k))
    return log


def test_it_looks_at_the_start_a_dozen_times_and_at_the_end() -> None:
    log, looks = EquilibriumLog(), 0
    for k in range(1001):
        if due(log, 0.1 * k, 100.0, at_end=k == 1000):
            log, looks = watched(log, 0.0, 0.1 * k), looks + 1
    assert looks == 13
    assert (log.last, log.known) == (100.0, 13)


@pytest.mark.parametrize(("told", "verdict", "words"), [
    ((0.0, 0.0, 0.0), TrustVerdict.HOLDS, ""), ((-1.0, -1.0), TrustVerdict.UNCHECKED, "slipped with friction"),
    ((0.0, -1.0), TrustVerdict.HOLDS, ""),
    ((0.0, 1.0, 2.0, 0.0), TrustVerdict.BROKEN, "at t = 1 s, and at 2 of 4 looks")])
def test_verdicts(told: tuple[float, ...], verdict: TrustVerdict, words: str) -> None:
    (check,) = checks(log_of(*told))
    assert check.verdict is verdict
    assert words in check.sentence
    assert check.number == max(*told, 0.0)


def test_no_half_that_tells_no_row() -> None:
    assert not checks(EquilibriumLog())


@pytest.mark.few("1.2-False")
@pytest.mark.parametrize(("load", "stable"), [(0.9, True), (1.2, False)])
def test_a_column_beyond_the_load_of_euler_is_not_to_be_trusted(load: float, stable: bool, tmp_path: Path) -> None:
    """Held at its foot, 50 times as high as thick; it stays straight to the last bit, and the run completes."""
    H, E = 0.02, 1e9
    euler = 3.141592653589793**2 * E * H**3 / 12.0 / 4.0
    scene = scenario_from(json.dumps({
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "signals": {"load": {"t": [0, 10], "value": [0, -load * euler / H]}},
        "materials": {"m": {"rho": 1000, "c": 1000, "k": 1.0, "E": E, "nu": 0.0, "alpha": 0}},
        "bodies": {"column": {"mesh": {"rectangle": {"origin": [0, 0], "size": [H, 1.0], "cells": [2, 40]}},
                              "material": "m", "T0": 300}},
        "thermal": {"boundary": []},
        "mechanical": {"half": "elastic", "elastic": {"element": "enhanced", "boundary": [
            {"on": "column.bottom", "u_x": 0, "u_y": 0}, {"on": "column.top", "t_y": "load"}]}},
        "probes": {"tip": {"u_x": "column.top.centre"}}, "coupling": {"end": 10}}), tmp_path / "column.yaml", {})
    results = run(scene, out=tmp_path / "run.h5")
    assert abs(results.probe("tip")[1][-1]) < 1e-9
    row = next(c for c in results.trust if c.name == NAME)
    assert row.verdict is (TrustVerdict.HOLDS if stable else TrustVerdict.BROKEN)
    assert (row in results.broken) is not stable
