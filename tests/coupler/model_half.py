"""A half in this process without an FMU: what it computes, behind the protocol that the coupler asks halves by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from contact.half import open_link
from contact.half.model import Done, HalfModel
from coupler.fmu.half import Advance, Array, Block, Status


class ModelHalf:
    """A half (coupler.fmu.half.Half) around a HalfModel.  States are those of the model, which are never changed."""

    can_save, can_serialise = True, False

    def __init__(self, model: HalfModel, name: str = "half") -> None:
        self.name = name
        self.strings = {v.name: str(v.start) for v in model.variables if v.kind == "String"}
        self._model, self._link = model, open_link("direct")
        self.blocks: Mapping[str, Block] = {v.name: Block(v.name, v.shape, v.unit, v.causality, v.kind)
                                            for v in model.variables}
        self._inputs: dict[str, Any] = {v.name: _as_its_shape(v.start, v.shape) if v.kind != "String" else v.start
                                        for v in model.variables if v.causality != "output"}
        self._out: dict[str, Any] = {}
        self._state: Any = None
        self._saved: dict[int, Any] = {}

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        self._set(inputs)
        self._state, first = self._model.start(self._inputs, t_start, self._link)
        self._out = dict(first)
        return self.read(outputs)

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        self._set(inputs)
        done = self._model.step(self._state, self._inputs, t, h, self._link)
        if not isinstance(done, Done):
            return Advance(Status.DISCARD, done.message, {}, 0.0)
        self._state = done.state
        self._out |= {name: done.outputs[name] for name in done.outputs if name in outputs or name in self._out}
        return Advance(Status.OK, "", self.read(outputs), 0.0)

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        found = {}
        for name in names:
            assert self.blocks[name].kind != "String", f"{name} is no number"
            if name in self._inputs:
                found[name] = np.array(self._inputs[name], dtype=float)
            elif name in self._out:
                found[name] = _as_its_shape(self._out[name], self.blocks[name].shape)
        return found

    def save(self) -> int:
        self._saved[len(self._saved)] = (self._state, dict(self._inputs), dict(self._out))
        return len(self._saved) - 1

    def restore(self, token: int) -> None:
        self._state, inputs, out = self._saved[token]
        self._inputs, self._out = dict(inputs), dict(out)

    def release(self, token: int) -> None: ...

    def serialise(self, token: int) -> bytes:
        raise NotImplementedError

    def deserialise(self, data: bytes) -> int:
        raise NotImplementedError

    def log_tail(self) -> str:
        return ""

    def close(self) -> None: ...

    def _set(self, inputs: Mapping[str, Array]) -> None:
        for name, value in inputs.items():
            kind = self.blocks[name].kind
            array = _as_its_shape(value, self.blocks[name].shape)
            self._inputs[name] = array if array.shape else (float if kind == "Real" else int)(array)


def _as_its_shape(value: Any, shape: tuple[int, ...]) -> Array:
    return np.array(np.broadcast_to(np.asarray(value, dtype=float), shape))
