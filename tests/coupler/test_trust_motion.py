"""The trust row on motion that windows do not resolve: an oscillation of n windows a period reads pi/n."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from contact.half.interface import Interface
from coupler import load_scenario, run
from coupler.trust.checks import Check, TrustVerdict
from coupler.trust.in_time.motion import LIMIT, NAME, NOTE_AT, Motion, MotionLog

HOLDS, NOTED, BROKEN, UNCHECKED = TrustVerdict


def scene(mu: float = 0.3) -> Interface:
    """A body on a floor, 0.1 m from the origin at most."""
    return cast(Interface, SimpleNamespace(bodies=("block", "floor"), pairs=(SimpleNamespace(mu=mu),),
                                           nodes=np.array([[0.1, 0.05], [0.0, 0.0]])))


def judged(u: np.ndarray, H: np.ndarray | float, *, mu: float = 0.3, model: dict[str, Any] | None = None,
           fresh: tuple[int, ...] = (), substeps: int = 1) -> Check:
    """The row for mean displacements u (n, 2) [m] of the block, in windows of H [s]; the floor rests."""
    motion = Motion({"dynamics": {}} if model is None else model, scene(mu), substeps)
    log, both = MotionLog(), np.stack([u, np.zeros_like(u)], axis=1)
    for k, size in enumerate(np.broadcast_to(H, len(u) - 1)):
        log = motion.watched(log, (both[k], both[k + 1]), float(size), k in fresh)
    return motion.checks(log)[0]


def along_y(y: np.ndarray) -> np.ndarray:
    return np.stack([np.zeros_like(y), y], axis=1)


@pytest.mark.parametrize(("windows", "verdict"), [(4, BROKEN), (12, NOTED), (24, HOLDS), (60, HOLDS)])
def test_an_oscillation_of_n_windows_a_period_reads_pi_over_n(windows: int, verdict: TrustVerdict) -> None:
    k = np.arange(40 * windows + 1)
    row = judged(along_y(1e-6 * np.sin(2 * math.pi * k / windows + 0.3)), 1e-5)
    assert row.number == pytest.approx(math.pi / windows, rel=0.12)
    assert row.verdict is verdict


@pytest.mark.parametrize("H", [1e-5, np.geomspace(1e-6, 1e-3, 60)])
def test_an_even_acceleration_reads_nothing(H: np.ndarray | float) -> None:
    t = np.concatenate([[0.0], np.cumsum(np.broadcast_to(H, 60))])
    assert judged(along_y(-0.5 * 9.81 * t**2), H).number < 1e-3


def test_a_body_that_rests_or_slides_evenly_is_not_told_by_its_round_off() -> None:
    noise = np.random.default_rng(1).normal(size=(200, 2))
    assert judged(1e-17 * noise, 1e-5).number == 0.0
    assert judged(np.stack([1e-3 * np.arange(200), np.zeros(200)], axis=1) + 1e-13 * noise, 1e-3).number == 0.0


def test_a_body_that_settles_on_its_contact_does_not_shake() -> None:
    """It sinks by 0.1 nm and stays, by a ten thousandth of its weight: that was told as an oscillation, with exit 4."""
    weighs = {"dynamics": {}, "gravity": {"y": -9.81}}
    settled = along_y(np.append(0.0, np.full(20, -1e-10)))
    assert not judged(settled, 6e-4, model=weighs).number > 0.0
    assert judged(settled, 6e-4).number > LIMIT
    k = np.arange(161)
    shaken = along_y(1e-6 * np.sin(math.pi * k / 2 + 0.3))
    assert judged(shaken, 1e-5, model=weighs).verdict is BROKEN


def test_a_force_that_jumps_at_a_breakpoint_is_no_oscillation() -> None:
    t = np.arange(101) * 1e-4
    y = np.where(t <= 5e-3, 0.5 * t**2, 1.25e-5 + 5e-3 * (t - 5e-3) - 0.5 * (t - 5e-3) ** 2)
    assert judged(along_y(y), 1e-4, fresh=(50,)).number < 1e-6 < judged(along_y(y), 1e-4).number


def test_a_body_that_hops_in_flights_reads_a_half() -> None:
    t = np.arange(401) * 1e-3
    in_flight = np.mod(t, 0.02)
    row = judged(along_y(0.5 * 9.81 * in_flight * (0.02 - in_flight)), 1e-3)
    assert row.number == pytest.approx(0.5, abs=0.05)
    assert row.verdict is BROKEN


def test_only_friction_heat_breaks_and_only_windows_are_judged() -> None:
    u = along_y(1e-6 * (-1.0) ** np.arange(50))
    assert judged(u, 1e-3).number == pytest.approx(1.0, abs=0.05)
    assert judged(u, 1e-3).verdict is BROKEN
    assert judged(u, 1e-3, mu=0.0).verdict is NOTED
    assert judged(u, 1e-3, substeps=4).verdict is judged(u, 1e-3, model={"method": "explicit"}).verdict is UNCHECKED
    assert judged(u[:2], 1e-3).verdict is UNCHECKED
    assert Motion({}, scene(), 1).checks(MotionLog()) == ()
    assert NOTE_AT < LIMIT


TEXT = """
slideline: 2
units: {temperature: K}
geometry: plane
materials: {steel: {rho: 7800, k: 50, c: 460, E: 2.1e11, nu: 0.3, alpha: 1.2e-5, T_ref: 300}}
bodies:
  floor: {mesh: {rectangle: {origin: [0, -0.05], size: [0.3, 0.05], cells: [11, 2]}}, material: steel, T0: 300}
  block: {mesh: {rectangle: {origin: [0.1, 0], size: [0.1, 0.04], cells: [5, 3]}}, material: steel, T0: 300}
contact: {foot: {slave: block.bottom, master: floor.top, gap_max: 0.01, friction: {mu: 0.3}}}
thermal: {}
mechanical:
  half: elastic
  elastic:
    gravity: {x: 4.905, y: -8.4957}
    dynamics: {rho_inf: 0.5}
    boundary: [{on: floor.bottom, u_x: 0, u_y: 0}]
coupling: {end: END, windows: [{size: WINDOW, until: END}], scheme: staggered}
"""


def incline(tmp_path: Path, window: float, end: float):
    file = tmp_path / "incline.yaml"
    file.write_text(TEXT.replace("END", str(end)).replace("WINDOW", str(window)), encoding="utf-8")
    results = run(load_scenario(file), out=tmp_path / "run.h5")
    return results, next(c for c in results.trust if c.name == NAME)


@pytest.mark.parametrize(("window", "end"), [(2e-3, 0.1), (2e-2, 0.1)])
def test_a_block_slides_down_an_incline_with_the_heat_of_its_way(tmp_path: Path, window: float, end: float) -> None:
    """It swings on its contact in 80 us.  In windows of 2 ms its friction heat was 0 to 1.3 of mu N s: energy that
    heat by the pressure at the ends of steps lacked was given back to it, and made it hop.
    """
    results, row = incline(tmp_path, window, end)
    assert row.verdict is HOLDS, (row.number, row.sentence)
    N, m = 7800 * 0.004 * 8.4957, 7800 * 0.004
    expected = 0.3 * N * 0.5 * (4.905 - 0.3 * N / m) * end**2
    assert results.totals["friction_heat"]["made"] == pytest.approx(expected, rel=0.6 * window + 1e-3)


@pytest.mark.slow
def test_a_swing_that_windows_resolve_holds(tmp_path: Path) -> None:
    _, row = incline(tmp_path, 2e-6, 2.4e-4)
    assert row.verdict is HOLDS, (row.number, row.sentence)


def test_by_defaults_a_block_slides_down_an_incline_in_few_windows(tmp_path: Path) -> None:
    """It took windows of a part of its swing on the contact, 1072 of 0.8 s, and lost 40 % of its heat."""
    file, end = tmp_path / "incline.yaml", 0.3
    text = TEXT.split("coupling:")[0] + f"coupling: {{end: {end}}}\nprobes: {{way: {{u_x: {{mean: block}}}}}}\n"
    file.write_text(text, encoding="utf-8")
    results = run(load_scenario(file), out=tmp_path / "run.h5")
    N, m = 7800 * 0.004 * 8.4957, 7800 * 0.004
    way = 0.5 * (4.905 - 0.3 * N / m) * end**2
    assert results.probe("way")[1][-1] == pytest.approx(way, rel=2e-3)
    assert results.totals["friction_heat"]["made"] == pytest.approx(0.3 * N * way, rel=0.02)
    assert len(results.windows) < 60
