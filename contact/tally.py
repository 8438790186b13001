"""What a server was asked, verb by verb: how often, how long it took, how many bytes."""

from __future__ import annotations

import time
from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import median
from threading import Lock

RECENT = 10_000  # calls a verb whose seconds are kept, for the median


@dataclass(frozen=True)
class Verb:
    """Calls of one verb.

    total, most : seconds of work, decoding and encoding included.  typical : their median over the last 10 000 calls.
    bytes_in, bytes_out : of the messages.
    """

    count: int
    total: float
    typical: float
    most: float
    bytes_in: int
    bytes_out: int


@dataclass(frozen=True)
class Told:
    """By name of the message that asks, in the order of their first calls.  since : seconds the server has lived."""

    since: float
    verbs: Mapping[str, Verb]


@dataclass
class _Count:
    count: int = 0
    total: float = 0.0
    most: float = 0.0
    bytes_in: int = 0
    bytes_out: int = 0
    recent: array[float] = field(default_factory=lambda: array("d"))


class Tally:
    """Counts calls; may be read from any thread while they go on."""

    def __init__(self) -> None:
        self._started = time.perf_counter()
        self._counts: dict[str, _Count] = {}
        self._lock = Lock()

    def add(self, verb: str, seconds: float, bytes_in: int, bytes_out: int) -> None:
        """One call more."""
        with self._lock:
            c = self._counts.setdefault(verb, _Count())
            if len(c.recent) < RECENT:
                c.recent.append(seconds)
            else:
                c.recent[c.count % RECENT] = seconds
            c.count += 1
            c.total += seconds
            # fault: the longest call is the shortest -> c.most = min(c.most, seconds) | contact/test_tally
            c.most = max(c.most, seconds)
            c.bytes_in += bytes_in
            c.bytes_out += bytes_out

    def told(self) -> Told:
        """All of it so far."""
        with self._lock:
            return Told(time.perf_counter() - self._started, {
                verb: Verb(c.count, c.total, median(c.recent), c.most, c.bytes_in, c.bytes_out)
                for verb, c in self._counts.items()})


def lines(told: Told) -> list[str]:
    """The same for a log, a line a verb."""
    return [f"{name}: {v.count} calls, {v.total:.4g} s (median {v.typical:.3g} s, most {v.most:.3g} s), "
            f"{v.bytes_in} bytes in, {v.bytes_out} bytes out" for name, v in told.verbs.items()]
