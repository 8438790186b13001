"""Bounds of a scene's data over time and place, from the problem that a half is given (model.json, SI and kelvin).

Intervals are (low, high).  They are never too narrow; a sum of products is bounded term by term.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Interval = tuple[float, float]


def signal_at(signal: Any, t: float, side: int = 1) -> float:
    """A SIGNAL at t [s]; side -1: before a jump there, 1: behind it."""
    if not isinstance(signal, Mapping):
        return float(signal)
    ts, values = np.array(signal["t"], dtype=float), np.array(signal["value"], dtype=float)
    if side > 0:
        k = int(np.searchsorted(ts, t, side="right"))
        if k and ts[k - 1] == t:
            return float(values[k - 1])
    else:
        k = int(np.searchsorted(ts, t, side="left"))
        if k < len(ts) and ts[k] == t:
            return float(values[k])
    if k == 0 or k == len(ts):
        return float(values[0] if k == 0 else values[-1])
    w = (t - ts[k - 1]) / (ts[k] - ts[k - 1])
    return float(values[k - 1] + w * (values[k] - values[k - 1]))


def signal_span(signal: Any, first: float, last: float) -> Interval:
    """The least and the largest value of a SIGNAL over [first, last] [s], both sides of a jump at their ends too."""
    if not isinstance(signal, Mapping):
        return float(signal), float(signal)
    inside = [float(v) for t, v in zip(signal["t"], signal["value"], strict=True) if first <= t <= last]
    ends = [signal_at(signal, t, side) for t in (first, last) for side in (-1, 1)]
    return min(inside + ends), max(inside + ends)


def _times(a: Interval, b: Interval) -> Interval:
    products = [p * q for p in a for q in b]
    return min(products), max(products)


def _profile_span(profile: Any, low: float, high: float) -> Interval:
    if "at" in profile:
        at, value = np.array(profile["at"], dtype=float), np.array(profile["value"], dtype=float)
        seen = [*np.interp([low, high], at, value), *value[(at >= low) & (at <= high)]]
        return float(min(seen)), float(max(seen))
    least = most = 0.0
    for power, a in enumerate(profile["polynomial"]):
        ends = [low**power, high**power] + ([0.0] if power and low < 0.0 < high else [])
        part = _times((float(a), float(a)), (min(ends), max(ends)))
        least, most = least + part[0], most + part[1]
    return least, most


def field_span(field: Any, first: float, last: float, x: Floats) -> Interval:
    """Bounds of a FIELD over [first, last] [s] and over the box around x : (n, 2) [m]."""
    if not isinstance(field, Mapping) or "terms" not in field:
        return signal_span(field, first, last)
    low, high = x.min(axis=0), x.max(axis=0)
    least = most = 0.0
    for term in field["terms"]:
        part = signal_span(term.get("t", 1.0), first, last)
        for column, name in enumerate(("x", "y")):
            if name in term:
                part = _times(part, _profile_span(term[name], float(low[column]), float(high[column])))
        least, most = least + part[0], most + part[1]
    return least, most


def property_span(value: Any, low: float, high: float) -> Interval:
    """Bounds of a PROPERTY or PHASED one over temperatures low..high [K]; tables by all of their values."""
    if isinstance(value, Mapping):
        if "solid" in value:
            parts = [property_span(value[k], low, high) for k in ("solid", "liquid")]
            return min(p[0] for p in parts), max(p[1] for p in parts)
        if "value" in value:
            return float(min(value["value"])), float(max(value["value"]))
        T = np.linspace(low, high, 101) - float(value.get("T_ref", 0.0))
        seen = np.polynomial.polynomial.polyval(T, value["polynomial"])
        return float(seen.min()), float(seen.max())
    return float(value), float(value)


def last_change(*parts: Any) -> float:
    """The last time [s] at which a signal anywhere in these mappings and lists bends; 0: all is constant."""
    return max((t for part in parts for t in _signal_ends(part)), default=0.0)


def _signal_ends(part: Any) -> Iterator[float]:
    if isinstance(part, Mapping):
        if "t" in part and "value" in part and isinstance(part["t"], Sequence):
            if len(set(part["value"])) > 1:
                yield float(max(part["t"]))
        else:
            for value in part.values():
                yield from _signal_ends(value)
    elif isinstance(part, Sequence) and not isinstance(part, str):
        for value in part:
            yield from _signal_ends(value)


