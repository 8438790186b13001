"""Numbers and tables that must lie in a range, whatever key they stand under."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Any

from coupler.scenario.base import Polynomial, PropertyTable
from coupler.scenario.quantity import problem

At = tuple[str | int, ...]


def positive(spec: float | PropertyTable | Polynomial, at: At, most: float = inf, zero_in_table: bool = False) -> None:
    """Raises a problem where a number or table is not above zero, or is above `most`.

    zero_in_table : a table may be zero in places, not everywhere.
    A polynomial cannot be checked here: the step that meets a wrong value is discarded.
    """
    numbers = list(numbers_in(spec, at))
    may_be_zero = zero_in_table and isinstance(spec, PropertyTable) and any(value for _, value in numbers)
    for place, value in numbers:
        if not (0 < value <= most or (value == 0 and may_be_zero)):
            raise problem("must be greater than zero" + (f" and at most {most:g}" if most < inf else ""), at=place)


def numbers_in(spec: Any, at: At) -> Iterator[tuple[At, float]]:
    """The number of a property, or those of its table, and their places; none for what cannot be looked at."""
    if isinstance(spec, PropertyTable):
        for i, value in enumerate(spec.value):
            yield (*at, "value", i), value
    elif isinstance(spec, float):
        yield at, spec


def not_negative(spec: Any, at: At) -> None:
    """Raises a problem where a number or table is below zero."""
    for place, value in numbers_in(spec, at):
        if value < 0.0:
            raise problem("must not be less than zero", at=place)
