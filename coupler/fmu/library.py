"""An instance of an FMU by the functions of its library, FMI 2.0 or 3.0.  The only file that imports fmpy.

All calls to one instance must come from one thread.
"""

from __future__ import annotations

import math
import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from ctypes import (
    POINTER,
    byref,
    c_bool,
    c_char,
    c_char_p,
    c_double,
    c_int,
    c_int8,
    c_int16,
    c_int64,
    c_size_t,
    c_uint,
    c_uint8,
    c_uint16,
    c_uint32,
    c_uint64,
    c_void_p,
    create_string_buffer,
)
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy.fmi2
import fmpy.fmi3
import fmpy.logging
import numpy as np
from fmpy import calloc, free
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from contact.half.door import Door, doors
from coupler.errors import HalfError
from coupler.fmu.description import Description

DISCARD, FATAL = 2, 4
_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
# Type in the XML -> of a value in memory, in C.
C_TYPES: Mapping[str, tuple[type, Any]] = {
    "Real": (np.float64, c_double), "Integer": (np.int32, c_int),
    "Float64": (np.float64, c_double), "Boolean": (np.bool_, c_bool), "Enumeration": (np.int64, c_int64),
    "Int8": (np.int8, c_int8), "UInt8": (np.uint8, c_uint8), "Int16": (np.int16, c_int16),
    "UInt16": (np.uint16, c_uint16), "Int32": (np.int32, c_int), "UInt32": (np.uint32, c_uint32),
    "Int64": (np.int64, c_int64), "UInt64": (np.uint64, c_uint64),
}
_BOOLEAN_2 = (np.int32, c_int)  # of FMI 2.0
LATE = 1e-6  # of a step: an FMU that is nearer to its end is there, up to its own sums of time
LOG: Mapping[int, str] = dict(enumerate(_STATUS))

libraries: dict[str, Any] = {}


class CallError(Exception):
    """A function answered neither ok nor warning.  status : its answer."""

    def __init__(self, function: str, status: int) -> None:
        # fault: a status that FMI does not know ends in a traceback -> said = _STATUS[status] |
        #   coupler/test_hostile_fmu
        said = _STATUS[status] if 0 <= status < len(_STATUS) else f"status {status}, which FMI has not"
        super().__init__(f"{function} answered {said}")
        self.status = status


@dataclass(frozen=True)
class Buffer:
    """Memory both sides see: value references, and the values of all of them, one after the other.

    n : value references.  type : of the values, as in the XML.  first : of references that follow each other, -1 of
    others.
    """

    n: int
    references: Any
    values: NDArray[Any]
    pointer: Any
    type: str
    keep: NDArray[np.uint32]
    first: int


@dataclass(frozen=True)
class Stepped:
    """What became of a step.  discarded : it was not taken.  ends : the FMU asks for the end of the run.

    reached : time of the FMU after it [s].
    """

    reached: float
    discarded: bool = False
    ends: bool = False


class Instance(ABC):
    """An instance of an FMU.  Every method raises CallError where the FMU answers neither ok nor warning."""

    prefix = ""  # of the functions

    def __init__(self, description: Description, extracted: Path, name: str, past_lists: bool = False) -> None:
        """Load the library.  past_lists : whether a half of ours in this process is read and written without FMI's
        lists.

        Raises HalfError where that is not possible.
        """
        self._description, self._past_lists = description, past_lists
        self._door: Door | None = None
        here = os.getcwd()
        try:
            self._fmu: Any = self._loader()(
                guid=description.guid, modelIdentifier=description.identifier, unzipDirectory=str(extracted),
                instanceName=name)
        except Exception as exc:
            raise HalfError(f"the FMU's library cannot be loaded: {exc}", half=name) from exc
        finally:
            os.chdir(here)  # fmpy leaves it if loading fails
        libraries[str(extracted)] = self._fmu.dll
        self._instance: Any = None

    @staticmethod
    @abstractmethod
    def _loader() -> Any:
        """The class of fmpy."""

    @abstractmethod
    def instantiate(self, log: Callable[[int, bytes], None]) -> None:
        """Make the instance.  log : told of status and text of each message.  Raises whatever goes wrong."""

    @abstractmethod
    def prepare(self, t_start: float, t_end: float) -> None:
        """What comes before parameters are set.  Times in s."""

    @abstractmethod
    def enter(self, t_start: float, t_end: float) -> None:
        """Begin initialisation, once parameters are set.  Times in s."""

    def leave(self) -> None:
        """End initialisation."""
        self._call("ExitInitializationMode")

    @abstractmethod
    def step(self, t: float, h: float) -> Stepped:
        """Step from t by h [s]; states from before may be set again."""

    def buffer(self, references: Iterable[int], size: int, type_: str) -> Buffer:
        """Make the memory for `size` values of value references.  Raises KeyError for a type that is no number."""
        dtype, c_type = self._c_type(type_)
        refs = np.array(list(references), dtype=np.uint32)
        values: NDArray[Any] = np.zeros(size, dtype=dtype)
        first = int(refs[0]) if refs.size and (np.diff(refs.astype(np.int64)) == 1).all() else -1
        return Buffer(refs.size, refs.ctypes.data_as(POINTER(c_uint)), values, values.ctypes.data_as(POINTER(c_type)),
                      type_, refs, first)

    def _c_type(self, type_: str) -> tuple[type, Any]:
        return C_TYPES[type_]

    @abstractmethod
    def get(self, buffer: Buffer) -> None:
        """Fill a buffer."""

    @abstractmethod
    def set(self, buffer: Buffer) -> None:
        """Set what a buffer holds."""

    @abstractmethod
    def text(self, buffer: Buffer) -> bytes:
        """Return a String."""

    @abstractmethod
    def set_text(self, buffer: Buffer, text: bytes) -> None:
        """Set a String."""

    # States: pointers that only the FMU reads.

    _state = ""  # how the version writes the word in names of functions
    _back = ""

    def get_state(self) -> c_void_p:
        """Keep the state."""
        state = c_void_p(None)
        self._call(f"GetFMU{self._state}", byref(state))
        return state

    def set_state(self, state: c_void_p) -> None:
        """Go back to a state."""
        self._call(f"SetFMU{self._state}", state)

    def free_state(self, state: c_void_p) -> None:
        """Forget a state."""
        self._call(f"FreeFMU{self._state}", byref(state))

    def state_size(self, state: c_void_p) -> int:
        """Bytes of a state, as the FMU says."""
        size = c_size_t(0)
        self._call(f"SerializedFMU{self._state}Size", state, byref(size))
        return size.value

    def state_bytes(self, state: c_void_p, size: int) -> bytes:
        """Return a state as so many bytes."""
        buffer = create_string_buffer(size)
        self._call(f"SerializeFMU{self._state}", state, self._bytes(buffer), size)
        return buffer.raw

    def state_of(self, data: bytes) -> c_void_p:
        """Return the state behind bytes."""
        state = c_void_p(None)
        buffer = (c_char * len(data)).from_buffer_copy(data)
        self._call(f"{self._back}FMU{self._state}", self._bytes(buffer), len(data), byref(state))
        return state

    def _bytes(self, buffer: Any) -> Any:
        return buffer

    # The end

    def terminate(self) -> None:
        """End the simulation."""
        self._call("Terminate")

    def free(self) -> None:
        """Free the instance.  The library stays loaded: unloading crashes some tools, and the next needs it anyway."""
        self._door = None
        getattr(self._fmu, f"{self.prefix}FreeInstance")(self._instance)

    def _call(self, function: str, *args: Any) -> None:
        name = f"{self.prefix}{function}"
        try:
            getattr(self._fmu, name)(self._instance, *args)
        except FMICallException as exc:
            raise CallError(name, int(exc.status)) from exc


class Instance2(Instance):
    """An instance of an FMU of FMI 2.0."""

    prefix, _state, _back = "fmi2", "state", "DeSerialize"

    @staticmethod
    def _loader() -> Any:
        return fmpy.fmi2.FMU2Slave

    def instantiate(self, log: Callable[[int, bytes], None]) -> None:
        """As of Instance."""
        self._callbacks = self._made_callbacks(log)
        with doors() as made:
            self._fmu.instantiate(callbacks=self._callbacks, loggingOn=True)
        self._instance = self._fmu.component
        if self._past_lists and len(made) == 1:
            self._door = made[0]

    def _made_callbacks(self, log: Callable[[int, bytes], None]) -> Any:
        def record(_: Any, __: bytes, status: int, ___: bytes, message: bytes) -> None:
            log(status, message)

        callbacks = fmpy.fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(record)
        callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(free)
        if not self._description.tool.startswith("PythonFMU"):
            # Others pass a format and arguments; pythonfmu passes plain text, which a formatter would read as format.
            fmpy.logging.addLoggerProxy(byref(callbacks))
        return callbacks

    def prepare(self, t_start: float, t_end: float) -> None:
        """As of Instance."""
        self._call("SetupExperiment", 0, 0.0, t_start, 1, t_end)

    def enter(self, t_start: float, t_end: float) -> None:
        """As of Instance."""
        self._call("EnterInitializationMode")

    def step(self, t: float, h: float) -> Stepped:
        """As of Instance."""
        try:
            self._call("DoStep", t, h, 0)
        except CallError as exc:
            if exc.status != DISCARD:
                raise
            return Stepped(t, discarded=True)
        return Stepped(t + h)

    def _c_type(self, type_: str) -> tuple[type, Any]:
        return _BOOLEAN_2 if type_ == "Boolean" else C_TYPES[type_]

    def get(self, buffer: Buffer) -> None:
        """As of Instance."""
        if self._door is not None and buffer.type == "Real" and buffer.first >= 0:
            self._door.read_block(buffer.first, buffer.values)
            return
        self._call(f"Get{buffer.type}", buffer.references, buffer.n, buffer.pointer)

    def set(self, buffer: Buffer) -> None:
        """As of Instance."""
        if self._door is not None and buffer.type == "Real" and buffer.first >= 0:
            self._door.write_block(buffer.first, buffer.values)
            return
        self._call(f"Set{buffer.type}", buffer.references, buffer.n, buffer.pointer)

    def text(self, buffer: Buffer) -> bytes:
        """As of Instance."""
        value = c_char_p(None)
        self._call("GetString", buffer.references, 1, byref(value))
        return value.value or b""

    def set_text(self, buffer: Buffer, text: bytes) -> None:
        """As of Instance."""
        self._call("SetString", buffer.references, 1, byref(c_char_p(text)))


class Instance3(Instance):
    """An instance of an FMU of FMI 3.0, without event mode, early return or intermediate update: a step is whole."""

    prefix, _state, _back = "fmi3", "State", "Deserialize"

    @staticmethod
    def _loader() -> Any:
        return fmpy.fmi3.FMU3Slave

    def instantiate(self, log: Callable[[int, bytes], None]) -> None:
        """As of Instance."""
        def record(_: Any, status: int, __: bytes, message: bytes) -> None:
            log(status, message)

        self._fmu.instantiate(loggingOn=True, eventModeUsed=False, earlyReturnAllowed=False, logMessage=record)
        self._instance = self._fmu.component

    def prepare(self, t_start: float, t_end: float) -> None:
        """As of Instance."""

    def enter(self, t_start: float, t_end: float) -> None:
        """As of Instance."""
        self._call("EnterInitializationMode", False, 0.0, t_start, True, t_end)

    def step(self, t: float, h: float) -> Stepped:
        """As of Instance."""
        end = t + h
        event, ends, early, reached = c_bool(False), c_bool(False), c_bool(False), c_double(end)
        try:
            self._call("DoStep", t, h, False, byref(event), byref(ends), byref(early), byref(reached))
        except CallError as exc:
            if exc.status != DISCARD:
                raise
            return Stepped(min(max(reached.value, t), end) if math.isfinite(reached.value) else t, discarded=True,
                           ends=ends.value)
        # fault: a step that ended early counts as whole -> whole = True | coupler/test_fmi3
        whole = not early.value and abs(reached.value - end) <= max(LATE * h, 64 * math.ulp(end))
        return Stepped(end if whole else reached.value, ends=ends.value)

    def get(self, buffer: Buffer) -> None:
        """As of Instance."""
        self._call(f"Get{_function_of(buffer.type)}", buffer.references, buffer.n, buffer.pointer, buffer.values.size)

    def set(self, buffer: Buffer) -> None:
        """As of Instance."""
        self._call(f"Set{_function_of(buffer.type)}", buffer.references, buffer.n, buffer.pointer, buffer.values.size)

    def text(self, buffer: Buffer) -> bytes:
        """As of Instance."""
        value = c_char_p(None)
        self._call("GetString", buffer.references, 1, byref(value), 1)
        return value.value or b""

    def set_text(self, buffer: Buffer, text: bytes) -> None:
        """As of Instance."""
        self._call("SetString", buffer.references, 1, byref(c_char_p(text)), 1)

    def _bytes(self, buffer: Any) -> Any:
        return (c_uint8 * len(buffer)).from_buffer(buffer)


def _function_of(type_: str) -> str:
    """How FMI 3.0 calls the functions of a type: enumerations are got and set as Int64."""
    return "Int64" if type_ == "Enumeration" else type_


def load_instance(description: Description, extracted: Path, name: str, past_lists: bool = False) -> Instance:
    """Load the library of an extracted FMU.  past_lists : as of Instance.  Raises HalfError where that is not possible.
    """
    return (Instance3 if description.fmi == 3 else Instance2)(description, extracted, name, past_lists)


def finish_libraries() -> None:
    """End the interpreters of wrappers: left to the loader, those corrupt the heap."""
    for library in libraries.values():
        finish = getattr(library, "finalizePythonInterpreter", None)
        if finish is not None:
            finish()
    libraries.clear()
