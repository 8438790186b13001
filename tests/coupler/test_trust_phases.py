"""Errors of what moves with inertia: told as large as they are, for one wave and for many, resolved and not."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from coupler import load_scenario, run
from coupler.trust.in_time import course, errors, phases
from coupler.trust.in_time.errors import Looked

Array = NDArray[np.float64]


class Waves:
    """Waves sum of A cos(w t), solved by the trapezoidal rule (Newmark 1/4, 1/2), wave by wave.

    A step of H turns the phase of a wave by 2 atan(w H/2), and keeps its energy.
    """

    def __init__(self, A: Array, w: Array, H: float, windows: int, looks: int) -> None:
        """looks : every so many windows one is looked at."""
        self.H, self.windows, self.t = H, windows, H * np.arange(windows + 1)
        one, two = 2.0 * np.arctan(w * H / 2.0), 4.0 * np.arctan(w * H / 4.0)
        at = np.arange(windows + 1)[:, None] * one
        self.v = np.cos(at) @ A
        # One window more, in one and in its two halves, from each level but the last: 4/3 of their distance.
        self.error = np.abs((np.cos(at[:-1] + two) - np.cos(at[:-1] + one)) @ A) * 4.0 / 3.0
        self.true = np.abs(self.v - np.cos(self.t[:, None] * w) @ A).max()
        self.looks = looks

    def told(self, lasts: bool = True) -> float:
        log = errors.begun(self.v[:1], 0.0, np.array([lasts]))
        path = course.begun(0.0, self.v[:1])
        for k in range(self.windows):
            path, second = course.after(path, self.t[k + 1], self.v[k + 1:k + 2])
            found = self.error[k:k + 1] if k % self.looks == 0 else np.empty(0)
            log = errors.watched(log, Looked(self.v[k + 1:k + 2], second, found), self.t[k + 1])
        return float(errors.estimated(log)[0])


@pytest.mark.parametrize("looks", [1, 13])
@pytest.mark.parametrize("a_period", [15, 40, 160])
@pytest.mark.parametrize("periods", [0.75, 5, 20])
def test_one_wave_is_told_as_wrong_as_its_phase(a_period: int, periods: float, looks: int) -> None:
    waves = Waves(np.ones(1), np.array([2.0 * math.pi]), 1.0 / a_period, round(periods * a_period), looks)
    assert 0.4 < waves.told() / waves.true < 2.5


def bar(n: int) -> tuple[Array, Array]:
    """Amplitudes and frequencies of the end of a bar that is pulled at once: a triangular wave of period 4."""
    k = 2.0 * np.arange(n) + 1.0
    return 8.0 / (math.pi * k)**2, k * math.pi / 2.0


@pytest.mark.parametrize("looks", [1, 13])
@pytest.mark.parametrize(("periods", "H"), [(2, 0.2), (10, 0.2), (40, 0.2), (2, 0.05), (10, 0.05), (2, 0.0125)])
def test_the_many_waves_of_a_bar_do_not_add_up_for_ever(periods: int, H: float, looks: int) -> None:
    waves = Waves(*bar(40), H, round(4 * periods / H), looks)
    assert 0.3 < waves.told() / min(waves.true, 2.0) < 3.0


@pytest.mark.parametrize(("share", "fast"), [(0.02, 5.0), (0.1, 5.0), (0.02, 12.0), (0.1, 12.0)])
def test_waves_on_top_of_a_slow_one_do_not_hide_it(share: float, fast: float) -> None:
    """Its phase goes on where those of the others are spent."""
    waves = Waves(np.array([1.0, share]), np.array([1.0, fast]), 0.05, 4000, 7)
    assert 0.4 < waves.told() / waves.true < 4.0


@pytest.mark.parametrize(("lasts", "all_of_it"), [(False, 7.73), (True, 20.5)])
def test_what_does_not_move_with_inertia_forgets(lasts: bool, all_of_it: float) -> None:
    """A body that cools by exp(-t), each window 1e-3 of it wrong: windows add up to 20.5 e-3, less where they fade."""
    t = 0.05 * np.arange(201)
    v, log = np.exp(-t), errors.begun(np.ones(1), 0.0, np.array([lasts]))
    path = course.begun(0.0, v[:1])
    for k in range(200):
        path, second = course.after(path, t[k + 1], v[k + 1:k + 2])
        log = errors.watched(log, Looked(v[k + 1:k + 2], second, 1e-3 * v[k:k + 1]), t[k + 1])
    assert float(errors.estimated(log)[0]) == pytest.approx(1e-3 * all_of_it, rel=0.01)


@pytest.mark.parametrize("every", [3, 5, 20])
def test_kinks_of_the_data_make_no_wave_faster(every: int) -> None:
    """A body on a table with many points: differences that reach back over one of these tell nothing of its waves."""
    k = np.arange(601)
    wave, table = np.cos(0.3 * k), 20.0 * np.abs((k / every) % 2.0 - 1.0)
    fast = []
    for kinks in (0.0, 1.0):
        went, log = np.diff(wave + kinks * table), phases.begun(np.array([True]))
        for n, step in enumerate(went):
            log = phases.watched(log, np.array([step]), 1.0, np.ones(1), bool(kinks) and n % every == 0)
        fast.append(float(log.thirds[0] / log.seconds[0]))
    assert fast[0] == pytest.approx(2.0 * math.sin(0.15), rel=1e-2)
    assert fast[1] == pytest.approx(fast[0], rel=0.05)


STRIP = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials: {{rubber: {{rho: 1000, k: 1, c: 1000, E: 1.0e+7, nu: 0, alpha: 0}}}}
bodies:
  strip: {{mesh: {{rectangle: {{origin: [0, 0], size: [1, 0.05], cells: [6, 1]}}}}, material: rubber, T0: 300}}
thermal: {{}}
mechanical:
  half: elastic
  elastic:
    element: enhanced
    dynamics: {{}}
    gravity: {{y: {{t: [0, 0], value: [0, -0.01]}}}}
    boundary: [{{on: strip.left, u_x: 0, u_y: 0}}]
coupling: {{end: 4{windows}}}
probes: {{tip: {{u_y: strip.right.centre}}}}
"""


def swung(folder: Path, name: str, windows: str) -> tuple[Array, Array, float]:
    (path := folder / f"{name}.yaml").write_text(STRIP.format(windows=windows))
    results = run(load_scenario(path), out=folder / f"{name}.h5")
    t, y = results.probe("tip")
    return np.asarray(t), np.asarray(y), results.probe_errors["tip"].error


@pytest.mark.parametrize("windows", ["", ", windows: [{until: 4, size: 0.04}]"])
def test_a_strip_that_swings_is_told_as_wrong_as_it_is(tmp_path: Path, windows: str) -> None:
    t, y, told = swung(tmp_path, "run", windows)
    fine, exact, _ = swung(tmp_path, "fine", ", windows: [{until: 4, size: 0.008}]")
    true = np.abs(y - np.interp(t, fine, exact)).max()
    assert 0.5 < told / true < 3.5


BAR = """
slideline: 2
units: {temperature: K}
geometry: plane
materials: {m: {rho: 1000, k: 1.0e-6, c: 1000, E: 1.0e+7, nu: 0.3, alpha: 1.0e-3, T_ref: 300}}
bodies: {bar: {mesh: {rectangle: {origin: [0, 0], size: [1, 0.1], cells: [2, 1]}}, material: m, T0: 300}}
thermal: {}
mechanical:
  half: elastic
  elastic:
    dynamics: {}
    thermoelastic_heat: true
    boundary:
    - {on: bar.left, u_x: 0}
    - {on: bar.bottom, u_y: 0}
    - {on: bar.top, u_y: 0}
    - {on: bar.right, t_x: {t: [0, 0], value: [0, 1.0e+4]}}
coupling: {end: 0.2, windows: [{until: 0.2, size: %g}]}
probes: {T: {T: {mean: bar}}}
"""


def test_heat_of_a_wave_is_told_as_wrong_as_it_is(tmp_path: Path) -> None:
    runs = {}
    for size in (1e-3, 2e-4):
        (path := tmp_path / f"{size}.yaml").write_text(BAR % size)
        results = run(load_scenario(path), out=path.with_suffix(".h5"))
        runs[size] = *(np.asarray(x) for x in results.probe("T")), results.probe_errors["T"].error
    (t, T, told), (fine, exact, _) = runs.values()
    true = np.abs(T - np.interp(t, fine, exact)).max()
    assert 1.2 < told / true < 3.0
