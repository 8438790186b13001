"""Records as bytes: a name, a small header of plain values, and arrays.  The binary form of every message.

    magic "SLDW" | u32 header length | u32 CRC-32 of the header | msgpack header | zeros to a multiple of 64
    | array | zeros to a multiple of 64 | array | ...

Integers are little-endian, arrays little-endian and C-ordered, each at a multiple of 64 bytes.  The header
says {"version", "name", "meta", "arrays": [[name, dtype, shape, offset, bytes], ...]}, offsets counted from
the first array.  There is exactly one way to lay out given arrays, and a reader refuses every other: what
arrives was written whole by this code or is not accepted.  The checksum covers the header only: a flipped bit
there could change what the arrays mean, while on the way between processes all of it is signed (contact.rpc.seal).
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import msgpack
import numpy as np
from numpy.typing import NDArray

from contact.messages import WIRE_VERSION

MAGIC = b"SLDW"
ALIGNMENT = 64  # a cache line, and the widest vector load
MAX_HEADER = 16 << 20  # bytes; a header holds names and texts, never fields
MAX_MESSAGE_HEADER = 256 << 10  # bytes, of what came over a link: 16 MB of it take 1.3 GB and half a minute to read
MAX_DIMENSIONS = 8
REMEMBERED = 4096  # bytes; call after call has the same header, so short ones are made and checked once
_GAPS = tuple(bytes(n) for n in range(ALIGNMENT))
_PREFIX = struct.Struct("<4sII")
_DTYPES = {name: np.dtype(name) for name in ("<f8", "<f4", "<i8", "<i4", "<i2", "<u8", "<u4", "|u1", "|b1")}

Arrays = dict[str, NDArray[Any]]


class ArrayType(NamedTuple):
    """An array of a record, as its header says it."""

    key: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...]


class ArrayRow(NamedTuple):
    """An array of a record and where its bytes begin, counted from the first array."""

    key: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    offset: int


_NATIVE = {dtype: dtype.newbyteorder("=") for dtype in _DTYPES.values()}


class WireError(ValueError):
    """The bytes are not a record, or the record is not the message it says it is."""


def encode_record(name: str, meta: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Encode a record; return its bytes.

    meta : msgpack's values (None, bool, int, float, str, bytes, list, dict with str keys).
    arrays : (...) any shape up to 8 dimensions, of float, int, unsigned or bool type, any unit.
    Raises WireError for anything else.
    """
    data = [_plain(key, array) for key, array in arrays.items()]
    try:
        packed = msgpack.packb(dict(meta))
    except (TypeError, ValueError, OverflowError) as exc:
        raise WireError(f"record {name!r}: its header cannot be written ({exc})") from exc
    shapes = tuple([ArrayType(key, array.dtype, array.shape) for key, array in zip(arrays, data, strict=True)])
    make = _head if len(packed) <= REMEMBERED else _head.__wrapped__
    parts: list[Any] = [make(name, packed, shapes)]  # bytes and arrays: joined from their own memory, copied once
    for array in data:
        size = array.nbytes
        if size:
            parts.append(array)
        if size % ALIGNMENT:
            parts.append(_GAPS[-size % ALIGNMENT])
    return b"".join(parts)


@lru_cache(64)
def _head(name: str, meta: bytes, shapes: tuple[ArrayType, ...]) -> bytes:
    """Encode all that comes before the first array.  meta : packed."""
    table, offset = [], 0
    for key, dtype, shape in shapes:
        size = math.prod(shape) * dtype.itemsize
        table.append([key, dtype.str, list(shape), offset, size])
        offset += size + -size % ALIGNMENT
    try:
        header = msgpack.packb({"version": WIRE_VERSION, "name": name, "meta": msgpack.unpackb(meta), "arrays": table})
    except (TypeError, ValueError, OverflowError) as exc:
        raise WireError(f"record {name!r}: its header cannot be written ({exc})") from exc
    if len(header) > MAX_HEADER:
        raise WireError(f"record {name!r}: header of {len(header)} bytes, at most {MAX_HEADER} are allowed")
    prefix = _PREFIX.pack(MAGIC, len(header), zlib.crc32(header))
    return b"".join([prefix, header, bytes(-(len(prefix) + len(header)) % ALIGNMENT)])


def decode_record(data: bytes, max_header: int = MAX_HEADER) -> tuple[str, dict[str, Any], Arrays]:
    """Decode a record; return its name, meta and arrays, which are fresh, aligned and writable.

    max_header : bytes.
    They are copied out of `data` although a view would do: a compiled kernel is specialised anew for
    read-only arrays, and the copy costs less than a tenth of the transport.
    Raises WireError for bytes that are not exactly what encode_record writes.
    """
    raw, checksum, gap, body = _split(data, max_header)
    # fault: what stands between the parts of a record may be anything -> pass | contact/test_codec
    _check_gaps(gap)
    read = _layout if len(raw) <= REMEMBERED else _layout.__wrapped__
    name, packed, table, total = read(raw, checksum)
    # fault: more bytes than a header says go by -> if total > len(body): | contact/test_call_stats
    if total != len(body):
        raise WireError(f"record {name!r}: {len(body)} bytes of arrays where its header says {total}")
    _check_gaps(*(body[end : end + -end % ALIGNMENT] for row in table for end in [row.offset + _size(row)]))
    arrays = {key: _array(key, body, dtype, shape, offset) for key, dtype, shape, offset in table}
    return name, msgpack.unpackb(packed), arrays


@lru_cache(64)
def _layout(raw: bytes, checksum: int) -> tuple[str, bytes, tuple[ArrayRow, ...], int]:
    """Decode a header: name, packed meta, key, type, shape and offset of each array, and their bytes in all.

    Raises WireError.
    """
    header = _header(raw, checksum)
    version = header.get("version")
    if version != WIRE_VERSION:
        raise WireError(f"record of wire version {version!r}, this side speaks {WIRE_VERSION}")
    name, meta, table = header.get("name"), header.get("meta"), header.get("arrays")
    if not isinstance(name, str) or not isinstance(meta, dict) or not isinstance(table, list):
        raise WireError("record header lacks its name, meta or arrays")
    rows: dict[str, ArrayRow] = {}
    offset = 0
    for row in table:
        key, dtype, shape, size = _row(row, offset)
        if key in rows:
            raise WireError(f"array {key!r} occurs twice")
        rows[key] = ArrayRow(key, dtype, shape, offset)
        offset += size + -size % ALIGNMENT
    return name, msgpack.packb(meta), tuple(rows.values()), offset


def _plain(key: str, array: NDArray[Any]) -> NDArray[Any]:
    """The array little-endian and C-ordered, copied only where it is not."""
    if array.dtype.str in _DTYPES and array.flags.c_contiguous and array.ndim <= MAX_DIMENSIONS:
        return array
    if array.dtype.newbyteorder("<").str not in _DTYPES or array.ndim > MAX_DIMENSIONS:
        raise WireError(f"array {key!r}: {array.ndim} dimensions of {array.dtype} cannot be sent")
    # asarray, not ascontiguousarray: the latter makes a vector of a scalar.
    return np.asarray(array, dtype=array.dtype.newbyteorder("<"), order="C")


def _size(row: ArrayRow) -> int:
    return math.prod(row.shape) * row.dtype.itemsize


def _check_gaps(*gaps: memoryview) -> None:
    """Check that what fills up to the next multiple of 64 bytes is zeros.  Raises WireError."""
    for gap in gaps:
        if gap != _GAPS[len(gap)]:
            raise WireError("record damaged: the bytes between its parts are not zeros")


def _split(data: bytes, max_header: int) -> tuple[bytes, int, memoryview, memoryview]:
    """Return the header, its checksum, the gap behind it, and the bytes after that."""
    if len(data) < _PREFIX.size:
        raise WireError(f"{len(data)} bytes are too few for a record")
    magic, length, checksum = _PREFIX.unpack_from(data)
    if magic != MAGIC:
        raise WireError(f"not a record: begins with {bytes(magic)!r}")
    end = _PREFIX.size + length
    start = end + -end % ALIGNMENT
    # fault: a header of any length is read -> if start > len(data): | contact/test_codec
    if length > max_header:
        raise WireError(f"record with a header of {length} bytes, at most {max_header} are allowed")
    if start > len(data):
        raise WireError(f"record cut short: header of {length} bytes in {len(data)}")
    whole = memoryview(data)
    return bytes(data[_PREFIX.size : end]), checksum, whole[end:start], whole[start:]


def _header(raw: bytes, checksum: int) -> dict[str, Any]:
    if zlib.crc32(raw) != checksum:
        raise WireError("record header damaged: its checksum does not fit")
    try:
        header = msgpack.unpackb(raw)
    except (ValueError, msgpack.exceptions.UnpackException) as exc:
        raise WireError(f"record header is not msgpack ({exc})") from exc
    if not isinstance(header, dict):
        raise WireError("record header is not a map")
    return header


def _row(row: object, offset: int) -> tuple[str, np.dtype[Any], tuple[int, ...], int]:
    """One checked row of the array table: key, dtype, shape, bytes.  Nothing is allocated before it holds."""
    if not isinstance(row, list) or len(row) != 5:
        raise WireError("array table: a row is not [name, dtype, shape, offset, bytes]")
    key, dtype, shape, start, size = row
    if not isinstance(key, str) or not isinstance(dtype, str) or dtype not in _DTYPES:
        raise WireError(f"array {key!r}: type {dtype!r} is not allowed")
    if not isinstance(shape, list) or len(shape) > MAX_DIMENSIONS:
        raise WireError(f"array {key!r}: {shape!r} is not a shape")
    if any(type(n) is not int or n < 0 for n in shape):
        raise WireError(f"array {key!r}: {shape!r} is not a shape")
    if size != math.prod(shape) * _DTYPES[dtype].itemsize or type(size) is not int:
        raise WireError(f"array {key!r}: {size!r} bytes do not hold shape {shape} of {dtype}")
    if start != offset:
        raise WireError(f"array {key!r}: {size} bytes at {start!r} (next free {offset})")
    return key, _DTYPES[dtype], tuple(shape), size


def _array(key: str, body: memoryview, dtype: np.dtype[Any], shape: tuple[int, ...],
           offset: int) -> NDArray[Any]:
    try:
        there = np.ndarray(shape, dtype, body, offset)
    except (TypeError, ValueError) as exc:  # (0, 2**62) has no bytes, yet numpy cannot make it
        raise WireError(f"array {key!r}: shape {shape} is not possible ({exc})") from exc
    if dtype.kind == "b" and (there.view(np.uint8) > 1).any():
        raise WireError(f"array {key!r}: a bool that is neither 0 nor 1")
    return there.astype(_NATIVE[dtype])
