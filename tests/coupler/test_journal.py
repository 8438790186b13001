"""The journal: whole records up to any cut or flipped byte, never an exception, one writer."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
import pytest

from coupler.errors import ResultsError
from coupler.record.journal import (
    _HEAD,
    MAGIC,
    Journal,
    JournalRecord,
    Mark,
    being_written,
    check_mark,
    read_journal,
)

RECORDS = [("run", {"title": "a"}, {"nodes": np.arange(6.0).reshape(3, 2)}),
           ("window", {"t": 1.0}, {"probes": np.array([1.0, 2.0])}),
           ("window", {"t": 2.0, "message": "ü"}, {}),
           ("end", {"outcome": "completed"}, {"T": np.array([3.0])})]


def write(path: Path) -> list[int]:
    """Write RECORDS; returns the length of the file after each."""
    ends = []
    with Journal(path) as journal:
        for kind, meta, arrays in RECORDS:
            journal.write(kind, meta, arrays)
            ends.append(path.stat().st_size)
    return ends


def same(found: list[JournalRecord], expected: list) -> bool:
    return len(found) == len(expected) and all(
        (f.kind, f.meta) == e[:2] and f.arrays.keys() == e[2].keys()
        and all(np.array_equal(f.arrays[k], e[2][k]) for k in e[2]) for f, e in zip(found, expected, strict=True))


def test_what_is_written_is_read(tmp_path: Path) -> None:
    write(tmp_path / "j")
    assert same(list(read_journal(tmp_path / "j")), RECORDS)


def test_a_record_is_in_the_file_when_write_returns(tmp_path: Path) -> None:
    with Journal(tmp_path / "j") as journal:
        for k, record in enumerate(RECORDS):
            journal.write(*record)
            assert same(list(read_journal(tmp_path / "j")), RECORDS[: k + 1])


def test_cut_at_every_byte_of_the_last_two_records(tmp_path: Path) -> None:
    ends = write(tmp_path / "j")
    data, cut = (tmp_path / "j").read_bytes(), tmp_path / "cut"
    assert ends[-1] == len(data)
    for size in range(ends[1], len(data) + 1):
        cut.write_bytes(data[:size])
        whole = sum(end <= size for end in ends)
        assert same(list(read_journal(cut)), RECORDS[:whole]), f"cut at byte {size} of {len(data)}"


def test_a_flipped_bit_anywhere_in_the_last_two_records_ends_the_reading_there(tmp_path: Path) -> None:
    ends = write(tmp_path / "j")
    data, bad = (tmp_path / "j").read_bytes(), tmp_path / "bad"
    for at in range(ends[1], len(data)):
        for mask in (0x01, 0x80, 0xFF):
            bad.write_bytes(data[:at] + bytes([data[at] ^ mask]) + data[at + 1:])
            whole = sum(end <= at for end in ends)
            assert same(list(read_journal(bad)), RECORDS[:whole]), f"byte {at} flipped by {mask:#x}"


def test_bytes_that_pass_the_checksum_but_are_no_record_end_the_reading(tmp_path: Path) -> None:
    write(tmp_path / "j")
    junk = b"not a record"
    with (tmp_path / "j").open("ab") as file:
        file.write(_HEAD.pack(len(junk), zlib.crc32(junk)) + junk)
    assert same(list(read_journal(tmp_path / "j")), RECORDS)


def test_a_length_beyond_the_file_allocates_nothing(tmp_path: Path) -> None:
    (tmp_path / "j").write_bytes(MAGIC + _HEAD.pack(2**63, 0) + b"x" * 100)
    assert list(read_journal(tmp_path / "j")) == []


@pytest.mark.parametrize("content", [b"", MAGIC[:-1], b"\x89HDF\r\n\x1a\n" + b"0" * 100])
def test_what_is_no_journal_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "j").write_bytes(content)
    with pytest.raises(ResultsError, match="not a journal"):
        list(read_journal(tmp_path / "j"))


def test_a_missing_journal_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="cannot be read"):
        list(read_journal(tmp_path / "none"))


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="cannot be written"):
        Journal(tmp_path / "none" / "j")


def test_one_writer_at_a_time_and_the_second_spoils_nothing(tmp_path: Path) -> None:
    with Journal(tmp_path / "j") as journal:
        journal.write(*RECORDS[0])
        assert being_written(tmp_path / "j")
        with pytest.raises(ResultsError, match="another run"):
            Journal(tmp_path / "j")
        journal.write(*RECORDS[1])
    assert not being_written(tmp_path / "j")
    assert same(list(read_journal(tmp_path / "j")), RECORDS[:2])


def test_an_old_journal_is_overwritten_whole(tmp_path: Path) -> None:
    write(tmp_path / "j")
    with Journal(tmp_path / "j") as journal:
        journal.write(*RECORDS[1])
    assert same(list(read_journal(tmp_path / "j")), [RECORDS[1]])


def marked(path: Path) -> list[Mark]:
    """Write RECORDS; returns the mark after each."""
    marks = []
    with Journal(path) as journal:
        for record in RECORDS:
            journal.write(*record)
            marks.append(journal.mark)
    return marks


def test_a_journal_goes_on_from_a_mark_as_if_it_had_never_stopped(tmp_path: Path) -> None:
    marks = marked(tmp_path / "j")
    whole = (tmp_path / "j").read_bytes()
    for k, mark in enumerate(marks):
        with Journal(tmp_path / "j", mark) as journal:
            for record in RECORDS[k + 1:]:
                journal.write(*record)
            assert journal.mark == marks[-1]
        assert (tmp_path / "j").read_bytes() == whole, f"gone on after record {k + 1}"


def test_a_journal_too_short_or_damaged_for_its_mark_is_left_as_it_is(tmp_path: Path) -> None:
    mark = marked(tmp_path / "j")[2]
    data, bad = (tmp_path / "j").read_bytes(), tmp_path / "bad"
    for size in range(len(MAGIC), mark.offset):
        bad.write_bytes(data[:size])
        with pytest.raises(ResultsError, match="whole up to byte"):
            Journal(bad, mark)
        assert bad.stat().st_size == size
    for at in range(len(MAGIC), mark.offset):
        bad.write_bytes(data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1:])
        with pytest.raises(ResultsError, match="whole up to byte"):
            Journal(bad, mark)
        assert bad.stat().st_size == len(data)


def test_the_journal_of_another_run_is_refused(tmp_path: Path) -> None:
    mark = marked(tmp_path / "j")[1]
    with Journal(tmp_path / "other") as journal:
        journal.write(RECORDS[0][0], {"title": "b"}, RECORDS[0][2])
        journal.write(*RECORDS[1])
        assert journal.mark.offset == mark.offset
    with pytest.raises(ResultsError, match="another run"):
        Journal(tmp_path / "other", mark)
    with Journal(tmp_path / "longer") as journal:
        journal.write(RECORDS[0][0], {"title": 100 * "b"}, RECORDS[0][2])
        journal.write(*RECORDS[1])
    with pytest.raises(ResultsError, match="another run"):
        check_mark(tmp_path / "longer", mark)
    with pytest.raises(ResultsError, match="cannot be written"):
        Journal(tmp_path / "none", mark)
