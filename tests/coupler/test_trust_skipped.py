"""Bodies that move through data over place in windows that are too long for it: a line of the trust table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import Results, run
from coupler.scenario.load import scenario_from
from coupler.trust.checks import TrustVerdict
from coupler.trust.skipped import NAME

RHO, C, SPEED = 7800.0, 480.0, 0.02
COIL = {"at": [0.1, 0.101, 0.104, 0.105], "value": [0, 1, 1, 0]}  # 4 mm in all


def strip(tmp_path: Path, windows: int, body: dict[str, Any], boundary: list[Any] | None = None,
          speed: float = SPEED) -> Results:
    """A strip of 20 mm, pushed by 0.2 m past what stands still, in so many windows."""
    out = tmp_path / "run.h5"
    doc = {
        "slideline": 2, "title": "strip", "units": {"temperature": "K"}, "geometry": "plane",
        "signals": {"go": {"t": [0, 10], "value": [0, 10 * speed]}},
        "materials": {"steel": {"rho": RHO, "c": C, "k": 1e-3}},
        "bodies": {"strip": {"mesh": {"rectangle": {"origin": [0, 0], "size": [0.02, 0.005], "cells": [8, 1]}},
                             "material": "steel", "T0": 300, **body}},
        "thermal": {"boundary": boundary or []},
        "mechanical": {"half": "rigid", "rigid": {"motion": {"strip": {"u_x": "go"}}}},
        "coupling": {"end": 10, "windows": [{"until": 10, "size": 10 / windows}]},
        "probes": {"most": {"T": {"max": "strip"}}, "least": {"T": {"min": "strip"}}}}
    run(scenario_from(json.dumps(doc), tmp_path / "strip.yaml", {}), out)
    return Results(out)


def row(results: Results) -> Any:
    return next((check for check in results.trust if check.name == NAME), None)


def heat(results: Results) -> tuple[float, float]:
    """How warm the coldest and the warmest node are, of what the strip takes up on its way."""
    rise = 2e9 * 0.004 / SPEED / (RHO * C)
    least, most = (float(results.probe(name)[1][-1]) for name in ("least", "most"))
    return (least - 300.0) / rise, (most - 300.0) / rise


def test_a_strip_that_jumps_past_a_coil_is_told(tmp_path):
    """A tenth of the way a window, five times the coil: nodes get none of its heat, or five times too much."""
    results = strip(tmp_path, 10, {"Q_T": {"terms": [{"t": 2e9, "x": COIL}]}})
    least, most = heat(results)
    assert least < 0.2
    assert most > 2.0
    assert row(results).verdict is TrustVerdict.BROKEN
    assert row(results) in results.broken
    # A node in the coil at the middle of one window gets 20 mm of it in place of 4.
    assert row(results).number == pytest.approx(4.0, abs=0.05)


@pytest.mark.slow
def test_windows_that_see_the_coil_say_nothing(tmp_path):
    """0.5 mm a window, half of its narrowest part; the rest is round-off."""
    results = strip(tmp_path, 400, {"Q_T": {"terms": [{"t": 2e9, "x": COIL}]}})
    np.testing.assert_allclose(heat(results), 1.0, rtol=0.02)
    assert row(results).verdict is TrustVerdict.HOLDS
    assert row(results).number < 0.01


@pytest.mark.slow
def test_data_that_move_along_or_are_the_same_everywhere_have_no_row(tmp_path):
    assert row(strip(tmp_path, 3, {"Q_T": 1e6})) is None
    assert row(strip(tmp_path, 3, {"Q_T": {"terms": [{"t": 2e9, "x": COIL}]}}, speed=0.0)) is None


@pytest.mark.few("condition3")
@pytest.mark.parametrize("condition", [
    {"flux": {"terms": [{"t": 1e6, "x": COIL}]}},
    {"convection": {"h": {"terms": [{"t": 500, "x": COIL}]}, "T": 800}},
    {"convection": {"h": 500, "T": {"terms": [{"t": 300}, {"t": 500, "x": COIL}]}}},
    {"radiation": {"emissivity": 0.9, "T": {"terms": [{"t": 300}, {"t": 900, "x": COIL}]}}}])
def test_conditions_on_surfaces_are_followed_too(tmp_path, condition):
    results = strip(tmp_path, 10, {}, [{"on": "strip.top", **condition}])
    assert row(results).verdict is TrustVerdict.BROKEN
    assert "strip.top" in row(results).what


def test_a_jump_is_no_narrow_part(tmp_path):
    """The coil again, which begins and ends within a nanometre: it is 4 mm wide, and windows need not resolve less."""
    sharp = {"at": [0.1, 0.1 + 1e-9, 0.104, 0.104 + 1e-9], "value": [0, 1, 1, 0]}
    results = strip(tmp_path, 10, {"Q_T": {"terms": [{"t": 2e9, "x": sharp}]}})
    assert "move by no more than 0.004 m, the narrowest part" in row(results).remedy
