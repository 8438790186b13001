"""Where the files of a run lie, and how files are written whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

import h5py

from coupler.errors import ResultsError, ScenarioError
from coupler.record.journal import being_written
from coupler.record.tables import FORMAT

# The files that stand beside a results file while its run is not complete.

def journal_of(path: Path) -> Path:
    """Where the journal of a run that writes `path` is kept while it runs."""
    return path.with_name(path.name + ".journal")


def stopped_of(path: Path) -> Path:
    """Where the journal of a run that ended early is kept, so that it can be resumed."""
    return path.with_name(path.name + ".stopped")


def checkpoint_of(path: Path) -> Path:
    """Where the checkpoint of a run that writes `path` is kept."""
    return path.with_name(path.name + ".checkpoint")


def part_of(path: Path) -> Path:
    """Where a file is made before it takes its place; what a killed run leaves there is overwritten."""
    return path.with_name(f".{path.name}.part")


def making_of(path: Path) -> Path:
    """The folder in which a results file and its field files are made before they take their places."""
    return path.with_name(f".{path.name}.making")


def can_resume(path: Path) -> bool:
    """Whether a run to `path` ended early and left what resuming it needs."""
    return checkpoint_of(path).exists() and (stopped_of(path).exists() or journal_of(path).exists())


def put_away(journal: Path, path: Path, complete: bool) -> None:
    """Leave of a run whose results file was made what resuming it needs: nothing, where it is complete."""
    # fault: the journal of a run that ended early is thrown away -> if complete and checkpoint_of(path).exists(): |
    #   coupler/test_resume::test_stopped_twice_and_resumed_it_is_the_undisturbed_run
    if not complete and checkpoint_of(path).exists():
        os.replace(journal, stopped_of(path))
        return
    journal.unlink(missing_ok=True)
    drop(path)


def drop(path: Path) -> None:
    """Remove what an earlier run to the same file could have been resumed from."""
    for file in (checkpoint_of(path), part_of(checkpoint_of(path)), stopped_of(path)):
        file.unlink(missing_ok=True)


def take_up(path: Path) -> None:
    """Make the journal of a run that ended early the one that is written again."""
    if not journal_of(path).exists() and stopped_of(path).exists():
        os.replace(stopped_of(path), journal_of(path))


# Where results may go: asked before a run starts, because after hours is too late to hear that they may not.

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
    try:
        taken = being_written(journal_of(out))
    except OSError:  # none, or none that can be read: the journal says so when it begins
        taken = False
    if taken:
        raise ResultsError(f"{out}: another run is writing to it; give this one another results file")


def _check_folder(folder: Path, out: Path) -> None:
    if not folder.is_dir():
        raise ResultsError(f"{out}: the folder {folder} does not exist. Make it first, or choose another with --out")
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


# Writes files whole or not at all: new ones never over another, results in place of an older one.

ANOTHER = "Give another one with --out"


def check_free(out: Path) -> None:
    """Check that a file can be made.  Raises ScenarioError where it exists already, or its folder does not."""
    # fault: init: a file that is there is written over -> if False: | coupler/test_init
    if out.exists() or out.is_symlink():
        raise ScenarioError("this file is there already; it is left as it is", file=str(out), remedy=ANOTHER)
    if not out.parent.is_dir():
        raise ScenarioError("the folder of this file does not exist", file=str(out),
                            remedy=f"Make it: mkdir -p {out.parent}")


@contextmanager
def new_files(texts: Mapping[Path, str]) -> Iterator[None]:
    """Write new files; remove them again where one cannot be written, or where the block raises.

    Raises ScenarioError for a file that cannot be written.
    """
    with ExitStack() as stack:
        for path, text in texts.items():
            try:
                # x: a file that came between the look and the writing is left alone too.
                with path.open("x", encoding="utf-8") as file:
                    # fault: new files: what was written stays where the check fails -> pass | coupler/test_deck
                    stack.callback(path.unlink, missing_ok=True)
                    file.write(text)
            except OSError as exc:
                raise ScenarioError(f"this file cannot be written ({exc.strerror})", file=str(path),
                                    remedy=ANOTHER) from exc
        yield
        stack.pop_all()


def write_whole(path: Path, text: str) -> Path:
    """Write a text in place of an older file, and return its path.  Raises ResultsError where it cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part_of(path).write_text(text, encoding="utf-8")
        os.replace(part_of(path), path)
    except OSError as exc:
        raise ResultsError(f"{path}: cannot be written ({exc.strerror})") from exc
    return path
