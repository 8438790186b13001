"""A run between two of its windows: shown, changed, kept, and taken back to what was kept."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupler import Results, Run, ScenarioError, load_scenario, run
from coupler.errors import CouplingError
from coupler.report.page import render
from coupler.running.resume import resume
from coupler.scenario import Scenario
from coupler.scenario.rule_model import Rule, Stop, Test, When

sys.path.insert(0, str(Path(__file__).parent))
from scenario_text import ROOT

SHORT: dict[str, Any] = {"coupling.end": 1.0, "output.fields.every": 5,
                         "coupling.windows": [{"until": 1, "size": 0.05}]}
CLOCKS = ("thermal_seconds", "mechanical_seconds", "fmi_seconds", "seconds", "recording_seconds")


def casting(**more: object) -> Scenario:
    return load_scenario(ROOT / "scenarios/casting_1d.yaml", SHORT | more)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return run(casting(), tmp_path_factory.mktemp("plain") / "run.h5")


@pytest.fixture(scope="module")
def unchanged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """A run before its first window; whoever takes it leaves it so."""
    with Run(casting(), tmp_path_factory.mktemp("unchanged") / "run.h5") as r:
        yield r


def same(a: Results, b: Results) -> None:
    """Bit for bit, but for clocks."""
    assert a.t.tolist() == b.t.tolist()
    for name in a.probe_names:
        np.testing.assert_array_equal(a.probe(name)[1], b.probe(name)[1])
    assert a.ledger == b.ledger
    for name in a.windows.dtype.names:
        if name not in CLOCKS:
            np.testing.assert_array_equal(a.windows[name], b.windows[name], err_msg=name)
    for half in a.field_files:
        assert a.field_files[half].stat().st_size == b.field_files[half].stat().st_size


def test_rewinding_leaves_no_trace_but_what_it_cost(plain: Results, tmp_path: Path) -> None:
    with Run(casting(), tmp_path / "run.h5") as r:
        steps = r.windows()
        for _ in range(7):
            next(steps)
        moment = r.keep()
        for turn in range(2):
            r.change(scheme="iterated", window_cap=0.02 + 0.01 * turn)
            for _ in range(4):
                next(steps)
            assert r.state.now.t > moment.t
            r.rewind(moment)
            assert r.state.now.t == moment.t
            assert r.monitors() == {}
        for _ in steps:
            pass
    results = Results(tmp_path / "run.h5")
    same(plain, results)
    assert results.notes == plain.notes
    assert results.rewound["windows"] == 8
    assert results.rewound["thermal_solves"] >= 16
    assert plain.rewound == {}


def test_a_run_that_ended_may_be_rewound_and_a_rewound_one_resumed(plain: Results, tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    with Run(casting(**{"output.checkpoint": 0}), out) as r:
        first = r.keep()
        for _ in r.windows(until=0.5):
            pass
        r.rewind(first)
        for _ in r.windows(until=0.3):
            pass
    assert Results(out).t[-1] == pytest.approx(0.3)
    same(plain, resume(out))


def test_later_moments_are_let_go(tmp_path: Path) -> None:
    with Run(casting(), tmp_path / "run.h5") as r:
        steps = r.windows()
        next(steps)
        early = r.keep()
        next(steps)
        late = r.keep()
        r.rewind(early)
        r.rewind(early)
        with pytest.raises(CouplingError, match="was released"):
            r.rewind(late)


def test_changes_hold_from_the_next_window_on_and_are_told(tmp_path: Path) -> None:
    with Run(casting(), tmp_path / "run.h5") as r:
        steps = r.windows()
        for _ in range(4):
            next(steps)
        before = r.monitors()
        assert before["t"] == r.state.now.t
        assert before["window"] == pytest.approx(0.05)
        assert set(before) >= {"imbalance", "max_T", "iterations", *r.scenario.probes}
        r.change(scheme="iterated", substeps={"thermal": 2}, window_cap=0.025,
                 inputs={"thermal": {"control.method": 2}})
        for _ in range(3):
            shown = next(steps)
        assert shown.scheme == "iterated"
        assert pytest.approx(0.025) == shown.H
        r.change(rules=[Rule("enough", When(all=(Test("t", above=0.5),)), (Stop("enough"),))])
        for _ in steps:
            pass
    results = Results(tmp_path / "run.h5")
    w = results.windows
    assert w.scheme.tolist() == ["extrapolated"] * 4 + ["iterated"] * (len(w) - 4)
    assert (w.thermal_solves[4:] % 2 == 0).all()
    assert w.thermal_solves[4:].max() >= 4
    assert results.outcome == "completed"
    assert "enough" in results.message
    assert results.t[-1] == pytest.approx(0.525, abs=0.03)
    assert any("changed at t = 0.2 s" in n and "window_cap 0.025" in n for n in results.notes)
    assert [f.rule for f in results.firings] == ["enough"]
    assert results.heat_imbalance < 1e-10


@pytest.mark.parametrize(("changes", "named"), [
    ({"scheme": "iterative"}, "iterative"), ({"window_cap": 0.0}, "window_cap"), ({"speed": 2}, "speed"),
    ({"substeps": {"thermal": 0}}, "substeps.thermal"), ({"substeps": {"contact": 2}}, "substeps.contact"),
    ({"inputs": {"thermal": {"load.nothing": 1.0}}}, "load.nothing"), ({"inputs": {"both": {}}}, "inputs.both")])
def test_what_cannot_be_changed_is_named(changes: dict[str, Any], named: str, unchanged: Run) -> None:
    settings = unchanged._at.control.settings
    with pytest.raises(ScenarioError, match=named):
        unchanged.change(**changes)
    assert unchanged._at.control.settings is settings


@pytest.mark.slow
def test_windows_of_their_own_size_are_recorded_with_reason_error_and_scheme(tmp_path: Path) -> None:
    scenario = casting(**{"coupling.adaptive": {"first": 0.02, "most": 0.3}, "coupling.scheme": "iterated"})
    results = run(scenario, tmp_path / "run.h5")
    w = results.windows
    assert results.t[-1] == 1.0
    assert set(w.scheme) == {"iterated"}
    assert set(results.reasons) == set(range(len(w)))
    assert len(results.estimates)
    rows = results.estimates.window
    assert np.allclose(w.error[rows], np.nanmax([results.estimates[q] for q in (
        "temperature", "gap", "heat", "displacement", "elastic_strain")], axis=0))
    assert results.messages.keys() >= set(np.flatnonzero(~w.taken).tolist())
    page = render(results)
    assert "commonest reasons" in page
    assert "Estimated error of each window" in page
    assert results.heat_imbalance < 1e-10
