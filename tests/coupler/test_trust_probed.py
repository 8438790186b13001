"""What a mesh puts a probe of temperature, solid fraction or heat off by is told of the probe, whenever it happens."""

from __future__ import annotations

import numpy as np
import pytest

from coupler import load_scenario, run
from coupler.errors import ResultsError
from coupler.running.resume import resume
from coupler.trust.in_space import probed
from coupler.trust.in_space.probed import ProbedLog

WALL = """
slideline: 2
units: {{temperature: K}}
geometry: plane
materials:
  m: {{rho: 7800, k: 40, c: 480}}
bodies:
  a: {{mesh: {{rectangle: {{origin: [0, 0], size: [0.02, 0.01], cells: [{n}, 1]}}}}, material: m, T0: 300}}
  b: {{mesh: {{rectangle: {{origin: [0.02, 0], size: [0.02, 0.01], cells: [{n}, 1]}}}}, material: m, T0: 300}}
contact:
  f: {{slave: a.right, master: b.left, gap_max: 0.001, conduction: {{closed: {{law: constant, h: 5000}}, open: null}}}}
thermal:
  boundary: [{{on: a.left, temperature: {{t: [0, 20, 200, 201, 300], value: [300, 400, 400, 300, 300]}}}},
             {{on: b.right, convection: {{h: 500, T: 300}}}}]
mechanical: {{half: rigid, rigid: {{pressure: {{f: 1e6}}}}}}
coupling: {{end: 300}}
output: {{checkpoint: 0}}
probes:
  deep: {{T: {{at: [0.01, 0.005], body: a}}}}
  other: {{T: b.left.centre}}
  mean: {{T: {{mean: a}}}}
  heat: {{"heat.pair.f[2]": value}}
"""


def wall(folder, n, **change):
    file = folder / f"wall{n}.yaml"
    file.write_text(WALL.format(n=n))
    return load_scenario(file, change)


def row(results):
    return {check.name: check for check in results.trust}[probed.NAME]


def test_a_wall_that_is_cooled_late(tmp_path, monkeypatch):
    """Its mean temperature is 15 K of 91 off for some seconds after 200 s, and was told 0.05 K: by windows alone."""
    kinks, kinked = [], probed.kinked
    monkeypatch.setattr(probed, "kinked", lambda log: kinks.append(log.t) or kinked(log))
    some, exact = (run(wall(tmp_path, n), tmp_path / f"{n}.h5") for n in (2, 16))
    assert kinks == [20.0, 200.0, 201.0] * 2
    for name in ("deep", "mean", "heat"):
        t, values = some.probe(name)
        off = np.abs(np.interp(t, *exact.probe(name)) - values)[t > 0.5].max()
        told = some.probe_errors[name]
        assert off / 3.0 < told.mesh < 3.0 * off, (name, off, told)
        assert name != "mean" or told.mesh > 0.6 * off
        assert exact.probe_errors[name].mesh < 0.2 * told.mesh
    assert row(some).verdict.value == "noted"
    assert row(some).t > 200.0
    assert not some.broken
    assert row(exact).verdict.value == "holds"
    # It costs more than a step, so frames have nothing of it.
    with pytest.raises(ResultsError):
        some.field("thermal.mesh.halved.T")


def test_a_run_that_went_on_tells_the_same(tmp_path):
    whole = run(wall(tmp_path, 2), tmp_path / "whole.h5")
    run(wall(tmp_path, 2), tmp_path / "part.h5", until=150.0)
    assert resume(tmp_path / "part.h5").probe_errors == whole.probe_errors


def course(times, values, end=100.0, off=lambda t: 0.0, kinks=(), n=0):
    """The log of a probe that goes through values at times, and when it was looked at."""
    log, at = probed.begun({"a": values(0.0)}, n), []
    before = 0.0
    for t in times:
        log, speeds = probed.after(log, {"a": values(t)}, t, end)
        if probed.due(log, speeds, t - before, kink=t in kinks, at_end=t == times[-1]):
            log, at = probed.looked(log, speeds, {"a": off(t)}), [*at, t]
        log, before = (probed.kinked(log) if t in kinks else log), t
    return log, at


def test_looks_are_where_most_is_to_be_seen():
    every = [float(t) for t in range(1, 101)]
    _, at = course(every, lambda t: 1.0 * t)
    assert at == [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 100.0]
    # Behind a kink it begins anew, and at the end of what goes before.
    _, at = course(every, lambda t: 1.0 * t, kinks=(70.0,))
    assert {70.0, 71.0, 72.0, 74.0, 78.0} <= set(at)
    # A probe that begins to move fast is looked at where it is fastest.
    _, at = course(every, lambda t: np.tanh((t - 50.0) / 3.0) + 0.001 * t)
    assert any(48.0 <= t <= 51.0 for t in at)
    # What was looked at before it began cost nothing in the end.
    _, at = course(every, lambda t: 1e-3 * (t % 7.0) + (t > 60.0) * (t - 60.0) ** 2, kinks=every[1:60])
    assert {61.0, 62.0, 63.0} <= set(at)
    assert len([t for t in at if t <= 60.0]) >= 12
    # Not in the first moment behind a kink, when all meshes are as wrong.
    _, at = course([1e-3, 0.05, 0.09, 1.0, 2.0, 100.0], lambda t: t**0.5)
    assert at[0] == 1.0


def test_looks_cost_no_more_than_a_share_of_the_windows():
    every = [float(t) for t in range(1, 1001)]
    _, at = course(every, lambda t: (1.0 + t) ** 4 * np.sin(t), 1000.0, kinks=set(every[::2]))
    often = probed.OFTEN
    most = often.at_first + often.over_the_run + probed.ON_CREDIT + often.earned * 1000 + often.given_back + 1
    assert len(at) <= most
    assert len([t for t in at if t > 800.0]) >= 5
    # Fewer where each costs more.
    _, few = course(every, lambda t: (1.0 + t) ** 4 * np.sin(t), 1000.0, kinks=set(every[::2]), n=7500)
    assert len(at) / 4.0 < len(few) < len(at) / 2.0


def verdict(offs, slight=0.0, end=100.0):
    log = probed.begun({"a": 300.0})
    for t, by in offs:
        log, speeds = probed.after(log, {"a": 400.0}, t, end)
        log = probed.looked(log, speeds, {"a": by})
    (check,) = probed.checks(log, {"a": "K"}, {"K": slight})
    return check.verdict.value, check.number


def test_what_lasts_breaks_a_run():
    assert verdict([(50.0, 1.0)]) == ("holds", 0.01)
    assert verdict([(10.0, 10.0), (20.0, 1.0)]) == ("noted", 0.1)
    # What is soon gone is told, and breaks nothing.
    assert verdict([(10.0, 40.0), (10.5, 30.0), (90.0, 1.0)]) == ("noted", 0.4)
    assert verdict([(10.0, 40.0), (20.0, 30.0), (90.0, 1.0)]) == ("broken", 0.3)
    assert verdict([(90.0, 1.0), (100.0, 30.0)]) == ("broken", 0.3)
    # Nor is a hair of what windows may err by.
    assert verdict([(90.0, 1.0), (100.0, 30.0)], slight=30.0)[0] == "holds"


def test_nothing_is_told_of_what_is_not_known():
    assert probed.checks(ProbedLog(), {}) == ()
    assert probed.checks(probed.begun({"a": 300.0}), {"a": "K"}) == ()
    assert probed.off_of(probed.begun({"a": 300.0})) == {"a": 0.0}


@pytest.mark.parametrize("off", [0.0, 1e-12])
def test_a_probe_that_rests_is_off_by_nothing(off):
    log = probed.begun({"a": 300.0})
    log, speeds = probed.after(log, {"a": 300.0}, 1.0, 1.0)
    (check,) = probed.checks(probed.looked(log, speeds, {"a": off}), {"a": "K"}, {"K": 1e-3})
    assert check.verdict.value == "holds"
