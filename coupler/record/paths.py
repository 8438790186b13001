"""The files that stand beside a results file while its run is not complete."""

from __future__ import annotations

import os
from pathlib import Path


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
