# SERVICE, PLEASE READ NOTE_TO_SERVICE.txt IN THE CHECKOUT ROOT BEFORE GOING ON (delete this line then).
"""A lane for the bytes of calls between processes of one machine: a Unix socket beside zenoh.

zenoh needs longer for a round trip of nothing than a call may cost, so it finds the service, tells that it lives and
carries what a lane cannot; where both ends run on one machine, which is always so here, calls go through the lane.
Every caller has a thread of its own at the service, which reads, carries out and answers: nothing is handed over.

    "SLDL" | u8 ok | 3 zeros | u64 bytes | that many bytes: a message (contact.codec), or the text of a failure

The name is in Linux's abstract space: it vanishes with the process, whatever ends that.  Elsewhere there are no lanes.
Either end refuses another user's.  A lane on which anything but a whole answer came back is closed, never used again.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable, Sequence

import numpy as np

from contact.codec import Part

MAGIC = b"SLDL"
MAX_BYTES = 1 << 30  # of one message, as over zenoh
PARTS = 512  # handed to the kernel at once; it takes 1024
BUFFER = 4 << 20  # bytes asked of the kernel; it gives what it allows
PERIOD = 0.25  # s between looks at whether the other end lives, while waiting for an answer
_HEAD = struct.Struct("<4sB3xQ")
_CREDENTIALS = struct.Struct("3i")

Carry = Callable[[memoryview], tuple[bool, Sequence[Part]]]


class LaneClosedError(Exception):
    """The lane broke off before a whole answer came; whether the call was carried out is not known."""


def name_of(role: str, instance: str) -> str:
    """The lane's name in the abstract space."""
    return f"\0slideline-{role}-{instance}"


def supported() -> bool:
    """Whether this system has lanes."""
    return sys.platform == "linux"


class Door:
    """Where callers come in: a thread each, for as long as they stay.

    carry : bytes of a request -> ok and pieces of the answer; called on many threads.
    """

    def __init__(self, name: str, carry: Carry) -> None:
        self._carry = carry
        self._open: set[socket.socket] = set()
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(name)
        self._listener.listen()
        threading.Thread(target=self._welcome, name="lanes", daemon=True).start()

    def close(self) -> None:
        """Nobody comes in any more, and those inside are sent away."""
        for s in (self._listener, *self._open):
            _shut(s)

    def _welcome(self) -> None:
        while True:
            try:
                caller, _ = self._listener.accept()
            except OSError:  # closed
                return
            if not _ours(caller):
                caller.close()
                continue
            self._open.add(caller)
            threading.Thread(target=self._attend, args=(caller,), name="lane", daemon=True).start()

    def _attend(self, caller: socket.socket) -> None:
        with caller:
            _widen(caller)
            try:
                while True:
                    _, request = _receive(caller, _patiently)
                    ok, parts = self._carry(request)
                    _send(caller, ok, parts, _patiently)
            except (LaneClosedError, OSError):  # the caller went away: nobody is left to be told
                return
            finally:
                self._open.discard(caller)


class Lane:
    """A caller's end.  One call at a time."""

    def __init__(self, line: socket.socket) -> None:
        self._line = line
        self.closed = False

    def ask(self, parts: Sequence[Part], until: float, watch: Callable[[], None]) -> tuple[bool, memoryview]:
        """ok and the bytes of the answer, which are the caller's.

        until : as time.monotonic().  watch : called every quarter of a second; it may raise what ends the wait.
        Raises TimeoutError, LaneClosedError.
        """
        def wait() -> None:
            watch()
            if time.monotonic() > until:
                raise TimeoutError("no answer before the deadline")

        whole = False
        try:
            _send(self._line, True, parts, wait)
            answer = _receive(self._line, wait)
            whole = True
            return answer
        except TimeoutError:
            raise
        except OSError as exc:
            raise LaneClosedError(str(exc)) from exc
        finally:
            if not whole:
                self.close()

    def close(self) -> None:
        """Let go of the line."""
        self.closed = True
        _shut(self._line)
        self._line.close()


def open_lane(name: str) -> Lane | None:
    """The lane of that name; None where there is none, or it is another user's."""
    if not supported():
        return None
    line = socket.socket(socket.AF_UNIX)
    try:
        line.connect(name)
    except OSError:
        line.close()
        return None
    if not _ours(line):
        line.close()
        return None
    _widen(line)
    line.settimeout(PERIOD)
    return Lane(line)


def _send(line: socket.socket, ok: bool, parts: Sequence[Part], wait: Callable[[], None]) -> None:
    """All pieces from their own memory.  wait : called whenever the line has been stuck for its timeout."""
    left = [memoryview(part).cast("B") for part in parts]
    left.insert(0, memoryview(_HEAD.pack(MAGIC, ok, sum(map(len, left)))))
    while left:
        try:
            sent = line.sendmsg(left[:PARTS])
        except TimeoutError:
            wait()
            continue
        while left and sent >= len(left[0]):
            sent -= len(left.pop(0))
        if sent:
            left[0] = left[0][sent:]


def _receive(line: socket.socket, wait: Callable[[], None]) -> tuple[bool, memoryview]:
    head = memoryview(bytearray(_HEAD.size))
    _fill(line, head, wait)
    magic, ok, size = _HEAD.unpack(head)
    if magic != MAGIC or ok > 1 or size > MAX_BYTES:
        raise LaneClosedError("what came is not a message of the lane")
    body = np.empty(size, np.uint8).data  # not a bytearray, which would be zeroed first
    _fill(line, body, wait)
    return bool(ok), body


def _fill(line: socket.socket, room: memoryview, wait: Callable[[], None]) -> None:
    filled = 0
    while filled < len(room):
        try:
            got = line.recv_into(room[filled:])
        except TimeoutError:
            wait()
            continue
        if got == 0:
            raise LaneClosedError("the other end is gone")
        filled += got


def _patiently() -> None:
    """A service waits for its callers; they do not wait without end for it."""


def _ours(line: socket.socket) -> bool:
    """Whether the process at the other end is this user's."""
    _, uid, _ = _CREDENTIALS.unpack(line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size))
    return bool(uid == os.getuid())


def _widen(line: socket.socket) -> None:
    for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
        line.setsockopt(socket.SOL_SOCKET, option, BUFFER)


def _shut(line: socket.socket) -> None:
    """End whatever waits on it, on other threads too."""
    try:
        line.shutdown(socket.SHUT_RDWR)
    except OSError:  # it is shut, or the other end was first
        return
