"""Where results may go: asked before a run starts, because after hours is too late to hear that they may not."""

from __future__ import annotations

import tempfile
from pathlib import Path

import h5py

from coupler.errors import ResultsError
from coupler.record.beside import journal_of
from coupler.record.columns import FORMAT
from coupler.record.journal import being_written

PAGE = ".html"


def check_target(out: Path, *, report: bool = False) -> None:
    """See whether a run may write its results file `out` (and its page beside it).

    An older results file may be replaced, an empty file filled; anything else that stands there stays: a scenario given
    twice by mistake, a device, a folder.  Raises ResultsError, with what to do instead.
    """
    _check_folder(out.parent, out)
    if report and out.suffix == PAGE:
        raise ResultsError(f"{out}: the report takes this name; end the results file in .h5")
    if out.exists() and not out.is_file():
        raise ResultsError(f"{out}: is no file that results could replace; give a name such as {out / 'run.h5'}"
                           if out.is_dir() else f"{out}: is no ordinary file; results cannot go there")
    if out.exists() and out.stat().st_size and not _is_ours(out):
        raise ResultsError(f"{out}: exists and is not a results file; it is left as it is. Give another name")
    journal = journal_of(out)
    if journal.is_file() and being_written(journal):
        raise ResultsError(f"{out}: another run is writing to it; give this one another results file")


def _check_folder(folder: Path, out: Path) -> None:
    if not folder.is_dir():
        raise ResultsError(f"{out}: the folder {folder} does not exist")
    try:
        # Permissions alone do not tell: read-only file systems, and root, to whom everything seems permitted.
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as exc:
        raise ResultsError(f"{out}: the folder {folder} cannot be written to ({exc.strerror})") from exc


def _is_ours(path: Path) -> bool:
    try:
        with h5py.File(path, "r") as f:
            return f.attrs.get("format") == FORMAT
    except OSError:
        return False
