"""Messages as records: any frozen dataclass of plain fields, by its type hints.

Field types: NDArray[...], str, bool, int, float, Enum, tuple[X, ...], dict or Mapping[str, X], and
dataclasses of those.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cache, lru_cache
from typing import Any, Protocol, get_args, get_origin, get_type_hints

import msgpack
import numpy as np
from numpy.typing import NDArray

from contact import wire
from contact.codec import (
    MAX_DIMENSIONS,
    REMEMBERED,
    SENT_AS_IS,
    Arrays,
    Row,
    WireError,
    encode_record,
    join_record,
    open_record,
    read_array,
    record_head,
)

Kinds = Mapping[str, type[Any]]


class Pack(Protocol):
    """A value as msgpack sees it; arrays go into `arrays` under their path."""

    def __call__(self, value: Any, path: str, arrays: Arrays) -> Any: ...


class Unpack(Protocol):
    """The value back.  Raises WireError naming the path."""

    def __call__(self, raw: Any, path: str, arrays: Arrays) -> Any: ...


@dataclass(frozen=True)
class Form:
    """How values of one type hint go onto the wire and come back."""

    pack: Pack
    unpack: Unpack


def kinds_of(types: Iterable[type[Any]]) -> dict[str, type[Any]]:
    """The registry decode needs: messages by class name."""
    return {t.__name__: t for t in types}


REQUESTS = kinds_of(get_args(wire.Request))
REPLIES = kinds_of(get_args(wire.Reply))


def encode(message: Any) -> bytes:
    """The bytes of a message.  Raises WireError where a field is not what its hint says."""
    kind: Any = type(message)
    flat = _flat_of(kind)
    if flat is not None and (data := _ready(message, flat)) is not None:
        plain = tuple([form.pack(getattr(message, name), path, {}) for name, path, form in flat.plain])
        return join_record(_flat_head(kind, plain, tuple([array.shape for array in data])), data)
    arrays: Arrays = {}
    meta = _form_of(kind).pack(message, kind.__name__, arrays)
    return encode_record(kind.__name__, meta, arrays)


def decode(data: bytes, kinds: Kinds) -> Any:
    """The message in `data`, one of `kinds`.  Raises WireError for anything else."""
    name, packed, table, body = open_record(data)
    kind: Any = kinds.get(name)
    if kind is None:
        raise WireError(f"message {name!r} is not one of {', '.join(sorted(kinds))}")
    if _flat_of(kind) is None:
        return _unpacked(kind, packed, {row[0]: read_array(body, row) for row in table})
    read = _flat_values if len(packed) <= REMEMBERED else _flat_values.__wrapped__
    plain, names = read(kind, packed, table)
    return kind(**plain, **{field: read_array(body, row) for field, row in zip(names, table, strict=True)})


def _unpacked(kind: Any, packed: bytes, arrays: Arrays) -> Any:
    message = _form_of(kind).unpack(msgpack.unpackb(packed), kind.__name__, arrays)
    if arrays:
        raise WireError(f"{kind.__name__}: unexpected array {next(iter(arrays))!r}")
    return message


@dataclass(frozen=True)
class _Flat:
    """A message of arrays and a few plain values, as those that come again and again are.

    Once its header has been seen, only the arrays differ: it is neither made nor checked again.
    arrays : field and type.  plain : field, path and form.
    """

    arrays: tuple[tuple[str, np.dtype[Any]], ...]
    plain: tuple[tuple[str, str, Form], ...]


@cache
def _flat_of(kind: Any) -> _Flat | None:
    """None for a message with anything else in it.  No floats: 0.0 and -0.0 would be found under one header."""
    arrays: list[tuple[str, np.dtype[Any]]] = []
    plain: list[tuple[str, str, Form]] = []
    for name, hint in get_type_hints(kind).items():
        scalar = get_args(get_args(hint)[1])[0] if get_origin(hint) is np.ndarray else Any
        if scalar is not Any and np.dtype(scalar).str in SENT_AS_IS:
            arrays.append((name, np.dtype(scalar)))
        elif hint in (str, int, bool):
            plain.append((name, f"{kind.__name__}.{name}", _form_of(hint)))
        else:
            return None
    return _Flat(tuple(arrays), tuple(plain)) if arrays else None


def _ready(message: Any, flat: _Flat) -> list[NDArray[Any]] | None:
    """The arrays of a message where all can be sent as they are."""
    data = [getattr(message, name) for name, _ in flat.arrays]
    for array, (_, dtype) in zip(data, flat.arrays, strict=True):
        if type(array) is not np.ndarray or array.dtype != dtype:
            return None
        if not array.flags.c_contiguous or array.ndim > MAX_DIMENSIONS:
            return None
    return data


@lru_cache(64)
def _flat_head(kind: Any, plain: tuple[Any, ...], shapes: tuple[tuple[int, ...], ...]) -> bytes:
    flat = _flat_of(kind)
    assert flat is not None
    said = {name: value for (name, _, _), value in zip(flat.plain, plain, strict=True)}
    meta = msgpack.packb({f.name: said.get(f.name) for f in fields(kind)})
    rows = [(f"{kind.__name__}.{name}", dtype, s) for (name, dtype), s in zip(flat.arrays, shapes, strict=True)]
    return record_head(kind.__name__, meta, tuple(rows))


@lru_cache(64)
def _flat_values(kind: Any, packed: bytes, table: tuple[Row, ...]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The plain values of a flat message, and the field of each array.  Raises WireError."""
    flat = _flat_of(kind)
    assert flat is not None
    message = _unpacked(kind, packed, {key: np.empty(0, dtype) for key, dtype, _, _ in table})
    return ({name: getattr(message, name) for name, _, _ in flat.plain},
            tuple(key.removeprefix(f"{kind.__name__}.") for key, *_ in table))


@cache
def _form_of(hint: Any) -> Form:
    """The form of a type hint.  Raises TypeError for a hint this module cannot send: a bug, not bad input."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is np.ndarray:
        return _array_form(get_args(args[1])[0])
    if origin is tuple and args[1:] == (Ellipsis,):
        return _tuple_form(_form_of(args[0]))
    if origin in (dict, Mapping):
        return _dict_form(_form_of(args[1]))
    if isinstance(hint, type) and is_dataclass(hint):
        return _dataclass_form(hint)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _enum_form(hint)
    if hint in _PLAIN:
        return _plain_form(hint)
    raise TypeError(f"{hint!r} has no form on the wire")


def _array_form(scalar: Any) -> Form:
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

    return Form(pack, unpack)


def _tuple_form(item: Form) -> Form:
    def pack(value: Any, path: str, arrays: Arrays) -> list[Any]:
        return [item.pack(v, f"{path}.{i}", arrays) for i, v in enumerate(value)]

    def unpack(raw: Any, path: str, arrays: Arrays) -> tuple[Any, ...]:
        _expect(raw, list, path)
        return tuple(item.unpack(v, f"{path}.{i}", arrays) for i, v in enumerate(raw))

    return Form(pack, unpack)


def _dict_form(item: Form) -> Form:
    def pack(value: Any, path: str, arrays: Arrays) -> dict[str, Any]:
        return {k: item.pack(v, f"{path}.{k}", arrays) for k, v in value.items()}

    def unpack(raw: Any, path: str, arrays: Arrays) -> dict[str, Any]:
        _expect(raw, dict, path)
        return {k: item.unpack(v, f"{path}.{k}", arrays) for k, v in raw.items() if _expect(k, str, path)}

    return Form(pack, unpack)


def _dataclass_form(kind: type[Any]) -> Form:
    hints = get_type_hints(kind)
    forms = {f.name: _form_of(hints[f.name]) for f in fields(kind)}

    def pack(value: Any, path: str, arrays: Arrays) -> dict[str, Any]:
        if type(value) is not kind:
            raise WireError(f"{path}: {kind.__name__} was expected, not {type(value).__name__}")
        return {k: form.pack(getattr(value, k), f"{path}.{k}", arrays) for k, form in forms.items()}

    def unpack(raw: Any, path: str, arrays: Arrays) -> Any:
        _expect(raw, dict, path)
        if raw.keys() != forms.keys():
            raise WireError(f"{path}: fields {sorted(map(str, raw))} where {sorted(forms)} were expected")
        return kind(**{k: form.unpack(raw[k], f"{path}.{k}", arrays) for k, form in forms.items()})

    return Form(pack, unpack)


def _enum_form(kind: type[Enum]) -> Form:
    def pack(value: Any, path: str, arrays: Arrays) -> str:
        return str(kind(value).value)

    def unpack(raw: Any, path: str, arrays: Arrays) -> Enum:
        for member in kind:
            if member.value == raw:
                return member
        raise WireError(f"{path}: {raw!r} is not one of {[m.value for m in kind]}")

    return Form(pack, unpack)


# numpy's scalars are accepted from the sender and leave as Python's; operator.index refuses a float for int.
_PLAIN: dict[Any, Callable[[Any], Any]] = {str: str, bool: bool, int: operator.index, float: float}


def _plain_form(kind: type[Any]) -> Form:
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

    return Form(pack, unpack)


def _expect(raw: Any, kind: type[Any], path: str) -> bool:
    # type() is, not isinstance: True is an int to Python and must not be one here.
    if type(raw) is not kind:
        raise WireError(f"{path}: {kind.__name__} was expected, not {type(raw).__name__}")
    return True
