"""A results file that was damaged is refused by name, or says what it said before."""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest

from coupler.errors import ResultsError
from coupler.record.checksums import DIGEST
from coupler.record.confidence import write_confidence
from coupler.record.results import Results
from coupler.record.vtkhdf import FieldReader
from coupler.trust.in_time.confidence import ProbeConfidence

sys.path.insert(0, str(Path(__file__).parent))
from synthetic_run import Case, write_run

FLIPS = 150


def content(path: Path) -> list[object]:
    """Everything a file tells."""
    r = Results(path)
    found: list[object] = [r.outcome, r.message, repr(r.header), repr(r.totals), r.t.tobytes(), r.windows.tobytes(),
                           repr((r.messages, r.reasons, r.events)), r.iterates.tobytes(), r.max_T]
    found += [(n, r.probe(n)[1].tobytes(), r.unit(n), r.quantity(n)) for n in r.probe_names]
    found += [(n, v.tobytes()) for n, v in (*r.ledger_history()[1].items(), *r.monitors.items())]
    found += [(n, v.values.tobytes()) for n, v in r.conditions.items()]
    found += [(n, k, v.tobytes()) for n, along in r.contact.items() for k, v in vars(along).items() if v is not None]
    found += [(n, r.field(n)[1].tobytes()) for n, f in r.fields.items() if f.half == "none"]
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "run.h5"
    write_run(path, Case(windows=100))
    return path


def test_no_flipped_bit_changes_what_a_file_says(whole, tmp_path):
    """Of 400 flips 307 were accepted, and 7 ended in a traceback."""
    data, before, random = whole.read_bytes(), content(whole), np.random.default_rng(1)
    damaged, refused = tmp_path / "run.h5", 0
    for bit in random.integers(8 * len(data), size=FLIPS):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        damaged.write_bytes(flipped)
        try:
            assert content(damaged) == before, f"bit {bit} of {len(data)} bytes"
        except ResultsError:
            refused += 1
    assert refused > FLIPS / 2, "the bits hit nothing that is read: nothing was shown"


def test_every_array_of_values_has_a_checksum(whole):
    bare = []

    def look(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and item.size and item.shape and not item.fletcher32:
            bare.append(name)

    with h5py.File(whole) as f:
        f.visititems(look)
        assert len(f["windows"]) > 50
    assert bare == []


@pytest.mark.parametrize("cut", [0, 1, 100, 5000, -1])
def test_a_file_that_was_cut_is_refused(whole, tmp_path, cut):
    short = tmp_path / "run.h5"
    short.write_bytes(whole.read_bytes()[:cut])
    with pytest.raises(ResultsError, match="not a readable results file"):
        content(short)


def test_a_file_of_before_has_no_digest_and_is_read(whole, tmp_path):
    old = tmp_path / "run.h5"
    old.write_bytes(whole.read_bytes())
    with h5py.File(old, "r+") as f:
        del f.attrs[DIGEST]
    assert content(old) == content(whole)


def test_what_is_added_later_is_checked_too(whole, tmp_path):
    path = tmp_path / "run.h5"
    path.write_bytes(whole.read_bytes())
    one = ProbeConfidence("windows", np.zeros(len(Results(path).t)), 1.0, 1, 2.0, "K", "")
    write_confidence(path, {"p": one})
    assert Results(path).confidence["p"].range == 2.0
    with h5py.File(path, "r+") as f:
        f["confidence/p"].attrs["unit"] = "C"
    with pytest.raises(ResultsError, match="its texts are not those that were written: it is damaged"):
        Results(path)


def test_a_field_file_that_was_damaged_is_refused(whole, tmp_path):
    file = sorted(whole.parent.glob("*.vtkhdf"))[0]
    with FieldReader(file) as reader:
        name, k = reader.point_fields[0], len(reader.times) - 1
        points = np.column_stack([reader.points(k), np.zeros(len(reader.points(k)))])
        arrays = {"field": reader.point_field(name, k).tobytes(), "points": points.tobytes()}
    data, damaged = file.read_bytes(), tmp_path / file.name
    for what, array in arrays.items():
        spoiled = bytearray(array)
        spoiled[len(array) // 2] ^= 1
        assert array in data, "the array does not stand in the file as it is: nothing was flipped"
        damaged.write_bytes(data.replace(array, bytes(spoiled)))  # frames in which nothing moves are alike
        with FieldReader(damaged) as reader:
            read = partial(reader.point_field, name) if what == "field" else reader.points
            with pytest.raises(ResultsError, match="damaged"):
                read(k)
