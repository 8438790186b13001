"""One run of a study: from a job to its outcome, both plain values that travel as JSON."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from coupler.errors import CouplingError, HalfError
from coupler.record.results import Results
from coupler.runner import run
from coupler.scenario.load import scenario_from

DONE, FAILED = "done", "failed"
# A study looks at probes and cost only: neither fields nor checkpoints are written.
LEAN = {"output.fields": {"every": 1_000_000_000}, "output.checkpoint": None}


class InterruptedRunError(Exception):
    """The run was asked to stop; it has no outcome."""


@dataclass(frozen=True)
class Job:
    """text : of the scenario.  path : where it stood, meshes are beside it.  overrides : dotted key -> value."""

    text: str
    path: str
    overrides: Mapping[str, Any]


@dataclass(frozen=True)
class Outcome:
    """state : done | failed, with its message.  half_solves : substeps of both halves, those of rejected windows too.

    seconds : wall time of the windows.  windows, rejected : counted.  t : [s], ends of accepted windows and 0.
    probes : name -> values at t, SI.  kept : worth keeping; a crash may not happen again.
    """

    state: str
    message: str = ""
    half_solves: int = 0
    seconds: float = 0.0
    windows: int = 0
    rejected: int = 0
    t: Sequence[float] = ()
    probes: Mapping[str, Sequence[float]] | None = None
    units: Mapping[str, str] | None = None
    kept: bool = True

    @property
    def done(self) -> bool:
        return self.state == DONE


def outcome_from(values: Mapping[str, Any]) -> Outcome:
    """The outcome of its plain values.  Raises TypeError where they are not those of one."""
    return Outcome(**values)


def solve(job: Mapping[str, Any]) -> dict[str, Any]:
    """Run one job, one thread, and tell its outcome.

    A window that cannot be solved is an outcome; a wrong scenario is not: it raises ScenarioError.
    """
    scenario = scenario_from(job["text"], Path(job["path"]), {**job["overrides"], **LEAN})
    with tempfile.TemporaryDirectory(prefix="slideline-study-") as folder, threadpool_limits(1):
        out = Path(folder) / "run.h5"
        try:
            results = run(scenario, out)
        except (CouplingError, HalfError) as exc:
            return asdict(_failed(str(exc), out))
        if results.outcome == "interrupted":
            raise InterruptedRunError(results.message)
        return asdict(_done(results))


def _done(results: Results) -> Outcome:
    values = {name: results.probe(name)[1] for name in results.probe_names}
    wrong = [name for name, v in values.items() if not np.isfinite(v).all()]
    if wrong:
        return Outcome(FAILED, f"probe {wrong[0]} is not a number", **_cost(results))
    return Outcome(DONE, results.message, **_cost(results), t=results.t.tolist(),
                   probes={n: v.tolist() for n, v in values.items()},
                   units={n: results.unit(n) for n in values})


def _failed(message: str, out: Path) -> Outcome:
    """What a run that failed had cost is in its results file, where it came so far as to have one."""
    return Outcome(FAILED, message.splitlines()[0], **(_cost(Results(out)) if out.exists() else {}))


def _cost(results: Results) -> dict[str, Any]:
    w = results.windows
    spent = int(w.thermal_solves.sum() + w.mechanical_solves.sum())
    return {"half_solves": spent, "seconds": float(results.totals.get("seconds", w.seconds.sum())),
            "windows": int(w.taken.sum()), "rejected": int((~w.taken).sum())}
