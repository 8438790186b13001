"""What is shown while trials run: one live line on a terminal, a line a trial elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.text import Text


class TrialLine:
    """Called with the name of each trial before it runs; gives what is told the share that is done."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(file=sys.stderr, highlight=False)
        self._live = Live(console=self._console, refresh_per_second=8, transient=True)
        self._began = time.monotonic()
        self._number = 0

    def __enter__(self) -> TrialLine:
        if self._console.is_terminal:
            self._live.start()
        return self

    def __call__(self, name: str) -> Callable[[float], object]:
        self._number += 1
        head = f"trial {self._number}, {time.monotonic() - self._began:.0f} s: {name}"
        if not self._console.is_terminal:
            print(head, file=self._console.file, flush=True)
            return lambda share: None
        self._live.update(Text(head))
        return lambda share: self._live.update(Text(f"{head}, {100 * share:.0f} %"))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._console.is_terminal:
            self._live.stop()
