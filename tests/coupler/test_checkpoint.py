"""The checkpoint file: every field comes back, and anything but the whole file of the same versions is refused."""

from __future__ import annotations

import hashlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.records import WireError
from coupler.errors import ResultsError
from coupler.record import checkpoint as module
from coupler.record.checkpoint import Checkpoint, Origin, from_bytes, read_checkpoint, to_bytes, write_checkpoint

sys.path.insert(0, str(Path(__file__).parent))
from filled import differences, filled

ORIGIN: Origin = filled(Origin)
FULL: Checkpoint = filled(Checkpoint)
DATA = to_bytes(ORIGIN, FULL)


def test_every_field_that_is_remembered_comes_back_to_the_bit() -> None:
    origin, back = from_bytes(DATA, ORIGIN.versions, "c")
    assert origin == ORIGIN
    assert differences(FULL, back) == []
    assert to_bytes(origin, back) == DATA


def test_the_comparison_sees_any_field() -> None:
    control = replace(FULL.committed.control, number=7)
    other = replace(FULL, committed=replace(FULL.committed, control=control))
    assert differences(FULL, other) == [".committed.control.number"]


def test_what_no_hint_describes_is_not_written() -> None:
    control = replace(FULL.committed.control, size="large")
    with pytest.raises(WireError, match="size"):
        to_bytes(ORIGIN, replace(FULL, committed=replace(FULL.committed, control=control)))


def test_every_truncation_is_refused() -> None:
    for size in range(len(DATA)):
        with pytest.raises(ResultsError, match=r"cut short|not a checkpoint"):
            from_bytes(DATA[:size], ORIGIN.versions, "c")
    with pytest.raises(ResultsError, match="damaged"):
        from_bytes(DATA + b"\0", ORIGIN.versions, "c")


def test_500_flipped_bytes_are_refused() -> None:
    random = np.random.default_rng(1)
    for at in random.integers(len(DATA), size=500):
        bad = DATA[:at] + bytes([DATA[at] ^ int(random.integers(1, 256))]) + DATA[at + 1:]
        with pytest.raises(ResultsError, match=r"damaged|not a checkpoint"):
            from_bytes(bad, ORIGIN.versions, "c")


def test_flipped_bytes_under_a_checksum_that_fits_end_in_the_same_error_or_in_a_checkpoint() -> None:
    """What a bug, not a disk, would make: no other exception than ResultsError all the same."""
    random = np.random.default_rng(2)
    begin, refused = len(module.MAGIC) + 32, 0
    for at in random.integers(begin, len(DATA), size=500):
        rest = DATA[begin:at] + bytes([DATA[at] ^ int(random.integers(1, 256))]) + DATA[at + 1:]
        try:
            from_bytes(module.MAGIC + hashlib.sha256(rest).digest() + rest, ORIGIN.versions, "c")
        except ResultsError:
            refused += 1
    assert refused > 250


def test_other_versions_are_refused_by_name() -> None:
    name = next(iter(ORIGIN.versions))
    with pytest.raises(ResultsError, match=f"{name} .*, now 2.0;? ?.*run anew"):
        from_bytes(DATA, ORIGIN.versions | {name: "2.0"}, "c")
    with pytest.raises(ResultsError, match="numpy none, now 1"):
        from_bytes(DATA, ORIGIN.versions | {"numpy": "1"}, "c")


def test_a_checkpoint_with_other_fields_is_of_another_version(monkeypatch: pytest.MonkeyPatch) -> None:
    older = DATA.replace(b"setup_seconds", b"setup_moments")
    rest = older[len(module.MAGIC) + 32:]
    with pytest.raises(ResultsError, match="another version"):
        from_bytes(module.MAGIC + hashlib.sha256(rest).digest() + rest, ORIGIN.versions, "c")


def test_a_file_takes_the_place_of_the_older_one_whole_or_not_at_all(tmp_path: Path,
                                                                     monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "run.h5.checkpoint"
    write_checkpoint(path, b"older")
    write_checkpoint(path, DATA)
    assert read_checkpoint(path, ORIGIN.versions)[0] == ORIGIN

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(module.os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_checkpoint(path, b"newer")
    assert path.read_bytes() == DATA


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="none: cannot be read"):
        read_checkpoint(tmp_path / "none", {})


def test_one_of_the_layout_before_is_refused_by_name() -> None:
    """It keeps one value of contact a node; read as pair nodes it would be another state."""
    data = module.MAGIC.replace(b"-2\n", b"-1\n") + b"0" * 100
    with pytest.raises(ResultsError, match=r"c: not a checkpoint of this version .* pair by pair; no resume from it"):
        from_bytes(data, ORIGIN.versions, "c")
