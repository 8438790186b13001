"""Numbers inside a page: arrays in one packed block, tables in 16 bits, and what refers to them."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# Names in the script (live/data.js) of the types that a block holds, all little-endian.
TYPES = {"f8": "<f8", "f4": "<f4", "u4": "<u4", "u1": "u1"}
STEPS, NO_VALUE = 65534, 65535
CHART_POINTS = 3000  # of a curve; a screen is not wider


class Pack:
    """Collects arrays; `text` is all of them as base64 of zlib."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def put(self, values: Any, kind: str = "f8") -> list[Any]:
        """Add an array of any shape, in any unit, and return the reference [type, first byte, length]."""
        data = np.ascontiguousarray(values, dtype=TYPES[kind])
        reference = [kind, self._size, int(data.size)]
        self._parts.append(data.tobytes())
        self._size += data.nbytes
        return reference

    def table(self, rows: Array) -> dict[str, Any]:
        """Add a table (n_rows, n_columns) in any unit, NaN where there is no value, to 1/65534 of its range.

        Each row is stored as the difference from the row before, high bytes before low bytes: what changes little from
        row to row takes little room.
        """
        known = np.isfinite(rows)
        low, high = (float(rows[known].min()), float(rows[known].max())) if known.any() else (0.0, 0.0)
        step = (high - low) / STEPS or 1.0
        # fault: report: values of the player are read from the largest down -> codes = np.where(known,
        #   np.rint((high - np.where(known, rows, low)) / step), NO_VALUE).astype(np.int64) | coupler/test_pack
        codes = np.where(known, np.rint((np.where(known, rows, low) - low) / step), NO_VALUE).astype(np.int64)
        change = np.diff(codes, axis=0, prepend=0) % (NO_VALUE + 1)
        both = np.stack([change >> 8, change & 255]).astype(np.uint8)
        return {"rows": len(rows), "columns": int(rows.shape[1]), "low": low,
                "high": high if high > low else low + STEPS, "values": self.put(both, "u1")}

    @property
    def size(self) -> int:
        """Bytes before they are packed."""
        return self._size

    @property
    def text(self) -> str:
        return base64.b64encode(zlib.compress(b"".join(self._parts), 6)).decode()


def json_text(value: Any) -> str:
    """Return JSON that can stand inside an element `script`: no name of a scenario ends that element."""
    # fault: report: a name can end the block of data -> return json.dumps(value, allow_nan=False) |
    #   coupler/test_pack
    return json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


@dataclass(frozen=True, eq=False)
class Curve:
    """values : (n_t,) as shown.  band : (n_t,) half width of what surrounds it, None: nothing does."""

    name: str
    values: Array
    band: Array | None = None


@dataclass(frozen=True, eq=False)
class Chart:
    """Curves over time that the page's script draws.  label : of the upright axis, with its unit.  alt : in words.

    t : (n_t,) [s], ascending.
    """

    label: str
    alt: str
    t: Array
    curves: Sequence[Curve]
    height: int = 260

    def packed(self, pack: Pack) -> dict[str, Any]:
        """What the script reads of it."""
        rows = thinned(self.t, [c.values for c in self.curves])
        return {"label": self.label, "alt": self.alt, "height": self.height, "t": pack.put(self.t[rows]), "series": [
            {"name": c.name, "values": pack.put(c.values[rows]),
             "band": None if c.band is None else pack.put(c.band[rows])} for c in self.curves]}


def thinned(t: Array, curves: Sequence[Array], most: int = CHART_POINTS) -> NDArray[np.intp]:
    """Return the numbers of at most some `most` times that keep the look of curves: ends, and extremes of each part.

    t : (n,) [s], ascending.  curves : (n,) each, in any unit.  All, where they are few.
    """
    if len(t) <= most:
        return np.arange(len(t))
    bounds = np.linspace(0, len(t), max(most // (2 * len(curves) + 1), 1) + 1).astype(int)
    kept = {0, len(t) - 1}
    for first, last in pairwise(bounds.tolist()):
        kept.add(first)
        for values in curves:
            part = values[first:last]
            if np.isfinite(part).any():
                # fault: report: a peak is lost where a curve has many points -> kept |= {first +
                #   int(np.nanargmin(part))} | coupler/test_pack
                kept |= {int(first + np.nanargmin(part)), int(first + np.nanargmax(part))}
    return np.array(sorted(kept))
