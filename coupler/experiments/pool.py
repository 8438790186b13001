"""Jobs run by processes of this machine, one thread each."""

from __future__ import annotations

import importlib
import json
import queue
import subprocess
import tempfile
import threading
import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import Any

from coupler.errors import HalfError, ScenarioError
from coupler.experiments.trial import Job, Trial, solve, trial_from
from coupler.fmu.children import environment, python

WORKER = [*python(), "-m", "coupler.experiments.worker"]
PATIENCE = 5.0  # s a process has to end once it is not needed
GLANCE = 1.0  # s between two looks at whether anybody still works


Done = tuple[str, Trial]


def run_here(jobs: Mapping[str, Job], processes: int, limit: float | None = None) -> Generator[Done, None, None]:
    """(name, trial) of each job as it is done; begun in the order of `jobs`.

    limit [s]: a run that takes longer is given up.  However the iteration is left, no process stays behind.
    """
    waiting: queue.SimpleQueue[tuple[str, Job]] = queue.SimpleQueue()
    for item in jobs.items():
        waiting.put(item)
    done: queue.SimpleQueue[Done] = queue.SimpleQueue()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="slideline-study-")))
        lanes = [_Lane(waiting, done, limit, folder / f"{k}.log") for k in range(min(processes, len(jobs)))]
        for lane in lanes:
            stack.callback(lane.end)
            lane.start()
        for _ in jobs:
            yield _next(done, lanes)


def _next(done: queue.SimpleQueue[Done], lanes: Sequence[_Lane]) -> Done:
    """What is done next; waits for it."""
    while True:
        alive = any(lane.alive for lane in lanes)
        try:
            return done.get(timeout=GLANCE)
        except queue.Empty:
            assert alive, "a job was lost"


class _Lane:
    """A thread with one process after another: a new one where the last one died."""

    def __init__(self, waiting: queue.SimpleQueue[tuple[str, Job]], done: queue.SimpleQueue[Done],
                 limit: float | None, log: Path) -> None:
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._waiting, self._done, self._limit, self._log = waiting, done, limit, log
        self._process: subprocess.Popen[str] | None = None
        self._lock = threading.Lock()
        self._ended = False

    @property
    def alive(self) -> bool:
        """Whether it still works."""
        return self._thread.is_alive()

    def start(self) -> None:
        """Begin to take jobs."""
        self._thread.start()

    def _run(self) -> None:
        while not self._ended:
            try:
                name, job = self._waiting.get_nowait()
            except queue.Empty:
                return
            self._done.put((name, self._tried(job)))

    def _tried(self, job: Job) -> Trial:
        process = self._standing()
        if process is None:
            return Trial("not begun", kept=False)
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
            answer = ""  # it died while it was told: its log says why
        finally:
            if timer:
                timer.cancel()
        if answer.endswith("\n"):
            return trial_from(json.loads(answer))
        code = process.wait()
        why = f"its process died ({code}): {self._tail()}"
        if self._limit and time.monotonic() - began >= self._limit:
            why = f"took longer than {self._limit:g} s"
        return Trial(why, kept=False)

    def _standing(self) -> subprocess.Popen[str] | None:
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
        return lines[-1] if lines else "it left no word"

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


# Jobs run by a Dask cluster; Dask is asked for only where a scheduler's address is given.

SCHEDULER_TIMEOUT = "30s"  # until a scheduler answers
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
        client = distributed.Client(address, timeout=SCHEDULER_TIMEOUT)
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
