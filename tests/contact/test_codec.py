"""Bytes of records and messages: every bit comes back, and nothing damaged is ever accepted or crashes."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, is_dataclass
from enum import Enum

import msgpack
import numpy as np
import pytest

from contact.codec import REPLIES, REQUESTS, decode, encode, kinds_of
from contact.messages import (
    WIRE_VERSION,
    Coupling,
    Couplings,
    Facing,
    Passes,
    Project,
    Refused,
    Register,
    Registered,
    Traction,
    Tractions,
)
from contact.records import ALIGNMENT, MAX_MESSAGE_HEADER, WireError, decode_record, encode_record

rng = np.random.default_rng(1)
I4 = np.arange(6, dtype=np.int32)
F8 = rng.random(5)
MESSAGES = [
    Register(5, I4.reshape(3, 2), I4[:3], True, Passes(I4, I4, I4, F8, I4, F8, F8, F8, F8)),
    Registered("abc"), Project("", rng.random((7, 2))),
    Traction("h", rng.random((7, 2)), -rng.random(7), rng.random((7, 2)), -rng.random(7), rng.random(7),
             rng.random((4, 3))),
    Facing(I4, I4, I4, *rng.random((9, 6))),
    Tractions(F8, I4, I4[:0], np.zeros((0, 2, 2)), F8, F8, F8, np.array([np.nan, np.inf, -0.0]), F8,
               rng.random((4, 3)), F8, F8, F8, F8, 3, 2, 0.5),
    Refused("busy", "grüß"),
    Coupling("h", rng.random((7, 2)), -rng.random(7), rng.random((7, 2)), -rng.random(7), rng.random(7)),
    Couplings(F8, F8, I4.reshape(1, -1), I4.reshape(1, -1), rng.random((1, 6, 4, 5))),
]


def same(a: object, b: object) -> bool:
    """Bitwise the same fields, types and shapes."""
    assert type(a) is type(b)
    for name, x in vars(a).items():
        y = getattr(b, name)
        if is_dataclass(x):
            if not same(x, y):
                return False
        elif isinstance(x, np.ndarray):
            if x.dtype != y.dtype or x.shape != y.shape or x.tobytes() != y.tobytes():
                return False
        elif type(x) is not type(y) or x != y:
            return False
    return True


@pytest.mark.parametrize("message", MESSAGES, ids=lambda m: type(m).__name__)
def test_every_bit_comes_back(message):
    assert same(decode(encode(message), {**REQUESTS, **REPLIES}), message)
    assert encode(message) == encode(message)


def test_record_keeps_shape_order_and_any_type():
    arrays = {"scalar": np.array(3.5), "none": np.zeros((0, 3)), "fortran": np.asfortranarray(F8.reshape(5, 1) * I4),
              "strided": F8[::2], "big-endian": np.arange(3, dtype=">i4"), "bool": np.array([True, False]),
              "u1": np.arange(3, dtype=np.uint8), "f4": F8.astype(np.float32), "i8": np.array([2**62])}
    meta = {"t": 0.1, "n": 2**40, "text": "ü", "list": [1, [2.5, None]], "on": True, "map": {"a": {}}}
    name, back_meta, back = decode_record(encode_record("step", meta, arrays))
    assert (name, back_meta, list(back)) == ("step", meta, list(arrays))
    for key, array in arrays.items():
        assert back[key].shape == array.shape
        assert back[key].dtype == array.dtype.newbyteorder("=")
        assert np.array_equal(back[key], array)
        assert back[key].flags.writeable
        assert back[key].flags.c_contiguous


def test_arrays_stand_at_multiples_of_64_bytes():
    data = encode_record("r", {}, {"a": np.full(3, 1.25), "b": np.full(9, 2.5)})
    places = [data.index(struct.pack("<d", v)) for v in (1.25, 2.5)]
    assert [p % ALIGNMENT for p in places] == [0, 0]
    assert len(data) % ALIGNMENT == 0


def test_every_cut_is_refused():
    data = encode(MESSAGES[1])
    for n in range(len(data)):
        with pytest.raises(WireError):
            decode(data[:n], REPLIES)
    with pytest.raises(WireError):
        decode(data + b"\0", REPLIES)


def test_every_flipped_bit_of_the_header_is_refused():
    data = bytearray(encode(MESSAGES[3]))
    end = 12 + struct.unpack_from("<I", data, 4)[0]
    for i in range(end):
        for bit in (1, 128):
            data[i] ^= bit
            with pytest.raises(WireError):
                decode(bytes(data), REQUESTS)
            data[i] ^= bit
    assert same(decode(bytes(data), REQUESTS), MESSAGES[3])


def forged(header: object, body: bytes = b"") -> bytes:
    """A record with any header and a fitting checksum."""
    raw = msgpack.packb(header) if not isinstance(header, bytes) else header
    start = struct.pack("<4sII", b"SLDW", len(raw), zlib.crc32(raw)) + raw
    return start + bytes(-len(start) % 64) + body


GOOD = {"version": WIRE_VERSION, "name": "r", "meta": {}, "arrays": [["a", "<f8", [2], 0, 16]]}


def test_the_forger_can_forge():
    assert decode_record(forged(GOOD, bytes(64)))[2]["a"].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("row", [
    ["a", "<f8", [2], 0, 8], ["a", "<f8", [3], 0, 16], ["a", "<f8", [2**61], 0, 2**64 - 1], ["a", "<f8", [-2], 0, -16],
    ["a", "<f8", [2], 8, 16], ["a", "<f8", [2], -64, 16], ["a", "|O", [2], 0, 16], ["a", "<f8", [2.0], 0, 16],
    ["a", "<f8", [1] * 9 + [2], 0, 16], ["a", "<f8", "2", 0, 16], ["a", "<f8", [2], 0], "a", None,
    [1, "<f8", [2], 0, 16],
    ["a", ["<f8"], [2], 0, 16], ["a", "<f8", [2], 0, 16.0], ["a", "|b1", [16], 0, 16], ["a", "<f8", [0, 2**62], 0, 0],
    ["a", "<f8", [True, 2], 0, 16], ["a", "<f8", [10**6] * 3, 0, 8 * 10**18]])
def test_lies_about_an_array_are_refused(row):
    with pytest.raises(WireError):
        decode_record(forged({**GOOD, "arrays": [row]}, b"\x02" * 64))


@pytest.mark.parametrize("header", [
    [], None, 7, b"\xc1", b"\x81\xa1", b"\xdd\xff\xff\xff\xff", b"\x81\xa1\xff\x01", {},
    {**GOOD, "version": WIRE_VERSION + 1},
    {**GOOD, "name": 3}, {**GOOD, "meta": []}, {**GOOD, "arrays": {}}, {**GOOD, "arrays": GOOD["arrays"] * 2},
    {1: 2}, b"\x91" * 3000])
def test_nonsense_headers_are_refused(header):
    with pytest.raises(WireError):
        decode_record(forged(header, bytes(64)))


def test_noise_never_crashes():
    base = forged(GOOD, bytes(64))
    for _ in range(2000):
        raw = bytearray(msgpack.packb(GOOD))
        for _ in range(rng.integers(1, 4)):
            raw[rng.integers(len(raw))] = rng.integers(256)
        try:
            decode_record(forged(bytes(raw), base[-64:]))
        except WireError:
            continue


def meta_forged(kind: str, **fields: object) -> bytes:
    return encode_record(kind, fields, {"Project.x": np.zeros((1, 2))} if kind == "Project" else {})


@pytest.mark.parametrize("data", [
    meta_forged("Registered", surfaces=3), meta_forged("Registered"), meta_forged("Registered", surfaces="a", more=1),
    meta_forged("Facing"), meta_forged("Project", surfaces="a"), meta_forged("Nothing")])
def test_records_that_are_not_the_message_are_refused(data):
    with pytest.raises(WireError, match=r"expected|not one of|missing"):
        decode(data, {**REPLIES, **REQUESTS})


@pytest.mark.parametrize("message", [
    Project("a", np.zeros((2, 2), np.float32)), Project(3, np.zeros((2, 2))), Project("a", [[0.0]]),  # type: ignore
    Register(2.5, I4.reshape(3, 2), I4, False, Passes(I4, I4, I4, F8, I4, F8, F8, F8, F8))])  # type: ignore
def test_a_wrong_field_does_not_leave(message):
    with pytest.raises(WireError, match="expected"):
        encode(message)


class Colour(Enum):
    RED = "red"


@dataclass(frozen=True)
class Inner:
    shape: tuple[int, ...]
    values: dict[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]


@dataclass(frozen=True)
class Outer:
    colour: Colour
    names: dict[str, str]
    inner: tuple[Inner, ...]
    on: bool
    number: float


def test_messages_nest():
    kinds = kinds_of((Outer,))
    message = Outer(Colour.RED, {"a.b": "c"}, (Inner((), {}), Inner((2, 3), {"T": F8, "x.y": np.array(1.0)})),
                    np.bool_(True), np.float64(2.0))  # type: ignore[arg-type]
    back = decode(encode(message), kinds)
    assert (back.colour, back.names, back.on, back.number) == (Colour.RED, {"a.b": "c"}, True, 2.0)
    assert (type(back.on), type(back.number)) == (bool, float)
    assert back.inner[0] == Inner((), {})
    assert back.inner[1].shape == (2, 3)
    assert np.array_equal(back.inner[1].values["T"], F8)
    assert back.inner[1].values["x.y"].shape == ()


def test_what_fills_up_between_the_parts_is_zeros():
    """A record has one form: 63 of its bytes could otherwise carry what nobody looks at."""
    data = encode_record("r", {"n": 1}, {"a": np.arange(3.0), "b": np.arange(16.0), "c": np.arange(1.0)})
    header = 12 + int.from_bytes(data[4:8], "little")
    start = header + -header % 64
    gaps = [*range(header, start), *range(start + 24, start + 64), *range(start + 192 + 8, start + 256)]
    assert len(data) == start + 256
    assert not any(data[i] for i in gaps)
    for i in gaps:
        damaged = bytearray(data)
        damaged[i] ^= 0x10
        with pytest.raises(WireError, match="the bytes between its parts are not zeros"):
            decode_record(bytes(damaged))
    assert decode_record(data)[2]["c"].tolist() == [0.0]


def test_a_long_header_over_a_link_is_refused_before_it_is_read():
    """16 MB of empty lists took 1.3 GB and 25 s."""
    header = msgpack.packb({"version": WIRE_VERSION, "name": "Project", "meta": {"a": [[]] * 300_000}, "arrays": []})
    data = struct.pack("<4sII", b"SLDW", len(header), zlib.crc32(header)) + header
    data += bytes(-len(data) % 64)
    assert decode_record(data)[0] == "Project"  # as a file of our own may have it
    with pytest.raises(WireError, match=f"a header of {len(header)} bytes, at most 262144 are allowed"):
        decode(data, REQUESTS, MAX_MESSAGE_HEADER)
