"""A run that is stopped right after a try that does not stand: gone on with, the try stands in the file once."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest

from coupler import Results, run
from coupler.running.resume import resume
from coupler.scenario import Scenario, load_scenario

sys.path.insert(0, str(Path(__file__).parent))
from killed_runs import differences

ROOT = Path(__file__).resolve().parents[2]
# Windows are cut again and again: three iterations are too few for most.
CUT = {"coupling.end": 2.0, "coupling.windows": [{"until": 2, "size": 0.5}], "coupling.scheme": "iterated",
       "coupling.iteration.acceleration": "iqn_ils", "coupling.iteration.max_iterations": 3}


def cut_often() -> Scenario:
    return load_scenario(ROOT / "scenarios/casting_1d.yaml", CUT)


@pytest.mark.slow
def test_a_run_stopped_after_a_rejected_try_has_it_once(tmp_path: Path) -> None:
    whole, out, seen = tmp_path / "whole.h5", tmp_path / "run.h5", []

    def stop_after_two(p) -> None:
        seen.append(p.verdict)
        if seen[-2:] == ["max iterations"] * 2:
            os.kill(os.getpid(), signal.SIGINT)

    run(cut_often(), whole)
    assert run(cut_often(), out, on_window=stop_after_two).outcome == "interrupted"
    assert seen[-1] == "max iterations"
    resume(out)
    assert len(Results(out).windows) == len(Results(whole).windows)
    assert not differences(whole, out)
