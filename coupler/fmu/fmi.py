"""A half behind FMI 2.0: loads an FMU and speaks to it by raw pointers.  The only file that imports fmpy.

All calls to one half must come from one thread.
"""

from __future__ import annotations

import atexit
import os
import tempfile
import weakref
from collections import deque
from collections.abc import Mapping, Sequence
from ctypes import POINTER, byref, c_char, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p, create_string_buffer
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import fmpy.fmi2
import fmpy.logging
import numpy as np
from fmpy import calloc, free
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from contact.half.slave import FAILED, INTERRUPTED
from contact.rpc.link import waits
from coupler.errors import HalfError
from coupler.fmu.description import Description, VariableBlock, read_description, unpack, unpacked_beside
from coupler.fmu.half import Advance, Array, Block, Status

DISCARD, FATAL = 2, 4
LOG_LENGTH = 200  # messages
LOG_TEXT = 2000  # characters of one message that are kept
MAX_STATE = 8 << 30  # bytes; no half is near it
_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")

_alive: weakref.WeakSet[FmuHalf] = weakref.WeakSet()
_libraries: dict[str, Any] = {}


def load_half(fmu: Path, extracted: Path | None = None, name: str = "half") -> FmuHalf:
    """Load an FMU and make one instance of it.

    extracted : where it is, or will be, unpacked; None for where it lies unpacked beside the FMU (as build_half leaves
    it), else for a directory of its own that goes when the program ends.  Raises HalfError with the half's own words.
    """
    if extracted is None:
        extracted = unpacked_beside(fmu)
    if extracted is None:
        scratch = tempfile.TemporaryDirectory(prefix="slideline-")
        _scratch.append(scratch)
        extracted = Path(scratch.name) / "fmu"
    return FmuHalf(unpack(fmu, extracted).absolute(), name)


_scratch: list[tempfile.TemporaryDirectory[str]] = []


@dataclass(frozen=True)
class _Buffer:
    """Memory both sides see: value references and values of one field."""

    n: int
    references: Any
    values: NDArray[Any]
    pointer: Any
    keep: NDArray[np.uint32]


@dataclass(frozen=True)
class _Part:
    """A field in a buffer.  first : the place of its first value."""

    field: VariableBlock
    first: int


@dataclass(frozen=True)
class _Run:
    """Fields fetched in one call."""

    buffer: _Buffer
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


def _run(fields: Sequence[VariableBlock]) -> _Run:
    first = int(fields[0].references[0])
    references = np.arange(first, int(fields[-1].references[-1]) + 1)
    parts = tuple(_Part(f, int(f.references[0]) - first) for f in fields)
    return _Run(_buffer(references, "Real"), parts)


def _to_si(field: VariableBlock, value: Array) -> Array:
    how = field.conversion
    return value if how.is_none else how.factor * value + how.offset


def _from_si(field: VariableBlock, value: Array) -> Array:
    return (value - field.conversion.offset) / field.conversion.factor


def _first_bad(name: str, value: Array) -> str:
    """The first number of a block that is not finite, by its name in FMI."""
    at = np.unravel_index(int(np.argmin(np.isfinite(value))), value.shape)
    return f"{name}[{','.join(str(i + 1) for i in at)}]" if at else name


def _buffer(references: NDArray[np.integer], kind: str) -> _Buffer:
    real = kind == "Real"
    refs = np.ascontiguousarray(references, dtype=np.uint32)
    values = np.zeros(refs.size, dtype=np.float64 if real else np.int32)
    return _Buffer(refs.size, refs.ctypes.data_as(POINTER(c_uint)), values,
                   values.ctypes.data_as(POINTER(c_double if real else c_int)), refs)


class FmuHalf:
    """A half (coupler.fmu.half.Half) behind an FMU's C interface."""

    def __init__(self, extracted: Path, name: str) -> None:
        self.name = name
        self._description: Description = read_description(extracted)
        self._fields = self._description.fields
        self.blocks: Mapping[str, Block] = {n: f.block for n, f in self._fields.items()}
        self.strings: Mapping[str, str] = {n: f.start for n, f in self._fields.items()
                                           if f.block.kind == "String" and f.start is not None}
        self.can_save = self._description.can_save
        self.can_serialise = self._description.can_serialise
        self._log: deque[str] = deque(maxlen=LOG_LENGTH)
        self._buffers: dict[str, _Buffer] = {}
        self._plans: dict[tuple[str, ...], list[_Run]] = {}
        self._reals = frozenset(int(vr) for f in self._fields.values() if f.block.kind == "Real"
                                for vr in f.references)
        self._states: dict[int, c_void_p] = {}
        self._token = 0
        self._t = self._h = float("nan")
        self._begun = self._dead = False
        self._fmu: Any = _library(self._description, extracted, name)
        self._callbacks = self._make_callbacks()
        try:
            self._fmu.instantiate(callbacks=self._callbacks, loggingOn=True)
        except Exception as exc:
            self._dead = True
            raise HalfError("the FMU could not be instantiated", half=name, log=self.log_tail()) from exc
        self._instance = self._fmu.component
        _alive.add(self)

    # The Half protocol

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        """Set parameters and first inputs, leave initialisation mode, return the outputs asked for.

        t_start, t_end : start and stop time [s].  inputs : shape and unit of the block of that name.  outputs : names;
        each comes back by name in the shape and unit of its block.
        """
        self._t, self._h = t_start, 0.0
        self._call("fmi2SetupExperiment", 0, 0.0, t_start, 1, t_end)
        for name, text in parameters.items():
            self._set_parameter(name, text)
        self._call("fmi2EnterInitializationMode")
        for name, value in inputs.items():
            self._set(name, value)
        self._call("fmi2ExitInitializationMode")
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
        # Our halves share this process, and its packages; one that is none of them asks contact by no link of ours.
        waited, requests = waits.seconds, waits.requests
        begin = perf_counter()
        # Fourth argument: earlier states may be set again.
        status = self._call("fmi2DoStep", t, h, 0, allow=(DISCARD,))
        seconds = perf_counter() - begin
        waited, requests = waits.seconds - waited, waits.requests - requests
        done = self._discarded(seconds) if status == DISCARD else self._stepped(outputs, seconds)
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
        state = c_void_p(None)
        self._call("fmi2GetFMUstate", byref(state))
        return self._keep(state)

    def restore(self, token: int) -> None:
        """Go back to a kept state, as often as wanted."""
        self._call("fmi2SetFMUstate", self._state(token))
        self._raise_if_failed()

    def release(self, token: int) -> None:
        """Forget a kept state."""
        state = self._state(token)
        del self._states[token]
        self._call("fmi2FreeFMUstate", byref(state))

    def serialise(self, token: int) -> bytes:
        """The bytes of a kept state, for another process."""
        if not self.can_serialise:
            raise self._error("its FMU cannot write its state down: no resume")
        state, size = self._state(token), c_size_t(0)
        self._call("fmi2SerializedFMUstateSize", state, byref(size))
        # fault: a state of any size is made room for -> if False: | coupler/test_hostile_fmu
        if size.value > MAX_STATE:
            raise self._error(f"it says its state takes {size.value} bytes, more than {MAX_STATE >> 30} GiB: no resume")
        buffer = create_string_buffer(size.value)
        self._call("fmi2SerializeFMUstate", state, buffer, size)
        if not size.value:
            raise self._error("it gave no bytes for its state: no resume")
        return buffer.raw

    def deserialise(self, data: bytes) -> int:
        """Keep the state behind bytes that serialise gave; returns a token."""
        state = c_void_p(None)
        buffer = (c_char * len(data)).from_buffer_copy(data)
        self._call("fmi2DeSerializeFMUstate", buffer, len(data), byref(state))
        return self._keep(state)

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
                self._call("fmi2Terminate")
            # The library stays loaded: unloading crashes some tools, and the next instance needs it anyway.
            self._fmu.fmi2FreeInstance(self._instance)
        finally:
            self._dead = True

    # Inside

    def _call(self, function: str, *args: Any, allow: Sequence[int] = ()) -> int:
        if self._dead:
            raise self._error(f"{function} was called after the half had ended")
        try:
            return int(getattr(self._fmu, function)(self._instance, *args))
        except FMICallException as exc:
            if exc.status in allow:
                return int(exc.status)
            # After fatal not even freeing is allowed.
            self._dead = exc.status == FATAL
            # fault: a status that FMI does not know ends in a traceback -> said = _STATUS[exc.status] |
            #   coupler/test_hostile_fmu
            said = _STATUS[exc.status] if 0 <= exc.status < len(_STATUS) else f"status {exc.status}, which FMI has not"
            raise self._error(f"{function} answered {said}") from exc

    def _error(self, message: str) -> HalfError:
        where = f" (t = {self._t:.9g} s, h = {self._h:.3g} s)" if self._t == self._t else ""
        return HalfError(message + where, half=self.name, log=self.log_tail())

    def _field(self, name: str) -> tuple[VariableBlock, _Buffer]:
        field = self._fields.get(name)
        if field is None:
            known = ", ".join(sorted(self._fields))
            raise self._error(f"it has no variable {name!r}; it has {known}")
        if name not in self._buffers:
            self._buffers[name] = _buffer(field.references, field.block.kind)
        return field, self._buffers[name]

    def _get(self, name: str) -> Array:
        field, buffer = self._field(name)
        kind = field.block.kind
        if kind not in ("Real", "Integer", "Boolean"):
            raise self._error(f"{name} is a {kind}, not a number")
        self._call(f"fmi2Get{kind}", buffer.references, buffer.n, buffer.pointer)
        return _to_si(field, np.array(buffer.values, dtype=np.float64).reshape(field.block.shape))

    def _get_all(self, names: Sequence[str]) -> tuple[dict[str, Array], str]:
        """Fields by name in SI, and one that is not finite, as `T[3]`, or "".

        Reals whose references nearly follow each other are fetched, and looked over, in one go.
        """
        key = tuple(names)
        if key not in self._plans:
            self._plans[key] = [_run(fields) for fields in _runs([self._field(name)[0] for name in key], self._reals)]
        got: dict[str, Array] = {}
        finite = True
        for run in self._plans[key]:
            self._call("fmi2GetReal", run.buffer.references, run.buffer.n, run.buffer.pointer)
            values = np.array(run.buffer.values)
            finite = finite and bool(np.isfinite(values).all())
            for part in run.parts:
                block, size = part.field.block, len(part.field.references)
                got[block.name] = _to_si(part.field, values[part.first : part.first + size].reshape(block.shape))
        fields = {name: got[name] if name in got else self._get(name) for name in key}
        if finite and len(got) == len(fields):
            return fields, ""
        return fields, next((_first_bad(name, v) for name, v in fields.items() if not np.isfinite(v).all()), "")

    def _set(self, name: str, value: Array) -> None:
        field, buffer = self._field(name)
        kind = field.block.kind
        if kind not in ("Real", "Integer", "Boolean"):
            raise self._error(f"{name} is a {kind}, not a number")
        if np.shape(value) != field.block.shape:
            raise self._error(f"{name} has shape {field.block.shape}, it was given {np.shape(value)}")
        buffer.values[:] = np.ravel(value) if field.conversion.is_none else _from_si(field, np.ravel(value))
        self._call(f"fmi2Set{kind}", buffer.references, buffer.n, buffer.pointer)

    def _set_parameter(self, name: str, text: str) -> None:
        field, buffer = self._field(name)
        if field.block.kind != "String":
            self._set(name, np.array(float(text)))
            return
        self._call("fmi2SetString", buffer.references, 1, byref(c_char_p(text.encode())))

    def _text(self, name: str) -> str:
        if name not in self._fields:
            return ""
        _, buffer = self._field(name)
        value = c_char_p(None)
        self._call("fmi2GetString", buffer.references, 1, byref(value))
        return (value.value or b"").decode("utf-8", "replace")

    def _code(self) -> int:
        return int(self._get("status.code")) if "status.code" in self._fields else 0

    def _raise_if_failed(self) -> None:
        code = self._code()
        if code == INTERRUPTED:
            raise KeyboardInterrupt
        if code == FAILED:
            raise self._error(self._text("status.message"))

    def _discarded(self, seconds: float) -> Advance:
        self._raise_if_failed()
        suggest = float(self._get("status.dt_suggest")) if "status.dt_suggest" in self._fields else 0.0
        message = self._text("status.message") or (self._log[-1] if self._log else "it gave no reason")
        return Advance(Status.DISCARD, message, {}, seconds, suggest)

    def _keep(self, state: c_void_p) -> int:
        self._token += 1
        self._states[self._token] = state
        return self._token

    def _state(self, token: int) -> c_void_p:
        if token not in self._states:
            raise self._error(f"state {token} was released, or never kept")
        return self._states[token]

    def _make_callbacks(self) -> Any:
        log = self._log

        def record(_: Any, __: bytes, status: int, ___: bytes, message: bytes) -> None:
            label = _STATUS[status] if 0 <= status < len(_STATUS) else status
            text = (message or b"")[: LOG_TEXT + 1].decode("utf-8", "replace")
            log.append(f"[{label}] {text if len(text) <= LOG_TEXT else text[:LOG_TEXT] + ' ...'}")

        callbacks = fmpy.fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(record)
        callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(free)
        if not self._description.tool.startswith("PythonFMU"):
            # Others pass a format and arguments; pythonfmu passes plain text, which a formatter would read as format.
            fmpy.logging.addLoggerProxy(byref(callbacks))
        return callbacks


def _library(description: Description, extracted: Path, name: str) -> Any:
    """fmpy's view of the FMU's library, in the working directory we came from (fmpy leaves it if loading fails)."""
    here = os.getcwd()
    try:
        fmu = fmpy.fmi2.FMU2Slave(guid=description.guid, modelIdentifier=description.identifier,
                                  unzipDirectory=str(extracted), instanceName=name)
    except Exception as exc:
        raise HalfError(f"the FMU's library cannot be loaded: {exc}", half=name) from exc
    finally:
        os.chdir(here)
    _libraries[str(extracted)] = fmu.dll
    return fmu


@atexit.register
def _finish() -> None:
    """End what is still alive, then the wrappers' own interpreters: left to the loader, those corrupt the heap."""
    for half in list(_alive):
        half.close()
    for library in _libraries.values():
        finish = getattr(library, "finalizePythonInterpreter", None)
        if finish is not None:
            finish()
    _libraries.clear()
    for scratch in _scratch:
        scratch.cleanup()
