"""The page of a run that goes on: made of its journal again and again, until the run ends."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from coupler.errors import ResultsError
from coupler.record.finish import NothingYetError, snapshot
from coupler.record.journal import being_written
from coupler.record.paths import journal_of
from coupler.record.results import Results
from coupler.report.page import write_page

SHARE = 0.2  # of one core that pages may take from the run
LOOK = 0.2  # s between two looks for a run


def wait_for(path: Path, patience: float, on_wait: Callable[[], object]) -> None:
    """Wait until a run writes this results file, or it is there, but no longer than `patience` [s].

    Halves are built before a run writes anything.  on_wait : called once, where there is something to wait for.
    """
    end, told = time.monotonic() + patience, False
    while not path.exists() and not journal_of(path).exists() and time.monotonic() < end:
        if not told:
            on_wait()
            told = True
        time.sleep(LOOK)


def watch(path: Path, out: Path, every: float, on_page: Callable[[Results], object]) -> Results:
    """Write the page of a run to `out` until the run ends, and return its results; the browser reads it anew.

    path : the results file that the run will write; one that has ended has its page at once.
    every : least time between two pages [s]; longer where a page takes long to make.  on_page : called after each.
    Raises ResultsError where there is no such run, or the page cannot be written.
    """
    journal = journal_of(path)
    while goes_on(journal):
        started = time.monotonic()
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}.") as folder:
            so_far = _so_far(journal, Path(folder) / path.name)
            if so_far is not None:
                write_page(so_far, out, renew=math.ceil(every))
                on_page(so_far)
        pause = max(every, (time.monotonic() - started) / SHARE)
        while goes_on(journal) and time.monotonic() - started < pause:
            time.sleep(min(0.2, pause))
    results = Results(path)
    # fault: watch: the last page is that of a running run -> write_page(results, out, renew=5) | coupler/test_watch
    write_page(results, out)
    on_page(results)
    return results


def _so_far(journal: Path, copy: Path) -> Results | None:
    """What the run has written; None where it has written nothing yet, or ended meanwhile.  Raises ResultsError."""
    try:
        snapshot(journal, copy)
    except NothingYetError:
        return None
    except ResultsError:
        # fault: watch: a journal that goes between two looks is an error -> if True: | coupler/test_watch
        if journal.exists():
            raise
        return None
    return Results(copy)


def goes_on(journal: Path) -> bool:
    """True while the journal is there and its run lives, and until its results file stands."""
    try:
        return being_written(journal)
    except FileNotFoundError:
        return False
