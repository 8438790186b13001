"""A clock of the machine that jumps: no deadline, no lease and no result depends on it."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import pytest

from coupler import Results, load_scenario, run
from coupler.running.status import status

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))
from killed_runs import differences  # noqa: E402

SCENARIO = HERE.parents[1] / "scenarios/casting_1d.yaml"
CHANGED = {"coupling.end": 0.1}
DAY = 86400.0


@pytest.mark.few("embedded")
@pytest.mark.parametrize("processes", [False, True], ids=["embedded", "processes"])
def test_a_clock_that_jumps_by_a_day_changes_nothing(tmp_path, monkeypatch, processes):
    out, right, jump = tmp_path / "run.h5", time.time, [0.0]
    monkeypatch.setattr(time, "time", lambda: right() + jump[0])
    seen = []

    def each(window):
        jump[0] = DAY if window.number % 2 else -DAY
        seen.append(status(out))

    run(load_scenario(SCENARIO, CHANGED), out, processes=processes, on_window=each)
    monkeypatch.undo()
    run(load_scenario(SCENARIO, CHANGED), tmp_path / "whole.h5")
    assert differences(tmp_path / "whole.h5", out) == []
    assert {s.state for s in seen} == {"running"}
    found = Results(out)
    assert (found.timings.seconds >= 0.0).all()
    assert found.totals["seconds"] < DAY
    assert found.totals["restarts"] == []
