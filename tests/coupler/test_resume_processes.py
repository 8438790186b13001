"""Runs whose halves live in processes of their own, resumed there or in one process: the same bits."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from coupler import HalfError, Results, load_scenario, run
from coupler.record.paths import checkpoint_of
from coupler.running.progress import Progress
from coupler.running.resume import resume, resumed

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(Path(__file__).parent))
from killed_runs import differences  # noqa: E402

SCENARIO = ROOT / "scenarios/casting_1d.yaml"
CHANGED = {"coupling.end": 0.5, "output.checkpoint": 0}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole") / "run.h5"
    run(load_scenario(SCENARIO, CHANGED), out)
    return out


@pytest.mark.few("on_in_processes")
@pytest.mark.parametrize("processes", [True, False], ids=["on_in_processes", "on_in_one"])
def test_stopped_in_one_place_and_resumed_in_another(whole: Path, tmp_path: Path, processes: bool) -> None:
    out = tmp_path / "run.h5"
    assert run(load_scenario(SCENARIO, CHANGED), out, processes=not processes, until=0.25).outcome == "stopped"
    assert resume(out, processes=processes).outcome == "completed"
    assert differences(whole, out) == []


@pytest.mark.slow
def test_a_half_that_was_killed_leaves_a_run_that_goes_on(whole: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.h5"

    def kill(progress: Progress) -> None:
        if progress.number == 10:
            os.kill(_child_of(os.getpid(), "mechanical"), signal.SIGKILL)

    with pytest.raises(HalfError) as died:
        run(load_scenario(SCENARIO, CHANGED), out, processes=True, on_window=kill)
    assert "mechanical" in str(died.value)
    assert died.value.__notes__[0].startswith(f"`slideline resume {out} --processes` goes on from t = ")
    assert Results(out).outcome == "failed"
    again = resumed(out)
    assert again.start == Results(out).t[10]
    resume(again)
    assert differences(whole, out) == []


@pytest.mark.slow
def test_a_killed_coupler_leaves_no_process_and_a_run_that_goes_on(whole: Path, tmp_path: Path) -> None:
    out = tmp_path / "run.h5"
    sets = [word for key, value in CHANGED.items() for word in ("--set", f"{key}={value}")]
    child = subprocess.Popen([sys.executable, "-m", "coupler.cli", "run", str(SCENARIO), "-o", str(out), "--processes",
                              *sets], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 200.0
    try:
        while not checkpoint_of(out).exists():
            assert time.monotonic() < until
            assert child.poll() is None
            time.sleep(0.02)
    finally:
        child.kill()
        child.wait()
    assert resume(out).outcome == "completed"
    assert differences(whole, out) == []


def _child_of(parent: int, name: str) -> int:
    import psutil

    return next(p.pid for p in psutil.Process(parent).children(recursive=True) if name in p.cmdline())
