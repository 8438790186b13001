"""A value for any type hint that has a form on the wire: every field of a record away from its default."""

from __future__ import annotations

import math
from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import fields, is_dataclass
from enum import Enum
from itertools import count
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from contact.problem.part import Part

_number = count(3)


def names_of(kind: Any) -> list[str]:
    """The fields of a dataclass or a Part."""
    return [f.name for f in fields(kind)] if is_dataclass(kind) else list(kind.model_fields)


def filled(hint: Any) -> Any:
    """A value of the hint; no two numbers alike."""
    origin, args, k = get_origin(hint), get_args(hint), next(_number)
    if origin is np.ndarray:
        return np.array([k + 0.5, -0.0, 1 / k]).astype(get_args(args[1])[0])
    if origin is tuple and get_origin(args[0]) in (Union, UnionType) and NoneType not in get_args(args[0]):
        return tuple(filled(kind) for kind in get_args(args[0]))
    if origin is tuple:
        return tuple(filled(a) for a in ((args[0],) * 2 if args[1:] == (Ellipsis,) else args))
    if origin in (frozenset, AbstractSet):
        return frozenset((filled(args[0]), filled(args[0])))
    if origin in (dict, Mapping):
        return {filled(args[0]): filled(args[1]), filled(args[0]): filled(args[1])}
    if origin in (Union, UnionType):
        return filled(next(a for a in args if a is not NoneType))
    if is_dataclass(hint):
        made: Any = object.__new__(hint)  # its checks, if any, are not what is asked here
        for name in names_of(hint):
            object.__setattr__(made, name, filled(get_type_hints(hint)[name]))
        return made
    if issubclass(hint, Part):
        return hint.model_construct(**{name: filled(get_type_hints(hint)[name]) for name in names_of(hint)})
    if issubclass(hint, Enum):
        return list(hint)[-1]
    return {str: f"text {k}", bool: True, int: 2**40 + k, float: 0.1 * k, bytes: bytes([k % 256, 0, 255])}[hint]


def differences(a: Any, b: Any, path: str = "") -> list[str]:
    """Paths at which two values differ in type, in shape or in a bit."""
    if type(a) is not type(b):
        return [path]
    if isinstance(a, np.ndarray):
        return [] if (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes()) else [path]
    if is_dataclass(a) or isinstance(a, Part):
        return [d for name in names_of(type(a))
                for d in differences(getattr(a, name), getattr(b, name), f"{path}.{name}")]
    if isinstance(a, Mapping):
        return [path] if list(a) != list(b) else [d for k in a for d in differences(a[k], b[k], f"{path}.{k}")]
    if isinstance(a, tuple):
        return [path] if len(a) != len(b) else [
            d for i, (x, y) in enumerate(zip(a, b, strict=True)) for d in differences(x, y, f"{path}.{i}")]
    same = a == b or (isinstance(a, float) and math.isnan(a) and math.isnan(b))
    return [] if same else [path]
