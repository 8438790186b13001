"""Writes files whole or not at all: new ones never over another, results in place of an older one."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path

from coupler.errors import ResultsError, ScenarioError
from coupler.record.paths import part_of

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
