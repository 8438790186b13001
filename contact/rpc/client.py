"""The client's side of a call: a deadline, repeats under one number, and the difference between slow and dead."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from threading import Lock
from typing import Any, cast

from contact.codec import REPLIES, Kinds, decode, encode, kinds_of
from contact.messages import Refused, Register, Registered, Reply, Request
from contact.records import MAX_MESSAGE_HEADER, WireError
from contact.rpc.calls import (
    Answered,
    Envelope,
    LinkError,
    LinkProtocolError,
    LinkTimeoutError,
    ServerStats,
    ServiceDownError,
    name_of,
)
from contact.rpc.seal import Seal, seal_of
from contact.rpc.server import keys_of, question_label
from contact.rpc.zenoh_session import CONNECT_TIMEOUT, Asked, QueryAnswer, Session, close_session, open_session

CALL_DEADLINE = 300.0  # s; a first request may compile kernels on a busy machine, a death is noticed at once
STATUS_TIMEOUT = 2.0  # s
LOOK_PERIOD = 5.0  # s between looks at whether the server lives, while its answer is waited for
PAUSES = (0.01, 0.02, 0.05, 0.1)  # s between repeats of a call; the last one stays

STRANGE_ROUNDS = 5  # repeats of a call to which only answers came that are not signed
STRANGE_BYTES = 80  # of such an answer that are quoted
STOPPED = 2.0  # s between two looks at the clock, a quarter of a second apart, that this process did not get
_BUSY = b"busy:"

STATS = kinds_of([ServerStats])


def _nothing() -> None:
    """A watch that watches nothing."""


def _unknown() -> bool:
    """Nobody knows whether the server's process lives."""
    return False


class Client:
    """Call one server, one call at a time.

    seal : of the run.  instance : which life of the server; taken from its token when not given (exactly one must be
    alive).  watch : called every quarter of a second while waiting; it may raise what ends the wait.  lives : whether
    the server's process is known to live: the network then only lost it for a while, as where either of both was
    stopped, and its call is repeated until the deadline.
    """

    def __init__(self, session: Session, seal: Seal, role: str, replies: Kinds, *, instance: str = "",
                 deadline: float = CALL_DEADLINE, watch: Callable[[], None] = _nothing,
                 lives: Callable[[], bool] = _unknown) -> None:
        self._session, self._seal = session, seal
        self._run, self._role, self._replies = seal.run, role, replies
        self._deadline, self._watch, self._lives = deadline, watch, lives
        self._name = secrets.token_hex(6)
        self._number = self._questions = 0
        self._lock = Lock()
        self._ticked, self._stopped = time.monotonic(), 0.0
        self._looked = self._ticked  # at whether the server lives
        self.answered_at = 0.0
        """When the answer to the last call had arrived (time.perf_counter)."""
        self._pin(instance or self.find(CONNECT_TIMEOUT))

    def call(self, request: Any, deadline: float | None = None) -> Any:
        """Call the server; return the reply to a request.

        deadline : seconds, the client's own if not given.  Raises LinkError, or WireError for a request that
        cannot be sent.
        """
        return self.answer(self.begin(request, deadline))

    def begin(self, request: Any, deadline: float | None = None) -> BegunCall:
        """Send a request, whose reply `answer` waits for; as of `call`.  One call is begun and answered at a time."""
        payload = encode(request)
        deadline = self._deadline if deadline is None else deadline
        with self._lock:
            self._number += 1
            until = time.monotonic() + deadline
            question = self._ask(self._keys.ask, self._envelope(self._number, 1), payload, deadline)
            return BegunCall(self._number, payload, f"{name_of(request)} to {self._role}", until, question)

    def _envelope(self, number: int, attempt: int) -> Envelope:
        # fault: a call repeated is the same message again -> return Envelope(self._instance, self._name, number) |
        #   contact/test_client
        return Envelope(self._instance, self._name, number, attempt)

    def answer(self, call: BegunCall) -> Any:
        """Return the reply to a call that was begun; what went wrong is asked again until its deadline."""
        what = call.what
        with self._lock:
            strange = 0
            self._ticked = self._looked = time.monotonic()
            # fault: who looks at an answer late cannot ask again -> until = call.until | contact/test_client
            until = max(call.until, self._ticked + STATUS_TIMEOUT)
            question = call.question
            for attempt, pause in enumerate(_pauses(), 1):
                if attempt > 1:
                    timeout = max(until - time.monotonic(), 0.001)
                    question = self._ask(self._keys.ask, self._envelope(call.number, attempt), call.payload, timeout)
                told = self._told(question)
                self.answered_at = question.asked.at
                self._tick()
                # fault: while this process was stopped its deadline went by -> pass | contact/test_client
                until += self._stopped
                self._stopped = 0.0
                if told.answer is not None and not told.answer.payload.startswith(_BUSY):
                    return self._opened(told.answer, what)
                if told.late and time.monotonic() + pause > until:
                    raise LinkTimeoutError(f"{what}: {told.late} after its deadline; it is {self.status()}")
                # fault: a process that was stopped for a while counts as dead -> if told.answer is None and
                #   self._instance not in self._alive(): | coupler/test_stopped
                if told.answer is None and self._instance not in self._alive() and not self._lives():
                    raise ServiceDownError(f"{what}: {self._role} is gone")
                strange += bool(told.strange)
                if strange >= STRANGE_ROUNDS:
                    raise LinkProtocolError(f"{what}: whoever answers has not the secret of run {self._run} "
                                            f"(it says {told.strange!r})")
                if time.monotonic() + pause > until:
                    raise LinkTimeoutError(f"{what}: no answer before the deadline; it is {self.status()}")
                time.sleep(pause)
        raise AssertionError("the pauses never end")

    def _tick(self) -> None:
        """Look at the clock, and at whether the process lives; who was stopped himself must not blame another."""
        now = time.monotonic()
        if now - self._ticked > STOPPED:
            self._stopped += now - self._ticked
        self._ticked = now

    def _watching(self) -> None:
        self._tick()
        self._watch()
        # The network says when it has lost who was asked, but not always.
        # fault: who waits for one that is gone waits until the deadline -> if False: | contact/test_client
        if self._ticked - self._looked > LOOK_PERIOD:
            self._looked = self._ticked
            if self._instance not in self._alive() and not self._lives():
                raise ServiceDownError(f"{self._role} is gone")

    def find(self, patience: float) -> str:
        """Wait for the one instance alive.  Raises ServiceDownError where none appears within `patience` seconds."""
        until = time.monotonic() + patience
        for pause in _pauses():
            alive = self._alive()
            if len(alive) == 1:
                return alive.pop()
            if time.monotonic() + pause > until:
                if alive:
                    raise LinkProtocolError(f"run {self._run} has {len(alive)} of {self._role}, not one")
                raise ServiceDownError(f"no {self._role} in run {self._run}")
            self._watch()
            time.sleep(pause)
        raise AssertionError("the pauses never end")

    def move(self, patience: float) -> None:
        """Turn to the next life of the server.  Raises ServiceDownError where none appears in time."""
        self._pin(self.find(patience))

    def status(self) -> str:
        """Ask what the server does, which another thread answers than the one that may be stuck."""
        answer = self._question(self._keys.status)
        return answer.payload.decode(errors="replace") if answer is not None else "silent"

    def stats(self) -> ServerStats:
        """Ask for the statistics of the server's calls, of all its clients.  Raises LinkError."""
        answer = self._question(self._keys.stats)
        if answer is None:
            raise ServiceDownError(f"{self._role} does not say what it was asked")
        return cast(ServerStats, self._decoded(answer.payload, "call statistics", STATS))

    def _question(self, key: str) -> Answered | None:
        """Ask on a key beside that of the calls; None where no answer came soon."""
        self._questions += 1
        envelope = Envelope(self._instance, self._name, self._questions)
        return self._told(self._ask(key, envelope, b"", STATUS_TIMEOUT)).answer

    def _ask(self, key: str, envelope: Envelope, payload: bytes, timeout: float) -> _Question:
        """Ask once."""
        label = question_label(self._seal, key, envelope, payload)
        return _Question(key, envelope, self._session.ask(key, payload, label, timeout))

    def _told(self, question: _Question) -> _Told:
        """What came of a question that is signed, and what is not."""
        told, key, envelope = _Told(), question.key, question.envelope

        def taken(said: QueryAnswer) -> bool:
            if not said.spoken:
                told.late = said.payload.decode(errors="replace")
                return False
            rest = said.label.removeprefix(f"{envelope}/")
            kind, _, signature = rest.partition("/")
            about = f"answer {key} {envelope}/{kind}"
            # fault: any answer is believed, whoever gave it -> true = kind in ("ok", "failed") | contact/test_client
            true = kind in ("ok", "failed") and self._seal.signed(about, said.payload, signature)
            if not true:
                told.strange = said.payload[:STRANGE_BYTES].decode(errors="replace")
                return False
            told.answer = Answered(kind == "ok", said.payload)
            return True

        question.asked.answers(self._watching, taken)
        return told

    def _pin(self, instance: str) -> None:
        self._instance = instance
        self._keys = keys_of(self._run, self._seal.name(self._role), instance)

    def _alive(self) -> set[str]:
        found = self._session.tokens(keys_of(self._run, self._seal.name(self._role), "*").token, self._watch)
        return {name for key in found if self._seal.made(self._role, name := key.rsplit("/", 1)[1])}

    def _opened(self, answer: Answered, what: str) -> Any:
        if not answer.ok:
            raise LinkProtocolError(f"{what}: {answer.payload.decode(errors='replace')}")
        return self._decoded(answer.payload, what, self._replies)

    def _decoded(self, payload: bytes, what: str, kinds: Kinds) -> Any:
        try:
            return decode(payload, kinds, MAX_MESSAGE_HEADER)
        except WireError as exc:
            raise LinkProtocolError(f"{what}: {exc}") from exc


@dataclass(frozen=True)
class _Question:
    """A question on its way."""

    key: str
    envelope: Envelope
    asked: Asked


@dataclass(frozen=True)
class BegunCall:
    """A call that was begun.  what : which, in words.  until : its deadline (time.monotonic)."""

    number: int
    payload: bytes
    what: str
    until: float
    question: _Question


@dataclass
class _Told:
    """What became of a question.

    answer : the first one signed for it.  late : zenoh's own words, that time is over.  strange : the last answer
    that is not signed, which is no answer.
    """

    answer: Answered | None = None
    late: str = ""
    strange: str = ""


def _pauses() -> Iterator[float]:
    yield from PAUSES
    while True:
        yield PAUSES[-1]


class ZenohLink:
    """The contact service of a run, in its own process.

    A service started anew has no surfaces: the link stores what was registered and registers it again.
    The process must have been given the secret of the run (contact.rpc.seal.keep_secret).
    """

    def __init__(self, endpoint: str, run: str, *, deadline: float = CALL_DEADLINE,
                 grace: float | None = None, watch: Callable[[], None] = _nothing) -> None:
        seal = seal_of(run)
        self._session: Session | None = open_session(connect=(endpoint,))
        self._grace = seal.patience if grace is None else grace
        self._registered: dict[str, Register] = {}
        self._client: Client | None = None
        try:
            self._client = Client(self._session, seal, "contact", REPLIES, deadline=deadline, watch=watch)
        except LinkError:
            self.close()
            raise

    def ask(self, request: Request) -> Reply:
        try:
            reply = self._ask(request)
        except WireError as exc:
            raise LinkProtocolError(f"{type(request).__name__}: {exc}") from exc
        if isinstance(request, Register) and isinstance(reply, Registered):
            self._registered[reply.surfaces] = request
        return reply

    def close(self) -> None:
        self._client = None
        if self._session is not None:
            close_session(self._session)
            self._session = None

    def _ask(self, request: Request) -> Reply:
        reply = self._call(request)
        unknown = isinstance(reply, Refused) and reply.code == "unknown_surfaces"
        if unknown and not isinstance(request, Register):
            registered = self._registered.get(request.surfaces)
            # fault: the next life of the service is not told the surfaces -> if registered is None and
            #   isinstance(self._call(registered), Registered): | contact/test_killed
            if registered is not None and isinstance(self._call(registered), Registered):
                return self._call(request)
        return reply

    def _call(self, request: Request) -> Reply:
        client = self._client
        if client is None:
            raise LinkError("the link is closed")
        until = float("inf")
        while True:
            try:
                reply: Reply = client.call(request)
            except ServiceDownError:
                # A request to contact changes nothing there, so the next life of the service may be asked it again; it
                # may die, too.
                until = min(until, time.monotonic() + self._grace)
                # fault: of two lives that a service loses the second is the link's end -> if until <
                #   time.monotonic() + 0.9 * self._grace: | contact/test_killed
                if until < time.monotonic():
                    raise
                client.move(until - time.monotonic())
            else:
                return reply
