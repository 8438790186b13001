"""Surfaces that are told to pass each other within a window: adaptive windows follow them, and a row tells the rest."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.half.interface import Interface, Pair
from coupler import Results, run
from coupler.scenario.load import scenario_from
from coupler.schemes.levels import Level
from coupler.trust.checks import TrustVerdict
from coupler.trust.surfaces.ways import NAME, Ways, WaysLog

H, WARM, WIDE, NARROW, STROKE = 1000.0, 480.0, 0.01, 0.005, 0.11


def swept(tmp_path: Path, coupling: dict[str, Any], strokes: int = 1, speed: float = 1.0, begin: float = 500.0,
          half: str = "rigid") -> Results:
    """A hot block, swept to and fro over a cold pin; both keep their temperatures."""
    out = tmp_path / "run.h5"
    times, ways, t = [0.0], [0.0], begin
    for _ in range(strokes):
        times += [t, t + STROKE / speed]
        ways += [ways[-1], STROKE - ways[-1]]
        t += STROKE / speed
    motion = {"t": times, "value": ways}
    mechanical: dict[str, Any] = {"half": "rigid", "rigid": {"motion": {"block": {"u_x": motion}}}}
    if half == "elastic":
        mechanical = {"half": "elastic", "elastic": {"boundary": [
            {"body": "pin", "u_x": 0, "u_y": 0}, {"body": "block", "u_x": motion, "u_y": 0}]}}
    doc = {
        "slideline": 2, "units": {"temperature": "degC"}, "geometry": "plane",
        "materials": {"m": {"rho": 7800, "c": 480, "k": 2000, "E": 2e11, "nu": 0.3, "alpha": 0}},
        "bodies": {
            "pin": {"mesh": {"rectangle": {"origin": [0.03, -0.01], "size": [NARROW, 0.01], "cells": [3, 2]}},
                    "material": "m", "T0": 20},
            "block": {"mesh": {"rectangle": {"origin": [-0.02, 0], "size": [WIDE, 0.01], "cells": [5, 2]}},
                      "material": "m", "T0": 20 + WARM}},
        "contact": {"face": {"slave": "block.bottom", "master": "pin.top", "gap_max": 0.001, "conduction": {
            "closed": {"law": "constant", "h": H}, "open": {"law": "constant", "h": H}}}},
        "thermal": {"boundary": [{"body": "block", "temperature": 20 + WARM}, {"body": "pin", "temperature": 20}]},
        "mechanical": mechanical, "coupling": coupling, "probes": {"heat": {"heat.pair.face[2]": "value"}}}
    run(scenario_from(json.dumps(doc), tmp_path / "swept.yaml", {}), out)
    return Results(out)


def share_met(results: Results, strokes: int = 1, speed: float = 1.0) -> float:
    """The heat that crossed over that of a block of WIDE that passes NARROW: each place is faced for WIDE/speed."""
    return float(results.probe("heat")[1][-1]) / (strokes * H * WARM * WIDE * NARROW / speed)


def row(results: Results) -> Any:
    return next((check for check in results.trust if check.name == NAME), None)


def test_a_block_that_is_swept_past_a_pin_meets_it(tmp_path):
    """0.11 s of 1000: as one window, or as its two halves, it never faces the pin.

    Round-off is what is left: the overlap is linear in time between the ends of windows, or it is summed as it is.
    """
    results = swept(tmp_path, {"end": 1000})
    assert share_met(results) == pytest.approx(1.0, abs=0.01)
    assert row(results).verdict is TrustVerdict.HOLDS
    assert len(results.windows) < 60


@pytest.mark.slow
@pytest.mark.parametrize("half", ["rigid", "elastic"])
def test_strokes_to_and_fro_all_meet_the_pin(tmp_path, half):
    """20 strokes: half of their heat was missed."""
    results = swept(tmp_path, {"end": 100}, strokes=20, speed=0.2, begin=10.0, half=half)
    assert share_met(results, 20, 0.2) == pytest.approx(1.0, abs=0.01)


def test_listed_windows_that_pass_the_pin_are_told(tmp_path):
    results = swept(tmp_path, {"end": 20, "windows": [{"until": 20, "size": 1}]}, begin=10.0)
    assert share_met(results) == 0.0
    assert row(results) in results.broken
    assert row(results).number == pytest.approx(STROKE / NARROW)


def boxes(shift: float = 0.0) -> Interface:
    """Two unit squares, the second above the first and moved aside."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    nodes = np.vstack([square, square + [shift, 1.1]])
    return Interface(geometry="plane", nodes=nodes, quads=np.array([[0, 1, 2, 3], [4, 5, 6, 7]]),
                     triangles=np.empty((0, 3), dtype=int), quad_body=np.array([0, 1]),
                     triangle_body=np.empty(0, dtype=int), bodies=("low", "high"), materials=("m", "m"),
                     surfaces={"low.top": np.array([[2, 3]]), "high.bottom": np.array([[4, 5]])},
                     pairs=(Pair("face", "high.bottom", "low.top", 0.2, 1e9),))


def ramp(rate: float) -> dict[str, list[float]]:
    return {"t": [0.0, 100.0], "value": [0.0, 100.0 * rate]}


def longest(model: dict[str, Any], shift: float = 0.0, t1: float = 10.0) -> float:
    interface = boxes(shift)
    return Ways(interface, model).longest(interface.nodes, 0.0, t1)


def test_a_window_lasts_for_half_of_the_shorter_surface():
    assert longest({"motion": {"high": {"u_x": ramp(0.25)}}}) == pytest.approx(2.0)
    assert longest({"motion": {"high": {"u_x": ramp(0.25)}}}, t1=1.9) == 1.9
    assert longest({"boundary": [{"on": "high.top", "u_x": ramp(0.25)}]}) == pytest.approx(2.0)


def test_what_is_let_go_moves_no_further():
    assert longest({"boundary": [{"on": "high.top", "u_x": ramp(0.25), "until": 1.0}]}) == 10.0


def test_bodies_that_move_as_one_pass_nothing():
    assert longest({"motion": {"high": {"u_x": ramp(3.0)}, "low": {"u_x": ramp(3.0)}}}) == 10.0
    spin = {"rotation": {"about": [0.0, 0.0], "angle": ramp(3.0)}}
    assert longest({"motion": {"high": spin, "low": spin}}) == 10.0


def test_a_body_far_away_comes_near_in_one_window():
    """It starts 20 m aside at 4 m/s: their boxes meet after 19/4 s less the reach, in pieces of 1/8 s."""
    assert longest({"motion": {"high": {"u_x": ramp(4.0)}}}, shift=-20.0) == pytest.approx(4.625)
    assert longest({"motion": {"high": {"u_x": ramp(-4.0)}}}, shift=-20.0) == 10.0


def test_a_way_along_an_arc_counts():
    """About a point of its surface it goes a length a radian, about its middle half of that."""
    for about, end in (([0.5, 1.1], 0.5), ([0.0, 1.1], 0.25)):
        assert longest({"motion": {"high": {"rotation": {"about": about, "angle": ramp(2.0)}}}}) == pytest.approx(end)


def test_a_ring_turns_by_no_more_than_a_radian():
    """Slip of more than some 80 degrees is not followed, though half of what a ring measures across is 1.41 radii."""
    n = 12
    angles = 2.0 * math.pi * np.arange(n) / n
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    i, k = np.arange(n), np.roll(np.arange(n), -1)
    quads = np.concatenate([np.stack([i + a, i + a + n, k + a + n, k + a], axis=1) for a in (0, 2 * n)])
    rings = Interface(geometry="plane", nodes=np.concatenate([r * circle for r in (1.0, 2.0, 2.0, 3.0)]), quads=quads,
                      triangles=np.empty((0, 3), dtype=int), quad_body=np.repeat([0, 1], n),
                      triangle_body=np.empty(0, dtype=int), bodies=("hub", "bush"), materials=("m", "m"),
                      surfaces={"hub.out": np.stack([i + n, k + n], axis=1),
                                "bush.in": np.stack([k + 2 * n, i + 2 * n], axis=1)},
                      pairs=(Pair("face", "hub.out", "bush.in", 0.2, 1e9),))
    spin = {"motion": {"hub": {"rotation": {"about": [0.0, 0.0], "angle": ramp(2.0)}}}}
    assert Ways(rings, spin).longest(rings.nodes, 0.0, 10.0) == pytest.approx(0.5)


def test_a_rigid_body_turns_about_a_point_that_moves_with_it():
    turning = [{"body": "high", "angle": ramp(2.0)}]
    model = {"boundary": turning, "bodies": {"high": {"rigid": True, "reference": [0.5, 1.1]}}}
    interface = boxes()
    x = interface.nodes.copy()
    x[4:] += [0.3, 0.0]
    assert Ways(interface, model).longest(x, 0.0, 10.0) == pytest.approx(0.5)


def watched(model: dict[str, Any], until: float, shift: float = 0.0, looks: int = 1) -> WaysLog:
    interface = boxes(shift)
    ways = Ways(interface, model, looks)
    levels = [Level(t, np.full(8, 300.0), interface.nodes, np.zeros(4), np.full(4, 0.1), np.zeros(4))
              for t in (0.0, until)]
    return ways.watched(WaysLog(), levels[0], levels[1])


def slider(at: float, edges: int = 4, lifted: float = 0.1) -> Interface:
    """A unit square on a track from 0 to 20 of so many edges."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    x = np.linspace(0.0, 20.0, edges + 1)
    track = np.concatenate([np.stack([x, 0.0 * x - 1.0], axis=1), np.stack([x, 0.0 * x], axis=1)])
    i, n = np.arange(edges), edges + 1
    return Interface(geometry="plane", nodes=np.vstack([track, square + [at, lifted]]),
                     quads=np.concatenate([np.stack([i, i + 1, n + i + 1, n + i], axis=1),
                                           [2 * n + np.arange(4)]]),
                     triangles=np.empty((0, 3), dtype=int), quad_body=np.array([*[0] * edges, 1]),
                     triangle_body=np.empty(0, dtype=int), bodies=("track", "slider"), materials=("m", "m"),
                     surfaces={"track.top": np.stack([n + i + 1, n + i], axis=1),
                               "slider.bottom": np.array([[2 * n, 2 * n + 1]])},
                     pairs=(Pair("face", "slider.bottom", "track.top", 0.2, 1e9),))


def test_a_slider_that_stays_on_its_track_passes_what_its_edges_can_hold():
    """Half of two edges of 5 m in a window, where it goes half a metre past a pin."""
    model = {"motion": {"slider": {"u_x": ramp(1.0)}}}

    def end(at: float, edges: int, lifted: float = 0.1, t1: float = 10.0, model: dict[str, Any] = model) -> float:
        interface = slider(at, edges, lifted)
        return Ways(interface, model).longest(interface.nodes, 0.0, t1)

    assert end(2.0, 4) == pytest.approx(5.0)
    assert end(2.0, 4, t1=4.0) == 4.0
    # Edges that are shorter than it is, the end of the track, and a turn.
    assert end(2.0, 80) == pytest.approx(0.5)
    assert end(17.0, 4) == pytest.approx(2.0)
    assert end(18.8, 4) == pytest.approx(0.5)
    turns = {"motion": {"slider": {"u_x": ramp(1.0), "rotation": {"about": [2.5, 0.6], "angle": ramp(0.01)}}}}
    assert end(2.0, 4, model=turns) < 0.6
    assert end(2.0, 4, lifted=0.5) == 10.0


def test_the_row_of_a_slider_on_its_track():
    interface = slider(2.0)
    ways = Ways(interface, {"motion": {"slider": {"u_x": ramp(1.0)}}})
    moved = interface.nodes.copy()
    moved[10:] += [6.0, 0.0]
    levels = [Level(t, np.full(14, 300.0), x, np.zeros(4), np.full(4, 0.1), np.zeros(4))
              for t, x in ((0.0, interface.nodes), (6.0, moved))]
    log = ways.watched(WaysLog(), *levels)
    assert log.share == pytest.approx(0.6)
    assert "by 0.6 times the length of two edges of its track" in ways.checks(log)[0].what


def test_a_row_tells_how_far_surfaces_went():
    model = {"motion": {"high": {"u_x": ramp(0.25)}}}
    assert watched(model, 6.0).share == pytest.approx(1.5)
    # The thermal half looks in each of its substeps.
    assert watched(model, 6.0, looks=3).share == pytest.approx(0.5)
    # Two turns in a window end where they began, however often one looks.
    spin = {"motion": {"high": {"rotation": {"about": [0.5, 1.1], "angle": ramp(math.pi)}}}}
    assert watched(spin, 4.0, looks=8).share > 4.0


def test_what_never_comes_near_has_no_row():
    away = {"motion": {"high": {"u_x": ramp(-4.0)}}}
    assert watched(away, 10.0, shift=-20.0) == WaysLog()
    interface = boxes()
    assert Ways(interface, {}).checks(WaysLog()) == ()
