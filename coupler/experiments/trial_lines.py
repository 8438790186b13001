"""Shows the progress of a study and of an advice: one live line on a terminal, a line a run elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.text import Text

from coupler.experiments.trial import TrialResult


class StudyLine:
    """Shows the runs of a study that are done, and those that failed.  console : default standard error."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(file=sys.stderr, highlight=False)
        self._bar = Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                             console=self._console, transient=True)
        self._began = time.monotonic()
        self._done = self._total = 0

    def __enter__(self) -> StudyLine:
        return self

    def begin(self, total: int, stored: int) -> None:
        """Show how many runs there are.  total : those of the reference too.  stored : done by an earlier call."""
        self._total, self._done = total, stored
        self._print(f"{total} runs, {stored} of them done before" if stored else f"{total} runs")
        if self._console.is_terminal and stored < total:
            self._task = self._bar.add_task("runs", total=total, completed=stored)
            self._bar.start()

    def __call__(self, label: str, trial: TrialResult) -> None:
        """Show that a run is done."""
        self._done += 1
        if trial.failed:
            self._print(f"failed: {label}: {trial.failed}")
        if self._console.is_terminal:
            self._bar.update(self._task, completed=self._done)
        elif not trial.failed:
            self._print(f"{self._done} of {self._total}, {self._total - self._done} to go, "
                        f"{time.monotonic() - self._began:.0f} s: {label}: {trial.solver_calls} solver calls")

    def _print(self, text: str) -> None:
        if self._console.is_terminal:
            self._bar.console.print(text, markup=False)
        else:
            print(text, file=self._console.file, flush=True)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._bar.stop()


class TrialLine:
    """Shows the trial of an advice that runs.

    Called with the name of each trial before it runs; returns what is called with the fraction that is done.
    """

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
            return lambda fraction: None
        self._live.update(Text(head))
        return lambda fraction: self._live.update(Text(f"{head}, {100 * fraction:.0f} %"))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        if self._console.is_terminal:
            self._live.stop()
