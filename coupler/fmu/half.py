"""What the coupler asks of a half, whether it runs in this process or behind a link."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Status(Enum):
    """What became of one substep."""

    OK = "ok"
    DISCARD = "discard"  # the step did not converge; a saved state may be restored and a smaller step tried


@dataclass(frozen=True)
class Block:
    """One field of a half's FMI variables: `T[1]..T[n]` is block "T" of shape (n,); a scalar has shape ().

    causality : input | output | parameter.  kind : Real | Integer | String | Boolean.
    description : the half's own words.  on : what its rows belong to (contact.half.model.PLACES), "" where the half
    does not say.
    """

    name: str
    shape: tuple[int, ...]
    unit: str
    causality: str
    kind: str
    description: str = ""
    on: str = ""


@dataclass(frozen=True)
class Advance:
    """The answer to one substep.  outputs : what was asked for (empty after a discard).  seconds : inside the half.

    Of the time it took besides, as far as it is known [s]: border : to set inputs and get outputs, in the half's
    process.  transport : of the messages there and back, 0 in one process.
    states : kept, put back and let go ahead of it, in the same message.
    waited : of `seconds`, until contact had answered, in so many `requests`.
    """

    status: Status
    message: str
    outputs: dict[str, Array]
    seconds: float
    dt_suggest: float = 0.0
    border: float = 0.0
    transport: float = 0.0
    states: float = 0.0
    waited: float = 0.0
    requests: int = 0


def seconds_of(done: Advance, ended: float, asked: float) -> float:
    """Return how long a step took [s]: as told, or as the caller waited, from `asked` to `ended`, if that is longer."""
    return max(done.seconds + done.border + done.transport + done.states, ended - asked)


Answer = Callable[[], Advance]
"""A substep that was begun: called once, it waits for the answer."""


class Half(Protocol):
    """A half after its FMU was loaded.  Errors of the half itself are HalfError (coupler.errors)."""

    @property
    def name(self) -> str: ...

    @property
    def blocks(self) -> Mapping[str, Block]: ...

    @property
    def strings(self) -> Mapping[str, str]:
        """String parameters and outputs as loaded: mesh.hash, surfaces.hash, geometry, ..."""
        ...

    @property
    def can_save(self) -> bool:
        """Whether states can be saved and restored; without, a window that fails cannot be tried again."""
        ...

    @property
    def can_serialise(self) -> bool:
        """Whether states can be written down; without, a run that stopped cannot be resumed."""
        ...

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        """Set parameters and first inputs, leave initialisation mode, return the outputs asked for.

        t_start, t_end : start and stop time [s].  inputs : shape and unit of the block of that name.  outputs : names;
        each comes back by name in the shape and unit of its block.
        """
        ...

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        """Set the inputs (only those that changed need be given), do one step from t to t + h [s], get the outputs.

        inputs : shape and unit of the block of that name.  outputs : names; the answer holds each in the shape and
        unit of its block.
        """
        ...

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        """Return the outputs as they stand: name -> array in the shape and unit of its block.

        finite : whether one that is not finite is a HalfError.
        """
        ...

    def save(self) -> int:
        """Keep the complete state; returns a token for restore and release."""
        ...

    def restore(self, token: int) -> None: ...

    def release(self, token: int) -> None: ...

    def serialise(self, token: int) -> bytes:
        """The bytes of a kept state, which restore the same bits in another process with the same FMU."""
        ...

    def deserialise(self, data: bytes) -> int:
        """Keep the state behind bytes that serialise gave; returns a token.

        What the bytes are may only be seen at restore, which then raises HalfError.
        """
        ...

    def log_tail(self) -> str:
        """The half's last log messages, for error texts."""
        ...

    def close(self) -> None: ...


def begin(half: Half, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Answer:
    """Begin `advance` of a half; what is returned gives its answer, and raises its errors.

    One in another process, which has a `begin` of its own, works meanwhile; one in this process when the answer is
    asked for.  Until then nothing else may be asked of the half.
    """
    # Of its own: one that passes on what it does not have would pass on what it does to a step as well.
    begun = getattr(type(half), "begin", None)
    return partial(half.advance, t, h, inputs, outputs) if begun is None else begun(half, t, h, inputs, outputs)
