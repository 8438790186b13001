"""Runs jobs in parallel, by processes of this machine or a Dask cluster, and shows how far they are."""

from __future__ import annotations

import importlib
import json
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from coupler.errors import HalfError, ScenarioError
from coupler.experiments.trial import Job, TrialResult, solve, trial_from
from coupler.fmu.children import environment, python

# Shows the progress of a study and of an advice: one live line on a terminal, a line a run elsewhere.

class StudyLine:
    """Shows the runs of a study that are done, and those that failed.  console : default standard error."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(file=sys.stderr, highlight=False)
        self._bar = Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                             console=self._console, transient=True)
        self._began = time.monotonic()
        self._done = self._total = 0

    def __enter__(self) -> StudyLine:
        return self

    def begin(self, total: int, stored: int) -> None:
        """Show how many runs there are.  total : those of the reference too.  stored : done by an earlier call."""
        self._total, self._done = total, stored
        self._print(f"{total} runs, {stored} of them done before" if stored else f"{total} runs")
        if self._console.is_terminal and stored < total:
            self._task = self._bar.add_task("runs", total=total, completed=stored)
            self._bar.start()

    def __call__(self, label: str, trial: TrialResult) -> None:
        """Show that a run is done."""
        self._done += 1
        if trial.failed:
            self._print(f"failed: {label}: {trial.failed}")
        if self._console.is_terminal:
            self._bar.update(self._task, completed=self._done)
        elif not trial.failed:
            self._print(f"{self._done} of {self._total}, {self._total - self._done} to go, "
                        f"{time.monotonic() - self._began:.0f} s: {label}: {trial.solver_calls} solver calls")

    def _print(self, text: str) -> None:
        if self._console.is_terminal:
            self._bar.console.print(text, markup=False)
        else:
            print(text, file=self._console.file, flush=True)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        # A bar that never began would leave an empty line.
        if self._console.is_terminal:
            self._bar.stop()


class TrialLine:
    """Shows the trial of an advice that runs.

    Called with the name of each trial before it runs; returns what is called with the fraction that is done.
    """

    def __init__(self, console: Console | None = None, *, quiet: bool = False) -> None:
        self._quiet = quiet
        self._console = console or Console(file=sys.stderr, highlight=False)
        self._live = Live(console=self._console, refresh_per_second=8, transient=True)
        self._began = time.monotonic()
        self._number = 0

    def __enter__(self) -> TrialLine:
        if self._console.is_terminal and not self._quiet:
            self._live.start()
        return self

    def __call__(self, name: str) -> Callable[[float], object]:
        # fault: --quiet: companions of a run tell their progress -> if False: | coupler/test_confidence
        if self._quiet:
            return lambda fraction: None
        self._number += 1
        head = f"trial {self._number}, {time.monotonic() - self._began:.0f} s: {name}"
        if not self._console.is_terminal:
            print(head, file=self._console.file, flush=True)
            return lambda fraction: None
        self._live.update(Text(head))
        return lambda fraction: self._live.update(Text(f"{head}, {100 * fraction:.0f} %"))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._console.is_terminal:
            self._live.stop()


# Runs jobs in parallel: by processes of this machine, one thread each, or by a Dask cluster.

WORKER = [*python(), "-m", "coupler.experiments.trial"]
PATIENCE = 5.0  # s a process has to end once it is not needed
GLANCE = 1.0  # s between two checks whether a process still works


@dataclass(frozen=True)
class FinishedJob:
    """A job that is done.  name : its key in the mapping of jobs."""

    name: str
    result: TrialResult


@dataclass(frozen=True)
class _WaitingJob:
    name: str
    job: Job


def run_here(jobs: Mapping[str, Job], processes: int, limit: float | None = None) -> Generator[FinishedJob, None, None]:
    """Yield each job as it is done; begun in the order of `jobs`.

    limit : a run that takes longer is stopped [s].  However the iteration is left, no process stays behind.
    """
    waiting: queue.SimpleQueue[_WaitingJob] = queue.SimpleQueue()
    for name, job in jobs.items():
        waiting.put(_WaitingJob(name, job))
    done: queue.SimpleQueue[FinishedJob] = queue.SimpleQueue()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="slideline-study-")))
        workers = [_Worker(waiting, done, limit, folder / f"{k}.log") for k in range(min(processes, len(jobs)))]
        for worker in workers:
            stack.callback(worker.end)
            worker.start()
        for _ in jobs:
            yield _next(done, workers)


def _next(done: queue.SimpleQueue[FinishedJob], workers: Sequence[_Worker]) -> FinishedJob:
    """Wait for the next job that is done."""
    while True:
        alive = any(worker.alive for worker in workers)
        try:
            return done.get(timeout=GLANCE)
        except queue.Empty:
            assert alive, "a job was lost"


class _Worker:
    """Runs jobs in one process after another: a new one where the last one died."""

    def __init__(self, waiting: queue.SimpleQueue[_WaitingJob], done: queue.SimpleQueue[FinishedJob],
                 limit: float | None, log: Path) -> None:
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._waiting, self._done, self._limit, self._log = waiting, done, limit, log
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()
        self._ended = False

    @property
    def alive(self) -> bool:
        """Whether its thread still runs."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Begin to take jobs."""
        self._thread.start()

    def _run(self) -> None:
        while not self._ended:
            try:
                waiting = self._waiting.get_nowait()
            except queue.Empty:
                return
            self._done.put(FinishedJob(waiting.name, self._run_job(waiting.job)))

    def _run_job(self, job: Job) -> TrialResult:
        process = self._running()
        if process is None:
            return TrialResult("not begun", storable=False)
        began = time.monotonic()
        timer = threading.Timer(self._limit, process.kill) if self._limit else None
        if timer:
            timer.start()
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(json.dumps(asdict(job)) + "\n")
            process.stdin.flush()
            answer = process.stdout.readline()
        except OSError:
            answer = ""  # it died while the job was written to it: its log says why
        finally:
            if timer:
                timer.cancel()
        if answer.endswith("\n"):
            return trial_from(json.loads(answer))
        code = process.wait()
        why = f"its process died ({code}): {self._tail()}"
        if self._limit and time.monotonic() - began >= self._limit:
            why = f"took longer than {self._limit:g} s"
        return TrialResult(why, storable=False)

    def _running(self) -> subprocess.Popen[str] | None:
        with self._lock:
            if self._ended:
                return None
            if self._process is None or self._process.poll() is not None:
                self._close()
                with self._log.open("wb") as log:
                    # A session of its own: Ctrl-C at the terminal goes to the study, which ends this process.
                    self._process = subprocess.Popen(WORKER, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log,
                                                     text=True, encoding="utf-8", env=environment(),
                                                     start_new_session=True)
            return self._process

    def _tail(self) -> str:
        lines = self._log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return lines[-1] if lines else "its log is empty"

    def end(self) -> None:
        """End the process, whatever it does."""
        with self._lock:
            self._ended = True
            if self._process is not None and self._process.poll() is None:
                # fault: a process of a study left behind -> pass | coupler/test_study
                self._process.kill()
        if self._thread.is_alive():
            self._thread.join(PATIENCE)
        with self._lock:
            self._close()

    def _close(self) -> None:
        if self._process is not None:
            for pipe in (self._process.stdin, self._process.stdout):
                assert pipe is not None
                pipe.close()
            self._process.wait(PATIENCE)
        self._process = None


# Dask is imported only where a scheduler's address is given.

SCHEDULER_TIMEOUT = "30s"  # until a scheduler answers
# A worker may have several threads; FMUs and the clock of a run want the process for themselves.
ALONE = threading.Lock()


def run_there(jobs: Mapping[str, Job], address: str) -> Generator[FinishedJob, None, None]:
    """Yield each job as it is done by the cluster whose scheduler is at `address`, tcp://host:port.

    Its workers need the same packages installed, and mesh files at the same paths.
    Raises ScenarioError where Dask is not installed, HalfError where no scheduler answers.
    """
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as exc:
        raise ScenarioError("Dask is not installed", key="--cluster", value=address,
                            remedy="pip install 'slideline[cluster]', or leave --cluster out") from exc
    try:
        client = distributed.Client(address, timeout=SCHEDULER_TIMEOUT)
    except (OSError, ValueError) as exc:
        raise HalfError(f"no Dask scheduler answers at {address} ({exc})") from exc
    with client:
        names = {client.submit(solve_alone, asdict(job), pure=False): name for name, job in jobs.items()}
        for future in distributed.as_completed(names):
            failure = future.exception()
            yield FinishedJob(names[future], TrialResult(str(failure), storable=False) if failure is not None
                              else trial_from(future.result()))


def solve_alone(job: Mapping[str, Any]) -> dict[str, Any]:
    """Run one job at a time in a process."""
    with ALONE:
        return solve(job)
