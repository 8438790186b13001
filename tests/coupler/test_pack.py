"""Numbers inside a page: what the script unpacks is what the run has."""

from __future__ import annotations

import base64
import json
import zlib

import numpy as np
import pytest

from coupler.report.pack import NO_VALUE, Pack, json_text, thinned


def unpacked(pack: Pack) -> bytes:
    return zlib.decompress(base64.b64decode(pack.text))


def rows_of(table: dict, data: bytes) -> np.ndarray:
    """As live/data.js reads a table."""
    _, first, length = table["values"]
    both = np.frombuffer(data[first:first + length], np.uint8).reshape(2, table["rows"], table["columns"]).astype(int)
    codes = np.cumsum(256 * both[0] + both[1], axis=0) % (NO_VALUE + 1)
    step = (table["high"] - table["low"]) / 65534
    return np.where(codes == NO_VALUE, np.nan, table["low"] + step * codes)


def test_arrays_come_back_to_the_bit() -> None:
    pack, t = Pack(), np.linspace(0.0, 1.0, 7) / 3.0
    pack.put([1, 2, 3], "u1")
    kind, first, length = pack.put(t)
    assert kind == "f8"
    assert np.array_equal(np.frombuffer(unpacked(pack)[first:first + 8 * length], "<f8"), t)


def test_tables_come_back_to_half_a_step() -> None:
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(5, 40)) * 1e6
    rows[1, 3] = rows[4, 7] = np.nan
    pack = Pack()
    table = pack.table(rows)
    found = rows_of(table, unpacked(pack))
    assert np.array_equal(np.isnan(found), np.isnan(rows))
    step = (np.nanmax(rows) - np.nanmin(rows)) / 65534
    assert np.nanmax(np.abs(found - rows)) <= 0.5001 * step
    assert np.nanmin(found) == pytest.approx(np.nanmin(rows), rel=1e-12)


@pytest.mark.parametrize("value", [0.0, 273.15, np.nan])
def test_a_table_of_one_value(value: float) -> None:
    pack = Pack()
    table = pack.table(np.full((3, 4), value))
    assert np.array_equal(rows_of(table, unpacked(pack)), np.full((3, 4), value), equal_nan=True)


def test_thinned_curves_keep_their_ends_and_peaks() -> None:
    t = np.linspace(0.0, 1.0, 50_001)
    peak, dip = np.zeros_like(t), np.zeros_like(t)
    peak[20_003], dip[44_444] = 5.0, -3.0
    kept = thinned(t, [peak, dip], 300)
    assert len(kept) <= 330
    assert (kept[0], kept[-1]) == (0, 50_000)
    assert peak[kept].max() == 5.0
    assert dip[kept].min() == -3.0
    assert np.array_equal(thinned(t[:9], [peak[:9]], 300), np.arange(9))


def test_no_name_ends_the_block_of_data() -> None:
    text = json_text({"name": "</script><b>"})
    assert "<" not in text
    assert json.loads(text) == {"name": "</script><b>"}
