"""Runs one trial of a scenario, and stores its result by content: plain values that travel as JSON."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.half.build import package_directory
from contact.half.entry import sources_hash
from coupler.errors import CouplingError, HalfError, ResultsError
from coupler.fmu.launch import known_halves
from coupler.record.checkpoint import versions
from coupler.record.paths import part_of
from coupler.record.results import Results
from coupler.running.run import Run
from coupler.scenario import Scenario
from coupler.scenario.load import scenario_from
from coupler.trust.checks import TrustVerdict
from coupler.verify.verdicts import Verify

# Probes and cost are all that is looked at: neither fields nor checkpoints are written.
LEAN = {"output.fields": {"every": 1_000_000_000}, "output.checkpoint": None}
# The first windows load compiled code: their time is no cost of the model.
COLD = 2


class StoppedError(Exception):
    """A trial was stopped before its end, by Ctrl-C or because time is up: it has no result."""


@dataclass(frozen=True)
class Job:
    """A scenario to run.  text : of its file.  path : of its file, meshes are beside it.  overrides : key -> value."""

    text: str
    path: str
    overrides: Mapping[str, Any]


@dataclass(frozen=True)
class TrialResult:
    """The result of a trial.

    failed : why it has no answer; empty where it has.
    solver_calls : substeps of both halves, those of rejected windows too.
    seconds, processor : of its windows [s], wall time and processor time; the first windows, which load compiled code,
    count as the median of the others in the latter.  wall : with its start [s].
    windows, rejected : counts.  t : (n,) ends of accepted windows, from 0 [s].
    probes : name -> (n,) values at t, SI.  units : of the probes.  scenario : hash of what was run.
    broken : names of the checks of its trust table that failed.
    storable : false for a crash, which may not happen again.
    """

    failed: str = ""
    solver_calls: int = 0
    seconds: float = 0.0
    processor: float = 0.0
    wall: float = 0.0
    windows: int = 0
    rejected: int = 0
    t: Sequence[float] = ()
    probes: Mapping[str, Sequence[float]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    scenario: str = ""
    broken: Sequence[str] = ()
    storable: bool = True


def trial_from(values: Mapping[str, Any]) -> TrialResult:
    """Return the trial of its plain values.  Raises TypeError where they are not those of one."""
    return TrialResult(**{**values, "broken": tuple(values.get("broken", ()))})


def scenario_of(job: Job) -> Scenario:
    """Return the scenario a job runs.  Raises ScenarioError."""
    return scenario_from(job.text, Path(job.path), {**job.overrides, **LEAN})


def solve(job: Mapping[str, Any]) -> dict[str, Any]:
    """Run a job of plain values, and return its trial as such.  Raises ScenarioError, StoppedError."""
    return asdict(run_trial(scenario_of(Job(**job))))


def run_trial(scenario: Scenario, deadline: float = float("inf"),
              on_window: Callable[[float], object] = lambda fraction: None,
              verify: Verify = Verify.ONCE) -> TrialResult:
    """Run a scenario in one thread.

    deadline : of time.monotonic().  on_window : called with the fraction that is done.  verify : as of Run.
    A window that cannot be solved makes a trial that failed.  Raises StoppedError.
    """
    pace: list[float] = []
    started = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="slideline-trial-") as folder:
        out, failed = Path(folder) / "run.h5", ""
        try:
            with Run(scenario, out, verify=verify) as run:
                since = time.process_time()
                for window in run.windows():
                    pace.append(time.process_time() - since)
                    on_window(window.fraction)
                    if time.monotonic() > deadline:
                        raise StoppedError("time is up")
                    since = time.process_time()
        except (CouplingError, HalfError) as exc:
            failed = str(exc).splitlines()[0]
        wall = time.perf_counter() - started
        # A run that failed has a results file if it came so far as to have one.
        if failed and not out.exists():
            return TrialResult(failed, wall=wall, scenario=scenario.hash)
        results = Results(out)
        if results.outcome == "interrupted":
            raise StoppedError("stopped by Ctrl-C")
        facts = {"failed": failed} if failed else _answers(results)
        return TrialResult(processor=_seconds(pace), wall=wall, scenario=scenario.hash, **_cost(results), **facts)


def probe_of(results: Results, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return t (n,) [s] and a probe (n,) in SI as runs are compared: one that is not a number keeps its last value.

    A gap is none where its surface faces nothing, as after a block slid off another: what it was when it last faced
    something says how that came about, and the rest is nobody's error.  0 before the first number.
    """
    t, values = results.probe(name)
    known = np.flatnonzero(~np.isnan(values))
    if not known.size:
        return t, np.zeros(len(values))
    last = np.searchsorted(known, np.arange(len(values)), side="right") - 1
    # fault: a gap that faces nothing has no past -> return t, values | coupler/test_confidence
    return t, np.where(last >= 0, values[known[np.maximum(last, 0)]], 0.0)


def _answers(results: Results) -> dict[str, Any]:
    values = {name: probe_of(results, name)[1] for name in results.probe_names}
    wrong = [name for name, v in values.items() if not np.isfinite(v).all()]
    if wrong:
        return {"failed": f"probe {wrong[0]} is not a number"}
    return {"t": results.t.tolist(), "probes": {n: v.tolist() for n, v in values.items()},
            "units": {n: results.unit(n) for n in values},
            "broken": tuple(c.name for c in results.trust if c.verdict is TrustVerdict.BROKEN)}


def _cost(results: Results) -> dict[str, Any]:
    w = results.windows
    # fault: half-solves of the thermal half alone -> return {"solver_calls": int(w.thermal_solves.sum()), |
    #   coupler/test_study_run
    return {"solver_calls": int(w.thermal_solves.sum() + w.mechanical_solves.sum()),
            "seconds": float(results.totals.get("seconds", w.seconds.sum())),
            "windows": int(w.taken.sum()), "rejected": int((~w.taken).sum())}


def _seconds(pace: Sequence[float]) -> float:
    """Return the processor time of all windows [s]; the first COLD ones count as the median of the others."""
    warm = pace[COLD:] or pace
    return sum(warm) + (len(pace) - len(warm)) * statistics.median(warm) if pace else 0.0


# Trials are stored by content: one of the same values by the same sources is never run twice.

FORMAT, VERSION = "slideline.trial", 3
# Parts of the coupler that change nothing in a trial; of experiments only this file does.
# fault: a part that no trial depends on is looked for where it was -> APART = ("study", "advise", "report", "deck",
#   "init", "cli.py") | coupler/test_study
APART = ("experiments", "report", "deck", "init", "cli")


def sources() -> str:
    """Return the hash of everything installed that a trial depends on."""
    packages = {"contact", *(point.module.split(".")[0] for point in known_halves().values())}
    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for name in sorted(packages):
        digest.update(sources_hash(package_directory(name)).encode())
    coupler = Path(__file__).resolve().parent.parent
    for path in sorted(coupler.rglob("*.py")):
        if path.relative_to(coupler).parts[0] not in APART or path == Path(__file__).resolve():
            digest.update(path.relative_to(coupler).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def key_of(scenario: Scenario, packages: str) -> str:
    """Return the name of a trial: a hash of its resolved values, its meshes and the sources."""
    return hashlib.sha256(f"{scenario.hash} {packages}".encode()).hexdigest()[:32]


class TrialStore:
    """Stores trials in a folder, a file each, whole or not at all; one of another version counts as missing."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def get(self, key: str) -> TrialResult | None:
        """Return the trial of a key, None where there is none.  Raises ResultsError for a file that is no trial."""
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

    def put(self, key: str, trial: TrialResult) -> None:
        """Store a trial.  Raises ResultsError where it cannot be written."""
        path = self._folder / f"{key}.json"
        whole = {"format": FORMAT, "version": VERSION, **asdict(trial)}
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            part_of(path).write_text(json.dumps(whole, allow_nan=False), encoding="utf-8")
            os.replace(part_of(path), path)
        except OSError as exc:
            raise ResultsError(f"{path}: the trial cannot be written ({exc.strerror})") from exc


# `python -m coupler.experiments.trial`: a process that runs jobs, one line of JSON in, one out; it ends when its
# input does.

def main() -> None:
    """Serve until standard input ends."""
    # What native code prints must not come between the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    # Ctrl-C is for the one who started this process; a run that sees it would stop half-way.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for line in sys.stdin:
        print(json.dumps(solve(json.loads(line)), allow_nan=False), file=answers, flush=True)


if __name__ == "__main__":
    main()
