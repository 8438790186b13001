"""One trial: a variant of the scenario, run coarse, and what it cost; kept by content, so it is never run twice."""

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

import numpy as np
from threadpoolctl import threadpool_limits

from contact.half.build import content_hash, package_directory
from contact.half.entry import sources_hash
from coupler.advise.edit import Edit, edited
from coupler.errors import CouplingError, HalfError, ResultsError, ScenarioError
from coupler.fmu.halves import known_halves
from coupler.record.beside import part_of
from coupler.record.results import Results
from coupler.runner import Run
from coupler.scenario import Scenario
from coupler.scenario.document import Document
from coupler.scenario.load import scenario_from

# The first windows load compiled code: their time is no cost of the model.
COLD = 2


class StoppedError(Exception):
    """A trial was stopped before its end: by Ctrl-C, or because time is up.  It tells nothing."""


class LateError(Exception):
    """A trial was not begun, because it would hardly end in time."""


@dataclass(frozen=True)
class Trial:
    """half_solves : substeps of both halves, those of rejected windows too.  seconds : processor time of its windows.

    wall [s].  t : (n,) [s], ends of accepted windows and 0.  probes : name -> values at t, SI.  units : of them.
    failed : why it has no answer; empty where it has.  scenario : hash of what was run.
    """

    scenario: str = ""
    half_solves: int = 0
    seconds: float = 0.0
    wall: float = 0.0
    t: Sequence[float] = ()
    probes: Mapping[str, Sequence[float]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    failed: str = ""


def variant(document: Document, edits: Sequence[Edit]) -> Scenario:
    """The scenario with edits.  Raises ScenarioError for what cannot be."""
    return scenario_from(document.text, document.path, edited(document.tree, edits))


class Trials:
    """Runs trials and keeps them in a folder, a file each, whole or not there.

    deadline : of time.monotonic(); a trial that is not done by then is stopped.
    """

    def __init__(self, document: Document, folder: Path, deadline: float = float("inf")) -> None:
        self.document = document
        self.deadline = deadline
        self._folder = folder
        self._sources = _sources()

    def run(self, edits: Sequence[Edit], begin: Callable[[], Callable[[float], object]], need: float = 0.0) -> Trial:
        """The trial of these edits, run or remembered.

        begin : called before it runs, gives what is told the share that is done.  need : time it will take [s].
        What cannot be run, or fails, is a trial too.  Raises LateError where there is not so much time, StoppedError,
        ResultsError where it cannot be kept.
        """
        try:
            scenario = variant(self.document, edits)
        except ScenarioError as exc:
            return Trial(failed=f"{exc.key}: {exc.message}" if exc.key else exc.message)
        path = self._folder / f"{content_hash(scenario.interface, {'scenario': scenario.hash}, self._sources)}.json"
        if (kept := _kept(path)) is not None:
            return kept
        if (left := self.deadline - time.monotonic()) <= 0.0:
            raise StoppedError("time is up")
        if need > left:
            raise LateError
        done = _solved(scenario, self.deadline, begin())
        _keep(path, done)
        return done


def _solved(scenario: Scenario, deadline: float, on_window: Callable[[float], object]) -> Trial:
    """Run it, one thread.  Raises StoppedError."""
    pace: list[float] = []
    started = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="slideline-advise-") as folder, threadpool_limits(1):
        out = Path(folder) / "run.h5"
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
            return Trial(scenario.hash, failed=str(exc).splitlines()[0])
        results = Results(out)
        if results.outcome == "interrupted":
            raise StoppedError("stopped by Ctrl-C")
        return _trial(scenario, results, _seconds(pace), time.perf_counter() - started)


def _trial(scenario: Scenario, results: Results, seconds: float, wall: float) -> Trial:
    w = results.windows
    values = {name: results.probe(name)[1] for name in results.probe_names}
    wrong = [name for name, v in values.items() if not np.isfinite(v).all()]
    return Trial(scenario.hash, int(w.thermal_solves.sum() + w.mechanical_solves.sum()), seconds, wall,
                 results.t.tolist(), {n: v.tolist() for n, v in values.items() if n not in wrong},
                 {n: results.unit(n) for n in values}, f"{wrong[0]} is not a number" if wrong else "")


def _seconds(pace: Sequence[float]) -> float:
    """Processor time of all windows, the first ones taken as the others are in the middle."""
    warm = pace[COLD:] or pace
    return sum(warm) + (len(pace) - len(warm)) * statistics.median(warm) if pace else 0.0


def _kept(path: Path) -> Trial | None:
    if not path.exists():
        return None
    try:
        return Trial(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as exc:
        raise ResultsError(f"{path}: not a trial ({exc}); remove it, and it is run again") from exc


def _keep(path: Path, trial: Trial) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part_of(path).write_text(json.dumps(asdict(trial), allow_nan=False), encoding="utf-8")
        os.replace(part_of(path), path)
    except OSError as exc:
        raise ResultsError(f"{path}: the trial cannot be written ({exc.strerror})") from exc


def _sources() -> dict[str, str]:
    """What is installed that an answer depends on: package -> hash; of the coupler all but what only looks at runs."""
    packages = {"contact", *(point.module.partition(".")[0] for point in known_halves().values())}
    found = {name: sources_hash(package_directory(name)) for name in sorted(packages)}
    here = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    for path in sorted(here.parent.rglob("*.py")):
        if path.relative_to(here.parent).parts[0] not in (here.name, "report", "cli.py"):
            digest.update(path.relative_to(here.parent).as_posix().encode() + path.read_bytes())
    return found | {"coupler": digest.hexdigest()}
