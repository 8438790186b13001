"""What a study shows while it runs: runs done and left, and those that failed."""

from __future__ import annotations

import sys
import time
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from coupler.trials.trial import Trial


class StudyLine:
    """A bar on a terminal, a line a run elsewhere.  console : default standard error."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(file=sys.stderr, highlight=False)
        self._bar = Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                             console=self._console, transient=True)
        self._began = time.monotonic()
        self._done = self._total = 0

    def __enter__(self) -> StudyLine:
        return self

    def begin(self, total: int, kept: int) -> None:
        """total : runs of the study, the reference's too.  kept : those done by an earlier call."""
        self._total, self._done = total, kept
        self._print(f"{total} runs, {kept} of them done before" if kept else f"{total} runs")
        if self._console.is_terminal and kept < total:
            self._task = self._bar.add_task("runs", total=total, completed=kept)
            self._bar.start()

    def __call__(self, label: str, trial: Trial) -> None:
        """A run is done."""
        self._done += 1
        if trial.failed:
            self._print(f"failed: {label}: {trial.failed}")
        if self._console.is_terminal:
            self._bar.update(self._task, completed=self._done)
        elif not trial.failed:
            self._print(f"{self._done} of {self._total}, {self._total - self._done} left, "
                        f"{time.monotonic() - self._began:.0f} s: {label}: {trial.half_solves} half-solves")

    def _print(self, text: str) -> None:
        if self._console.is_terminal:
            self._bar.console.print(text, markup=False)
        else:
            print(text, file=self._console.file, flush=True)

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self._bar.stop()
