"""The way past lists: who makes a half by FMI in its own process may exchange arrays of its Reals directly.

The wrapper of pythonfmu makes a list of every value and one of every reference, a tenth of a microsecond a number, in
every call.  A half says that it was made; the caller that listens then reads and writes consecutive references as one
array.  What is read and written, what is refused and what is worked out on demand are those of get_real and set_real.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from contact.half.model import Floats


class Door(Protocol):
    """A half in this process.  Neither method raises: what goes wrong is in status.*, as of get_real and set_real."""

    def read_block(self, first: int, values: Floats) -> None:
        """Fill values : (n,) with those of the references from `first` on; NaN where that fails."""
        ...

    def write_block(self, first: int, values: Floats) -> None:
        """Set the inputs of the references from `first` on to values : (n,)."""
        ...


_heard = threading.local()


@contextmanager
def doors() -> Iterator[list[Door]]:
    """Collect the halves that are made in this thread meanwhile."""
    before = getattr(_heard, "made", None)
    made: list[Door] = []
    _heard.made = made
    try:
        yield made
    finally:
        _heard.made = before


def announce(half: Door) -> None:
    """Tell who listens that a half was made."""
    made = getattr(_heard, "made", None)
    if made is not None:
        made.append(half)
