"""States: copies nobody else holds, bytes that bring back the same bits and nothing they should not."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from contact.half import functions, state
from contact.half.functions import Signal
from contact.half.state import StateError, from_bytes, frozen_copy, to_bytes

HERE = __name__.partition(".")[0]


@dataclass(frozen=True)
class Bag:
    value: Any


def same(a: Any, b: Any) -> bool:
    """Equal to the bit, type, order of arrays and sign of zeros included."""
    if isinstance(a, np.ndarray):
        return (type(a) is type(b) and a.dtype == b.dtype and a.shape == b.shape and a.tobytes("A") == b.tobytes("A")
                and a.flags.f_contiguous == b.flags.f_contiguous)
    if isinstance(a, float):
        return type(a) is type(b) and np.float64(a).tobytes() == np.float64(b).tobytes()
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return isinstance(b, dict) and list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    return type(a) is type(b) and a == b


def values() -> dict[str, Any]:
    rng = np.random.default_rng(1)
    return {"c": rng.random((3, 2)), "f": np.asfortranarray(rng.random((3, 2))), "empty": np.empty((0, 4)),
            "ints": np.arange(3, dtype=np.int32), "flags": np.array([True, False]), "zero_d": np.array(2.5),
            "scalar": np.float32(0.1), "floats": (0.1, -0.0, float("inf"), 1e-320), "nan": (float("nan"),),
            "int": 2**70, "none": None, "true": True, "text": "µ%\0\n", "bytes": b"\0\xff", "nested": {"a": ({},)}}


@pytest.mark.parametrize("name", values())
def test_bytes_bring_back_the_same_bits(name):
    value = {"it": values()[name]}
    assert same(from_bytes(to_bytes(value), ()), value)
    assert same(frozen_copy(value), value)
    assert to_bytes(value) == to_bytes(frozen_copy(value))


def test_dataclasses_come_back_without_their_init():
    made = Signal(np.array([0.0, 1.0]), np.array([2.0, 3.0]))
    back = from_bytes(to_bytes((made,)), {"contact"})[0]
    assert type(back) is Signal
    assert back.value.tolist() == [2.0, 3.0]


def test_a_copy_is_private_and_cannot_be_written():
    array = np.zeros(3)
    copy = frozen_copy(Bag(array)).value
    array[0] = 1.0
    assert copy[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        copy[0] = 1.0


def test_strided_views_are_straightened_before_anything_computes_with_them():
    assert frozen_copy(np.zeros((4, 4))[:, ::2]).flags.c_contiguous


@pytest.mark.parametrize("value", [[1], {1}, object(), np.array([object()]), {1: 2}, len],
                         ids=["list", "set", "object", "array of objects", "dict", "function"])
def test_what_cannot_be_kept_is_named(value):
    for way in (frozen_copy, to_bytes):
        with pytest.raises(StateError, match=r"state\.value"):
            way(Bag(value))


def test_only_dataclasses_of_the_half_are_made():
    data = to_bytes(Signal(np.zeros(1), np.zeros(1)))
    with pytest.raises(StateError, match="may not hold"):
        from_bytes(data, {"other"})
    for name in ("contact.half.state:kept", "contact.half.functions:Signal.at", "contact.half.functions:nothing"):
        with pytest.raises(StateError, match="not a dataclass"):
            from_bytes(data.replace(b"contact.half.functions:Signal", name.encode()).replace(
                data[10:18], (len(name) - len("contact.half.functions:Signal") + int.from_bytes(data[10:18], "little")
                              ).to_bytes(8, "little"), 1), {"contact"})
    assert functions.Signal is Signal


def test_damaged_bytes_are_refused():
    data = to_bytes({"a": np.arange(4.0), "b": "text"})
    wrong = [b"", data[:5], data[:-1], data + b"\0", b"X" + data[1:], data[:8] + b"\7" + data[9:]]
    wrong += [data[:i] + bytes([data[i] ^ 0x55]) + data[i + 1 :] for i in range(10, 24)]
    for bad in wrong:
        with pytest.raises(StateError):
            from_bytes(bad, ())


def test_the_header_is_readable_and_says_its_version():
    data = to_bytes(np.arange(2.0))
    assert data[:8] == state.MAGIC
    assert int.from_bytes(data[8:10], "little") == state.VERSION
    length = int.from_bytes(data[10:18], "little")
    assert json.loads(data[18 : 18 + length]) == {"a": ["<f8", [2], "C"]}
