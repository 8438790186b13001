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
