"""The server's side of a call: one worker, each call once, a status that other threads can read; and its process.

Keys, with a random instance for every life of a server, so that an answer of a former life is never taken for
one of this, and two servers of one role are detected instead of silently both being heard:
    slideline/RUN/ROLE/INSTANCE/v1/ask      the calls; the label is the envelope (contact.rpc.calls)
    slideline/RUN/ROLE/INSTANCE/v1/status   what the server is busy with, as a text
    slideline/RUN/ROLE/INSTANCE/v1/stats    counts and times of its calls so far (contact.rpc.calls), a message
    slideline/RUN/alive/ROLE/INSTANCE       the token
"""

from __future__ import annotations

import ctypes
import faulthandler
import os
import secrets
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
from contact.records import WireError
from contact.rpc.calls import Answered, CallQueue, CallStats, LinkError, failure
from contact.rpc.zenoh_session import Question, Session

UNREADABLE = "unreadable"  # the verb of bytes that are no request


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


class Server:
    """Answer calls on a session.  `work` does so on the thread that calls it, one call after the other."""

    def __init__(self, session: Session, run: str, role: str, requests: Kinds) -> None:
        self.instance = secrets.token_hex(6)
        self._requests = requests
        self._calls: CallQueue[Question] = CallQueue(self.instance)
        self._busy: tuple[str, float] | None = None
        self.stats = CallStats()
        self._served = 0
        self._keys = keys_of(run, role, self.instance)
        self._declared = [
            session.answer(self._keys.ask, self._arrive),
            session.answer(self._keys.status, self._tell_status),
            session.answer(self._keys.stats, self._tell_stats),
            session.show_token(self._keys.token),
        ]

    def work(self, handle: Callable[[Any], Any]) -> None:
        """Carry out calls until `stop`.  handle : request -> reply, both messages."""
        while (call := self._calls.queue.get()) is not None:
            answered = self._carry_out(call.payload, handle)
            for question in self._calls.finish(call, answered):
                self._answer(question, answered)

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
            request = decode(payload, self._requests)
        except WireError as exc:
            return UNREADABLE, failure("bad_request", str(exc))
        verb = type(request).__name__
        self._busy = verb, started
        try:
            return verb, Answered(True, encode(handle(request)))
        except Exception as exc:  # noqa: BLE001  the process border: a bug must reach the caller as text
            traceback.print_exc(file=sys.stderr)
            return verb, failure("bug", f"{type(exc).__name__}: {exc}")
        finally:
            self._busy = None

    def _arrive(self, question: Question) -> None:
        answered = self._calls.arrive(question.label, question.payload, question)
        if answered is not None:
            self._answer(question, answered)

    def _answer(self, question: Question, answered: Answered) -> None:
        try:
            question.answer(self._keys.ask, answered.ok, answered.payload)
        except LinkError as exc:  # the asker went away: nobody is left to be told
            print(exc, file=sys.stderr)

    def _tell_status(self, question: Question) -> None:
        busy = self._busy
        doing = f"busy with {busy[0]} for {time.monotonic() - busy[1]:.1f} s" if busy else "idle"
        text = f"{doing}, {self._calls.queue.qsize()} waiting, {self._served} served"
        question.answer(self._keys.status, True, text.encode())

    def _tell_stats(self, question: Question) -> None:
        question.answer(self._keys.stats, True, encode(self.stats.so_far()))


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
