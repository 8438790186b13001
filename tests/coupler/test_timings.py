"""Where the time of a window went: measured at the halves' calls, kept in run.h5, drawn, and given out as a trace."""

from __future__ import annotations

import json
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from contact.rpc.link import Waits
from coupler import Results, load_scenario
from coupler.cli.cli import app
from coupler.fmu import metered
from coupler.fmu.half import Advance, Status
from coupler.fmu.metered import CALLS, PARTS, Meter, MeteredHalf
from coupler.record.tables import TIMING_FIELDS
from coupler.record.trace import trace_of
from coupler.report.timeline import LAYERS, shares_over_time, typical
from coupler.running.resume import resume
from coupler.running.run import Run, run

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios/casting_1d.yaml"
CHANGED = {"coupling.end": 0.08}
WHOLE = ("thermal", "mechanical", "thermal_contact", "mechanical_contact", "border", "transport", "states", "coupler")


@pytest.fixture(scope="module", params=[False, True], ids=["embedded", "processes"])
def results(request, tmp_path_factory) -> Results:
    return run(load_scenario(SCENARIO, CHANGED), tmp_path_factory.mktemp("timed") / "run.h5", processes=request.param)


class Clock:
    """A clock that stands still until it is told otherwise."""

    now = 0.0

    def perf_counter(self) -> float:
        return self.now


class Slow:
    """A half whose calls take so many seconds of a clock."""

    name, blocks, strings, can_save, can_serialise = "slow", {}, {}, True, True

    def __init__(self, clock: Clock) -> None:
        self.clock = clock

    def advance(self, t, h, inputs, outputs):
        self.clock.now += 10.0
        return Advance(Status.OK, "", {}, 7.0, border=1.0, transport=1.5, waited=2.0, requests=3)

    def save(self):
        self.clock.now += 0.5
        return 1

    def read(self, names, finite=True):
        self.clock.now += 4.0
        return {}


def test_every_second_of_a_window_is_in_one_part(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(metered, "time", clock)
    meter = Meter(spent=100.0)
    thermal, mechanical = (MeteredHalf(Slow(clock), side, meter) for side in ("thermal", "mechanical"))
    thermal.read(())  # before the window: no part of it
    clock.now = 50.0
    meter.begin()
    thermal.save()
    thermal.advance(0.0, 1.0, {}, ())
    mechanical.advance(0.0, 1.0, {}, ())
    mechanical.advance(1.0, 1.0, {}, ())
    clock.now += 0.25
    meter.solved()
    mechanical.read(())
    timing = meter.end()
    parts = dict(zip(PARTS, timing.parts, strict=True))
    assert parts == {"begun": 100.0, "seconds": 30.75, "thermal": 5.0, "mechanical": 10.0, "thermal_contact": 2.0,
                     "mechanical_contact": 4.0, "border": 3.0, "transport": 4.5, "states": 0.5, "coupler": 1.75,
                     "thermal_wait": 20.25, "mechanical_wait": 10.75, "record": 4.0, "calls": 5, "requests": 9,
                     "overlap": 0.0}
    assert timing.calls[:, 2].tolist() == [0.0, 0.5, 10.5, 20.5, 30.75]
    meter.begin()
    clock.now += 1.0
    meter.solved()
    assert meter.end().parts[:2].tolist() == [134.75, 1.0]


def test_waiting_for_contact_is_counted_also_where_it_fails():
    class Link:
        def ask(self, request):
            time.sleep(0.02)
            raise ValueError("asked")

        def close(self): ...

    waits = Waits()
    for _ in range(2):
        with pytest.raises(ValueError, match="asked"):
            waits.ask(Link(), None)
    assert waits.requests == 2
    assert 0.04 <= waits.seconds < 2.0


@pytest.mark.few("embedded")
def test_a_run_tells_where_the_time_of_each_window_went(results):
    w, timings = results.windows, results.timings
    assert timings.dtype.names == tuple(n for n, _ in TIMING_FIELDS)
    assert len(timings) == len(w) > 3
    assert sum(timings[n] for n in WHOLE) == pytest.approx(timings.seconds, rel=1e-9)
    # A window's own work does not count the spare solves that look at the error of probes; its timing does.
    steps = np.bincount(results.calls.window[results.calls.call == CALLS.index("advance")])
    assert steps.sum() == w.solves.sum() + results.totals["looks"]["solves"]
    plain = steps == w.solves
    assert plain.any()
    for side in ("thermal", "mechanical"):
        whole = timings[side] + timings[f"{side}_contact"]
        assert whole[plain] == pytest.approx(w[f"{side}_seconds"][plain], abs=1e-9)
        assert (whole >= w[f"{side}_seconds"] - 1e-9).all()
    assert (timings.thermal_contact > 0.0).all()
    assert (timings.mechanical_contact > 0.0).all()
    assert (timings.requests >= 2).all()
    assert (timings.coupler > 0.0).all()
    assert (timings.record > 0.0).all()
    assert (timings.transport > 0.0).all() if results.header["processes"] else (timings.transport == 0.0).all()
    # One window after the other, and each timing is that of its own window.
    assert (timings.begun[1:] >= (timings.begun + timings.seconds + timings.record)[:-1]).all()
    assert (timings.seconds >= w.seconds).all()
    assert np.bincount(results.calls.window).tolist() == timings.calls.tolist()


@pytest.mark.few("embedded")
def test_the_trace_has_every_call_in_its_window(results, tmp_path):
    out = tmp_path / "t.json"
    said = CliRunner().invoke(app, ["trace", str(results.path), "--out", str(out)])
    assert said.exit_code == 0, said.output
    trace = json.loads(out.read_text())
    assert trace == trace_of(results)
    events = [e for e in trace["traceEvents"] if e["ph"] == "X"]
    windows = [e for e in events if e["name"] == "window"]
    steps = [e for e in events if e["name"] == "advance"]
    inside = [e for e in events if e["name"] == "work and contact"]
    assert len(windows) == len(results.windows)
    assert len(steps) == len(inside) == results.windows.solves.sum() + results.totals["looks"]["solves"]
    rounded = 0.02  # us, and in float32 of its seconds
    for step, work in zip(steps, inside, strict=True):
        window = windows[step["args"]["window"]]
        slack = rounded + 1e-6 * window["dur"]
        assert window["ts"] - slack <= step["ts"]
        assert step["ts"] + step["dur"] <= window["ts"] + window["dur"] + slack
        assert work["ts"] + 0.5 * work["dur"] == pytest.approx(step["ts"] + 0.5 * step["dur"], abs=slack)
        assert work["dur"] <= step["dur"] + slack
        assert work["tid"] == step["tid"] > 0
    assert CliRunner().invoke(app, ["trace", str(results.path), "--out", str(results.path)]).exit_code != 0


def test_windows_that_were_rewound_leave_no_times(tmp_path):
    out = tmp_path / "run.h5"
    with Run(load_scenario(SCENARIO, CHANGED), out) as r:
        windows = r.windows()
        next(windows)
        snapshot = r.keep()
        for _ in range(2):
            next(windows)
        r.rewind(snapshot)
    results = Results(out)
    assert len(results.timings) == len(results.windows) == 1
    assert set(results.calls.window) == {0}
    # The time of the one window that stands is its own, and a run that goes on tells the time after it.
    assert np.isfinite(results.timings.begun).all()
    after = resume(out)
    known = after.timings[np.isfinite(after.timings.begun)]
    assert len(after.timings) == len(after.windows)
    assert len(known) >= len(after.windows) - 1
    assert (np.diff(known.begun) > 0.0).all()


def test_shares_of_time_are_those_of_the_windows():
    fields = [(n, "f8") for n, _ in TIMING_FIELDS]
    rows = np.zeros(3, dtype=fields).view(np.recarray)
    rows.begun, rows.seconds, rows.record = [0.0, 6.0, np.nan], [4.0, 2.0, np.nan], [1.0, 2.0, np.nan]
    rows.thermal, rows.transport = [3.0, 0.5, np.nan], [1.0, 1.5, np.nan]
    edges, shares = shares_over_time(SimpleNamespace(timings=rows))
    assert edges.tolist() == [0.0, 5.0, 10.0]
    by = dict(zip((name for name, _ in LAYERS), shares.tolist(), strict=True))
    assert by["thermal half"] == pytest.approx([0.6, 0.1])
    assert by["messages"] == pytest.approx([0.2, 0.3])
    assert by["recording"] == pytest.approx([0.2, 0.4])
    rows = rows[[0, 1, 1, 1, 1, 1, 1, 1]]
    rows.begun = np.arange(8) * 10.0
    edges, shares = shares_over_time(SimpleNamespace(timings=rows))
    assert (shares * np.diff(edges)).sum(axis=1)[[0, 4, 7]] == pytest.approx([6.5, 11.5, 15.0])
    taken = SimpleNamespace(taken=np.array([False] + [True] * 7))
    assert typical(SimpleNamespace(timings=rows, windows=taken)) == 4


def test_a_run_without_timings_has_no_trace_and_no_timeline(results):
    bare = SimpleNamespace(path=Path("old.h5"), timings=results.timings[:0], windows=results.windows[:0])
    with pytest.raises(Exception, match="no timings"):
        trace_of(bare)
    assert typical(bare) is None
    assert not len(shares_over_time(bare)[0])
