"""Behaviour of a process that a coupler started and will reap.

It lives exactly as long as its standard input is open at the other end: the kernel closes that pipe however
the parent ends.  It ignores Ctrl-C (the parent gets it too, and reaps in order).  Its standard output is a
private line to the parent; whatever else prints goes to the log.
"""

from __future__ import annotations

import ctypes
import faulthandler
import os
import signal
import sys
import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue

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
