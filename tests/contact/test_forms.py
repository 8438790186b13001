"""Forms of type hints: what goes onto the wire comes back equal, and what is not of the hint is refused."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from contact.codec import decode, encode, kinds_of
from contact.records import WireError, decode_record, encode_record

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Inner:
    a: Array
    at: int | None = None


@dataclass(frozen=True)
class Other:
    name: str


@dataclass(frozen=True)
class Outer:
    data: bytes
    pair: tuple[int, Array]
    marks: Mapping[int, float]
    said: frozenset[str]
    columns: tuple[tuple[tuple[Array, Array], ...], ...] = ()
    inner: Inner | None = None
    maybe: Array | None = None
    more: dict[str, Inner | None] = field(default_factory=dict)
    either: tuple[Inner | Other, ...] = ()


KINDS = kinds_of((Outer,))
V = np.array([1.0, -0.0, np.nan])
FULL = Outer(b"\0\xff" * 40, (3, V), {-2: 0.1, 2**40: 0.2}, frozenset("ba"), (((V, 2 * V),), ()),
             Inner(np.ones((2, 3)), 2**50), np.zeros(()), {"x": None, "y": Inner(V)}, (Other("o"), Inner(2 * V, 1)))


def test_every_form_comes_back() -> None:
    back = decode(encode(FULL), KINDS)
    assert encode(back) == encode(FULL)
    assert back.data == FULL.data
    assert (back.pair[0], back.marks, back.said) == (3, FULL.marks, FULL.said)
    assert back.columns[0][0][1].tobytes() == (2 * V).tobytes()
    assert back.columns[1] == ()
    assert (back.either[0], back.either[1].at) == (Other("o"), 1)
    assert (back.inner.at, back.maybe.shape, back.more["x"], back.more["y"].at) == (2**50, (), None, None)


def test_what_is_not_there_comes_back_as_none() -> None:
    back = decode(encode(replace(FULL, inner=None, maybe=None)), KINDS)
    assert (back.inner, back.maybe) == (None, None)


@pytest.mark.parametrize("part", [{"data": "text"}, {"pair": (1, V, V)}, {"pair": (1.5, V)}, {"marks": {"a": 1.0}},
                                  {"said": frozenset([1])}, {"inner": V}, {"maybe": 1.0}, {"more": {1: None}},
                                  {"either": (FULL.pair,)}, {"either": (None,)}])
def test_what_is_not_of_the_hint_is_not_sent(part: dict) -> None:
    with pytest.raises(WireError):
        encode(replace(FULL, **part))


@pytest.mark.parametrize(("name", "raw"), [("pair", [1]), ("pair", 1), ("marks", [[1, 2.0, 3]]), ("marks", {"1": 2.0}),
                                           ("said", ["a", 1]), ("inner", []), ("inner", [1, 2]), ("maybe", 1.0),
                                           ("data", 5), ("data", ["a"]), ("either", [["Third", {"name": "o"}]]),
                                           ("either", [["Other", 1]]), ("either", [[1, {}]]), ("either", ["Other"])])
def test_what_is_not_of_the_hint_is_not_taken(name: str, raw: object) -> None:
    kind, meta, arrays = decode_record(encode(FULL))
    if name == "data":
        arrays["Outer.data"] = V
    with pytest.raises(WireError):
        decode(encode_record(kind, meta | {name: raw}, arrays), KINDS)
