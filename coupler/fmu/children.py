"""Child processes: started with a pipe to their standard input, watched, and reaped whatever happens."""

from __future__ import annotations

import os
import selectors
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import contact

LOG_LINES = 20  # of a dead child's log, quoted in the error
LOG_BYTES = 8192
LOG_MOST = 16 << 20  # bytes of a log
WATCH_PERIOD = 0.25  # s
END_PATIENCE = 2.0  # s a child has to end by itself after its input was closed
ONE_THREAD = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


class ChildError(Exception):
    """A child did not start.  child : its name.  log : the tail of its log."""

    def __init__(self, message: str, child: str, log: str) -> None:
        super().__init__(message)
        self.child = child
        self.log = log


@dataclass(frozen=True)
class Child:
    """A running child.  log : the file with its standard error."""

    name: str
    process: subprocess.Popen[bytes]
    log: Path

    @property
    def pid(self) -> int:
        """Of its process."""
        return self.process.pid

    def tell(self, line: str) -> None:
        """One line to the child.  A dead one does not mind: `ready_line` or the watch will tell."""
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(f"{line}\n".encode())
            self.process.stdin.flush()
        except BrokenPipeError:
            return

    def log_tail(self) -> str:
        """The last lines of its log."""
        with self.log.open("rb") as f:
            f.seek(max(0, f.seek(0, os.SEEK_END) - LOG_BYTES))
            lines = f.read().decode(errors="replace").splitlines()
        return "\n".join(lines[-LOG_LINES:])

    def trim(self) -> None:
        """Cut a log that has become long down to its last lines: an FMU may print without end."""
        # fault: the log of a child grows without end -> if True: | coupler/test_processes
        if self.log.stat().st_size <= LOG_MOST:
            return
        with self.log.open("r+b") as f:
            f.seek(-LOG_BYTES, os.SEEK_END)
            tail = f.read()
            # What the child writes in between is lost; it goes on at the end, wherever that is.
            f.truncate(0)
        with self.log.open("ab") as f:
            f.write(b"(the log was cut here: it had become longer than %d bytes)\n" % LOG_MOST + tail)

    def is_stopped(self) -> bool:
        """Whether its process is stopped (Ctrl-Z, SIGSTOP), where the system tells."""
        try:
            text = Path(f"/proc/{self.process.pid}/stat").read_text(encoding="ascii", errors="replace")
        except OSError:
            return False
        # Behind the name, which is in brackets and may hold anything.
        return text.rpartition(")")[2].split()[:1] in (["T"], ["t"])

    def death(self) -> str:
        """How it ended, in words; empty while it lives."""
        code = self.process.poll()
        if code is None:
            return ""
        if code < 0:
            return f"its process was ended by signal {-code}"
        return f"its process ended with code {code}"


def start(name: str, command: Sequence[str], directory: Path) -> Child:
    """Start a child whose log is DIRECTORY/NAME.log.  Raises ChildError where the program cannot be run."""
    log = directory / f"{name}.log"
    with log.open("ab") as f:  # so that `trim` may cut it while the child writes
        try:
            # A group of its own: Ctrl-C in a terminal reaches the coupler alone, even while a child still starts.
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=f,
                                       env=environment(), process_group=0)
        except OSError as exc:
            raise ChildError(f"{command[0]} cannot be run: {exc}", name, "") from exc
    return Child(name, process, log)


def ready_line(child: Child, until: float, watch: Callable[[], None] = lambda: None) -> str:
    """The first line a child says.  Raises ChildError if it dies or is late.

    until : as time.monotonic().  watch : called every quarter of a second meanwhile.
    """
    assert child.process.stdout is not None
    line = b""
    with selectors.DefaultSelector() as selector:
        selector.register(child.process.stdout, selectors.EVENT_READ)
        while not line.endswith(b"\n"):
            while not selector.select(min(WATCH_PERIOD, max(0.0, until - time.monotonic()))):
                if time.monotonic() >= until:
                    raise ChildError("it was not ready in time", child.name, child.log_tail())
                watch()
            chunk = os.read(child.process.stdout.fileno(), 4096)
            if not chunk:
                _wait(child, 1.0)
                death = child.death() or "it fell silent"
                raise ChildError(f"{death} before it was ready", child.name, child.log_tail())
            line += chunk
    return line.decode().strip()


def reap(children: Iterable[Child]) -> None:
    """End all children: close their input, wait a little, then kill.  None is left when this returns."""
    everyone = list(children)
    try:
        for child in everyone:
            _close_pipes(child)
        until = time.monotonic() + END_PATIENCE
        for child in everyone:
            _wait(child, until - time.monotonic())
    finally:
        # Also when a second Ctrl-C ends the waiting.
        for child in everyone:
            child.process.kill()
        for child in everyone:
            child.process.wait()


def _wait(child: Child, seconds: float) -> None:
    try:
        child.process.wait(max(0.0, seconds))
    except subprocess.TimeoutExpired:
        return


def _close_pipes(child: Child) -> None:
    for pipe in (child.process.stdin, child.process.stdout):
        if pipe is not None and not pipe.closed:
            try:
                pipe.close()
            except BrokenPipeError:
                continue


def python() -> list[str]:
    """The command of this interpreter; -P: a file in the current directory must not shadow a module."""
    return [sys.executable, "-P"]


def environment() -> dict[str, str]:
    """Of a child: this one's, one thread, and the packages of this checkout."""
    environment = {**os.environ, **dict.fromkeys(ONE_THREAD, "1")}
    root = Path(contact.__file__).resolve().parent.parent
    if root.name not in ("site-packages", "dist-packages"):  # run from a checkout: the child must find it too
        known = [p for p in environment.get("PYTHONPATH", "").split(os.pathsep) if p]
        environment["PYTHONPATH"] = os.pathsep.join(dict.fromkeys([str(root), *known]))
    return environment
