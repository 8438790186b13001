"""The journal: an append-only file of records that a crash cannot corrupt; run.h5 is made from it."""

from __future__ import annotations

import os
import struct
import sys
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from contact.codec import WireError, decode_record, encode_record
from coupler.errors import ResultsError

MAGIC = b"SLIDELINE-JOURNAL-1\n"
_HEAD = struct.Struct("<QI")  # length of the record, crc32 of the record


class Journal:
    """Appends records; each is whole on disk or, after a crash, not there: the reader drops a cut tail.

    HDF5 cannot promise that (a process killed while it writes leaves a file nobody opens), so run.h5 is made
    from the journal when a run ends, in one atomic step.

    path : overwritten if it exists.  The journal is locked while its writer lives.
    Raises ResultsError if another run is writing it, or it cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            # Not mode "wb": that would empty the journal of another run before its lock is seen.
            self._file: BinaryIO = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+b")
        except OSError as exc:
            raise ResultsError(f"{path}: cannot be written ({exc.strerror})") from exc
        if not _lock(self._file):
            self._file.close()
            raise ResultsError(f"{path}: another run is writing to it; give this one another results file")
        self._file.truncate(0)
        self._file.write(MAGIC)
        self._file.flush()

    def write(self, kind: str, meta: Mapping[str, Any],
              arrays: Mapping[str, NDArray[Any]] | None = None) -> None:
        """Append one record.  Raises ResultsError where that cannot be done, the disk being full, say."""
        record = encode_record(kind, dict(meta), {k: np.asarray(v) for k, v in (arrays or {}).items()})
        try:
            self._file.write(_HEAD.pack(len(record), zlib.crc32(record)) + record)
            self._file.flush()
        except OSError as exc:
            raise ResultsError(f"{self.path}: cannot be written ({exc.strerror}); what it holds stays good") from exc

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


def read_journal(path: Path) -> Iterator[tuple[str, dict[str, Any], dict[str, NDArray[Any]]]]:
    """The whole records of a journal in order: (kind, meta, arrays).  A cut or damaged tail ends the reading.

    Raises ResultsError if the file is no journal.
    """
    try:
        opened = path.open("rb")
    except OSError as exc:
        raise ResultsError(f"{path}: cannot be read ({exc.strerror})") from exc
    with opened as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise ResultsError(f"{path}: not a journal of a run")
        size = path.stat().st_size
        while len(head := file.read(_HEAD.size)) == _HEAD.size:
            length, crc = _HEAD.unpack(head)
            if length > size - file.tell():
                return
            record = file.read(length)
            if zlib.crc32(record) != crc:
                return
            try:
                yield decode_record(record)
            except WireError:
                return


def being_written(path: Path) -> bool:
    """True while the run that writes this journal lives."""
    with path.open("rb") as file:
        return not _lock(file)


def _lock(file: BinaryIO) -> bool:
    """Lock a journal until the file is closed or its process dies; False if another has the lock."""
    if sys.platform == "win32":  # no such lock there: two runs to one file are not noticed
        return True
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
