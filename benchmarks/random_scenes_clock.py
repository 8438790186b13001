"""The clock of a worker of random_scenes.py: by CPU time, which other work on the machine does not change."""

from __future__ import annotations

import contextlib
import time

import psutil

IDLE = 0.002  # of the time that passes: a worker that uses less waits for what does not come
PATIENCE = 5.0  # limits by the clock: where twenty programs share a core, one may get next to nothing for a minute


class LateError(Exception):
    """A worker has used what it may, or does nothing."""


class Clock:
    """The CPU time of a process and those it started, from now on."""

    def __init__(self, pid: int, limit: float) -> None:
        self._pid, self._limit = pid, limit
        self._start = self._seen = _cpu(pid)
        self._moved = time.monotonic()

    @property
    def used(self) -> float:
        """[s]"""
        return _cpu(self._pid) - self._start

    def look(self) -> None:
        """Raises LateError where more than the limit was used, or nothing in several times as long."""
        now = _cpu(self._pid)
        if now - self._start > self._limit:
            raise LateError(f"not done after {self._limit:g} s of CPU")
        still = time.monotonic() - self._moved
        if abs(now - self._seen) > IDLE * still:  # less than before: one that it started has ended
            self._seen, self._moved = now, time.monotonic()
        elif still > PATIENCE * self._limit:
            raise LateError(f"nothing done in {still:.0f} s")


def _cpu(pid: int) -> float:
    """CPU time [s] of a process and of those it started."""
    total = 0.0
    try:
        process = psutil.Process(pid)
        for each in (process, *process.children(recursive=True)):
            with contextlib.suppress(psutil.NoSuchProcess):
                times = each.cpu_times()
                total += times.user + times.system
    except psutil.NoSuchProcess:
        return 0.0  # it has ended: its pipe says so
    return total
