"""The calls of a server: a queue that carries each out once, their statistics, their errors.  No transport in here.

A client numbers its calls 1, 2, 3, ... and repeats a call under its number, and the next number of its repeats, when no
answer came.  So that a call is never carried out twice, the queue keeps the last answers of every client, lets a
repeated call wait for the answer of the first, and refuses numbers it has already forgotten.  No message is taken
twice: what is not newer than all that was heard of its client is a replay, or was overtaken (`Heard`).
"""

from __future__ import annotations

import re
import time
from array import array
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from queue import SimpleQueue
from statistics import median
from threading import Lock
from typing import Any, Generic, TypeVar

KEEP_ANSWERS = 4  # per client; it has one call open at a time, so one would do if no packet were ever late
KEEP_CLIENTS = 64
CAPACITY = 64  # calls waiting; more is a client gone wild, and it is told so

Waiter = TypeVar("Waiter")
_ENVELOPE = re.compile(r"([A-Za-z0-9_-]{1,64})/([A-Za-z0-9_-]{1,64})/([1-9][0-9]{0,17})/([1-9][0-9]{0,17})")


def name_of(request: Any) -> str:
    """What is asked: the kind of a request, or of the one that it carries as its `verb`."""
    # fault: who is busy says with what carries the call -> return type(request).__name__ |
    #   coupler/test_processes::test_a_stuck_half_is_named_at_its_deadline
    return type(getattr(request, "verb", request)).__name__


@dataclass(frozen=True)
class Envelope:
    """The label of a message.

    instance : whom it is for.  client : who calls.  number : which of the client's calls.  attempt : which message of
    that call, 1 and more where it is repeated.
    """

    instance: str
    client: str
    number: int
    attempt: int = 1

    def __str__(self) -> str:
        return f"{self.instance}/{self.client}/{self.number}/{self.attempt}"


def parse_envelope(text: str) -> Envelope | None:
    """Parse an envelope; None where the text is not one."""
    match = _ENVELOPE.fullmatch(text)
    return Envelope(match[1], match[2], int(match[3]), int(match[4])) if match else None


class Heard:
    """The newest message of every client.  None is forgotten, so that what was heard once is known for ever."""

    def __init__(self) -> None:
        self._newest: dict[str, tuple[int, int]] = {}
        self._lock = Lock()

    def is_new(self, envelope: Envelope) -> bool:
        """Whether a message is newer than all of its client before it, which from now on it is one of."""
        message = envelope.number, envelope.attempt
        with self._lock:
            # fault: a message heard before is taken again -> if message < (0, 0): | contact/test_link
            if message <= self._newest.get(envelope.client, (0, 0)):
                return False
            self._newest[envelope.client] = message
            return True


@dataclass(frozen=True)
class Answered:
    """The answer to a call.  ok : payload is a reply's bytes; else it is the UTF-8 text `code: message`."""

    ok: bool
    payload: bytes


def failure(code: str, message: str) -> Answered:
    """Make the answer to a call that gets no reply, and why."""
    return Answered(False, f"{code}: {message}".encode())


@dataclass(frozen=True)
class Call:
    """A call to be carried out."""

    envelope: Envelope
    payload: bytes


@dataclass
class _Client(Generic[Waiter]):
    newest: int = 0
    waiting: dict[int, list[Waiter]] = field(default_factory=dict)
    answers: OrderedDict[int, Answered] = field(default_factory=OrderedDict)


class CallQueue(Generic[Waiter]):
    """Take calls from any thread and hand new ones to one worker, in order.

    one_owner : whether the client that calls first is the only one who may.
    """

    def __init__(self, instance: str, *, one_owner: bool = False) -> None:
        self.instance = instance
        self._one_owner, self._owner = one_owner, ""
        self.queue: SimpleQueue[Call | None] = SimpleQueue()
        self._clients: OrderedDict[str, _Client[Waiter]] = OrderedDict()
        self._lock = Lock()

    def arrive(self, envelope: Envelope, payload: bytes, waiter: Waiter) -> Answered | None:
        """Return what to answer at once, or None: the waiter gets its answer from `finish`."""
        with self._lock:
            # fault: a half serves whoever calls -> if False: | contact/test_link
            if self._one_owner and (self._owner or envelope.client) != envelope.client:
                return failure("not_owner", f"this serves {self._owner} alone, not {envelope.client}")
            self._owner = self._owner or envelope.client
            client = self._client(envelope.client)
            if envelope.number in client.answers:
                return client.answers[envelope.number]
            if envelope.number in client.waiting:
                client.waiting[envelope.number].append(waiter)
                return None
            if envelope.number <= client.newest:
                return failure("stale", f"call {envelope.number} after {client.newest}")
            if self.queue.qsize() >= CAPACITY:
                return failure("busy", f"{CAPACITY} calls are waiting")
            client.newest = envelope.number
            client.waiting[envelope.number] = [waiter]
        self.queue.put(Call(envelope, payload))
        return None

    def finish(self, call: Call, answered: Answered) -> list[Waiter]:
        """Store the answer of a call carried out; return all who wait for it."""
        with self._lock:
            client = self._client(call.envelope.client)
            client.answers[call.envelope.number] = answered
            while len(client.answers) > KEEP_ANSWERS:
                client.answers.popitem(last=False)
            return client.waiting.pop(call.envelope.number, [])

    def _client(self, name: str) -> _Client[Waiter]:
        client = self._clients.setdefault(name, _Client())
        self._clients.move_to_end(name)
        if len(self._clients) > KEEP_CLIENTS:
            idle = next((k for k, c in self._clients.items() if not c.waiting and k != name), None)
            if idle is not None:
                del self._clients[idle]
        return client


# Statistics of calls

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
class ServerStats:
    """Statistics of a server's calls.

    since : seconds the server has lived.  verbs : by name of the request, in the order of their first calls.
    """

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


class CallStats:
    """Count calls; may be read from any thread while they go on."""

    def __init__(self) -> None:
        self._started = time.perf_counter()
        self._counts: dict[str, _Count] = {}
        self._lock = Lock()

    def add(self, verb: str, seconds: float, bytes_in: int, bytes_out: int) -> None:
        """Count one call."""
        with self._lock:
            c = self._counts.setdefault(verb, _Count())
            if len(c.recent) < RECENT:
                c.recent.append(seconds)
            else:
                c.recent[c.count % RECENT] = seconds
            c.count += 1
            c.total += seconds
            # fault: the longest call is the shortest -> c.most = min(c.most, seconds) | contact/test_call_stats
            c.most = max(c.most, seconds)
            c.bytes_in += bytes_in
            c.bytes_out += bytes_out

    def so_far(self) -> ServerStats:
        """Return the statistics so far."""
        with self._lock:
            return ServerStats(time.perf_counter() - self._started, {
                verb: Verb(c.count, c.total, median(c.recent), c.most, c.bytes_in, c.bytes_out)
                for verb, c in self._counts.items()})


def lines(stats: ServerStats) -> list[str]:
    """Format statistics for a log, a line a verb."""
    return [f"{name}: {v.count} calls, {v.total:.4g} s (median {v.typical:.3g} s, most {v.most:.3g} s), "
            f"{v.bytes_in} bytes in, {v.bytes_out} bytes out" for name, v in stats.verbs.items()]


# What may go wrong with a call:
#
#     LinkError
#     |-- LinkSpecError      the link's text is wrong, or names an address that is not allowed
#     |-- ServiceDownError   nobody is there, or who was there died
#     |-- LinkTimeoutError   somebody is there and did not answer within the deadline
#     `-- LinkProtocolError  what came back is not an answer (damaged, refused by the transport, a bug at the far end)
#
# That the service refuses a request is no error of the link: it is the reply `Refused`.

class LinkError(Exception):
    """The contact service could not be asked."""


class LinkSpecError(LinkError):
    """The link's text is wrong, or names an address that is not allowed."""


class ServiceDownError(LinkError):
    """Nobody is there, or who was there died."""


class LinkTimeoutError(LinkError):
    """Somebody is there and did not answer within the deadline."""


class LinkProtocolError(LinkError):
    """What came back is not an answer."""
