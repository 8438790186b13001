"""What a front that melts or freezes puts a probe off by, because it goes from node to node, is told of the probe."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "thermal_fmu"))
from test_fronts import neumann

from coupler import load_scenario, run
from coupler.running.resume import resume
from coupler.scenario.probes import Probe
from coupler.trust.in_space import fronts

SLAB = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials:
  a: {{rho: 2600, k: {{solid: 240, liquid: 100}}, c: {{solid: 900, liquid: 1100}}, latent: {{L: 390e3, {latent}}}}}
bodies:
  p: {{mesh: {{rectangle: {{origin: [0, 0], size: [0.2, 0.01], cells: [{n}, 1]}}}}, material: a, T0: 973}}
thermal: {{boundary: [{{on: p.left, temperature: 773}}]}}
mechanical: {{half: rigid}}
coupling: {{end: 8}}
output: {{checkpoint: 0}}
probes:
  near: {{T: {{at: [0.013, 0.005], body: p}}}}
  far: {{T: {{at: [0.15, 0.005], body: p}}}}
  frozen: {{f_s: {{mean: p}}}}
"""


def slab(folder, n, latent="T_m: 933"):
    file = folder / "slab.yaml"
    file.write_text(SLAB.format(n=n, latent=latent))
    return load_scenario(file)


def row(results):
    return {check.name: check for check in results.trust}.get(fronts.NAME)


def test_a_point_that_a_front_passes(tmp_path):
    """12 % off, and told 13 %.  It was told 0.3 %, by its windows alone."""
    results = run(slab(tmp_path, 40), tmp_path / "run.h5")
    t, T = results.probe("near")
    true = np.array([abs(value - float(neumann(np.array([0.013]), now)[0]))
                     for now, value in zip(t, T, strict=True) if now > 1.0])
    told = results.probe_errors["near"].mesh
    assert 0.5 * true.max() < told < 2.0 * true.max()
    assert row(results).verdict.value == "noted"
    assert results.probe_errors["far"].mesh < 0.02 * told
    # Of solid fractions halved cells tell (probed.py).
    assert 0.0 < results.probe_errors["frozen"].mesh < 0.1 * results.probe_errors["frozen"].range
    assert not results.broken
    # Frames have it of each node; of each window, where it costs more than a step, its extremes are not kept.
    at, off = results.field("thermal.mesh.T_front_off")
    assert off.shape == (at.size, 82)
    assert np.abs(off).max() > 0.5 * told
    assert not [name for name in results.extremes if "front_off" in name]


def test_a_range_of_melting_that_cells_resolve_is_no_front(tmp_path):
    results = run(slab(tmp_path, 30, "T_s: 783, T_l: 973"), tmp_path / "run.h5")
    assert row(results).verdict.value == "holds"


def test_a_run_that_went_on_tells_the_same(tmp_path):
    whole = run(slab(tmp_path, 20), tmp_path / "whole.h5")
    run(slab(tmp_path, 20), tmp_path / "part.h5", until=4.0)
    assert resume(tmp_path / "part.h5").probe_errors["near"] == whole.probe_errors["near"]


def point(quantity="T"):
    return Probe(quantity, "K", "point", np.array([0, 1], dtype=np.int32), np.array([0.5, 0.5]))


def test_the_largest_of_all_windows_counts():
    log, T = fronts.FrontLog(), np.array([300.0, 310.0])
    log = fronts.watched(log, {"a": point(), "p": point("p")}, T, None, 0.0)
    for k, off in enumerate(([0.0, 2.0], [-8.0, 4.0], [-1.0, 1.0], [math.nan, 0.0])):
        log = fronts.watched(log, {"a": point(), "p": point("p")}, T - 10.0 * k, np.array(off), k + 1.0)
    (one,) = log.of.values()
    assert (one.by, one.t, one.low, one.high) == (2.0, 2.0, 275.0, 305.0)
    (check,) = fronts.checks(log)
    assert check.number == pytest.approx(2.0 / 30.0)
    assert "probe a may be off by 2 K" in check.what


def test_the_hottest_place_is_off_by_what_it_would_be_elsewhere():
    """The hottest node is not off, but the next one would be hotter."""
    hottest = Probe("T", "K", "max", np.array([0, 1], dtype=np.int32), np.zeros(2))
    log = fronts.watched(fronts.FrontLog(), {"a": hottest}, np.array([300.0, 310.0]), np.array([15.0, 0.0]), 1.0)
    assert log.of["a"].by == 5.0


def test_nothing_is_told_of_scenes_without_probes_or_fronts():
    assert fronts.checks(fronts.FrontLog()) == ()
    assert fronts.checks(fronts.watched(fronts.FrontLog(), {"a": point()}, np.full(2, 300.0), np.zeros(2), 1.0))[0]\
        .verdict.value == "holds"
