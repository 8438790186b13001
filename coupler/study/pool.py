"""Jobs run by processes of this machine, one thread each."""

from __future__ import annotations

import json
import queue
import subprocess
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import IO

from coupler.children import environment, python
from coupler.study.cell import FAILED, Job, Outcome, outcome_from

WORKER = [*python(), "-m", "coupler.study.worker"]
PATIENCE = 5.0  # s a process has to end once it is not needed
LOG_BYTES = 4096
GLANCE = 1.0  # s between two looks at whether anybody still works


def run_here(jobs: Mapping[str, Job], processes: int, limit: float | None = None) -> Iterator[tuple[str, Outcome]]:
    """(name, outcome) of each job as it is done; begun in the order of `jobs`.

    limit [s]: a run that takes longer is given up.  However the iteration is left, no process stays behind.
    """
    waiting: queue.SimpleQueue[tuple[str, Job]] = queue.SimpleQueue()
    for item in jobs.items():
        waiting.put(item)
    done: queue.SimpleQueue[tuple[str, Outcome]] = queue.SimpleQueue()
    lanes = [_Lane(waiting, done, limit) for _ in range(min(processes, len(jobs)))]
    try:
        for lane in lanes:
            lane.start()
        for _ in jobs:
            yield _next(done, lanes)
    finally:
        for lane in lanes:
            lane.end()


def _next(done: queue.SimpleQueue[tuple[str, Outcome]], lanes: Sequence[_Lane]) -> tuple[str, Outcome]:
    """What is done next; waits for it."""
    while True:
        alive = any(lane.alive for lane in lanes)
        try:
            return done.get(timeout=GLANCE)
        except queue.Empty:
            assert alive, "a job was lost"


class _Lane:
    """A thread with one process after another: a new one where the last one died."""

    def __init__(self, waiting: queue.SimpleQueue[tuple[str, Job]], done: queue.SimpleQueue[tuple[str, Outcome]],
                 limit: float | None) -> None:
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._waiting, self._done, self._limit = waiting, done, limit
        self._process: subprocess.Popen[str] | None = None
        self._log: IO[bytes] | None = None
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
            self._done.put((name, self._outcome(job)))

    def _outcome(self, job: Job) -> Outcome:
        process = self._standing()
        if process is None:
            return Outcome(FAILED, "not begun", kept=False)
        late = threading.Event()
        timer = threading.Timer(self._limit, lambda: (late.set(), process.kill())) if self._limit else None
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
            return outcome_from(json.loads(answer))
        code = process.wait()
        why = f"took longer than {self._limit:g} s" if late.is_set() else f"its process died ({code}): {self._tail()}"
        return Outcome(FAILED, why, kept=False)

    def _standing(self) -> subprocess.Popen[str] | None:
        with self._lock:
            if self._ended:
                return None
            if self._process is None or self._process.poll() is not None:
                self._close()
                self._log = tempfile.TemporaryFile(prefix="slideline-study-")
                # A session of its own: Ctrl-C at the terminal goes to the study, which ends this process.
                self._process = subprocess.Popen(WORKER, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                                 stderr=self._log, text=True, encoding="utf-8", env=environment(),
                                                 start_new_session=True)
            return self._process

    def _tail(self) -> str:
        assert self._log is not None
        self._log.seek(max(self._log.seek(0, 2) - LOG_BYTES, 0))
        lines = self._log.read().decode("utf-8", "replace").strip().splitlines()
        return lines[-1] if lines else "it left no word"

    def end(self) -> None:
        """End the process, whatever it does."""
        with self._lock:
            self._ended = True
            if self._process is not None and self._process.poll() is None:
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
        if self._log is not None:
            self._log.close()
        self._process = self._log = None
