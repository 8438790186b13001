"""The FMI 2.0 face of a half: a HalfModel behind pythonfmu's slave methods.

An exception that leaves a slave method crashes the host sooner or later (the native wrapper drops references it
still uses), so every method here ends in a value: what went wrong is status.code, status.message and the log.
"""

from __future__ import annotations

import functools
import math
import sys
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from contact.half.interface import Interface
from contact.half.layout import Layout, checked_output, layout_of, standard_variables
from contact.half.model import Discard, Done, Floats, HalfModel, Value, Values, load_directory
from contact.half.state import StateError, from_bytes, kept, to_bytes
from contact.wire import Reply, Request

WELL, DISCARDED, FAILED, INTERRUPTED = range(4)  # status.code
LOG_LENGTH = 200  # messages kept for a host that never fetches them
TEXT_LENGTH = 1500  # characters of one message: hosts cut at 2047


def plain(text: str) -> str:
    """A text any host's logger can take: hosts pass it to printf, where a percent sign writes to memory."""
    return text.replace("%", " percent").replace("\0", " ").encode("utf-8", "replace").decode("utf-8")


@dataclass(frozen=True)
class Saved:
    """An FMI state: all that a later step depends on.  half : identity of the FMU it belongs to.

    reals : (n_real,) the whole store, inputs included.  started : whether initialisation has ended.
    """

    half: str
    time: float
    reals: Floats
    integers: tuple[int, ...]
    texts: tuple[str, ...]
    state: Any
    started: bool


@dataclass(frozen=True)
class Unread:
    """Bytes of a state, not looked at yet: the native wrapper gives no way to refuse them."""

    data: bytes


class LinkOnDemand:
    """A link opened when first asked, so that a half without contact opens none."""

    def __init__(self, spec: str) -> None:
        self.spec = spec
        self._link: Any = None

    def ask(self, request: Request) -> Reply:
        """Ask the contact service."""
        if self._link is None:
            from contact.link import open_link

            self._link = open_link(self.spec)
        return self._link.ask(request)

    def close(self) -> None:
        """Close the link, if it was ever opened."""
        if self._link is not None:
            self._link.close()


Fallback = Callable[..., Any]


def guarded(fallback: Fallback) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make a slave method end in fallback(slave, *arguments) where it would end in an exception."""

    def decorate(method: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(method)
        def guard(slave: HalfSlave, *args: Any) -> Any:
            try:
                return method(slave, *args)
            except BaseException as exc:  # noqa: BLE001 the border: even SystemExit would crash the host here
                slave._fail(method.__name__, exc)
                return fallback(slave, *args)

        return guard

    return decorate


def _nothing(slave: HalfSlave, *args: Any) -> None:
    return None


class HalfSlave(Fmi2Slave, ABC):  # type: ignore[misc]
    """A half as pythonfmu wants it.  The entry script of an FMU derives the one concrete class.

    identity : guid of the FMU.  packages : top-level packages inside it -> hash of their sources.
    """

    identity: ClassVar[str] = ""
    packages: ClassVar[dict[str, str]] = {}

    @staticmethod
    @abstractmethod
    def load(interface: Interface, model: dict[str, Any]) -> HalfModel:
        """The half of an interface and the content of its model.json."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        resources = str(self.resources)
        # The wrapper adds the resources to sys.path for ever, once an instance.
        sys.path[:] = [p for p in sys.path if p != resources]
        try:
            interface, model = load_directory(Path(resources))
            self._model: HalfModel | None = type(self).load(interface, model)
            text = " ".join(f"{k}:{v}" for k, v in self.packages.items())
            self._layout: Layout = layout_of(self._model.variables, standard_variables(interface, text))
        except (ValueError, OSError) as exc:
            raise RuntimeError(plain(f"the half cannot be made: {exc}")) from None
        except Exception as exc:  # noqa: BLE001 a bug: the text below is all the host will ever show
            text = plain("the half cannot be made:\n" + "".join(traceback.format_exception(exc)))
            raise RuntimeError(text) from None
        self._reals = self._layout.start_store()
        self._integers = [int(v.start) for v in self._layout.integers]
        self._texts = [str(v.start) for v in self._layout.texts]
        self._ranges: dict[tuple[int, int], list[int]] = {}
        self._link = LinkOnDemand("direct")
        self._state: Any = None
        self._time = 0.0
        self._started = False
        self._broken = ""

    # Initialisation and stepping

    @guarded(_nothing)
    def setup_experiment(self, start_time: float = 0.0, stop_time: float | None = None,
                         tolerance: float | None = None) -> None:
        """Take the start time [s]."""
        self._time = float(start_time)

    @guarded(_nothing)
    def exit_initialization_mode(self) -> None:
        """Compute first state and outputs from the first inputs."""
        assert self._model is not None, "the half was terminated"
        self._link.close()
        self._link = LinkOnDemand(self._text("contact.link"))
        refusal = self._refused_inputs()
        if refusal:
            raise ValueError(refusal)
        state, outputs = self._model.start(self._inputs(), self._time, self._link)
        refusal = self._accept(state, outputs, self._time)
        if refusal:
            raise ValueError(refusal)
        self._started = True
        self._report(WELL)

    @guarded(lambda slave, t, h: False)
    def do_step(self, current_time: float, step_size: float) -> bool:
        """One substep; False (a discard) leaves everything but status.* as it was."""
        if self._broken or self._model is None or not self._started:
            self._report(FAILED, self._broken or "a step was asked of a half that is not initialised")
            return False
        refusal = self._refused_inputs()
        if not (math.isfinite(current_time) and 0 < step_size < math.inf):
            refusal = f"a step from {current_time!r} s by {step_size!r} s is none"
        if refusal:
            self._report(DISCARDED, refusal)
            return False
        answer = self._model.step(self._state, self._inputs(), current_time, step_size, self._link)
        if isinstance(answer, Discard):
            self._report(DISCARDED, answer.message, dt_suggest=answer.dt_suggest)
            return False
        if not isinstance(answer, Done):
            raise TypeError(f"a step must answer Done or Discard, not {answer!r}")
        refusal = self._accept(answer.state, answer.outputs, current_time + step_size)
        if refusal:
            self._report(DISCARDED, refusal)
            return False
        self._report(WELL, dt_stable=answer.dt_stable)
        return True

    @guarded(_nothing)
    def terminate(self) -> None:
        """Drop what is big: instances are freed by the garbage collector only, later."""
        self._link.close()
        self._model = self._state = None
        self._started = False

    # Values

    @guarded(lambda slave, vrs: [math.nan] * len(vrs))
    def get_real(self, vrs: list[int]) -> list[float]:
        """Reals by value reference; always a list of full length."""
        place = self._place(vrs)
        if isinstance(place, slice):
            return self._reals[place].tolist()
        return self._reals[place].tolist()

    @guarded(_nothing)
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set inputs and parameters."""
        if not vrs:
            return
        if max(vrs[0], vrs[-1], max(vrs)) >= self._layout.n_set:
            raise ValueError(f"{self._layout.name_of(max(vrs))} is not an input or parameter")
        self._reals[self._place(vrs)] = values

    @guarded(lambda slave, vrs: [FAILED] * len(vrs))
    def get_integer(self, vrs: list[int]) -> list[int]:
        """Integers by value reference."""
        return [self._integers[self._checked(vr, "Integer")] for vr in vrs]

    @guarded(_nothing)
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set Integer inputs and parameters."""
        for vr, value in zip(vrs, values, strict=True):
            self._integers[self._checked(vr, "Integer", settable=True)] = int(value)

    @guarded(lambda slave, vrs: [""] * len(vrs))
    def get_string(self, vrs: list[int]) -> list[str]:
        """Texts by value reference."""
        return [plain(self._texts[self._checked(vr, "String")]) for vr in vrs]

    @guarded(_nothing)
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """Set String inputs and parameters."""
        for vr, value in zip(vrs, values, strict=True):
            self._texts[self._checked(vr, "String", settable=True)] = str(value)

    # State

    @guarded(lambda slave: Unread(b""))
    def _get_fmu_state(self) -> Saved:
        # self._state is a private copy already and cannot be written to: sharing it is safe.
        return Saved(self.identity, self._time, kept(self._reals), tuple(self._integers), tuple(self._texts),
                     self._state, self._started)

    @guarded(_nothing)
    def _set_fmu_state(self, saved: Saved | Unread) -> None:
        if isinstance(saved, Unread):
            saved = from_bytes(saved.data, self.packages)
        if not isinstance(saved, Saved) or saved.half != self.identity:
            raise StateError("this state belongs to another half, or to another version of it")
        link = self._text("contact.link")
        self._time, self._started = saved.time, saved.started
        self._reals = np.array(saved.reals)
        self._integers, self._texts = list(saved.integers), list(saved.texts)
        # Where the contact service is belongs to the run, not to the state: a restored half may live elsewhere.
        self._texts[self._checked(self._layout.first["contact.link"], "String")] = link
        self._state = kept(saved.state)

    @staticmethod
    def _fmu_state_to_bytes(saved: Saved | Unread) -> bytes:
        try:
            return saved.data if isinstance(saved, Unread) else to_bytes(saved)
        except BaseException:  # noqa: BLE001 the border; restoring no bytes at all fails with a clear text
            return b""

    @staticmethod
    def _fmu_state_from_bytes(data: bytes) -> Unread:
        return Unread(bytes(data))

    # Inside

    def _inputs(self) -> Values:
        """What is set from outside, by name; copies, so that no model holds what changes under it."""
        layout = self._layout
        store = self._reals[: layout.n_set].copy()
        store.flags.writeable = False
        values: dict[str, Value] = {}
        for variable in layout.reals:
            if variable.causality != "output":
                block = layout.block(store, variable)
                values[variable.name] = block if variable.shape else float(block)
        for variables, kind in ((layout.integers, self._integers), (layout.texts, self._texts)):
            for variable, value in zip(variables, kind, strict=True):
                if variable.causality != "output":
                    values[variable.name] = value
        return values

    def _refused_inputs(self) -> str:
        if np.isfinite(self._reals[: self._layout.n_set]).all():
            return ""
        layout = self._layout
        name = layout.not_finite(self._reals, "input") or layout.not_finite(self._reals, "parameter")
        return f"input {name} holds a value that is not finite"

    def _accept(self, state: Any, outputs: Values, time: float) -> str:
        """Take a state and outputs over, all or nothing; the reason if they are refused, else ""."""
        layout = self._layout
        known = {v.name: v for v in layout.variables if v.causality == "output"}
        checked = {name: checked_output(known[name], value) for name, value in outputs.items()}
        for name, value in checked.items():
            if known[name].kind == "Real" and not np.isfinite(value).all():
                return f"output {name} is not finite"
        state = kept(state)
        for name, value in checked.items():
            at = layout.first[name]
            if known[name].kind == "Real":
                layout.block(self._reals, known[name])[...] = value
            elif known[name].kind == "Integer":
                self._integers[at - layout.n_real] = value
            else:
                self._texts[at - layout.n_real - len(layout.integers)] = value
        self._state, self._time = state, time
        return ""

    def _place(self, vrs: list[int]) -> slice | np.ndarray:
        """Where value references lie; a slice if they are consecutive (the whole list is compared, not its ends)."""
        n = len(vrs)
        if n == 0:
            return slice(0, 0)
        if n == 1 or vrs[-1] - vrs[0] == n - 1:
            key = (vrs[0], n)
            if key not in self._ranges:
                self._ranges[key] = list(range(vrs[0], vrs[0] + n))
            if vrs[0] >= 0 and vrs[-1] < self._layout.n_real and vrs == self._ranges[key]:
                return slice(vrs[0], vrs[0] + n)
        places = np.array(vrs, dtype=np.intp)
        if places.min() < 0 or places.max() >= self._layout.n_real:
            raise ValueError("a value reference that is no Real")
        return places

    def _checked(self, vr: int, kind: str, settable: bool = False) -> int:
        """Place of an Integer or a text among its kind.  Raises ValueError for another kind, or where not settable."""
        layout = self._layout
        start = layout.n_real + (len(layout.integers) if kind == "String" else 0)
        variables = layout.texts if kind == "String" else layout.integers
        if not 0 <= vr - start < len(variables):
            raise ValueError(f"value reference {vr} is no {kind}")
        variable = variables[vr - start]
        if settable and variable.causality == "output":
            raise ValueError(f"{variable.name} is not an input or parameter")
        return vr - start

    def _text(self, name: str) -> str:
        return self._texts[self._checked(self._layout.first[name], "String")]

    def _report(self, code: int, message: str = "", dt_suggest: float = 0.0, dt_stable: float = 0.0) -> None:
        layout = self._layout
        self._integers[self._checked(layout.first["status.code"], "Integer")] = code
        self._texts[self._checked(layout.first["status.message"], "String")] = plain(message)
        self._reals[layout.first["status.dt_suggest"]] = dt_suggest
        self._reals[layout.first["status.dt_stable"]] = dt_stable
        if message:
            self._say(message, Fmi2Status.warning if code == DISCARDED else Fmi2Status.error)

    def _fail(self, where: str, exc: BaseException) -> None:
        """Turn an exception into a status.  A failed computation may be tried again; a bug may not."""
        what = f"{type(exc).__name__}: {exc}" if str(exc) else type(exc).__name__
        if isinstance(exc, KeyboardInterrupt):
            self._report(INTERRUPTED, "interrupted")
            return
        self._say("".join(traceback.format_exception(exc)), Fmi2Status.error)
        if where == "do_step" and isinstance(exc, (ArithmeticError, np.linalg.LinAlgError)):
            self._report(DISCARDED, what)
            return
        self._broken = self._broken or f"{where}: {what}"
        self._report(FAILED, self._broken)

    def _say(self, text: str, status: Fmi2Status) -> None:
        text = plain(text)
        for at in range(0, len(text), TEXT_LENGTH):
            self.log(text[at : at + TEXT_LENGTH], status)
        del self.log_queue[:-LOG_LENGTH]
