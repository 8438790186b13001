"""Builders of halves: those of this project in one process that has imported all they need, others in their own.

An import of a builder costs a second of processor time, a build a tenth of that.  What goes wrong with the common
process is nobody's build: the builder then runs in a process of its own, as those of other packages always do.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import CancelledError, Future
from pathlib import Path
from threading import Lock, Thread

from coupler.errors import HalfError
from coupler.fmu.children import environment, python

DEADLINE = 300.0  # s a builder may take
SERVER = ["-m", "coupler.fmu.build_server"]
LOG_LINES = 30  # of what a builder said, quoted in the error


def run_builder(kind: str, module: str, words: Sequence[str], out: Path,
                common: tuple[str, Sequence[str]] | None) -> None:
    """Run `python -m MODULE WORDS`, which makes the FMU `out`.

    kind : of the half, for errors.  common : what the sources of builders are that may share a process (another text
    for other sources), and their modules; None: this one runs alone.  Raises HalfError with the builder's words.
    """
    code, said = _common(module, words, out, *common) if common and _FORKS else (None, "")
    if code is None:
        code, said = _alone(kind, module, words)
    if code < 0 and not said.strip():
        said = f"it was ended by signal {-code}"
    if code != 0 or not out.is_file():
        tail = "\n".join(said.strip().splitlines()[-LOG_LINES:])
        raise HalfError(f"its builder ({module}) ended with code {code} and made no FMU", half=kind, log=tail)


_FORKS = sys.platform == "linux"  # elsewhere a process that has imported so much cannot be forked, or not safely


def _alone(kind: str, module: str, words: Sequence[str]) -> tuple[int, str]:
    """Run a builder in a process of its own; return its exit code, and what it said."""
    try:
        done = subprocess.run([*python(), "-m", module, *words], capture_output=True, text=True, errors="replace",
                              timeout=DEADLINE, stdin=subprocess.DEVNULL, check=False)
    except subprocess.TimeoutExpired as exc:
        raise HalfError(f"its builder ({module}) did not end within {DEADLINE:g} s", half=kind) from exc
    return done.returncode, done.stderr or done.stdout


def _common(module: str, words: Sequence[str], out: Path, sources: str,
            modules: Sequence[str]) -> tuple[int | None, str]:
    """Run a builder in the common process; return None for its exit code where that was of no use."""
    with tempfile.NamedTemporaryFile(prefix="build-", suffix=".log", dir=out.parent) as log:
        try:
            code = _server_of(sources, modules).build(module, words, log.name).result(DEADLINE)
        except (OSError, CancelledError):  # a TimeoutError is an OSError
            _end_all()
            out.unlink(missing_ok=True)
            return None, ""
        return code, log.read().decode(errors="replace")


class _Server:
    """The process (coupler.fmu.build_server).  sources : of what it has imported."""

    def __init__(self, sources: str, modules: Sequence[str]) -> None:
        self.sources, self.pid = sources, os.getpid()
        self._process = subprocess.Popen([*python(), *SERVER], stdin=subprocess.PIPE,
                                         stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment(),
                                         process_group=0)
        self._lock, self._number = Lock(), 0
        self._waiting: dict[int, Future[int]] = {}
        self.ended = False
        self._reader = Thread(target=self._listen, daemon=True)
        self._reader.start()
        self._say({"modules": list(modules)})

    def build(self, module: str, words: Sequence[str], log: str) -> Future[int]:
        """Ask for a build; the exit code comes later, or is cancelled where the process ended before."""
        asked: Future[int] = Future()
        with self._lock:
            self._number += 1
            number = self._number
            if self.ended:
                raise BrokenPipeError("it has ended")
            self._waiting[number] = asked
        self._say({"id": number, "module": module, "words": list(words), "log": log})
        return asked

    def end(self) -> None:
        """End the process, and all that it builds."""
        with contextlib.suppress(OSError):
            assert self._process.stdin is not None
            self._process.stdin.close()
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
        assert self._process.stdout is not None
        self._process.stdout.close()

    def _say(self, what: dict[str, object]) -> None:
        assert self._process.stdin is not None
        line = f"{json.dumps(what)}\n".encode()
        with self._lock:
            self._process.stdin.write(line)
            self._process.stdin.flush()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            told = json.loads(line)
            with self._lock:
                asked = self._waiting.pop(told["id"])
            asked.set_result(int(told["code"]))
        self._process.wait()
        with self._lock:
            self.ended = True
            left = list(self._waiting.values())
        for asked in left:
            asked.cancel()


_servers: list[_Server] = []  # at most one
_servers_lock = Lock()


def _server_of(sources: str, modules: Sequence[str]) -> _Server:
    """The process that has imported these sources; a new one where there is none, or it has ended."""
    with _servers_lock:
        if _servers and _servers[0].pid != os.getpid():
            _servers.clear()  # of the process that this one was forked from
        if _servers and (_servers[0].ended or _servers[0].sources != sources):
            _servers.pop().end()
        if not _servers:
            _servers.append(_Server(sources, modules))
        return _servers[0]


def _end_all() -> None:
    with _servers_lock:
        if _servers and _servers[0].pid == os.getpid():
            _servers.pop().end()


atexit.register(_end_all)
