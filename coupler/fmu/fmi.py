"""A half behind FMI 2.0 or 3.0: loads an FMU and speaks to it by raw pointers.

All calls to one half must come from one thread.
"""

from __future__ import annotations

import atexit
import tempfile
import weakref
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_void_p
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from contact.half.slave import FAILED, INTERRUPTED
from contact.rpc.link import waits
from coupler.errors import HalfError
from coupler.fmu.description import Description, read_description, unpack, unpacked_beside
from coupler.fmu.half import Advance, Array, Block, Status
from coupler.fmu.library import FATAL, LOG, Buffer, CallError, Instance, finish_libraries, load_instance
from coupler.fmu.variables import VariableBlock

LOG_LENGTH = 200  # messages
LOG_TEXT = 2000  # characters of one message that are kept
MAX_STATE = 8 << 30  # bytes; no half is near it
NUMBERS = ("Real", "Integer", "Boolean")

_alive: weakref.WeakSet[FmuHalf] = weakref.WeakSet()


def load_half(fmu: Path, extracted: Path | None = None, name: str = "half", past_lists: bool = False) -> FmuHalf:
    """Load an FMU and make one instance of it.

    past_lists : whether numbers of a half of ours may go as arrays, beside FMI's lists (contact.half.door).

    extracted : where it is, or will be, unpacked; None for where it lies unpacked beside the FMU (as build_half leaves
    it), else for a directory of its own that goes when the program ends.  Raises HalfError with the half's own words.
    """
    if extracted is None:
        extracted = unpacked_beside(fmu)
    if extracted is None:
        scratch = tempfile.TemporaryDirectory(prefix="slideline-")
        _scratch.append(scratch)
        extracted = Path(scratch.name) / "fmu"
    return FmuHalf(unpack(fmu, extracted).absolute(), name, past_lists)


_scratch: list[tempfile.TemporaryDirectory[str]] = []


@dataclass(frozen=True)
class _Part:
    """A field in a buffer.  first : the place of its first value."""

    field: VariableBlock
    first: int


@dataclass(frozen=True)
class _Run:
    """Fields fetched in one call."""

    buffer: Buffer
    parts: tuple[_Part, ...]


# Fetching this many values nobody asked for costs less than one more call.
SKIP = 32


def _runs(fields: Sequence[VariableBlock], reals: frozenset[int]) -> list[list[VariableBlock]]:
    """Real fields of consecutive references, grouped where at most SKIP references, all of them reals, lie between."""
    groups: list[list[VariableBlock]] = []
    real = [f for f in fields if f.block.kind == "Real" and (np.diff(np.asarray(f.references, dtype=int)) == 1).all()]
    for field in sorted(real, key=lambda f: int(f.references[0])):
        first, last = int(field.references[0]), int(groups[-1][-1].references[-1]) if groups else 0
        if groups and 0 < first - last <= SKIP and reals.issuperset(range(last, first)):
            groups[-1].append(field)
        else:
            groups.append([field])
    return groups


def _to_si(field: VariableBlock, value: Array) -> Array:
    how = field.conversion
    return value if how.is_none else how.factor * value + how.offset


def _from_si(field: VariableBlock, value: Array) -> Array:
    return (value - field.conversion.offset) / field.conversion.factor


def _first_bad(name: str, value: Array) -> str:
    """The first number of a block that is not finite, by its name in FMI."""
    at = np.unravel_index(int(np.argmin(np.isfinite(value))), value.shape)
    return f"{name}[{','.join(str(i + 1) for i in at)}]" if at else name


class FmuHalf:
    """A half (coupler.fmu.half.Half) behind an FMU's C interface."""

    def __init__(self, extracted: Path, name: str, past_lists: bool = False) -> None:
        self.name = name
        self._description: Description = read_description(extracted)
        self._fields = self._description.fields
        self.blocks: Mapping[str, Block] = {n: f.block for n, f in self._fields.items()}
        self.strings: Mapping[str, str] = {n: f.start for n, f in self._fields.items()
                                           if f.block.kind == "String" and f.start is not None}
        self.can_save = self._description.can_save
        self.can_serialise = self._description.can_serialise
        self._log: deque[str] = deque(maxlen=LOG_LENGTH)
        self._buffers: dict[str, Buffer] = {}
        self._plans: dict[tuple[str, ...], list[_Run]] = {}
        self._reals = frozenset(int(vr) for f in self._fields.values() if f.block.kind == "Real"
                                for vr in f.references)
        self._states: dict[int, c_void_p] = {}
        self._token = 0
        self._t = self._h = float("nan")
        self._begun = self._dead = False
        self._fmu: Instance = load_instance(self._description, extracted, name, past_lists)
        try:
            self._fmu.instantiate(_recorder(self._log))
        except Exception as exc:
            self._dead = True
            raise HalfError("the FMU could not be instantiated", half=name, log=self.log_tail()) from exc
        _alive.add(self)

    # The Half protocol

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        """Set parameters and first inputs, leave initialisation mode, return the outputs asked for.

        t_start, t_end : start and stop time [s].  inputs : shape and unit of the block of that name.  outputs : names;
        each comes back by name in the shape and unit of its block.
        """
        self._t, self._h = t_start, 0.0
        self._call("prepare", t_start, t_end)
        for name, text in parameters.items():
            self._set_parameter(name, text)
        self._call("enter", t_start, t_end)
        for name, value in inputs.items():
            self._set(name, value)
        self._call("leave")
        self._begun = True
        self._raise_if_failed()
        return self.read(outputs)

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        """Set the inputs (only those that changed need be given), do one step from t to t + h [s], get the outputs.

        inputs : shape and unit of the block of that name.  outputs : names; the answer holds each in the shape and
        unit of its block.
        """
        called = perf_counter()
        self._t, self._h = t, h
        for name, value in inputs.items():
            self._set(name, value)
        said = self._log[-1] if self._log else ""
        # Our halves share this process, and its packages; one that is none of them asks contact by no link of ours.
        waited, requests = waits.seconds, waits.requests
        begin = perf_counter()
        stepped = self._call("step", t, h)
        seconds = perf_counter() - begin
        waited, requests = waits.seconds - waited, waits.requests - requests
        # fault: an FMU that asks for the end is asked for more -> if False: | coupler/test_fmi3
        if stepped.ends:
            raise self._error("it asks for the end of the simulation")
        if stepped.discarded:
            done = self._discarded(seconds, stepped.reached - t, said)
        elif stepped.reached != t + h:
            # No step is left half done: the window goes back, and on in shorter ones.
            early = f"it ended its step early, at {stepped.reached:.9g} s, which was not allowed"
            done = Advance(Status.DISCARD, early, {}, seconds, max(stepped.reached - t, 0.0))
        else:
            done = self._stepped(outputs, seconds)
        return replace(done, border=perf_counter() - called - seconds, waited=waited, requests=requests)

    def _stepped(self, outputs: Sequence[str], seconds: float) -> Advance:
        values, bad = self._get_all(outputs)
        if bad:
            return Advance(Status.DISCARD, f"output {bad} is not finite", {}, seconds)
        return Advance(Status.OK, "", values, seconds)

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        """Return the outputs as they stand: name -> array in the shape and unit of its block.

        finite : whether one that is not finite is a HalfError.
        """
        values, bad = self._get_all(names)
        if bad and finite:
            raise self._error(f"{bad} is not finite")
        return values

    def save(self) -> int:
        """Keep the complete state; returns a token for restore and release."""
        if not self.can_save:
            raise self._error("its FMU cannot keep its state: no iteration, no second try of a window")
        return self._keep(self._call("get_state"))

    def restore(self, token: int) -> None:
        """Go back to a kept state, as often as wanted."""
        self._call("set_state", self._state(token))
        self._raise_if_failed()

    def release(self, token: int) -> None:
        """Forget a kept state."""
        state = self._state(token)
        del self._states[token]
        self._call("free_state", state)

    def serialise(self, token: int) -> bytes:
        """The bytes of a kept state, for another process."""
        if not self.can_serialise:
            raise self._error("its FMU cannot write its state down: no resume")
        state = self._state(token)
        size = self._call("state_size", state)
        # fault: a state of any size is made room for -> if False: | coupler/test_hostile_fmu
        if size > MAX_STATE:
            raise self._error(f"it says its state takes {size} bytes, more than {MAX_STATE >> 30} GiB: no resume")
        if not size:
            raise self._error("it gave no bytes for its state: no resume")
        return bytes(self._call("state_bytes", state, size))

    def deserialise(self, data: bytes) -> int:
        """Keep the state behind bytes that serialise gave; returns a token."""
        return self._keep(self._call("state_of", data))

    def log_tail(self) -> str:
        """The half's last log messages."""
        return "\n".join(list(self._log)[-30:])

    def close(self) -> None:
        """End the instance; further calls raise HalfError.  May be called again."""
        if self._dead:
            return
        try:
            for token in list(self._states):
                self.release(token)
            if self._begun:
                self._call("terminate")
            self._fmu.free()
        finally:
            self._dead = True

    # Inside

    def _call(self, what: str, *args: Any) -> Any:
        """Ask the instance (coupler.fmu.library.Instance).  Raises HalfError for what it answers, or after its end."""
        if self._dead:
            raise self._error(f"it was asked to {what.replace('_', ' ')} after the half had ended")
        try:
            return getattr(self._fmu, what)(*args)
        except CallError as exc:
            # After fatal not even freeing is allowed.
            self._dead = exc.status == FATAL
            raise self._error(str(exc)) from exc

    def _error(self, message: str) -> HalfError:
        where = f" (t = {self._t:.9g} s, h = {self._h:.3g} s)" if self._t == self._t else ""
        return HalfError(message + where, half=self.name, log=self.log_tail())

    def _field(self, name: str) -> VariableBlock:
        field = self._fields.get(name)
        if field is None:
            known = ", ".join(sorted(self._fields))
            raise self._error(f"it has no variable {name!r}; it has {known}")
        return field

    def _buffer(self, field: VariableBlock) -> Buffer:
        """The memory of a block of numbers, or of the name of a text."""
        name, kind = field.block.name, field.block.kind
        if name not in self._buffers:
            if kind not in (*NUMBERS, "String"):
                raise self._error(f"{name} is a {kind}, not a number")
            type_ = "Int32" if kind == "String" else field.type  # of a text only the reference is used
            self._buffers[name] = self._fmu.buffer(field.references, field.size, type_)
        return self._buffers[name]

    def _number(self, name: str) -> tuple[VariableBlock, Buffer]:
        field = self._field(name)
        if field.block.kind == "String":
            raise self._error(f"{name} is a String, not a number")
        return field, self._buffer(field)

    def _get(self, name: str) -> Array:
        field, buffer = self._number(name)
        self._call("get", buffer)
        return _to_si(field, np.array(buffer.values, dtype=np.float64).reshape(field.block.shape))

    def _get_all(self, names: Sequence[str]) -> tuple[dict[str, Array], str]:
        """Fields by name in SI, and one that is not finite, as `T[3]`, or "".

        Reals are fetched, and looked over, in one go: of FMI 2.0 those whose references nearly follow each other.
        """
        key = tuple(names)
        if key not in self._plans:
            fields = [self._field(name) for name in key]
            self._plans[key] = [self._run(group) for group in self._grouped(fields)]
        got: dict[str, Array] = {}
        finite = True
        for run in self._plans[key]:
            self._call("get", run.buffer)
            values = np.array(run.buffer.values)
            finite = finite and bool(np.isfinite(values).all())
            for part in run.parts:
                block, end = part.field.block, part.first + part.field.size
                got[block.name] = _to_si(part.field, values[part.first : end].reshape(block.shape))
        found = {name: got[name] if name in got else self._get(name) for name in key}
        if finite and len(got) == len(found):
            return found, ""
        return found, next((_first_bad(name, v) for name, v in found.items() if not np.isfinite(v).all()), "")

    def _grouped(self, fields: Sequence[VariableBlock]) -> list[list[VariableBlock]]:
        if self._description.fmi == 2:
            return _runs(fields, self._reals)
        # An array has one reference: any of them go in one call.
        real = [f for f in fields if f.block.kind == "Real"]
        return [real] if real else []

    def _run(self, fields: Sequence[VariableBlock]) -> _Run:
        if self._description.fmi == 2:
            first = int(fields[0].references[0])
            references = np.arange(first, int(fields[-1].references[-1]) + 1)
            parts = tuple(_Part(f, int(f.references[0]) - first) for f in fields)
            return _Run(self._fmu.buffer(references, references.size, "Real"), parts)
        ends = np.cumsum([f.size for f in fields]).tolist()
        parts = tuple(_Part(f, end - f.size) for f, end in zip(fields, ends, strict=True))
        return _Run(self._fmu.buffer(np.concatenate([f.references for f in fields]), ends[-1], "Float64"), parts)

    def _set(self, name: str, value: Array) -> None:
        field, buffer = self._number(name)
        if np.shape(value) != field.block.shape:
            raise self._error(f"{name} has shape {field.block.shape}, it was given {np.shape(value)}")
        buffer.values[:] = np.ravel(value) if field.conversion.is_none else _from_si(field, np.ravel(value))
        self._call("set", buffer)

    def _set_parameter(self, name: str, text: str) -> None:
        field = self._field(name)
        if field.block.kind != "String":
            self._set(name, np.array(float(text)))
            return
        self._call("set_text", self._buffer(field), text.encode())

    def _text(self, name: str) -> str:
        if name not in self._fields:
            return ""
        return str(self._call("text", self._buffer(self._field(name))).decode("utf-8", "replace"))

    def _code(self) -> int:
        return int(self._get("status.code")) if "status.code" in self._fields else 0

    def _raise_if_failed(self) -> None:
        code = self._code()
        if code == INTERRUPTED:
            raise KeyboardInterrupt
        if code == FAILED:
            raise self._error(self._text("status.message"))

    def _discarded(self, seconds: float, done: float, said: str) -> Advance:
        """done : how much of the step could be done, in s, as the FMU says.  said : its last message before."""
        self._raise_if_failed()
        suggest = float(self._get("status.dt_suggest")) if "status.dt_suggest" in self._fields else done
        last = self._log[-1] if self._log else ""
        # fault: what an FMU said long ago is told as the reason of a discard -> told = True | coupler/test_fmi3
        told = last is not said
        message = self._text("status.message") or (last if told and last else "it gave no reason")
        return Advance(Status.DISCARD, message, {}, seconds, suggest)

    def _keep(self, state: c_void_p) -> int:
        self._token += 1
        self._states[self._token] = state
        return self._token

    def _state(self, token: int) -> c_void_p:
        if token not in self._states:
            raise self._error(f"state {token} was released, or never kept")
        return self._states[token]


def _recorder(log: deque[str]) -> Callable[[int, bytes], None]:
    """What puts an FMU's messages into a log; it knows no half, which would then live as long as its callbacks."""
    def record(status: int, message: bytes) -> None:
        text = (message or b"")[: LOG_TEXT + 1].decode("utf-8", "replace")
        log.append(f"[{LOG.get(status, status)}] {text if len(text) <= LOG_TEXT else text[:LOG_TEXT] + ' ...'}")

    return record


@atexit.register
def _finish() -> None:
    """End what is still alive, then the wrappers' own interpreters."""
    for half in list(_alive):
        half.close()
    finish_libraries()
    for scratch in _scratch:
        scratch.cleanup()
