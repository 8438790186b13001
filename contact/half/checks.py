"""Checks of a half's model.json; every refusal names the key, the value and what would do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import inf, isfinite
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from contact.half.functions import Signal, signal_from
from contact.half.interface import Interface

R = TypeVar("R")


def keys(spec: Any, where: str, needed: set[str], optional: Iterable[str] = ()) -> Mapping[str, Any]:
    """The object `spec`, holding all of `needed` and nothing beyond `optional`.  Raises ValueError."""
    if not isinstance(spec, Mapping):
        raise ValueError(f"model.json: {where} must be an object, not {spec!r}")
    may_be = needed | set(optional)
    for key in spec:
        if key not in may_be:
            raise ValueError(f"model.json: {where or 'top level'}: unknown key {key!r}; "
                             f"known: {', '.join(sorted(may_be)) or '(nothing)'}")
    for key in sorted(needed - set(spec)):
        raise ValueError(f"model.json: {where or 'top level'}: key {key!r} is missing")
    return spec


def known(value: Any, where: str, names: Iterable[str]) -> str:
    """The name `value`, one of `names`.  Raises ValueError."""
    names = list(names)
    if not isinstance(value, str) or value not in names:
        raise ValueError(f"model.json: {where}: {value!r} is none of: {', '.join(names) or '(nothing)'}")
    return value


def number(value: Any, where: str, low: float = -inf, high: float = inf, *, low_itself: bool = False) -> float:
    """A finite number with low < value < high; low_itself, without a high: low <= value.  Raises ValueError."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"model.json: {where} must be a finite number, not {value!r}")
    if not (low < value < high or (low_itself and value == low)):
        bound = f"lie between {low:g} and {high:g} (ends excluded)" if high < inf else (
            f"be {'at least' if low_itself else 'greater than'} {low:g}")
        raise ValueError(f"model.json: {where} must {bound}, not {value!r}")
    return float(value)


def signal(spec: Any, where: str) -> Signal:
    """A Signal.  Raises ValueError."""
    return made(signal_from, spec, where)


def nodes_on(interface: Interface, on: Any, where: str) -> NDArray[np.int32]:
    """The nodes of the surface or node set that `on` names, ascending, each once.  Raises ValueError."""
    name = known(on, where, [*interface.surfaces, *interface.node_sets])
    sets = interface.node_sets if name in interface.node_sets else interface.surfaces
    return np.unique(sets[name]).astype(np.int32)


def made(make: Callable[[Any], R], spec: Any, where: str) -> R:
    """make(spec), its refusal told with the place.  Raises ValueError."""
    try:
        return make(spec)
    except (ValueError, TypeError, KeyError) as exc:
        raise ValueError(f"model.json: {where}: {exc}") from exc
