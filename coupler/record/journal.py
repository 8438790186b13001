"""The journal: an append-only file of records that a crash cannot corrupt; run.h5 is made from it."""

from __future__ import annotations

import os
import shlex
import struct
import sys
import time
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from contact.records import WireError, decode_record, encode_record
from coupler.errors import ResultsError

MAGIC = b"SLIDELINE-JOURNAL-1\n"
_HEAD = struct.Struct("<QI")  # length of the record, crc32 of the record
LOOKS, LOOK = 5, 0.02  # times, [s]: whoever looks whether a journal is written holds it for microseconds


@dataclass(frozen=True)
class Mark:
    """A place between two records of one journal.

    offset [bytes].  chain : checksum over the heads of all records before it, and so over the records: two journals
    that differ anywhere before a place have different marks there.
    """

    offset: int = len(MAGIC)
    chain: int = 0

    def after(self, head: bytes) -> Mark:
        """The place behind the record with this head."""
        return Mark(self.offset + len(head) + int(_HEAD.unpack(head)[0]), zlib.crc32(head, self.chain))


class Journal:
    """Appends records; each is whole on disk or, after a crash, not there: the reader drops a cut tail.

    HDF5 cannot promise that (a process killed while it writes leaves a file nobody opens), so run.h5 is made
    from the journal when a run ends, in one atomic step.

    path : overwritten if it exists.  The journal is locked while its writer lives.
    since : go on with an older journal instead, behind this place; what stands after it is cut off.
    mark : where the next record goes.
    Raises ResultsError if another run is writing it, it cannot be written, or it does not hold `since`.
    """

    def __init__(self, path: Path, since: Mark | None = None) -> None:
        self.path = path
        self.mark = since or Mark()
        try:
            # Not mode "wb": that would empty the journal of another run before its lock is seen.
            flags = os.O_RDWR | (os.O_CREAT if since is None else 0)
            self._file: BinaryIO = os.fdopen(os.open(path, flags, 0o666), "r+b")
        except OSError as exc:
            raise ResultsError(f"{path}: cannot be written ({exc.strerror})") from exc
        try:
            if not _lock_soon(self._file):
                raise ResultsError(f"{path}: another run is writing to it; give this one another results file")
            if since is not None:
                check_mark(path, since)
        except ResultsError:
            self._file.close()
            raise
        # fault: the journal is not cut back to the checkpoint -> self._file.truncate(0) if since is None else None |
        #   coupler/test_journal::test_a_journal_goes_on_from_a_mark_as_if_it_had_never_stopped
        self._file.truncate(0 if since is None else since.offset)
        self._file.seek(0, os.SEEK_END)
        if since is None:
            self._file.write(MAGIC)
        self._file.flush()

    def write(self, kind: str, meta: Mapping[str, Any],
              arrays: Mapping[str, NDArray[Any]] | None = None) -> None:
        """Append one record.  Raises ResultsError where that cannot be done, the disk being full, say.

        arrays : any shape and dtype, by name; None: none.  The unit of each is what the kind of record says, in SI.
        """
        record = encode_record(kind, dict(meta), {k: np.asarray(v) for k, v in (arrays or {}).items()})
        head = _HEAD.pack(len(record), zlib.crc32(record))
        try:
            self._file.write(head + record)
            self._file.flush()
        except OSError as exc:
            run = shlex.quote(str(self.path.with_suffix("")))
            raise ResultsError(f"{self.path}: cannot be written ({exc.strerror}). What it holds stays good: once this "
                               f"is mended, `slideline resume {run}` goes on") from exc
        self.mark = self.mark.after(head)

    def sync(self) -> None:
        """Wait until all that was written is on the disk.  Raises OSError."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()


@dataclass(frozen=True)
class JournalRecord:
    """kind : run | start | window | frame | thin | rewind | end.  meta : plain values.  arrays : by name."""

    kind: str
    meta: dict[str, Any]
    arrays: dict[str, NDArray[Any]]


def read_journal(path: Path) -> Iterator[JournalRecord]:
    """The whole records of a journal in order.  A cut or damaged tail ends the reading.

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
                yield JournalRecord(*decode_record(record))
            except WireError:
                return


def check_mark(path: Path, mark: Mark) -> None:
    """See that a journal has this place, every record before it whole.  Raises ResultsError."""
    at, whole = Mark(), True
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            raise ResultsError(f"{path}: not a journal of a run")
        size = path.stat().st_size
        while at.offset < mark.offset and len(head := file.read(_HEAD.size)) == _HEAD.size:
            length, crc = _HEAD.unpack(head)
            whole = length <= size - file.tell() and zlib.crc32(file.read(length)) == crc
            if not whole or length > mark.offset - at.offset:
                break
            at = at.after(head)
    # fault: the longer journal of another run is taken for one that is damaged -> if at.offset < mark.offset: |
    #   coupler/test_journal
    if at.offset < mark.offset and not (whole and size >= mark.offset):
        raise ResultsError(f"{path}: is whole up to byte {at.offset} only; its checkpoint goes on from byte "
                           f"{mark.offset}")
    # fault: any journal that is long enough will do -> if at.offset != mark.offset: |
    #   coupler/test_journal::test_the_journal_of_another_run_is_refused
    if at != mark:
        raise ResultsError(f"{path}: is the journal of another run than its checkpoint")


def being_written(path: Path) -> bool:
    """True while the run that writes this journal lives, and until its results file stands.

    Raises FileNotFoundError where it has ended and put its journal away.
    """
    with path.open("rb") as file:
        # Shared: two that look at once do not take each other for the writer.
        return not _lock(file, shared=True)


@contextmanager
def taken(path: Path) -> Iterator[bool]:
    """Hold the journal of a killed run, so that nobody else makes its results file; False where that cannot be."""
    try:
        file = path.open("rb")
    except FileNotFoundError:
        yield False
        return
    with file:
        # Who had it before may have put it away.
        yield _lock(file) and path.exists()


def _lock_soon(file: BinaryIO) -> bool:
    """Lock a journal, also where somebody looks at it just now."""
    for _ in range(LOOKS):
        if _lock(file):
            return True
        time.sleep(LOOK)
    return _lock(file)


def _lock(file: BinaryIO, shared: bool = False) -> bool:
    """Lock a journal until the file is closed or its process dies; False if another has the lock."""
    if sys.platform == "win32":  # no such lock there: two runs to one file are not noticed
        return True
    import fcntl

    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
