"""Records as bytes: a name, a small header of plain values, and arrays.  The binary form of every message.

    magic "SLDW" | u32 header length | u32 CRC-32 of the header | msgpack header | zeros to a multiple of 64
    | array | zeros to a multiple of 64 | array | ...

Integers are little-endian, arrays little-endian and C-ordered, each at a multiple of 64 bytes.  The header
says {"version", "name", "meta", "arrays": [[name, dtype, shape, offset, bytes], ...]}, offsets counted from
the first array.  There is exactly one way to lay out given arrays, and a reader refuses every other: what
arrives was written whole by this code or is not accepted.  The checksum covers the header only: a flipped bit
there could change what the arrays mean, while the transports already guard the bulk.
"""

from __future__ import annotations

import math
import operator
import struct
import zlib
from collections.abc import Callable, Iterable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cache, lru_cache
from types import NoneType, UnionType
from typing import Any, NamedTuple, Protocol, Union, get_args, get_origin, get_type_hints

import msgpack
import numpy as np
from numpy.typing import NDArray

from contact import messages
from contact.messages import WIRE_VERSION
from contact.problem.part import Part

MAGIC = b"SLDW"
ALIGNMENT = 64  # a cache line, and the widest vector load
MAX_HEADER = 16 << 20  # bytes; a header holds names and texts, never fields
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


def decode_record(data: bytes) -> tuple[str, dict[str, Any], Arrays]:
    """Decode a record; return its name, meta and arrays, which are fresh, aligned and writable.

    They are copied out of `data` although a view would do: a compiled kernel is specialised anew for
    read-only arrays, and the copy costs less than a tenth of the transport.
    Raises WireError for bytes that are not exactly what encode_record writes.
    """
    raw, checksum, body = _split(data)
    read = _layout if len(raw) <= REMEMBERED else _layout.__wrapped__
    name, packed, table, total = read(raw, checksum)
    # fault: more bytes than a header says go by -> if total > len(body): | contact/test_call_stats
    if total != len(body):
        raise WireError(f"record {name!r}: {len(body)} bytes of arrays where its header says {total}")
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


def _split(data: bytes) -> tuple[bytes, int, memoryview]:
    """Return the header, its checksum, and the bytes after it."""
    if len(data) < _PREFIX.size:
        raise WireError(f"{len(data)} bytes are too few for a record")
    magic, length, checksum = _PREFIX.unpack_from(data)
    if magic != MAGIC:
        raise WireError(f"not a record: begins with {bytes(magic)!r}")
    end = _PREFIX.size + length
    start = end + -end % ALIGNMENT
    if length > MAX_HEADER or start > len(data):
        raise WireError(f"record cut short: header of {length} bytes in {len(data)}")
    return bytes(data[_PREFIX.size : end]), checksum, memoryview(data)[start:]


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


# Messages as records: any frozen dataclass of plain fields, by its type hints
#
# Field types: NDArray[...], str, bool, int, float, bytes, Enum, tuple[X, ...], tuple[X, Y], frozenset[str] or [int],
# dict or Mapping[str, X] or [int, X], X | None, dataclasses of those, and D | E, one of several dataclasses.  Arrays
# come back in C order.

Kinds = Mapping[str, type[Any]]


class Pack(Protocol):
    """A value as msgpack sees it; arrays go into `arrays` under their path."""

    def __call__(self, value: Any, path: str, arrays: Arrays) -> Any: ...


class Unpack(Protocol):
    """The value back.  Raises WireError naming the path."""

    def __call__(self, raw: Any, path: str, arrays: Arrays) -> Any: ...


@dataclass(frozen=True)
class WireForm:
    """How values of one type hint go onto the wire and come back."""

    pack: Pack
    unpack: Unpack


def kinds_of(types: Iterable[type[Any]]) -> dict[str, type[Any]]:
    """Return the registry decode needs: messages by class name."""
    return {t.__name__: t for t in types}


REQUESTS = kinds_of(get_args(messages.Request))
REPLIES = kinds_of(get_args(messages.Reply))


def encode(message: Any) -> bytes:
    """Encode a message; return its bytes.  Raises WireError where a field is not what its hint says."""
    arrays: Arrays = {}
    kind: Any = type(message)
    meta = _form_of(kind).pack(message, kind.__name__, arrays)
    return encode_record(kind.__name__, meta, arrays)


def decode(data: bytes, kinds: Kinds) -> Any:
    """Decode the message in `data`, one of `kinds`.  Raises WireError for anything else."""
    name, meta, arrays = decode_record(data)
    kind: Any = kinds.get(name)
    if kind is None:
        raise WireError(f"message {name!r} is not one of {', '.join(sorted(kinds))}")
    message = _form_of(kind).unpack(meta, name, arrays)
    if arrays:
        raise WireError(f"{name}: unexpected array {next(iter(arrays))!r}")
    return message


@cache
def _form_of(hint: Any) -> WireForm:
    """Return the form of a type hint.  Raises TypeError for a hint this module cannot send: a bug, not bad input."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is np.ndarray:
        return _array_form(get_args(args[1])[0])
    if origin is tuple and args[1:] == (Ellipsis,):
        return _tuple_form(_form_of(args[0]))
    if origin is tuple and args:
        return _fixed_form(tuple(_form_of(arg) for arg in args))
    if origin in (frozenset, AbstractSet) and args[0] in (str, int):
        return _set_form(args[0])
    if origin in (dict, Mapping) and args[0] in (str, int):
        return _dict_form(args[0], _form_of(args[1]))
    if origin in (Union, UnionType) and len(args) == 2 and NoneType in args:
        return _optional_form(_form_of(args[0] if args[1] is NoneType else args[1]))
    if origin in (Union, UnionType) and all(is_dataclass(arg) for arg in args):
        return _one_of_form({arg.__name__: arg for arg in args})
    if hint is bytes:
        return _bytes_form()
    if isinstance(hint, type) and is_dataclass(hint):
        return _record_form(hint, hint, [f.name for f in fields(hint)])
    if isinstance(hint, type) and issubclass(hint, Part):
        return _record_form(hint, hint.model_construct, list(hint.model_fields))
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _enum_form(hint)
    if hint in _PLAIN:
        return _plain_form(hint)
    raise TypeError(f"{hint!r} has no form on the wire")


def _array_form(scalar: Any) -> WireForm:
    expected = None if scalar is Any else np.dtype(scalar)

    def check(array: Any, path: str) -> Any:
        if not isinstance(array, np.ndarray):
            raise WireError(f"{path}: an array was expected, not {type(array).__name__}")
        if expected is not None and array.dtype != expected:
            raise WireError(f"{path}: {expected} was expected, not {array.dtype}")
        return array

    def pack(value: Any, path: str, arrays: Arrays) -> None:
        arrays[path] = check(value, path)

    def unpack(raw: Any, path: str, arrays: Arrays) -> Any:
        if path not in arrays:
            raise WireError(f"{path}: the array is missing")
        return check(arrays.pop(path), path)

    return WireForm(pack, unpack)


def _tuple_form(item: WireForm) -> WireForm:
    def pack(value: Any, path: str, arrays: Arrays) -> list[Any]:
        return [item.pack(v, f"{path}.{i}", arrays) for i, v in enumerate(value)]

    def unpack(raw: Any, path: str, arrays: Arrays) -> tuple[Any, ...]:
        _expect(raw, list, path)
        return tuple(item.unpack(v, f"{path}.{i}", arrays) for i, v in enumerate(raw))

    return WireForm(pack, unpack)


def _fixed_form(items: tuple[WireForm, ...]) -> WireForm:
    def sized(value: Any, path: str) -> Any:
        if len(value) != len(items):
            raise WireError(f"{path}: {len(items)} items were expected, not {len(value)}")
        return value

    def pack(value: Any, path: str, arrays: Arrays) -> list[Any]:
        return [form.pack(v, f"{path}.{i}", arrays)
                for i, (form, v) in enumerate(zip(items, sized(value, path), strict=True))]

    def unpack(raw: Any, path: str, arrays: Arrays) -> tuple[Any, ...]:
        _expect(raw, list, path)
        return tuple(form.unpack(v, f"{path}.{i}", arrays)
                     for i, (form, v) in enumerate(zip(items, sized(raw, path), strict=True)))

    return WireForm(pack, unpack)


def _set_form(kind: type[Any]) -> WireForm:
    # Sorted: equal sets have equal bytes.
    def pack(value: Any, path: str, arrays: Arrays) -> list[Any]:
        return sorted(v for v in value if _expect(v, kind, path))

    def unpack(raw: Any, path: str, arrays: Arrays) -> frozenset[Any]:
        _expect(raw, list, path)
        return frozenset(v for v in raw if _expect(v, kind, path))

    return WireForm(pack, unpack)


def _optional_form(item: WireForm) -> WireForm:
    # In a list, because an array leaves nothing but None in the header.
    def pack(value: Any, path: str, arrays: Arrays) -> list[Any] | None:
        return None if value is None else [item.pack(value, path, arrays)]

    def unpack(raw: Any, path: str, arrays: Arrays) -> Any:
        if raw is None:
            return None
        if _expect(raw, list, path) and len(raw) != 1:
            raise WireError(f"{path}: one value was expected, not {len(raw)}")
        return item.unpack(raw[0], path, arrays)

    return WireForm(pack, unpack)


def _one_of_form(kinds: Kinds) -> WireForm:
    # The forms are found when first used: one of them may hold the union again.
    def pack(value: Any, path: str, arrays: Arrays) -> list[Any]:
        name = type(value).__name__
        # fault: one of several dataclasses comes back as the first that fits its name -> if False: | contact/test_forms
        if kinds.get(name) is not type(value):
            raise WireError(f"{path}: one of {', '.join(sorted(kinds))} was expected, not {name}")
        kind: Any = kinds[name]
        return [name, _form_of(kind).pack(value, path, arrays)]

    def unpack(raw: Any, path: str, arrays: Arrays) -> Any:
        if not (_expect(raw, list, path) and len(raw) == 2 and isinstance(raw[0], str) and raw[0] in kinds):
            raise WireError(f"{path}: one of {', '.join(sorted(kinds))} was expected")
        kind: Any = kinds[raw[0]]
        return _form_of(kind).unpack(raw[1], path, arrays)

    return WireForm(pack, unpack)


def _bytes_form() -> WireForm:
    # An array on the wire: a header is bounded, the state of a half is not.
    array = _array_form(np.uint8)

    def pack(value: Any, path: str, arrays: Arrays) -> None:
        _expect(value, bytes, path)
        array.pack(np.frombuffer(value, np.uint8), path, arrays)

    def unpack(raw: Any, path: str, arrays: Arrays) -> bytes:
        data: bytes = array.unpack(raw, path, arrays).tobytes()
        return data

    return WireForm(pack, unpack)


def _dict_form(kind: type[Any], item: WireForm) -> WireForm:
    # As pairs where keys are numbers: a reader of maps takes text keys only.
    def pack(value: Any, path: str, arrays: Arrays) -> Any:
        packed = {k: item.pack(v, f"{path}.{k}", arrays) for k, v in value.items() if _expect(k, kind, path)}
        return packed if kind is str else [[k, v] for k, v in packed.items()]

    def unpack(raw: Any, path: str, arrays: Arrays) -> dict[Any, Any]:
        _expect(raw, dict if kind is str else list, path)
        pairs = raw.items() if kind is str else [(row[0], row[1]) for row in raw if _pair(row, path)]
        return {k: item.unpack(v, f"{path}.{k}", arrays) for k, v in pairs if _expect(k, kind, path)}

    return WireForm(pack, unpack)


def _pair(row: Any, path: str) -> bool:
    if _expect(row, list, path) and len(row) != 2:
        raise WireError(f"{path}: a key and a value were expected, not {len(row)}")
    return True


def _record_form(kind: type[Any], make: Callable[..., Any], names: list[str]) -> WireForm:
    hints = get_type_hints(kind)
    forms = {name: _form_of(hints[name]) for name in names}

    def pack(value: Any, path: str, arrays: Arrays) -> dict[str, Any]:
        if type(value) is not kind:
            raise WireError(f"{path}: {kind.__name__} was expected, not {type(value).__name__}")
        return {k: form.pack(getattr(value, k), f"{path}.{k}", arrays) for k, form in forms.items()}

    def unpack(raw: Any, path: str, arrays: Arrays) -> Any:
        _expect(raw, dict, path)
        if raw.keys() != forms.keys():
            raise WireError(f"{path}: fields {sorted(map(str, raw))} where {sorted(forms)} were expected")
        return make(**{k: form.unpack(raw[k], f"{path}.{k}", arrays) for k, form in forms.items()})

    return WireForm(pack, unpack)


def _enum_form(kind: type[Enum]) -> WireForm:
    def pack(value: Any, path: str, arrays: Arrays) -> str:
        return str(kind(value).value)

    def unpack(raw: Any, path: str, arrays: Arrays) -> Enum:
        for member in kind:
            if member.value == raw:
                return member
        raise WireError(f"{path}: {raw!r} is not one of {[m.value for m in kind]}")

    return WireForm(pack, unpack)


# numpy's scalars are accepted from the sender and leave as Python's; operator.index refuses a float for int.
_PLAIN: dict[Any, Callable[[Any], Any]] = {str: str, bool: bool, int: operator.index, float: float}


def _plain_form(kind: type[Any]) -> WireForm:
    convert = _PLAIN[kind]

    def pack(value: Any, path: str, arrays: Arrays) -> Any:
        try:
            if kind is str:
                _expect(value, str, path)
            return convert(value)
        except (TypeError, ValueError) as exc:
            raise WireError(f"{path}: {kind.__name__} was expected, not {value!r}") from exc

    def unpack(raw: Any, path: str, arrays: Arrays) -> Any:
        _expect(raw, kind, path)
        return raw

    return WireForm(pack, unpack)


def _expect(raw: Any, kind: type[Any], path: str) -> bool:
    # type() is, not isinstance: True is an int to Python and must not be one here.
    if type(raw) is not kind:
        raise WireError(f"{path}: {kind.__name__} was expected, not {type(raw).__name__}")
    return True
