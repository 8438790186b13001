"""The folder of a run among the temporary ones: its owner's alone, gone with the run, or with the next one.

A run that is killed cannot clean up.  Whoever makes a folder holds a lock in it, which the kernel takes away however
the process ends; the next run removes those of this user that nobody holds.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PREFIX = "slideline-run-"
_NEW = ".slideline-new-"  # before its lock is held
_LOCK = "lock"


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Make a folder of mode 0700 and remove it on the way out, and with it those that killed runs left."""
    if sys.platform == "win32":
        with tempfile.TemporaryDirectory(prefix=PREFIX) as folder:
            yield Path(folder)
        return
    remove_abandoned()
    new = Path(tempfile.mkdtemp(prefix=_NEW))
    lock = os.open(new / _LOCK, os.O_CREAT | os.O_RDWR, 0o600)
    folder = new.with_name(PREFIX + new.name.removeprefix(_NEW))
    try:
        _hold(lock)
        os.rename(new, folder)
        yield folder
    finally:
        shutil.rmtree(new, ignore_errors=True)
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def remove_abandoned() -> list[Path]:
    """Remove the folders of this user's runs whose process is gone; returns them."""
    removed = []
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        # Another run may be removing it, too, and what belongs to somebody else is not ours to touch.
        with contextlib.suppress(OSError):
            if folder.is_symlink() or folder.stat().st_uid != os.getuid():
                continue
            lock = os.open(folder / _LOCK, os.O_RDWR | os.O_NOFOLLOW)
            try:
                # fault: the folder of a run that goes on is removed -> pass | coupler/test_scratch
                _hold(lock)
                shutil.rmtree(folder, ignore_errors=True)
                removed.append(folder)
            finally:
                os.close(lock)
    return removed


def _hold(lock: int) -> None:
    """Take a lock until its process ends.  Raises OSError where another has it."""
    import fcntl  # not on every system

    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
