"""Handles Ctrl-C: once to stop after the current window, twice to stop at once."""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType
from typing import Any


class Interrupts:
    """While open, the first Ctrl-C is remembered in `asked`; the second interrupts at once.

    An interrupt raised inside a half's step would look to the half like a failure of its own.
    """

    def __init__(self) -> None:
        self.asked = False

    def __enter__(self) -> Interrupts:
        self._old: Any = None
        if threading.current_thread() is threading.main_thread():
            self._old = signal.signal(signal.SIGINT, self._handle)
        return self

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self.asked:
            raise KeyboardInterrupt
        self.asked = True
        line = "stopping after this window; Ctrl-C again stops at once"
        try:
            print(line, file=sys.stderr, flush=True)
        except RuntimeError:
            # The signal came while a line of progress was being written, and no buffer may be entered twice.
            # fault: a signal amid a line ends the run -> raise | coupler/test_stopped::test_ctrl_c_amid_a_line
            os.write(2, f"\n{line}\n".encode())

    def __exit__(self, *exc: object) -> None:
        if self._old is not None:
            signal.signal(signal.SIGINT, self._old)
