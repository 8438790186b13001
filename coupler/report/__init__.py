"""The report of a run: one HTML page that needs nothing but itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from coupler.record.results import Results


def write_report(results: Results, path: Path) -> Path:
    """Write the report of a run to `path` (HTML) and return it.

    The page loads nothing: no script, no style, no image from elsewhere.
    Raises ResultsError if it cannot be written.
    """
    # Here and not above: a command that writes no report starts a second sooner without matplotlib.
    from coupler.report.page import write_page

    return write_page(results, path)


def watch_report(path: Path, out: Path, every: float, on_page: Callable[[Results], object]) -> Results:
    """Write the report of a run again and again while the run goes on; see coupler.report.watch.watch."""
    from coupler.report.watch import watch

    return watch(path, out, every, on_page)


__all__ = ["watch_report", "write_report"]
