"""Bodies that move through data over place in windows that are too long for it: a line of the trust table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import Results, run
from coupler.scenario.load import scenario_from
from coupler.scenario.options import Scheme, Seen
from coupler.schemes.schemes import read_at
from coupler.trust.checks import TrustVerdict
from coupler.trust.surfaces.skipped import NAME

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


def test_a_coil_that_is_a_fiftieth_of_the_way_is_seen(tmp_path):
    """As above, 200 mm a window: a node in the coil at the middle of one gets 200 mm of it in place of 4."""
    results = strip(tmp_path, 10, {"Q_T": {"terms": [{"t": 2e9, "x": COIL}]}}, speed=10 * SPEED)
    assert row(results).number == pytest.approx(49.0, rel=0.05)


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


# A block of 400 K, even in itself, leaves a plate of 300 K at 80 um/s.  What cools it, 200 W/m2K, begins or ends where
# it has gone 2.6 mm, at 32.5 s, over 0.1 mm.  Windows find their own size; until then all is as before.
RISE, FROM, TO, FILM, HEIGHT = 8e-5, 2.6e-3, 2.7e-3, 200.0, 0.01
AT = 0.5 * (FROM + TO) / RISE


def leaves(tmp_path: Path, pair: dict[str, Any], boundary: list[Any], windows: float = 0.0,
           until: float | None = None, **coupling: Any) -> Results:
    """windows : their size [s]; 0: they find it."""
    out = tmp_path / "run.h5"
    mesh = [{"rectangle": {"origin": [0, y], "size": [0.02, HEIGHT], "cells": [2, 1]}} for y in (-HEIGHT, 0.0)]
    doc = {
        "slideline": 2, "title": "leaves", "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"steel": {"rho": RHO, "c": C, "k": 1e4}},
        "bodies": {"plate": {"mesh": mesh[0], "material": "steel", "T0": 300},
                   "block": {"mesh": mesh[1], "material": "steel", "T0": 400}},
        "contact": {"slot": {"slave": "block.bottom", "master": "plate.top", "gap_max": 0.02, **pair}},
        "thermal": {"boundary": [{"body": "plate", "temperature": 300}, *boundary]},
        "mechanical": {"half": "rigid", "rigid": {"motion": {"block": {"u_y": {"t": [0, 100], "value": [0, 0.008]}}}}},
        "coupling": {"end": 100, **({"windows": [{"until": 100, "size": windows}]} if windows else {}), **coupling},
        "probes": {"T": {"T": {"mean": "block"}}}}
    run(scenario_from(json.dumps(doc), tmp_path / "leaves.yaml", {}), out, until=until)
    return Results(out)


def cooled(seconds: float) -> float:
    return 300.0 + 100.0 * float(np.exp(-FILM * seconds / (RHO * C * HEIGHT)))


OPENS = {"convection": {"h": FILM, "T": 300, "gap": {"d_cut": FROM, "d_full": TO}}}
ABOVE = {"convection": {"h": {"terms": [{"t": FILM, "y": {"at": [FROM, TO], "value": [0, 1]}}]}, "T": 300}}
ENDS = {"conduction": {"closed": {"law": "constant", "h": FILM},
                       "open": {"law": "table", "x": [0, FROM, TO], "h": [FILM, FILM, 0]}}}


@pytest.mark.few("film over the gap", "table over the gap")
@pytest.mark.parametrize(("pair", "boundary", "seconds"), [
    pytest.param({}, [{"on": "block.bottom", **OPENS}], 100.0 - AT, id="film over the gap"),
    pytest.param(ENDS, [], AT, id="table over the gap"),
    pytest.param({}, [{"on": "block.bottom", **ABOVE}], 100.0 - AT, id="film over place")])
def test_windows_skip_nothing_that_begins_or_ends_in_them(tmp_path, pair, boundary, seconds):
    """Off by 3.2 K of 30, by 3.2 K of 16 and, by chance, by 0.05 K of 30; told as 0.016, 0.005 and 0.01 K."""
    results = leaves(tmp_path, pair, boundary)
    assert float(results.probe("T")[1][-1]) == pytest.approx(cooled(seconds), abs=0.05)
    assert not results.broken
    assert len(results.windows) < 40


@pytest.mark.parametrize("end", [pytest.param(26.0, marks=pytest.mark.slow), 31.0])
def test_a_run_that_is_stopped_before_something_begins_has_missed_nothing_of_it(tmp_path, end):
    """It stops at the first end of a window behind that, which lies where the film begins or before."""
    results = leaves(tmp_path, {}, [{"on": "block.bottom", **OPENS}], until=end)
    assert results.probe("T")[0][-1] >= end
    assert not results.broken


@pytest.mark.parametrize(("level", "read"), [("middle", 50.0), ("end", 100.0)])
def test_what_fades_with_a_gap_is_followed_in_listed_windows(tmp_path, level, read):
    """Two windows of 50 s, read at 25 and 75 s, or at 50 and 100 s: the film acts for `read` seconds, not for 66.9."""
    held = {"scheme": "iterated", "iteration": {"level": level}}
    results = leaves(tmp_path, {}, [{"on": "block.bottom", **OPENS}], 50.0, **held)
    # Steps of a quarter of the time in which the block cools.
    assert float(results.probe("T")[1][-1]) == pytest.approx(cooled(read), abs=0.6)
    assert row(results).number == pytest.approx(abs(read - (100.0 - AT)) / (100.0 - AT), abs=0.01)
    assert row(results) in results.broken
    assert "the convection on block.bottom changes with the gap" in row(results).what


def test_where_a_half_reads_in_a_window():
    assert read_at(Scheme.ITERATED, Seen.MIDDLE, 1, 1) == (0.5,)
    assert read_at(Scheme.ITERATED, Seen.END, 1, 2) == (0.5, 1.0)
    assert read_at(Scheme.EXTRAPOLATED, Seen.MIDDLE, 2, 1) == (0.25, 0.75)
    assert read_at(Scheme.STAGGERED, Seen.MIDDLE, 3, 2) == (0.0, 0.5)
