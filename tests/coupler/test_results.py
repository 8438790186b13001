"""Results: what users read, what a killed run leaves, and that run.h5 is made whole or not at all."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

import coupler.record.finish as finish_module
from coupler.errors import ResultsError
from coupler.record.finish import finish
from coupler.record.paths import journal_of
from coupler.record.results import Results
from coupler.record.tables import WINDOW_FIELDS
from coupler.record.vtkhdf import FieldReader

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import (
    IMBALANCE,
    PROBES,
    TERMS,
    Case,
    blocks,
    level,
    probes_at,
    record,
    times_of,
    write_run,
)

CASE = Case()
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Results:
    return write_run(tmp_path_factory.mktemp("results") / "run.h5", CASE)


def test_probes_are_what_was_recorded_in_si_and_other_units(run: Results) -> None:
    scene, times = blocks(CASE.n), times_of(CASE)
    expected = np.array([probes_at(level(scene, t), CASE.n) for t in times])
    assert run.probe_names == tuple(PROBES)
    for i, name in enumerate(PROBES):
        t, value = run.probe(name)
        assert t.tolist() == times.tolist()
        assert np.array_equal(value, expected[:, i])
    assert np.allclose(run.probe("lower.top.left", "degC")[1], expected[:, 0] - 273.15, atol=1e-12)
    assert np.allclose(run.probe("gap", "mm")[1], 1e3 * expected[:, 4], rtol=1e-15)
    assert np.allclose(run.probe("pressure", "MPa")[1], 1e-6 * expected[:, 5], rtol=1e-15)
    assert [run.quantity(n) for n in ("lower.top.left", "gap", "pressure")] == ["T", "gap", "p"]
    assert [run.unit(n) for n in ("lower.top.left", "gap", "pressure")] == ["K", "m", "Pa"]


def test_unknown_probe_or_unit_says_what_there_is(run: Results) -> None:
    with pytest.raises(ResultsError, match=r"no probe 'lower.top.leftt'; it has lower.top.left, .*pressure"):
        run.probe("lower.top.leftt")
    with pytest.raises(ResultsError, match="no probe"):
        run.quantity("x")
    with pytest.raises(ResultsError, match="is in K; it cannot be given in 'mm', only in K, degC"):
        run.probe("lower.top.left", "mm")
    with pytest.raises(ResultsError, match="only in m, mm, um"):
        run.probe("gap", "furlong")


def test_windows_table(run: Results) -> None:
    w, rejected = run.windows, CASE.windows // CASE.reject
    assert w.dtype.names == tuple(n for n, _ in WINDOW_FIELDS)
    assert len(w) == CASE.windows + rejected
    assert (w["verdict"] == "accepted").sum() == CASE.windows
    assert (w.verdict == "thermal discard").sum() == rejected
    accepted = w[w.verdict == "accepted"]
    assert np.allclose(accepted.t + accepted.H, times_of(CASE)[1:])
    assert accepted.solves.sum() == 2 * CASE.windows
    assert accepted.max_p.max() == 1e7
    assert (w.recording_seconds > 0).all()
    assert run.messages == {int(k): CASE.message for k in np.flatnonzero(w.verdict != "accepted")}


def test_ledger_and_imbalance_by_construction(run: Results) -> None:
    expected = {n.removeprefix("heat."): e * CASE.windows for n, e in TERMS.items()}
    assert run.ledger == pytest.approx(expected, rel=1e-14)
    assert run.heat_imbalance == pytest.approx(IMBALANCE, rel=1e-12)
    t, history = run.ledger_history()
    assert len(t) == CASE.windows + 1
    assert np.allclose(history["temperature.in"], 70.0 * np.arange(CASE.windows + 1), rtol=1e-14)


def test_a_completed_run_leaves_only_its_files(run: Results) -> None:
    names = {p.name for p in run.path.parent.iterdir()}
    assert names == {"run.h5", "run.thermal.vtkhdf", "run.mechanical.vtkhdf"}
    assert (run.outcome, run.message, run.later) == ("completed", "", None)
    assert run.totals["setup_seconds"] == 0.5
    assert run.header["title"] == CASE.title


def test_missing_foreign_and_damaged_files_are_named(tmp_path: Path, run: Results) -> None:
    with pytest.raises(ResultsError, match=r"none\.h5: no such results file"):
        Results(tmp_path / "none.h5")
    foreign = tmp_path / "foreign.h5"
    with h5py.File(foreign, "w") as f:
        f["x"] = 1
    with pytest.raises(ResultsError, match=r"foreign\.h5: not a readable results file .*slideline\.run"):
        Results(foreign)
    text = tmp_path / "text.h5"
    text.write_text("hello")
    with pytest.raises(ResultsError, match=r"text\.h5: not a readable results file"):
        Results(text)
    half = tmp_path / "half.h5"
    half.write_bytes(run.path.read_bytes()[:3000])
    with pytest.raises(ResultsError, match=r"half\.h5: not a readable results file"):
        Results(half)


def test_a_run_that_failed_keeps_what_it_had(tmp_path: Path) -> None:
    r = write_run(tmp_path / "r.h5", CASE, "failed", "window 41 at t = 25000 s: no")
    assert (r.outcome, r.message) == ("failed", "window 41 at t = 25000 s: no")
    assert len(r.t) == CASE.windows + 1


def test_killed_in_the_middle_of_writing_windows(tmp_path: Path) -> None:
    out, case = tmp_path / "run.h5", Case(windows=20000, frames=50, reject=3)
    code = ("import sys; from pathlib import Path; from synthetic_run import Case, record\n"
            f"record(Path({str(out)!r}), Case(windows={case.windows}, frames={case.frames}, reject=3))")
    path = os.pathsep.join([str(ROOT), str(Path(__file__).parent)])
    child = subprocess.Popen([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": path})
    deadline = time.monotonic() + 200
    try:
        while not (journal_of(out).exists() and journal_of(out).stat().st_size > 300_000):
            assert child.poll() is None, "the writer ended before it could be killed"
            assert time.monotonic() < deadline
            time.sleep(0.002)
        with pytest.raises(ResultsError, match="still goes on"):
            Results(out)
    finally:
        child.send_signal(signal.SIGKILL)
        ended = child.wait()
    assert ended == -signal.SIGKILL
    r = Results(out)
    assert r.outcome == "killed"
    assert 100 < len(r.t) < case.windows
    assert r.t.tolist() == times_of(case)[: len(r.t)].tolist()
    assert (r.windows.verdict == "accepted").sum() == len(r.t) - 1
    assert r.heat_imbalance == pytest.approx(IMBALANCE, rel=1e-9)
    assert not journal_of(out).exists()
    with FieldReader(r.field_files["thermal"]) as f:
        assert len(f.times) >= 1
        assert f.times[-1] <= r.t[-1]
    assert Results(out).t.tolist() == r.t.tolist()


@pytest.mark.parametrize("windows", [0, 1])
def test_a_run_killed_before_or_after_its_first_window(tmp_path: Path, windows: int) -> None:
    out = tmp_path / "run.h5"
    r = record(out, Case(windows=windows, frames=windows, reject=0))
    r._journal.close()
    found = Results(out)
    assert found.outcome == "killed"
    assert len(found.t) == windows + 1
    assert len(found.windows) == windows


def test_a_journal_with_a_header_only(tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    record(out, Case(windows=1))._journal.close()
    data = journal_of(out).read_bytes()
    journal_of(out).write_bytes(data[: data.index(b"\xa5start")])
    found = Results(out)
    assert (len(found.t), len(found.windows), found.ledger, found.heat_imbalance) == (0, 0, {}, 0.0)
    assert found.probe("gap")[1].shape == (0,)


def test_an_empty_journal_says_so(tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    record(out, Case(windows=0))._journal.close()
    journal_of(out).write_bytes(journal_of(out).read_bytes()[:40])
    with pytest.raises(ResultsError, match="before its first window"):
        Results(out)


@pytest.mark.parametrize("where", ["_write", "write_field_files", "replace"])
def test_finish_is_all_or_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str) -> None:
    out = tmp_path / "run.h5"
    write_run(out, CASE)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    record(out, Case(windows=3))._journal.close()

    def full(*args: object) -> None:
        raise OSError("no space left on device")

    target = finish_module.os if where == "replace" else finish_module
    monkeypatch.setattr(target, where, full)
    with pytest.raises(ResultsError, match="no space"):
        finish(journal_of(out), out)
    monkeypatch.undo()
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir() if p != journal_of(out)} == before
    r = Results(out)
    assert (len(r.t), r.later) == (CASE.windows + 1, journal_of(out))
    finish(journal_of(out), out)
    r = Results(out)
    assert (len(r.t), r.later) == (4, None)


def test_a_disk_full_while_recovering_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "run.h5"
    record(out, Case(windows=3))._journal.close()

    def full(*args: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(finish_module, "_write", full)
    with pytest.raises(ResultsError, match="no space"):
        Results(out)
    assert journal_of(out).exists()


def test_a_file_that_is_cut_short_is_told_in_plain_words(tmp_path):
    path = write_run(tmp_path / "run.h5", CASE).path
    whole = path.read_bytes()
    path.write_bytes(whole[:5000])
    with pytest.raises(ResultsError, match=f"it is cut short: 5000 of its {len(whole)} bytes are there"):
        Results(path)


def test_a_scenario_is_not_taken_for_results(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("slideline: 2\n")
    with pytest.raises(ResultsError, match="this is a scenario, not a results file"):
        Results(path)
