"""The journal: an append-only file of records that a crash cannot corrupt, from which the results file is made."""

from __future__ import annotations

import struct
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

    HDF5 cannot promise that (a process killed while it writes leaves a file nobody opens), so run.h5 is made from
    the journal when a run ends, in one atomic step.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: BinaryIO = path.open("wb")
        self._file.write(MAGIC)
        self._file.flush()

    def write(self, kind: str, meta: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]] | None = None) -> None:
        """Append one record."""
        record = encode_record(kind, dict(meta), {k: np.asarray(v) for k, v in (arrays or {}).items()})
        self._file.write(_HEAD.pack(len(record), zlib.crc32(record)) + record)
        self._file.flush()

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
    with path.open("rb") as file:
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
