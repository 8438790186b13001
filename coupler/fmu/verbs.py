"""What the coupler says to a half that lives in another process, and what it hears back.

Coarse on purpose: a substep is one message each way.  States stay with the half; only tokens travel.
Repeating a message is harmless: the server knows a call by its number and carries it out once.
"""

from __future__ import annotations

from dataclasses import dataclass

from contact.codec import kinds_of
from coupler.fmu.half import Advance, Array, Block


@dataclass(frozen=True)
class Describe:
    """Which half are you?  Answered by Described."""


@dataclass(frozen=True)
class Described:
    """A half's name, blocks, strings and what it can do: the attributes of coupler.fmu.half.Half."""

    name: str
    blocks: tuple[Block, ...]
    strings: dict[str, str]
    can_save: bool
    can_serialise: bool


@dataclass(frozen=True)
class Initialise:
    """Half.initialise.  Answered by Values."""

    t_start: float
    t_end: float
    parameters: dict[str, str]
    inputs: dict[str, Array]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Step:
    """Half.advance.  Answered by coupler.fmu.half.Advance."""

    t: float
    h: float
    inputs: dict[str, Array]
    outputs: tuple[str, ...]


@dataclass(frozen=True)
class Read:
    """Half.read.  Answered by Values."""

    names: tuple[str, ...]
    finite: bool = True


@dataclass(frozen=True)
class Values:
    """Blocks by name."""

    values: dict[str, Array]


@dataclass(frozen=True)
class Save:
    """Half.save.  Answered by Token."""


@dataclass(frozen=True)
class Token:
    """Names a state that the half keeps."""

    token: int


@dataclass(frozen=True)
class Restore:
    """Half.restore.  Answered by Acknowledged."""

    token: int


@dataclass(frozen=True)
class Release:
    """Half.release.  Answered by Acknowledged."""

    token: int


@dataclass(frozen=True)
class Serialise:
    """Half.serialise.  Answered by StateBytes."""

    token: int


@dataclass(frozen=True)
class StateBytes:
    """A half's state, written down."""

    data: bytes


@dataclass(frozen=True)
class Deserialise:
    """Half.deserialise.  Answered by Token."""

    data: bytes


@dataclass(frozen=True)
class LogTail:
    """Half.log_tail.  Answered by Text."""


@dataclass(frozen=True)
class Text:
    """Some text."""

    text: str


@dataclass(frozen=True)
class Close:
    """Half.close, and the end of its process.  Answered by Acknowledged."""


@dataclass(frozen=True)
class Acknowledged:
    """It is done."""


@dataclass(frozen=True)
class Failed:
    """The half raised HalfError.  message, log : its parts."""

    message: str
    log: str


Verb = Describe | Initialise | Step | Read | Save | Restore | Release | Serialise | Deserialise | LogTail | Close
VERBS = kinds_of((Describe, Initialise, Step, Read, Save, Restore, Release, Serialise, Deserialise, LogTail, Close))
ANSWERS = kinds_of((Described, Values, Advance, Token, StateBytes, Text, Acknowledged, Failed))
