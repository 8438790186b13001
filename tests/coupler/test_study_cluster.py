"""Runs of a study on a Dask cluster of this machine: what they tell is what a run here tells."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from coupler.errors import HalfError
from coupler.experiments.pool import run_there
from coupler.experiments.trial import Job, run_trial, scenario_of

sys.path.insert(0, str(Path(__file__).parent))
from study_scenes import LUMPED

distributed = pytest.importorskip("distributed", reason="Dask is not installed: pip install 'slideline[cluster]'")

WINDOWS = {"coupling.end": 1.0, "coupling.windows": [{"until": 1.0, "size": 0.25}]}
STUCK = {**WINDOWS, "coupling.scheme": "iterated", "coupling.iteration.max_iterations": 1,
         "coupling.iteration.on_max": "stop"}


def job(sets: dict[str, object]) -> Job:
    return Job(LUMPED.read_text(encoding="utf-8"), str(LUMPED), sets)


def test_a_run_on_a_cluster_is_that_of_this_process() -> None:
    """One process of two threads: runs in it must not meet."""
    jobs = {"a": job({**WINDOWS, "coupling.scheme": "staggered"}), "b": job({**WINDOWS, "coupling.scheme": "iterated"}),
            "stuck": job(STUCK), "wrong": job({**WINDOWS, "coupling.scheme": "none such"})}
    with distributed.LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=None) as cluster:
        done = {job.name: job.result for job in run_there(jobs, cluster.scheduler_address)}
    assert set(done) == set(jobs)
    for name in ("a", "b"):
        here = run_trial(scenario_of(jobs[name]))
        assert replace(done[name], seconds=0, processor=0, wall=0) == replace(here, seconds=0, processor=0, wall=0)
    assert "on_max says to stop" in done["stuck"].failed
    assert done["stuck"].storable
    assert "coupling.scheme" in done["wrong"].failed
    assert not done["wrong"].storable


def test_a_scheduler_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("coupler.experiments.pool.PATIENCE", "1s")
    with pytest.raises(HalfError, match="no Dask scheduler answers"):
        next(run_there({"a": job(WINDOWS)}, "tcp://127.0.0.1:1"))
