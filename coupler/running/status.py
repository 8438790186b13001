"""How far a run is, read from what it has written so far: by anybody who may read its files, also while it runs."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from coupler.errors import ResultsError
from coupler.record.journal import being_written, read_journal
from coupler.record.paths import can_resume, checkpoint_of, journal_of, stopped_of
from coupler.record.results import Results

LOOKS = 20  # at files that a run moves when it ends
PARTS = ("thermal", "mechanical", "fmi", "recording")


@dataclass(frozen=True)
class RunProgress:
    """How far a run is.

    state : running, or what became of it; killed where its process is gone without a word.  t, end : time and end of
    the run [s].  windows, rejected : how many were accepted so far, and how many not.  seconds : wall time
    of windows, of parts by name besides.
    last : of the last window: its size H [s], scheme, verdict and message.  quiet : since anything was written [s].
    checkpoint : since the last one was [s]; None: there is none.  message : how it ended.  resume : the command that
    goes on with it; empty where it goes on itself, is complete, or left no checkpoint.
    """

    title: str
    state: str
    t: float
    end: float
    windows: int = 0
    rejected: int = 0
    seconds: float = 0.0
    parts: Mapping[str, float] = field(default_factory=dict)
    last: Mapping[str, Any] = field(default_factory=dict)
    quiet: float = 0.0
    checkpoint: float | None = None
    message: str = ""
    resume: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain values."""
        return asdict(self)

    @property
    def lines(self) -> list[str]:
        """It in words."""
        share = f", {100.0 * self.t / self.end:.1f} %" if self.end else ""
        told = [f"{self.title}: {self.state}, t = {self.t:.9g} s of {self.end:g} s{share}",
                f"  {self.windows} windows ({self.rejected} rejected) in {self.seconds:.1f} s"
                + "".join(f", {n} {s:.1f} s" for n, s in self.parts.items())]
        if self.last:
            told.append(f"  the last: {self.last['H']:.3g} s, {self.last['scheme']}, {self.last['verdict']}"
                        + (f" ({self.last['message']})" if self.last["message"] else ""))
        if self.state == "running":
            told.append(f"  written to {self.quiet:.1f} s ago")
        if self.checkpoint is not None and self.state == "running":
            told.append(f"  its checkpoint is {self.checkpoint:.0f} s old")
        if self.resume:
            told.append(f"  to resume: {self.resume}")
        return told + [f"  {line}" for line in self.message.splitlines()]


def status(out: Path) -> RunProgress:
    """Return how far the run of a results file is.  Raises ResultsError where there is neither file nor journal."""
    for _ in range(LOOKS):
        journal = journal_of(out) if journal_of(out).exists() else stopped_of(out)
        if not journal.exists():
            if not out.exists():
                raise ResultsError(f"{out}: there is no such file, and no run that writes it")
            return _finished(Results(out))
        # fault: a run that ends while it is looked at is a traceback -> with suppress(KeyError): |
        #   coupler/test_status::test_a_run_that_ends_while_it_is_looked_at_is_looked_at_again
        with suppress(FileNotFoundError):
            return _of_journal(out, journal)
    raise ResultsError(f"{out}: its run begins and ends faster than it can be looked at")


def _of_journal(out: Path, journal: Path) -> RunProgress:
    # Before it is read: a run that ends meanwhile has then said so.
    running = being_written(journal)
    title, end, t, rows, state, message = "", 0.0, 0.0, [], "", ""
    for record in read_journal(journal):
        meta = record.meta
        if record.kind == "run":
            title, end = str(meta["title"]), float(meta["coupling"]["end"])
        elif record.kind == "window":
            rows.append(meta)
            t = float(meta.get("t_now", t))
        elif record.kind == "rewind":
            rows, t = rows[:int(meta["rows"])], float(meta["t_now"])
        elif record.kind == "end":
            state, message = str(meta["outcome"]), str(meta["message"])
    last = rows[-1] if rows else {}
    # fault: rejected windows are counted among those of the run -> taken = len(rows) |
    #   coupler/test_status::test_windows_are_counted_as_by_the_run_itself
    taken = sum(bool(row["taken"]) for row in rows)
    kept = checkpoint_of(out)
    now = time.time()
    return RunProgress(
        # fault: a run whose process is gone counts as running -> title, state or "running", t, end, taken, |
        #   coupler/test_status
        title, state or ("running" if running else "killed"), t, end, taken, len(rows) - taken,
        sum(float(row["seconds"]) for row in rows),
        {n: sum(float(row[f"{n}_seconds"]) for row in rows) for n in PARTS} if rows else {},
        {n: last[n] for n in ("H", "scheme", "verdict", "message")} if last else {},
        max(0.0, now - journal.stat().st_mtime), max(0.0, now - kept.stat().st_mtime) if kept.exists() else None,
        message,
        # fault: how a killed run goes on is not told -> "") | coupler/test_status
        f"slideline resume {out}" if not running and can_resume(out) else "")


def _finished(results: Results) -> RunProgress:
    w, parts = results.windows, results.seconds_by_part
    # What the run itself says: windows, what is recorded of them and what the coupler finds out between them.
    # fault: seconds between windows are forgotten -> seconds = float(w.seconds.sum()) | coupler/test_status
    seconds = sum(parts.values()) - parts["set-up"] - results.overlap_seconds
    return RunProgress(str(results.header["title"]), results.outcome, float(results.t[-1]),
                       float(results.header["coupling"]["end"]), int(w.taken.sum()), int((~w.taken).sum()),
                       seconds,
                       {n: float(w[f"{n}_seconds"].sum()) for n in PARTS}, message=results.message)
