"""Jobs run by a Dask cluster; Dask is asked for only where a scheduler's address is given."""

from __future__ import annotations

import importlib
import threading
from collections.abc import Generator, Mapping
from dataclasses import asdict
from typing import Any

from coupler.errors import HalfError, ScenarioError
from coupler.trials.trial import Job, Trial, solve, trial_from

PATIENCE = "30s"  # until a scheduler answers
# A worker may have several threads; FMUs and the clock of a run want the process for themselves.
ALONE = threading.Lock()


def run_there(jobs: Mapping[str, Job], address: str) -> Generator[tuple[str, Trial], None, None]:
    """(name, trial) of each job as it is done by the cluster whose scheduler is at `address`, tcp://host:port.

    Its workers need the same packages installed, and mesh files at the same paths.
    Raises ScenarioError where Dask is not installed, HalfError where no scheduler answers.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as exc:
        raise ScenarioError("Dask is not installed", key="--cluster", value=address,
                            remedy="pip install 'slideline[cluster]', or leave --cluster out") from exc
    try:
        client = distributed.Client(address, timeout=PATIENCE)
    except (OSError, ValueError) as exc:
        raise HalfError(f"no Dask scheduler answers at {address} ({exc})") from exc
    with client:
        names = {client.submit(solve_alone, asdict(job), pure=False): name for name, job in jobs.items()}
        for future in distributed.as_completed(names):
            failure = future.exception()
            yield names[future], (Trial(str(failure), kept=False) if failure is not None
                                  else trial_from(future.result()))


def solve_alone(job: Mapping[str, Any]) -> dict[str, Any]:
    """One job at a time in a process."""
    with ALONE:
        return solve(job)
