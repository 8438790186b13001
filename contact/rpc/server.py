"""The server's side of a call: one worker, each call once, a status that other threads can read; and its process.

Keys, with a random instance for every life of a server, so that an answer of a former life is never taken for
one of this, and two servers of one role are detected instead of silently both being heard:
    slideline/RUN/ROLE/INSTANCE/v1/ask      the calls; the label is the envelope (contact.rpc.calls)
    slideline/RUN/ROLE/INSTANCE/v1/status   what the server is busy with, as a text
    slideline/RUN/ROLE/INSTANCE/v1/stats    counts and times of its calls so far (contact.rpc.calls), a message
    slideline/RUN/alive/ROLE/INSTANCE       the token
ROLE and INSTANCE are made with the secret of the run, and every question and answer is signed with it
(contact.rpc.seal): the label of a question is ENVELOPE/SIGNATURE, that of its answer ENVELOPE/ok/SIGNATURE or
ENVELOPE/failed/SIGNATURE. What is not signed, or was heard before, is refused without a signature, which no client
takes for an answer.
"""

from __future__ import annotations

import ctypes
import faulthandler
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any, Self

from contact.codec import Kinds, decode, encode
from contact.records import MAX_MESSAGE_HEADER, WireError
from contact.rpc.calls import (
    Answered,
    Call,
    CallQueue,
    CallStats,
    Envelope,
    Heard,
    LinkError,
    failure,
    name_of,
    parse_envelope,
)
from contact.rpc.seal import Seal
from contact.rpc.zenoh_session import Question, Session

UNREADABLE = "unreadable"  # the verb of bytes that are no request
REFUSED = "refused"  # the verb of what is not signed, or was heard before
SIGNALS_HEARD = 1.0  # s between looks for signals while no call comes


@dataclass(frozen=True)
class Keys:
    """The keys of one life of a server."""

    ask: str
    status: str
    stats: str
    token: str


def keys_of(run: str, role: str, instance: str) -> Keys:
    """Return the keys of a life of a server; instance : `*` makes patterns for all."""
    base = f"slideline/{run}/{role}/{instance}/v1"
    return Keys(f"{base}/ask", f"{base}/status", f"{base}/stats", f"slideline/{run}/alive/{role}/{instance}")


def question_label(seal: Seal, key: str, envelope: Envelope, payload: bytes) -> str:
    """Return the label of a question, signed."""
    return f"{envelope}/{seal.sign(f'ask {key} {envelope}', payload)}"


def answer_label(seal: Seal, key: str, envelope: Envelope, answered: Answered) -> str:
    """Return the label of the answer to a question, signed."""
    said = f"{envelope}/{'ok' if answered.ok else 'failed'}"
    return f"{said}/{seal.sign(f'answer {key} {said}', answered.payload)}"


class Server:
    """Answer calls on a session.  `work` does so on the thread that calls it, one call after the other.

    seal : of the run.  one_owner : whether the client that calls first is the only one who may.
    """

    def __init__(self, session: Session, seal: Seal, role: str, requests: Kinds, *, one_owner: bool = False) -> None:
        self._seal = seal
        self.instance = seal.instance(role)
        self._requests = requests
        self._calls: CallQueue[_Caller] = CallQueue(self.instance, one_owner=one_owner)
        self._busy: tuple[str, float] | None = None
        self.stats = CallStats()
        self._served = 0
        self._keys = keys = keys_of(seal.run, seal.name(role), self.instance)
        self._declared = [
            session.answer(keys.ask, self._door(keys.ask, self._arrive)),
            session.answer(keys.status, self._door(keys.status, lambda caller: self._tell(caller, self._status()))),
            session.answer(keys.stats, self._door(
                keys.stats, lambda caller: self._tell(caller, encode(self.stats.so_far())))),
            session.show_token(keys.token),
        ]

    def work(self, handle: Callable[[Any], Any]) -> None:
        """Carry out calls until `stop`.  handle : request -> reply, both messages."""
        while (call := self._next()) is not None:
            answered = self._carry_out(call.payload, handle)
            for caller in self._calls.finish(call, answered):
                self._answer(caller, answered)

    def _next(self) -> Call | None:
        """Wait for the next call."""
        while True:
            try:
                # A signal that comes just before a wait, or to another thread, is handled when the wait is over.
                # fault: a server may miss Ctrl-C for ever -> return self._calls.queue.get() | contact/test_zenoh
                return self._calls.queue.get(timeout=SIGNALS_HEARD)
            except Empty:
                continue

    def stop(self) -> None:
        """Let `work` return after the calls that came before; from any thread, or from handle."""
        self._calls.queue.put(None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for declared in reversed(self._declared):
            declared.undeclare()

    def _carry_out(self, payload: bytes, handle: Callable[[Any], Any]) -> Answered:
        started = time.monotonic()
        verb, answered = self._done(payload, handle, started)
        self.stats.add(verb, time.monotonic() - started, len(payload), len(answered.payload))
        self._served += 1
        return answered

    def _done(self, payload: bytes, handle: Callable[[Any], Any], started: float) -> tuple[str, Answered]:
        """Carry out a call; return the verb and the answer."""
        try:
            request = decode(payload, self._requests, MAX_MESSAGE_HEADER)
        except WireError as exc:
            return UNREADABLE, failure("bad_request", str(exc))
        verb = name_of(request)
        self._busy = verb, started
        try:
            return verb, Answered(True, encode(handle(request)))
        except Exception as exc:  # noqa: BLE001  the process border: a bug must reach the caller as text
            traceback.print_exc(file=sys.stderr)
            return verb, failure("bug", f"{type(exc).__name__}: {exc}")
        finally:
            self._busy = None

    def _door(self, key: str, enter: Callable[[_Caller], None]) -> Callable[[Question], None]:
        """Let in what is signed and new; tell all others why not."""
        heard = Heard()

        def arrived(question: Question) -> None:
            label, _, signature = question.label.rpartition("/")
            envelope = parse_envelope(label)
            # fault: who asks need not sign -> if envelope is None: | contact/test_seal
            if envelope is None or not self._seal.signed(f"ask {key} {envelope}", question.payload, signature):
                self._refuse(question, key, "unsigned: this is not signed with the secret of the run")
            elif envelope.instance != self.instance:
                self._refuse(question, key, f"wrong_instance: this is {self.instance}, not {envelope.instance}")
            elif not heard.is_new(envelope):
                self._refuse(question, key, "replayed: this was heard before, or is older than what was")
            else:
                enter(_Caller(question, key, envelope))

        return arrived

    def _refuse(self, question: Question, key: str, why: str) -> None:
        # Without a signature: a signed refusal could be played to the client as the answer to its own call.
        self.stats.add(REFUSED, 0.0, len(question.payload), len(why))
        try:
            question.answer(key, "", why.encode())
        except LinkError as exc:
            print(exc, file=sys.stderr)

    def _arrive(self, caller: _Caller) -> None:
        answered = self._calls.arrive(caller.envelope, caller.question.payload, caller)
        if answered is not None:
            self._answer(caller, answered)

    def _tell(self, caller: _Caller, payload: bytes) -> None:
        self._answer(caller, Answered(True, payload))

    def _answer(self, caller: _Caller, answered: Answered) -> None:
        label = answer_label(self._seal, caller.key, caller.envelope, answered)
        try:
            caller.question.answer(caller.key, label, answered.payload)
        except LinkError as exc:  # the asker went away: nobody is left to be told
            print(exc, file=sys.stderr)

    def _status(self) -> bytes:
        busy = self._busy
        doing = f"busy with {busy[0]} for {time.monotonic() - busy[1]:.1f} s" if busy else "idle"
        return f"{doing}, {self._calls.queue.qsize()} waiting, {self._served} served".encode()


@dataclass(frozen=True)
class _Caller:
    """Who waits for an answer: a question that was let in, on which key, and its envelope."""

    question: Question
    key: str
    envelope: Envelope


# Behaviour of a process that a coupler started and will reap.
#
# It lives exactly as long as its standard input is open at the other end: the kernel closes that pipe however the
# parent ends.  It ignores Ctrl-C (the parent gets it too, and reaps in order).  Its standard output is a private line
# to the parent; whatever else prints goes to the log.

_ORPHAN_GRACE = 0.5  # seconds to close sessions before the process ends regardless
_M_MMAP_THRESHOLD, _M_TRIM_THRESHOLD, _M_TOP_PAD = -3, -1, -2


class Parent:
    """The two pipes to the parent."""

    def __init__(self, output: int, lines: SimpleQueue[str]) -> None:
        self._output = output
        self._lines = lines

    def say(self, line: str) -> None:
        """Send one line to the parent."""
        os.write(self._output, f"{line}\n".encode())

    def hear(self, timeout: float) -> str:
        """Wait for the next line from the parent.  Raises TimeoutError."""
        try:
            return self._lines.get(timeout=timeout)
        except Empty:
            raise TimeoutError(f"the parent said nothing for {timeout} s") from None


def become_child(on_orphan: Callable[[], None]) -> Parent:
    """Behave as a child from here on.

    on_orphan : called when the parent is gone, just before this process ends.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    faulthandler.enable()
    keep_freed_memory()
    output = os.dup(1)
    os.set_inheritable(output, False)
    os.dup2(2, 1)
    lines: SimpleQueue[str] = SimpleQueue()
    threading.Thread(target=_listen, args=(lines, on_orphan), name="parent", daemon=True).start()
    return Parent(output, lines)


def keep_freed_memory() -> None:
    """Tell glibc not to hand big buffers back to the kernel after every use.

    Each copy of a message would page-fault anew: 2.5 to 10 times slower above 128 kB.  Elsewhere: nothing to do.
    """
    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:  # musl has none
        mallopt(_M_MMAP_THRESHOLD, 1 << 30)
        mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)
        mallopt(_M_TOP_PAD, 64 << 20)


def _listen(lines: SimpleQueue[str], on_orphan: Callable[[], None]) -> None:
    pending = b""
    while chunk := os.read(0, 4096):
        *complete, pending = (pending + chunk).split(b"\n")
        for line in complete:
            lines.put(line.decode())
    # Half a second for a clean good-bye to the network; a solver deep in its work does not delay the end.
    timer = threading.Timer(_ORPHAN_GRACE, os._exit, (1,))
    timer.daemon = True
    timer.start()
    try:
        on_orphan()
    finally:
        os._exit(1)
