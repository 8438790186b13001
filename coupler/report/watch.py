"""The page of a run that goes on: made of its journal again and again, until the run ends."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from coupler.record.finish import snapshot
from coupler.record.journal import being_written
from coupler.record.paths import journal_of
from coupler.record.results import Results
from coupler.report.page import write_page

SHARE = 0.2  # of one core that pages may take from the run


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
            copy = Path(folder) / path.name
            snapshot(journal, copy)
            so_far = Results(copy)
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


def goes_on(journal: Path) -> bool:
    """True while the journal is there and its run lives."""
    return journal.exists() and being_written(journal)
