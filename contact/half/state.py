"""States of halves: private copies, and bytes that restore the same bits in another process.  Never pickle.

A state is a dataclass of arrays, float, int, str, bool, bytes, None, tuples, dicts with text keys, and such
dataclasses.  Bytes: magic, version (u16), header length (u64), JSON header (a tree), the arrays' bytes one after
the other.
"""

from __future__ import annotations

import importlib
import json
import math
import struct
from collections.abc import Collection
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

MAGIC = b"SLSTATE\n"
VERSION = 1
_HEAD = struct.Struct("<8sHQ")
_KINDS = "biufcS"  # of array elements: no objects, whose bytes are addresses


class StateError(ValueError):
    """A state has a part of a type that cannot be stored, or bytes are not a state of this version and half."""


def frozen_copy(value: Any, where: str = "state") -> Any:
    """Copy a value for a state: arrays read-only, C or Fortran order as they were, never strided views.

    The order of an array is part of it: sums over other strides may round otherwise.
    Raises StateError naming the part that cannot be stored.
    """
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in _KINDS:
            raise StateError(f"{where}: arrays of {value.dtype} cannot be kept")
        fortran = value.flags.f_contiguous and not value.flags.c_contiguous
        copy = np.array(value, order="F" if fortran else "C", copy=True)
        copy.flags.writeable = False
        return copy
    if value is None or isinstance(value, (bool, int, float, str, bytes, np.generic)):
        return value
    if isinstance(value, tuple):
        return tuple(frozen_copy(v, f"{where}[{i}]") for i, v in enumerate(value))
    if isinstance(value, dict):
        return {_text(k, where): frozen_copy(v, f"{where}[{k!r}]") for k, v in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return _rebuilt(type(value), {f.name: frozen_copy(getattr(value, f.name), f"{where}.{f.name}")
                                      for f in fields(value)})
    raise StateError(f"{where}: a {type(value).__name__} cannot be kept in a state")


def to_bytes(value: Any) -> bytes:
    """Write a state as deterministic bytes.  Raises StateError naming the part that cannot be stored."""
    arrays: list[np.ndarray] = []
    header = json.dumps(_tree(value, arrays, "state"), separators=(",", ":")).encode()
    body = (a.tobytes(order="A") for a in arrays)
    return b"".join([_HEAD.pack(MAGIC, VERSION, len(header)), header, *body])


def from_bytes(data: bytes, packages: Collection[str] | None) -> Any:
    """Restore the state behind bytes made by to_bytes.

    packages : top-level packages whose dataclasses may be made; nothing else is imported or called.  None : none at
    all, a dataclass is the dict of its fields.
    Raises StateError where the bytes are cut, of another version, or name what is not there.
    """
    if len(data) < _HEAD.size:
        raise StateError("not the bytes of a state: too short")
    magic, version, length = _HEAD.unpack_from(data)
    if magic != MAGIC:
        raise StateError("not the bytes of a state")
    if version != VERSION:
        raise StateError(f"a state of version {version}; this program reads version {VERSION}")
    try:
        tree = json.loads(data[_HEAD.size : _HEAD.size + length])
        value, end = _value(tree, data, _HEAD.size + length, packages)
    except (ValueError, KeyError, TypeError, IndexError, RecursionError) as exc:
        raise StateError(f"damaged bytes of a state: {exc}") from exc
    if end != len(data):
        raise StateError("damaged bytes of a state: wrong length")
    return value


def _text(key: Any, where: str) -> str:
    if not isinstance(key, str):
        raise StateError(f"{where}: the keys of a dict must be texts, not {key!r}")
    return key


def _tree(value: Any, arrays: list[np.ndarray], where: str) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        array = np.asarray(value)
        if array.dtype.kind not in _KINDS:
            raise StateError(f"{where}: arrays of {array.dtype} cannot be kept")
        fortran = array.flags.f_contiguous and not array.flags.c_contiguous
        arrays.append(array if fortran else np.asarray(array, order="C"))
        kind = "a" if isinstance(value, np.ndarray) else "g"
        return {kind: [array.dtype.str, list(array.shape), "F" if fortran else "C"]}
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return {"x": value.hex()} if math.isfinite(value) else {"n": struct.pack("<d", value).hex()}
    if isinstance(value, bytes):
        return {"b": value.hex()}
    if isinstance(value, tuple):
        return {"t": [_tree(v, arrays, f"{where}[{i}]") for i, v in enumerate(value)]}
    if isinstance(value, dict):
        return {"m": [[_text(k, where), _tree(v, arrays, f"{where}[{k!r}]")] for k, v in value.items()]}
    if is_dataclass(value) and not isinstance(value, type):
        of = f"{type(value).__module__}:{type(value).__qualname__}"
        return {"d": of, "f": [[f.name, _tree(getattr(value, f.name), arrays, f"{where}.{f.name}")]
                               for f in fields(value)]}
    raise StateError(f"{where}: a {type(value).__name__} cannot be kept in a state")


def _value(tree: Any, data: bytes, at: int, packages: Collection[str] | None) -> tuple[Any, int]:
    """Return the value of a tree whose arrays begin at byte `at`, and the byte after them."""
    if not isinstance(tree, dict):
        return tree, at
    if "a" in tree or "g" in tree:
        return _array(tree, data, at)
    if "x" in tree:
        return float.fromhex(tree["x"]), at
    if "n" in tree:
        return struct.unpack("<d", bytes.fromhex(tree["n"]))[0], at
    if "b" in tree:
        return bytes.fromhex(tree["b"]), at
    if "t" in tree:
        items = []
        for item in tree["t"]:
            value, at = _value(item, data, at, packages)
            items.append(value)
        return tuple(items), at
    named = {}
    for name, item in tree["m"] if "m" in tree else tree["f"]:
        named[name], at = _value(item, data, at, packages)
    return (named if "m" in tree or packages is None else _rebuilt(_class(tree["d"], packages), named)), at


def _array(tree: dict[str, Any], data: bytes, at: int) -> tuple[Any, int]:
    name, shape, order = tree["a"] if "a" in tree else tree["g"]
    dtype = np.dtype(name)
    if dtype.kind not in _KINDS or order not in ("C", "F") or any(n < 0 for n in shape):
        raise StateError(f"an array of {name} and shape {shape} is not allowed")
    count = math.prod(shape)
    end = at + count * dtype.itemsize
    if end > len(data):
        raise StateError("cut short")
    array = np.frombuffer(data, dtype, count, at).reshape(shape, order=order).copy(order=order)
    array.flags.writeable = False
    return (array if "a" in tree else array[()]), end


def _class(of: str, packages: Collection[str]) -> type:
    module, _, path = of.partition(":")
    if module.partition(".")[0] not in packages:
        raise StateError(f"a state may not hold {of}: only classes of {', '.join(sorted(packages))}")
    target: Any = importlib.import_module(module)
    for part in path.split("."):
        target = getattr(target, part, None)
    if not (isinstance(target, type) and is_dataclass(target)):
        raise StateError(f"{of} is not a dataclass")
    return target


def _rebuilt(kind: type, values: dict[str, Any]) -> Any:
    """Make an instance with exactly these fields, without __init__: the values were checked when first made."""
    expected = [f.name for f in fields(kind)]
    if sorted(expected) != sorted(values):
        raise StateError(f"{kind.__qualname__} has fields {expected}, the state {sorted(values)}")
    made: Any = object.__new__(kind)
    for name, value in values.items():
        object.__setattr__(made, name, value)
    return made
