"""A program of another maker, run for one task: its deck in, its results out, in a folder that is gone afterwards.

What a half knows of the program is what it wrote and what it reads back, so a run is a function of the deck: a task can
be given again, and leaves nothing behind.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

LIMIT = 60.0  # s that a run may take where options.time_limit does not say it
TAIL = 1500  # characters of a failed program's words that are told
# One thread: the order of sums, and with it the last bits of an answer, would depend on the machine's load.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "CCX_NPROC_STIFFNESS": "1", "CCX_NPROC_EQUATION_SOLVER": "1",
              "CCX_NPROC_RESULTS": "1"}


class ProgramError(ArithmeticError):
    """A run of a program that failed, took too long, or left results that cannot be read."""


@dataclass(frozen=True)
class Program:
    """A program to run.  name : of it.  path : of its file.  limit : [s] that a run may take."""

    name: str
    path: Path
    limit: float = LIMIT

    def run(self, arguments: Sequence[str], files: Mapping[str, str], wanted: Sequence[str]) -> dict[str, str]:
        """Run it in a folder of its own and return what it wrote there, name -> content.

        arguments : of its command line.  files : name -> content of what lies in the folder before.
        wanted : names of the files to return.  Raises ProgramError with the end of what the program said.
        """
        with tempfile.TemporaryDirectory(prefix=f"slideline-{self.name}-", ignore_cleanup_errors=True) as scratch:
            folder = Path(scratch)
            for name, content in files.items():
                (folder / name).write_text(content, encoding="utf-8")
            log = folder / "slideline.log"
            begun = time.monotonic()
            code = self._ended(arguments, folder, log)
            spent = time.monotonic() - begun
            if code is None:
                raise ProgramError(f"{self.name} took longer than options.time_limit ({self.limit:g} s) and was "
                                   f"stopped{_words(log)}")
            # fault: a program that failed is believed -> if False: | contact/test_half_program
            if code:
                raise ProgramError(f"{self.name} ended with exit code {code} after {spent:.3g} s{_words(log)}")
            missing = [name for name in wanted if not (folder / name).is_file()]
            if missing:
                raise ProgramError(f"{self.name} ended without writing {', '.join(missing)}{_words(log)}")
            return {name: (folder / name).read_text(encoding="utf-8", errors="replace") for name in wanted}

    def _ended(self, arguments: Sequence[str], folder: Path, log: Path) -> int | None:
        """The exit code; None where it had to be stopped, with all that it started."""
        with log.open("wb") as words:
            try:
                child = subprocess.Popen([str(self.path), *arguments], cwd=folder, stdin=subprocess.DEVNULL,
                                         stdout=words, stderr=subprocess.STDOUT, env={**os.environ, **ONE_THREAD},
                                         start_new_session=os.name == "posix")
            except OSError as exc:
                raise ProgramError(f"{self.name} cannot be started: {self.path}: {exc.strerror}") from exc
            try:
                return child.wait(self.limit)
            except subprocess.TimeoutExpired:
                return None
            finally:
                # fault: what a program started goes on without it -> child.kill() | contact/test_half_program
                _end(child)
                child.wait()


def _end(child: subprocess.Popen[bytes]) -> None:
    if os.name == "posix":
        # Its group bears its number until the last of them is gone, whether it has ended itself or not.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(child.pid, signal.SIGKILL)
    else:
        child.kill()


def _words(log: Path) -> str:
    """The end of what a program said, as the end of a message."""
    text = log.read_bytes()[-4 * TAIL:].decode("utf-8", "replace")
    lines = [line.rstrip() for line in text.splitlines() if line.strip()]
    said = "\n".join(lines)[-TAIL:]
    return f". It said last:\n{said}" if said else "; it said nothing"


def program_of(options: Mapping[str, Any], name: str, remedy: str) -> Program:
    """Return the program that the options of a half name, `program` and `time_limit` of them; else `name` on the PATH.

    remedy : what to do where it is not there.  Raises ValueError.
    """
    stated = options.get("program", name)
    if not isinstance(stated, str) or not stated:
        raise ValueError(f"options.program must be the path of a program, or its name; it is {stated!r}")
    # fault: a program that is not there is told by the first run -> found = shutil.which(stated) or stated |
    #   contact/test_half_program
    found = shutil.which(stated)
    if found is None:
        where = "is no program that can be run" if os.sep in stated else "is not on the PATH"
        raise ValueError(f"the program {stated} {where}. {remedy}")
    limit = options.get("time_limit", LIMIT)
    if isinstance(limit, bool) or not isinstance(limit, int | float) or not limit > 0:
        raise ValueError(f"options.time_limit must be a number of seconds above 0; it is {limit!r}")
    return Program(name, Path(found).resolve(), float(limit))


def refuse_unknown(options: Mapping[str, Any], known: Sequence[str]) -> None:
    """Raise ValueError where options have a key that nobody reads."""
    if unknown := sorted(set(options) - set(known)):
        raise ValueError(f"there is no option {', '.join(unknown)}; there are {', '.join(known)}")
