"""A log of a run for programs: one JSON object a line, as things happen."""

from __future__ import annotations

import json
import math
import sys
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from coupler.errors import ResultsError
from coupler.running.progress import Progress


class RunLog:
    """Appends a line when the run begins, after every window tried, and at its end.

    Each has `at` (UTC) and `kind`: `begin` (out), `window` (the fields of Progress; null for what is not finite),
    `end` (outcome: that of the run, as `done` was told it, or the error's class, and its text).  None for the path:
    nothing is written.  Raises ResultsError where the file cannot be begun; where it cannot be gone on with, that is
    said once on stderr, for it ends no run.
    """

    def __init__(self, path: Path | None, out: Path) -> None:
        self._path, self._out = path, out
        self._outcome = "left"

    def __enter__(self) -> Self:
        self._write("begin", {"out": str(self._out)})
        return self

    def __call__(self, progress: Progress) -> None:
        self._write("window", {**asdict(progress), "taken": progress.taken})

    def done(self, outcome: str) -> None:
        """How the run ended that raised no error, as its results say: completed, stopped, interrupted."""
        self._outcome = outcome

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        how: dict[str, Any] = {"outcome": self._outcome}
        # fault: a run that failed is logged as if it had not -> if False: | coupler/test_status
        if kind is not None:
            how = {"outcome": kind.__name__, "message": str(error), "notes": list(getattr(error, "__notes__", ()))}
        self._write("end", how)

    def _write(self, kind: str, what: dict[str, Any]) -> None:
        if self._path is None:
            return
        line = {"at": datetime.now(UTC).isoformat(timespec="milliseconds"), "kind": kind,
                **{n: None if isinstance(v, float) and not math.isfinite(v) else v for n, v in what.items()}}
        try:
            with self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")
        except OSError as exc:
            # fault: a disk that is full for the log ends the run -> if True: |
            #   coupler/test_status::test_a_log_on_a_full_disk_ends_no_run
            if kind == "begin":
                raise ResultsError(f"{self._path}: the log cannot be written ({exc.strerror})") from exc
            print(f"{self._path}: the log cannot be gone on with ({exc.strerror}); the run goes on without",
                  file=sys.stderr, flush=True)
            self._path = None
