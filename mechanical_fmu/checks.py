"""Checks of model.json shared by the mechanical halves; every refusal names the key, the value and what would do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import inf, isfinite
from typing import Any, TypeVar

from contact.half.signal import Signal, signal_from

R = TypeVar("R")


def keys(spec: Any, where: str, needed: set[str], optional: Iterable[str] = ()) -> Mapping[str, Any]:
    """The object `spec`, holding all of `needed` and nothing beyond `optional`.  Raises ValueError."""
    if not isinstance(spec, Mapping):
        raise ValueError(f"model.json: {where} must be an object, not {spec!r}")
    known = needed | set(optional)
    for key in spec:
        if key not in known:
            raise ValueError(f"model.json: {where or 'top level'}: unknown key {key!r}; known: {sorted(known)}")
    for key in sorted(needed - set(spec)):
        raise ValueError(f"model.json: {where or 'top level'}: key {key!r} is missing")
    return spec


def known(value: Any, where: str, names: Iterable[str]) -> str:
    """The name `value`, one of `names`.  Raises ValueError."""
    names = list(names)
    if not isinstance(value, str) or value not in names:
        raise ValueError(f"model.json: {where}: {value!r} is none of: {', '.join(names) or '(nothing)'}")
    return value


def number(value: Any, where: str, low: float = -inf, high: float = inf) -> float:
    """A finite number with low < value < high.  Raises ValueError."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"model.json: {where} must be a finite number, not {value!r}")
    if not low < value < high:
        raise ValueError(f"model.json: {where} must lie between {low:g} and {high:g} (ends excluded), not {value!r}")
    return float(value)


def signal(spec: Any, where: str) -> Signal:
    """A Signal.  Raises ValueError."""
    return made(signal_from, spec, where)


def made(make: Callable[[Any], R], spec: Any, where: str) -> R:
    """make(spec), its refusal told with the place.  Raises ValueError."""
    try:
        return make(spec)
    except (ValueError, TypeError, KeyError) as exc:
        raise ValueError(f"model.json: {where}: {exc}") from exc
