"""Probes of what is 0 by symmetry or statics: what solvers leave of it is no error of windows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import Results, run
from coupler.scenario.load import scenario_from
from coupler.trust.checks import TrustVerdict
from coupler.trust.in_time import errors
from coupler.trust.in_time.errors import Looked


def heated(tmp_path: Path, probes: dict[str, Any]) -> Results:
    """A plate of steel, 100 by 10 mm, that grows freely; it is held in its middle."""
    out = tmp_path / "run.h5"
    film = {"convection": {"h": 2000, "T": {"t": [0, 20, 60], "value": [20, 600, 20]}}}
    doc = {
        "slideline": 2, "units": {"temperature": "degC"}, "geometry": "plane",
        "materials": {"steel": {"rho": 7800, "c": 480, "k": 45, "E": 2e11, "nu": 0.3, "alpha": 1.2e-5, "T_ref": 20}},
        "bodies": {"b": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.1, 0.01], "cells": [10, 4]}},
                         "material": "steel", "T0": 20}},
        "thermal": {"boundary": [{"on": "b.left", **film}, {"on": "b.right", **film}]},
        "mechanical": {"half": "elastic", "elastic": {"state": "plane_stress", "boundary": [
            {"at": "b.bottom.centre", "u_x": 0, "name": "grip"}, {"at": "b.bottom.centre", "u_y": 0},
            {"at": "b.top.centre", "u_x": 0}]}},
        "coupling": {"end": 60}, "probes": probes}
    run(scenario_from(json.dumps(doc), tmp_path / "heated.yaml", {}), out)
    return Results(out)


@pytest.mark.parametrize(("quantity", "place"), [
    ("reaction.grip.x", "value"),
    pytest.param("mechanical.sigma.xy", {"at": [0.05, 0.01], "body": "b"}, marks=pytest.mark.slow),
    pytest.param("thermal.q.x", {"at": [0.05, 0.01], "body": "b"}, marks=pytest.mark.slow)])
def test_what_solvers_leave_is_no_error(tmp_path, quantity, place):
    """1e-7 N, 1e-6 Pa and 1e-10 W/m2 that come and go as they like: it was off by twice its range, with exit 4."""
    results = heated(tmp_path, {"nothing": {quantity: place}})
    assert results.broken == ()
    assert np.ptp(results.probe("nothing")[1]) > 0.0
    check = next(c for c in results.trust if c.name == errors.NAME)
    assert check.verdict is TrustVerdict.HOLDS


def test_heat_across_a_plane_of_symmetry(tmp_path):
    """4e-11 J of 100 kJ, what rounding leaves: it was off by 1.7 times its range, with exit 4."""
    film = {"convection": {"h": 1000, "T": 400}}
    doc = {
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"m": {"rho": 7800, "c": 480, "k": 40}},
        "bodies": {name: {"mesh": {"rectangle": {"origin": [0, y], "size": [0.02, 0.02], "cells": [6, 6]}},
                          "material": "m", "T0": 300} for name, y in (("a", 0), ("b", 0.02))},
        "contact": {"f": {"slave": "a.top", "master": "b.bottom", "gap_max": 0.001,
                          "conduction": {"closed": {"law": "constant", "h": 5000}, "open": None}}},
        "thermal": {"boundary": [{"on": "a.left", **film}, {"on": "b.left", **film}]},
        "mechanical": {"half": "rigid", "rigid": {"pressure": {"f": 1e6}}},
        "coupling": {"end": 200}, "probes": {"across": {"heat.pair.f[2]": "value"}}}
    results = run(scenario_from(json.dumps(doc), tmp_path / "across.yaml", {}), tmp_path / "across.h5")
    assert 0.0 < np.ptp(results.probe("across")[1]) < 1e-6
    assert results.broken == ()


def judged(size: float, nothing: dict[str, float]) -> TrustVerdict:
    """A force that goes up by `size` and may be off by as much."""
    log = errors.watched(errors.begun(np.zeros(1)), Looked(np.full(1, size), np.full(1, size), np.full(1, size)), 1.0)
    return errors.check(log, {"F": "N"}, True, nothing=nothing).verdict


def test_what_is_more_than_solvers_leave_is_held_against_its_own_range():
    assert judged(1e-3, {"N": 2.0}) is TrustVerdict.HOLDS
    assert judged(1e-3, {"Pa": 2.0}) is TrustVerdict.BROKEN
    assert judged(2.0, {"N": 2.0}) is TrustVerdict.BROKEN


def test_what_an_error_is_held_against_is_told():
    log = errors.watched(errors.begun(np.zeros(1)), Looked(np.full(1, 1e-4), np.full(1, 1e-4), np.full(1, 5e-5)), 1.0)
    told = [errors.check(log, {"T": "K"}, True, nothing=nothing).sentence for nothing in ({}, {"K": 5e-4})]
    assert "probe T may be off by 50 % of its range (5e-05 K)" in told[0]
    assert "probe T may be off by 5e-05 K, 10 % of 0.0005 K, the least that its errors are held against" in told[1]
