"""The trust row on drives that miss their targets: one that swings, one at its bound, one that holds."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest

from coupler import load_scenario, run
from coupler.scenario.rule_model import Drive, Rule, When
from coupler.trust.checks import Check, TrustVerdict
from coupler.trust.in_time import drives
from coupler.trust.in_time.instants import Acted

HOLDS, NOTED, _, _ = TrustVerdict


def rule(*, log: bool = False, target: float = 400.0, after: float = -math.inf, when: When | None = None) -> Rule:
    lamp = Drive("thermal", "load.lamp", "T", target, 1.0, 0.1, 10.0, log)
    return Rule("keep", when or When(), drive=lamp, after=after)


def judged(of: Rule, monitor: list[float], H: float = 1.0) -> tuple[Check, ...]:
    """The row for what the monitor was at the ends of windows of H [s], the first of them the start."""
    log, rules = drives.DriveLog(), drives.always_on([of])
    for k, (before, now) in enumerate(pairwise(monitor)):
        log = drives.watched(log, Acted((k + 1) * H, H, {"T": before}, {"T": now}, {}), rules)
    return drives.checks(log, rules)


def approach(n: int = 100) -> list[float]:
    return [400.0 - 100.0 * math.exp(-k / 5.0) for k in range(n)]


@pytest.mark.parametrize("log", [False, True])
def test_a_target_that_is_held_reads_nothing_of_the_way_to_it(log: bool) -> None:
    (row,) = judged(rule(log=log), approach())
    # In the mean over time it is off by 5 %: exp(-t/5), weighted by t, adds up to 25 of 5000.
    assert row.verdict is HOLDS
    assert row.number == pytest.approx(0.005, rel=0.2)


@pytest.mark.parametrize("log", [False, True])
def test_a_drive_that_swings_is_told_by_how_much_and_how_often(log: bool) -> None:
    swings = [400.0 + 100.0 * math.cos(2.0 * math.pi * (k + 0.5) / 20.0) for k in range(201)]
    (row,) = judged(rule(log=log), swings)
    # |cos| is 2/pi in the mean; the range is twice the amplitude.
    assert row.number == pytest.approx(1.0 / math.pi, rel=0.05)
    assert row.verdict is NOTED
    assert "passed it 20 times" in row.what
    assert "lag" in row.remedy


def test_a_drive_at_its_bound_never_gets_there() -> None:
    (row,) = judged(rule(), [min(v, 350.0) for v in approach()])
    assert row.verdict is NOTED
    assert row.number == pytest.approx(0.5, rel=0.05)
    assert "never got there" in row.what
    assert "wider bounds than 0.1 to 10" in row.remedy


def test_a_monitor_of_another_sign_or_size_counts_as_not_held_at_all() -> None:
    (row,) = judged(rule(log=True), [-1.0] * 50)
    assert row.number == pytest.approx(1.0)
    (row,) = judged(rule(log=True), [1e-9] * 50)
    assert row.number == pytest.approx(1.0)


def test_a_drive_counts_from_when_it_is_on_and_one_with_conditions_not() -> None:
    (row,) = judged(rule(after=50.0), [300.0] * 50 + approach())
    assert row.number == pytest.approx(0.005, rel=0.2)
    assert judged(rule(after=500.0), approach()) == ()
    assert drives.always_on([rule(when=When(all=("anything",)))]) == ()  # type: ignore[arg-type]


def test_the_size_of_windows_counts_for_nothing() -> None:
    """Every other level of the same course, in windows of twice the size."""
    course = [400.0 + 50.0 * math.sin(0.05 * k) for k in range(401)]
    (fine,), (coarse,) = judged(rule(), course), judged(rule(), course[::2], 2.0)
    assert fine.number == pytest.approx(coarse.number, rel=0.02)


SLAB = """
slideline: 2
units: {temperature: K}
geometry: plane
materials: {m: {rho: 7800, k: 45, c: 480}}
bodies: {a: {mesh: {rectangle: {origin: [0, 0], size: [0.02, 0.05], cells: [1, 6]}}, material: m, T0: 300}}
thermal:
  boundary:
  - {on: a.bottom, flux: 20000.0, name: lamp}
  - {on: a.top, convection: {h: 500, T: 300}}
mechanical: {half: rigid}
coupling: {end: 2000, windows: [{until: 2000, size: 10}]}
rules: [{name: keep, drive: {load: lamp, so_that: {Ttop: 400}, lag: %g, least: 0.01, most: 100}}]
probes: {Ttop: {T: a.top.centre}}
"""


@pytest.mark.parametrize(("lag", "verdict"), [(0.0, NOTED), (100.0, HOLDS)])
def test_a_run_tells_of_a_lamp_that_answers_too_fast(tmp_path: Path, lag: float, verdict: TrustVerdict) -> None:
    (path := tmp_path / "slab.yaml").write_text(SLAB % lag)
    results = run(load_scenario(path), tmp_path / "run.h5")
    (row,) = [c for c in results.trust if c.name == drives.NAME]
    assert row.verdict is verdict
    assert not results.broken
