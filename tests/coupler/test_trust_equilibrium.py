"""The check of stable equilibria: when it looks, what it says, and that a run under too much load does not pass."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coupler import Results, run
from coupler.scenario.load import scenario_from
from coupler.trust.checks import TrustVerdict
from coupler.trust.laws.equilibrium import FINE, NAME, EquilibriumLog, checks, due, softened, watched


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


@pytest.mark.parametrize(("told", "verdict", "words"), [
    ((0.0, 0.05), TrustVerdict.HOLDS, ""), ((0.2, 0.3, 0.1), TrustVerdict.NOTED, "too stiff: by 30 %"),
    ((0.2, 0.7), TrustVerdict.BROKEN, "lower loads"), ((-0.9, 0.3), TrustVerdict.NOTED, "too soft: by 90 %"),
    ((0.7, 0.0, -0.05), TrustVerdict.BROKEN, "at t = 0 s")])
def test_what_the_mesh_makes_of_the_stiffness_that_is_left(told: tuple[float, ...], verdict: TrustVerdict, words: str
                                                           ) -> None:
    log = log_of(*(0.0 for _ in told))
    for k, share in enumerate(told):
        log = softened(log, share, float(k))
    (_, check) = checks(log)
    assert (check.name, check.verdict) == (FINE, verdict)
    assert words in check.sentence
    assert check.number == max(abs(share) for share in told if share > -1.0)
    assert checks(log_of(0.0))[1:] == ()


@pytest.mark.parametrize(("told", "verdict"), [((0.0, -1.0, 0.05), TrustVerdict.UNCHECKED),
                                               ((-1.0,), TrustVerdict.UNCHECKED), ((0.7, -1.0), TrustVerdict.BROKEN)])
def test_a_mesh_that_does_not_tell_does_not_hold(told: tuple[float, ...], verdict: TrustVerdict) -> None:
    log = log_of(*(0.0 for _ in told))
    for k, share in enumerate(told):
        log = softened(log, share, float(k))
    assert checks(log)[1].verdict is verdict


def column_scene(folder: Path, load: float, cells: tuple[int, int], more: dict[str, bool], element: str) -> Results:
    """Held at its foot, 50 times as high as thick; it stays straight to the last bit, and the run completes."""
    H, E = 0.02, 1e9
    euler = 3.141592653589793**2 * E * H**3 / 12.0 / 4.0
    scene = scenario_from(json.dumps({
        "slideline": 2, "units": {"temperature": "K"}, "geometry": "plane",
        "signals": {"load": {"t": [0, 10], "value": [0, -load * euler / H]}},
        "materials": {"m": {"rho": 1000, "c": 1000, "k": 1.0, "E": E, "nu": 0.0, "alpha": 0}},
        "bodies": {"column": {"mesh": {"rectangle": {"origin": [0, 0], "size": [H, 1.0], "cells": list(cells),
                                                         **more}},
                              "material": "m", "T0": 300}},
        "thermal": {"boundary": []},
        "mechanical": {"half": "elastic", "elastic": {"element": element, "boundary": [
            {"on": "column.bottom", "u_x": 0, "u_y": 0}, {"on": "column.top", "t_y": "load"}]}},
        "probes": {"tip": {"u_x": "column.top.centre"}}, "coupling": {"end": 10}}), folder / "column.yaml", {})
    results = run(scene, out=folder / "run.h5")
    assert abs(results.probe("tip")[1][-1]) < 1e-9
    return results


@pytest.mark.few("1.2-False")
@pytest.mark.parametrize(("load", "stable"), [(0.9, True), (1.2, False)])
def test_a_column_beyond_the_load_of_euler_is_not_to_be_trusted(load: float, stable: bool, tmp_path: Path) -> None:
    results = column_scene(tmp_path, load, (2, 40), {}, "enhanced")
    row = next(c for c in results.trust if c.name == NAME)
    assert row.verdict is (TrustVerdict.HOLDS if stable else TrustVerdict.BROKEN)
    assert (row in results.broken) is not stable


@pytest.mark.parametrize(("load", "verdict"), [(0.05, "holds"), (1.05, "broken")])
def test_a_column_of_triangles_that_hides_that_it_buckles(load: float, verdict: str, tmp_path: Path) -> None:
    """2 x 80 pairs of triangles bend 60 % too stiffly: the count finds nothing at 1.05 times Euler's load."""
    results = column_scene(tmp_path, load, (2, 80), {"triangles": True}, "mean_dilatation")
    count, fine = (next(c for c in results.trust if c.name == name) for name in (NAME, FINE))
    assert (count.verdict, fine.verdict) == ("holds", verdict)
    assert [c.name for c in results.broken] == ([FINE] if verdict == "broken" else [])
