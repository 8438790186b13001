"""How far a run is, told from its files while it runs, when it ended and when it was killed; its log of JSON lines."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

from coupler import Results, ResultsError, load_scenario
from coupler.cli.cli import app
from coupler.cli.console import summary
from coupler.errors import HalfError
from coupler.record.journal import being_written
from coupler.running import status as status_module
from coupler.running.run import Run
from coupler.running.runlog import RunLog
from coupler.running.status import status

SCENARIO = Path(__file__).resolve().parents[2] / "scenarios/casting_1d.yaml"
CHANGED = {"coupling.end": 0.1}


def test_a_run_is_told_while_it_goes_on_and_when_it_is_done(tmp_path):
    out = tmp_path / "run.h5"
    with Run(load_scenario(SCENARIO, CHANGED), out) as run:
        before = status(out)
        assert (before.state, before.t, before.windows, before.last) == ("running", 0.0, 0, {})
        for n, w in enumerate(run.windows(), 1):
            now = status(out)
            assert (now.state, now.t, now.windows, now.end) == ("running", w.t, n, 0.1)
            assert now.last["scheme"] == w.scheme
            assert now.parts["thermal"] > 0.0
    done = status(out)
    assert (done.state, done.t, done.windows, done.rejected) == ("completed", pytest.approx(0.1), n, 0)
    assert done.title in done.lines[0]
    assert not any("resume" in line for line in done.lines)
    results = Results(out)
    assert f", {done.seconds:.1f} s after " in summary(results), "it tells the seconds that the run told"
    assert done.seconds > results.windows.seconds.sum()
    said = CliRunner().invoke(app, ["status", str(out), "--json"])
    assert json.loads(said.output)["windows"] == n
    with pytest.raises(ResultsError, match="no such file"):
        status(tmp_path / "other.h5")


def test_a_window_that_was_gone_back_behind_is_no_progress(tmp_path):
    out = tmp_path / "run.h5"
    with Run(load_scenario(SCENARIO, CHANGED), out) as run:
        windows = run.windows()
        first = next(windows)
        snapshot = run.keep()
        next(windows)
        assert status(out).t > first.t
        run.rewind(snapshot)
        assert (status(out).t, status(out).windows) == (first.t, 1)


def test_a_killed_run_is_told_as_such_and_can_be_gone_on_with(tmp_path):
    out = tmp_path / "run.h5"
    sets = ["--set", "coupling.end=2"]
    child = subprocess.Popen([sys.executable, "-m", "coupler.cli", "run", str(SCENARIO), "-o", str(out), *sets],
                             stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        until = time.monotonic() + 120.0
        while True:
            assert time.monotonic() < until
            assert child.poll() is None
            try:
                if status(out).windows > 2:
                    break
            except ResultsError:
                pass
            time.sleep(0.02)
        assert status(out).state == "running"
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait()
    left = status(out)
    assert left.state == "killed"
    assert left.checkpoint is not None
    assert left.windows > 2
    assert left.lines[-1] == f"  to resume: slideline resume {out}"


def test_a_log_is_a_line_of_json_for_whatever_happens(tmp_path):
    out, log = tmp_path / "run.h5", tmp_path / "run.jsonl"
    sets = [word for k, v in CHANGED.items() for word in ("--set", f"{k}={v}")]
    done = CliRunner().invoke(app, ["run", str(SCENARIO), "-o", str(out), "--log", str(log), *sets])
    assert done.exit_code == 0, done.output
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert [line["kind"] for line in lines] == ["begin", *["window"] * status(out).windows, "end"]
    assert lines[-1]["outcome"] == "completed"
    assert [line["t"] for line in lines[1:-1]] == sorted(line["t"] for line in lines[1:-1])
    out.unlink()
    CliRunner().invoke(app, ["run", str(SCENARIO), "-o", str(out), "--log", str(log), "--until", "0.03", *sets])
    assert json.loads(log.read_text().splitlines()[-1])["outcome"] == "stopped"
    with pytest.raises(HalfError), RunLog(log, out):
        raise HalfError("it died", half="thermal")
    assert json.loads(log.read_text().splitlines()[-1])["outcome"] == "HalfError"
    with pytest.raises(ResultsError, match="the log cannot be written"):
        RunLog(tmp_path / "no" / "log", out).__enter__()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full disk at hand")
def test_a_log_on_a_full_disk_ends_no_run(tmp_path, capsys):
    out, log = tmp_path / "run.h5", tmp_path / "run.jsonl"
    with RunLog(log, out) as written, Run(load_scenario(SCENARIO, CHANGED), out) as run:
        log.unlink()
        log.symlink_to("/dev/full")
        for w in run.windows():
            written(w)
    assert status(out).state == "completed"
    assert capsys.readouterr().err.count("the log cannot be gone on with (No space left on device)") == 1


@pytest.mark.slow
def test_windows_are_counted_as_by_the_run_itself(tmp_path):
    """Those that were rejected beside those of the run, while it goes on and when it is done."""
    out = tmp_path / "run.h5"
    rejecting = {"coupling.end": 2.0, "coupling.windows": [{"until": 2, "size": 0.5}], "coupling.scheme": "iterated",
                 "coupling.iteration.max_iterations": 3}
    with Run(load_scenario(SCENARIO, rejecting), out) as run:
        taken = [w.taken for w in run.windows()]
        now = status(out)
    assert 0 < sum(taken) < len(taken)
    for told in (now, status(out)):
        assert (told.windows, told.rejected) == (sum(taken), len(taken) - sum(taken))


def test_a_run_that_ends_while_it_is_looked_at_is_looked_at_again(tmp_path, monkeypatch):
    out = tmp_path / "run.h5"
    run = Run(load_scenario(SCENARIO, CHANGED), out)
    run.__enter__()
    n = len(list(run.windows()))
    looks = []

    def ends(journal: Path) -> bool:
        if not looks:
            run.__exit__(None, None, None)
        looks.append(journal)
        return being_written(journal)

    monkeypatch.setattr(status_module, "being_written", ends)
    assert (status(out).state, status(out).windows, len(looks)) == ("completed", n, 1)
