"""What a half is, apart from FMI: variables, a pure step, and what a step may answer.

A half is written as a HalfModel; contact.half.slave gives it its FMI face.  Nothing here knows FMI or pythonfmu.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from contact.half.interface import Interface, read_interface
from contact.rpc.link import Link as Link

Floats = NDArray[np.float64]
Value = Floats | float | int | str
"""An array for a block, a number or a text for a scalar."""
Values = Mapping[str, Value]
"""Values by the name of their Variable."""

CAUSALITIES = ("input", "output", "parameter")
KINDS = ("Real", "Integer", "String")
PLACES = ("nodes", "cells", "contact_nodes", "pair_nodes", "bodies", "none")
"""What the rows of an array may belong to, in the order of interface.h5; "none": an array of the half's own."""


@dataclass(frozen=True)
class Variable:
    """One field of a half: block `name` of `shape`, or a scalar (shape ()).

    causality : input | output | parameter.  unit : SI, "1" for none (Reals only).
    start : first value, a scalar or an array of `shape`; used for inputs and parameters, and shown for nothing else.
    kind : Real | Integer | String; only Reals may be arrays.
    variability : "" for the usual one: Real inputs and outputs continuous, Integer and String discrete, parameters
        fixed; "constant" for an output that never changes (its start is its value).
    on : of an array, which of PLACES its rows belong to; "": its number of rows tells, and nothing where two have it.
    Raises ValueError where these do not fit together.
    """

    name: str
    shape: tuple[int, ...] = ()
    causality: str = "output"
    unit: str = "1"
    start: Floats | float | int | str = 0.0
    kind: str = "Real"
    variability: str = ""
    description: str = ""
    on: str = ""

    def __post_init__(self) -> None:
        if self.causality not in CAUSALITIES or self.kind not in KINDS:
            raise ValueError(f"variable {self.name}: causality {self.causality}, kind {self.kind} are not known")
        if self.shape and self.kind != "Real":
            raise ValueError(f"variable {self.name}: only a Real may be an array")
        if self.on and (self.on not in PLACES or not self.shape):
            raise ValueError(f"variable {self.name}: on {self.on!r} is for arrays, and one of {', '.join(PLACES)}")
        if isinstance(self.start, str) != (self.kind == "String"):
            raise ValueError(f"variable {self.name}: start {self.start!r} does not suit a {self.kind}")
        if self.kind == "Real" and np.shape(self.start) not in ((), self.shape):
            raise ValueError(f"variable {self.name}: start has shape {np.shape(self.start)}, not {self.shape}")

    @property
    def size(self) -> int:
        """Number of scalars."""
        return math.prod(self.shape)


@dataclass(frozen=True, eq=False)
class Outputs(Mapping[str, Value]):
    """Outputs of which some are worked out only when somebody asks for one of them, such as stresses.

    now : those that are known.  later : names of the others, Reals.  make : gives all of these; it holds what they
    follow from, which nobody may change any more, and it cannot fail: a step without such an answer is a Discard.
    apart : name -> gives this one alone, in the same way; for what is asked for much more seldom.
    unless_asked : those of `apart` that a state in bytes does not keep, and what is told of them there.
    """

    now: Values
    later: tuple[str, ...] = ()
    make: Callable[[], Values] = dict
    apart: Mapping[str, Callable[[], Value]] = field(default_factory=dict)
    unless_asked: Mapping[str, Value] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Value:
        # fault: what is seldom asked for is made with the rest -> if name in self.apart and self._made: |
        #   contact/test_store
        if name in self.apart:
            return self.apart[name]()
        return self._made[name] if name in self.later else self.now[name]

    def __iter__(self) -> Iterator[str]:
        return iter((*self.now, *self.owed))

    def __len__(self) -> int:
        return len(self.now) + len(self.owed)

    @property
    def owed(self) -> tuple[str, ...]:
        """Names of those that are not worked out yet."""
        return (*self.later, *self.apart)

    @cached_property
    def _made(self) -> Values:
        return self.make()


@dataclass(frozen=True)
class Done:
    """A step that converged.

    state : all that evolves, a frozen dataclass of arrays, float, int, str, bool, None, tuples and such dataclasses.
    outputs : the outputs by name, in the shape of their Variable; an output left out keeps its value.  What is costly
        and seldom read may wait until it is (Outputs).
    dt_stable : largest step the half considers stable from here [s], 0 where it does not know.
    """

    state: Any
    outputs: Mapping[str, Value]
    dt_stable: float = 0.0


@dataclass(frozen=True)
class Discard:
    """A step that did not converge: nothing has changed.  dt_suggest : a step worth trying [s], 0 for no idea."""

    message: str
    dt_suggest: float = 0.0


class HalfModel(Protocol):
    """A half: values in, values out.

    What is kept on the object (patterns, factors, compiled kernels) must not change the bits of any answer.
    inputs holds every input and parameter by name: arrays of Variable.shape (read-only), floats, ints, texts.
    """

    variables: tuple[Variable, ...]

    def start(self, inputs: Values, t: float, link: Link) -> tuple[Any, Mapping[str, Value]]:
        """First state and first outputs, at time t [s], when initialisation ends."""
        ...

    def step(self, state: Any, inputs: Values, t: float, h: float, link: Link) -> Done | Discard:
        """From t to t + h [s]; must not write to state or inputs."""
        ...


Load = Callable[[Interface, Mapping[str, Any]], HalfModel]
"""What a half's package offers to its builder: the two files of its directory in, the half out."""


def load_directory(directory: Path) -> tuple[Interface, dict[str, Any]]:
    """interface.h5 and model.json of a half's directory.  Raises ValueError naming the file that is not usable."""
    path = directory / "model.json"
    try:
        model = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as exc:
        raise ValueError(f"{path}: not a readable JSON file ({exc})") from exc
    if not isinstance(model, dict):
        raise ValueError(f"{path}: must hold one object")
    return read_interface(directory / "interface.h5"), model
