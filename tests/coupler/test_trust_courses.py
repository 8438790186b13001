"""Bodies that forces, blows and rules carry past a surface: windows look ahead, and the row judges the rest."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from contact.half.interface import Interface
from coupler import Results, run
from coupler.scenario.load import scenario_from
from coupler.schemes.levels import Level
from coupler.trust.checks import TrustVerdict
from coupler.trust.surfaces.courses import Course, Courses
from coupler.trust.surfaces.ways import NAME

H, WARM, LONG, WIDE, AHEAD, M = 1000.0, 100.0, 0.1, 0.2, 1.0, 39.0


def carried(tmp_path: Path, boundary: list[dict[str, Any]], coupling: dict[str, Any], *,
            body: dict[str, Any] | None = None,
            inertia: bool = True, rules: list[dict[str, Any]] | None = None, swapped: bool = False) -> Results:
    """A cold block of LONG, AHEAD of a hot plate of WIDE, 1 mm above it; both keep their temperatures."""
    out, sides = tmp_path / "run.h5", ("block.bottom", "plate.top")
    slave, master = sides[::-1] if swapped else sides
    doc = {
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "materials": {"m": {"rho": M / 0.005, "c": 480, "k": 45, "E": 2e11, "nu": 0.3, "alpha": 0}},
        "bodies": {
            "plate": {"mesh": {"rectangle": {"origin": [AHEAD, -0.05], "size": [WIDE, 0.05], "cells": [4, 2]}},
                      "material": "m", "T0": 300 + WARM},
            "block": {"mesh": {"rectangle": {"origin": [0, 0.001], "size": [LONG, 0.05], "cells": [2, 2]}},
                      "material": "m", "T0": 300}},
        "contact": {"face": {"slave": slave, "master": master, "gap_max": 0.003, "conduction": {
            "closed": {"law": "constant", "h": H}, "open": {"law": "constant", "h": H}}}},
        "thermal": {"boundary": [{"body": "plate", "temperature": 300 + WARM}, {"body": "block", "temperature": 300}]},
        "mechanical": {"half": "elastic", "elastic": {
            "bodies": {"plate": {"rigid": True}, "block": {"rigid": True} | (body or {})},
            "boundary": [{"body": "plate", "u_x": 0, "u_y": 0, "angle": 0}, *boundary],
            **({"dynamics": {}} if inertia else {})}},
        "coupling": coupling, "probes": {"heat": {f"heat.pair.face[{2 if swapped else 1}]": "value"}},
        **({"rules": rules} if rules else {})}
    run(scenario_from(json.dumps(doc), tmp_path / "carried.yaml", {}), out)
    return Results(out)


def heat(results: Results) -> float:
    return float(results.probe("heat")[1][-1])


def evenly(v: float) -> float:
    """The heat of a block that goes at v [m/s]: each place faces the plate for WIDE/v."""
    return H * WARM * LONG * WIDE / v


def speeding_up(a: float) -> float:
    """The heat of a block that sets off with a [m/s2], from its place."""
    x = np.linspace(0.0, LONG, 2001)
    return H * WARM * float(np.trapezoid(np.sqrt(2.0 * (AHEAD + WIDE - x) / a) - np.sqrt(2.0 * (AHEAD - x) / a), x))


def row(results: Results) -> Any:
    return next((check for check in results.trust if check.name == NAME), None)


@pytest.mark.parametrize("swapped", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_body_that_flies_past_a_plate_meets_it(tmp_path: Path, swapped: bool) -> None:
    """At 2 m/s it never faced the plate, with exit 0: its flight has no error in windows of any size."""
    results = carried(tmp_path, [], {"end": 50}, body={"v0": [2, 0]}, swapped=swapped)
    assert heat(results) == pytest.approx(evenly(2.0), rel=0.01)
    assert row(results).verdict is TrustVerdict.HOLDS
    assert len(results.windows) < 60
    assert set(results.windows.verdict) == {"accepted"}  # looked ahead, none was tried in vain


SLIDES = [{"body": "block", "u_y": 0, "angle": 0}]


def test_a_force_that_sets_a_body_off_is_followed(tmp_path: Path) -> None:
    """After 500 s at rest its first window was half a second long; the body went 1.25 m in it."""
    push = {"body": "block", "f_x": {"t": [0, 500, 500, 501], "value": [0, 0, 10 * M, 10 * M]}}
    results = carried(tmp_path, [push, *SLIDES], {"end": 501})
    assert heat(results) == pytest.approx(speeding_up(10.0), rel=0.01)
    assert row(results).verdict is TrustVerdict.HOLDS
    assert len(results.windows) < 60


def test_a_body_that_is_held_on_its_way_only_meets_it_too(tmp_path: Path) -> None:
    results = carried(tmp_path, [{"body": "block", "f_x": 10 * M}, *SLIDES], {"end": 1})
    assert heat(results) == pytest.approx(speeding_up(10.0), rel=0.01)


@pytest.mark.slow
def test_so_does_one_that_is_driven_and_let_go(tmp_path: Path) -> None:
    drive = {"body": "block", "u_x": {"t": [0, 1], "value": [0, 2]}, "until": 0.3}
    assert heat(carried(tmp_path, [drive, *SLIDES], {"end": 50})) == pytest.approx(evenly(2.0), rel=0.01)


def test_listed_windows_are_judged_by_how_far_bodies_went(tmp_path: Path) -> None:
    results = carried(tmp_path, [], {"end": 1, "windows": [{"until": 1, "size": 0.25}]}, body={"v0": [2, 0]})
    assert row(results).verdict is TrustVerdict.BROKEN
    assert row(results).number == pytest.approx(5.0)


def test_what_a_rule_moves_is_judged_too(tmp_path: Path) -> None:
    """It adds 2 m to where the body is held; the scene does not say when."""
    rules = [{"name": "go", "once": True, "when": {"t": {"above": 5}}, "do": [{"set": {"bc.ram": 2.0}}]}]
    results = carried(tmp_path, [{"body": "block", "u_x": 0, "name": "ram"}, *SLIDES], {"end": 10}, inertia=False,
                      rules=rules)
    assert row(results).verdict is TrustVerdict.BROKEN


def level(t: float, x: float) -> Level:
    none = np.empty(0)
    return Level(t, none, np.array([[x, 0.0], [x + 1.0, 0.0]]), none, none, none)


def followed(bodies: dict[str, Any]) -> Courses:
    """One body of two nodes."""
    scene = SimpleNamespace(bodies=("b",), node_body=np.zeros(2, dtype=int))
    return Courses(cast(Interface, scene), {"bodies": bodies})


def test_what_flies_from_the_start_is_looked_ahead_from_there() -> None:
    courses = followed({"b": {"v0": [2.0, 1.0], "omega0": 3.0}})
    np.testing.assert_array_equal(courses.moved(courses.begun(), 0, 0.5), [1.0, 0.5])
    assert courses.begun().spin == pytest.approx([3.0])


def test_an_even_acceleration_is_looked_ahead_as_it_goes() -> None:
    courses = followed({})
    course, t, a = courses.begun(), 0.0, 3.0
    for size in (0.1, 0.3, 0.2):
        course = courses.after(course, level(t, 0.5 * a * t * t), level(t + size, 0.5 * a * (t + size) ** 2))
        t += size
    np.testing.assert_allclose(courses.moved(course, 0, 0.4)[0], 0.5 * a * ((t + 0.4) ** 2 - t * t), rtol=1e-12)


def test_a_blow_says_little_of_what_follows() -> None:
    """From 0 to 1 m/s within a microsecond: 10^6 m/s2 that do not last."""
    moved = Courses.moved(Course(np.array([[1.0, 0.0]]), np.array([[1e6, 0.0]]), np.zeros(1), 1e-6), 0, 0.1)
    assert moved[0] == pytest.approx(0.3)
