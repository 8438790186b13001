"""One trial: from a job to what it told and what it cost, all plain values that travel as JSON."""

from __future__ import annotations

import hashlib
import json
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from contact.half.build import package_directory
from contact.half.entry import sources_hash
from coupler.errors import CouplingError, HalfError, ResultsError
from coupler.fmu.builders import known_halves
from coupler.record.checkpoint import versions
from coupler.record.paths import part_of
from coupler.record.results import Results
from coupler.running.run import Run
from coupler.scenario import Scenario
from coupler.scenario.load import scenario_from

# Probes and cost are all that is looked at: neither fields nor checkpoints are written.
LEAN = {"output.fields": {"every": 1_000_000_000}, "output.checkpoint": None}
# The first windows load compiled code: their time is no cost of the model.
COLD = 2


class StoppedError(Exception):
    """A trial was stopped before its end: by Ctrl-C, or because time is up.  It tells nothing."""


@dataclass(frozen=True)
class Job:
    """text : of the scenario.  path : where it stood, meshes are beside it.  overrides : dotted key -> value."""

    text: str
    path: str
    overrides: Mapping[str, Any]


@dataclass(frozen=True)
class Trial:
    """failed : why it has no answer; empty where it has.  half_solves : substeps of both halves, those of rejected
    windows too.

    seconds, processor : of its windows, on the wall and of this process, the first ones of the latter taken as the
    others are.  wall [s] : with its start.  windows, rejected : counted.  t : [s], ends of accepted windows and 0.
    probes : name -> values at t, SI.  units : of them.  scenario : hash of what was run.
    kept : worth keeping; a crash may not happen again.
    """

    failed: str = ""
    half_solves: int = 0
    seconds: float = 0.0
    processor: float = 0.0
    wall: float = 0.0
    windows: int = 0
    rejected: int = 0
    t: Sequence[float] = ()
    probes: Mapping[str, Sequence[float]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    scenario: str = ""
    kept: bool = True


def trial_from(values: Mapping[str, Any]) -> Trial:
    """The trial of its plain values.  Raises TypeError where they are not those of one."""
    return Trial(**values)


def scenario_of(job: Job) -> Scenario:
    """What a job runs.  Raises ScenarioError."""
    return scenario_from(job.text, Path(job.path), {**job.overrides, **LEAN})


def solve(job: Mapping[str, Any]) -> dict[str, Any]:
    """Run a job of plain values, and tell its trial as such.  Raises ScenarioError, StoppedError."""
    return asdict(tried(scenario_of(Job(**job))))


def tried(scenario: Scenario, deadline: float = float("inf"),
          on_window: Callable[[float], object] = lambda share: None) -> Trial:
    """Run a scenario, one thread.

    deadline : of time.monotonic().  on_window : told the share that is done.
    A window that cannot be solved makes a trial that failed.  Raises StoppedError.
    """
    pace: list[float] = []
    started = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="slideline-trial-") as folder, threadpool_limits(1):
        out, failed = Path(folder) / "run.h5", ""
        try:
            with Run(scenario, out) as run:
                since = time.process_time()
                for window in run.windows():
                    pace.append(time.process_time() - since)
                    on_window(window.share)
                    if time.monotonic() > deadline:
                        raise StoppedError("time is up")
                    since = time.process_time()
        except (CouplingError, HalfError) as exc:
            failed = str(exc).splitlines()[0]
        wall = time.perf_counter() - started
        # A run that failed has a results file if it came so far as to have one.
        if failed and not out.exists():
            return Trial(failed, wall=wall, scenario=scenario.hash)
        results = Results(out)
        if results.outcome == "interrupted":
            raise StoppedError("stopped by Ctrl-C")
        facts = {"failed": failed} if failed else _told(results)
        return Trial(processor=_seconds(pace), wall=wall, scenario=scenario.hash, **_cost(results), **facts)


def _told(results: Results) -> dict[str, Any]:
    values = {name: results.probe(name)[1] for name in results.probe_names}
    wrong = [name for name, v in values.items() if not np.isfinite(v).all()]
    if wrong:
        return {"failed": f"probe {wrong[0]} is not a number"}
    return {"t": results.t.tolist(), "probes": {n: v.tolist() for n, v in values.items()},
            "units": {n: results.unit(n) for n in values}}


def _cost(results: Results) -> dict[str, Any]:
    w = results.windows
    # fault: half-solves of the thermal half alone -> return {"half_solves": int(w.thermal_solves.sum()), |
    #   coupler/test_study_run
    return {"half_solves": int(w.thermal_solves.sum() + w.mechanical_solves.sum()),
            "seconds": float(results.totals.get("seconds", w.seconds.sum())),
            "windows": int(w.taken.sum()), "rejected": int((~w.taken).sum())}


def _seconds(pace: Sequence[float]) -> float:
    """Processor time of all windows, the first ones taken as the others are in the middle."""
    warm = pace[COLD:] or pace
    return sum(warm) + (len(pace) - len(warm)) * statistics.median(warm) if pace else 0.0


# Trials kept by content: one of the same values by the same sources is never run twice.

FORMAT, VERSION = "slideline.trial", 1
# Parts of the coupler that change nothing in a trial.
APART = ("study", "advise", "report", "deck", "init", "verify", "cli.py")


def sources() -> str:
    """Hash of everything installed that a trial depends on."""
    packages = {"contact", *(point.module.split(".")[0] for point in known_halves().values())}
    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for name in sorted(packages):
        digest.update(sources_hash(package_directory(name)).encode())
    coupler = Path(__file__).resolve().parent.parent
    for path in sorted(coupler.rglob("*.py")):
        if path.relative_to(coupler).parts[0] not in APART:
            digest.update(path.relative_to(coupler).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def key_of(scenario: Scenario, packages: str) -> str:
    """Name of a trial: of its resolved values, its meshes and the sources."""
    return hashlib.sha256(f"{scenario.hash} {packages}".encode()).hexdigest()[:32]


class Store:
    """Trials in a folder, a file each, whole or not there; one of another version is as if it were not there."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, key: str) -> Trial | None:
        """The trial kept under a key.  Raises ResultsError for a file that is not one."""
        path = self._folder / f"{key}.json"
        if not path.exists():
            return None
        try:
            values = json.loads(path.read_text(encoding="utf-8"))
            if values.pop("format") != FORMAT:
                raise ValueError("of another format")
            # fault: trials of another version are taken -> return trial_from(values) if values.pop("version") or True
            #   else None | coupler/test_study
            return trial_from(values) if values.pop("version") == VERSION else None
        except (OSError, ValueError, TypeError, KeyError, AttributeError) as exc:
            raise ResultsError(f"{path}: not a trial ({exc}); remove it, and it is run again") from exc

    def put(self, key: str, trial: Trial) -> None:
        """Keep a trial.  Raises ResultsError where it cannot be written."""
        path = self._folder / f"{key}.json"
        whole = {"format": FORMAT, "version": VERSION, **asdict(trial)}
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            part_of(path).write_text(json.dumps(whole, allow_nan=False), encoding="utf-8")
            os.replace(part_of(path), path)
        except OSError as exc:
            raise ResultsError(f"{path}: the trial cannot be written ({exc.strerror})") from exc
