"""The FMI 2.0 face of a half: a HalfModel behind pythonfmu's slave methods.

An exception that leaves a slave method crashes the host sooner or later (the native wrapper drops references it
still uses), so every method here ends in a value: what went wrong is status.code, status.message and the log.
"""

from __future__ import annotations

import contextlib
import functools
import math
import sys
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from pythonfmu import Fmi2Slave
from pythonfmu.enums import Fmi2Status

from contact.half.door import announce
from contact.half.interface import Interface
from contact.half.layout import layout_of, standard_variables
from contact.half.model import Discard, Done, Floats, HalfModel, Values, load_directory
from contact.half.state import StateError, from_bytes, frozen_copy, to_bytes
from contact.half.store import Owed, VariableStore
from contact.messages import Reply, Request
from contact.rpc.link import Link, open_link, waits

WELL, DISCARDED, FAILED, INTERRUPTED = range(4)  # status.code


class LinkOnDemand:
    """A link (contact.rpc.link.Link) by its text, opened by its first request."""

    def __init__(self, spec: str) -> None:
        self.spec = spec
        self._link: Link | None = None

    def ask(self, request: Request) -> Reply:
        """Ask the service.  Raises contact.rpc.calls.LinkError."""
        if self._link is None:
            self._link = open_link(self.spec)
        return waits.ask(self._link, request)

    def close(self) -> None:
        """Close the link, if it was opened."""
        if self._link is not None:
            self._link.close()
            self._link = None


LOG_LENGTH = 200  # messages kept for a host that never fetches them
TEXT_LENGTH = 1500  # characters of one message: hosts cut at 2047


def plain(text: str) -> str:
    """Make a text safe for any host's logger: hosts pass it to printf, where a percent sign writes to memory."""
    return text.replace("%", " percent").replace("\0", " ").encode("utf-8", "replace").decode("utf-8")


@dataclass(frozen=True)
class Saved:
    """An FMI state: all that a later step depends on.  half : identity of the FMU it belongs to.

    reals : (n_real,) all Reals, inputs included.  started : whether initialisation has ended.  owed : outputs that are
    not worked out yet; none in bytes.
    """

    half: str
    time: float
    reals: Floats
    integers: tuple[int, ...]
    texts: tuple[str, ...]
    state: Any
    started: bool
    owed: tuple[Owed, ...] = ()

    def settled(self) -> Saved:
        """Return it with nothing owed."""
        if not self.owed:
            return self
        reals = np.array(self.reals)
        for one in self.owed:
            one.leave(reals)
        return replace(self, reals=frozen_copy(reals), owed=())

    # fault: a state is written down for its size and then once more -> @property | contact/test_store
    @cached_property
    def data(self) -> bytes:
        """The state in bytes: a master asks how many they are, and then for them."""
        return to_bytes(self.settled())


@dataclass(frozen=True)
class Unread:
    """Bytes of a state that are decoded later: the native wrapper gives no way to refuse them."""

    data: bytes


def guarded(fallback: Callable[..., Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
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


def _is_refusal(exc: BaseException) -> bool:
    """Return whether a half refused a computation (its own ArithmeticError); Python's are bugs."""
    return isinstance(exc, ArithmeticError) and type(exc).__module__ != "builtins"


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
        sys.path[:] = [p for p in sys.path if p.rstrip("/\\") != resources.rstrip("/\\")]
        try:
            interface, model = load_directory(Path(resources))
            self._model: HalfModel | None = type(self).load(interface, model)
            hashes = " ".join(f"{k}:{v}" for k, v in self.packages.items())
            self._store = VariableStore(layout_of(self._model.variables, standard_variables(interface, hashes)))
        except (ValueError, OSError) as exc:
            raise RuntimeError(plain(f"the half cannot be made: {exc}")) from None
        except Exception as exc:  # noqa: BLE001 a bug: the text below is all the host will ever show
            text = plain("the half cannot be made:\n" + "".join(traceback.format_exception(exc)))
            raise RuntimeError(text) from None
        self._link = LinkOnDemand("direct")
        self._state: Any = None
        self._time = 0.0
        self._started = False
        self._initialising = self._unanswered = False
        self._broken = ""
        self._interrupted = False
        announce(self)

    # Initialisation and stepping

    @guarded(_nothing)
    def setup_experiment(self, start_time: float = 0.0, stop_time: float | None = None,
                         tolerance: float | None = None) -> None:
        """Take the start time [s]."""
        self._time = float(start_time)

    @guarded(_nothing)
    def enter_initialization_mode(self) -> None:
        """Take first inputs from now on; who reads outputs is told those of the inputs so far."""
        self._initialising = self._unanswered = True

    @guarded(_nothing)
    def exit_initialization_mode(self) -> None:
        """Compute first state and outputs from the first inputs."""
        self._initialising = self._unanswered = False
        refusal = self._store.input_refused()
        if not refusal:
            state, outputs = self._first()
            refusal = self._accept(state, outputs, self._time)
        if refusal:
            raise ValueError(refusal)
        self._started = True
        self._report(WELL)

    def _first(self) -> tuple[Any, Values]:
        """First state and outputs, of the inputs as they are."""
        if self._model is None:
            raise RuntimeError("the half was terminated; make a new instance")
        self._link.close()
        self._link = LinkOnDemand(self._store.text("contact.link"))
        return self._model.start(self._store.inputs(), self._time, self._link)

    def _answer_early(self) -> None:
        """Compute first outputs for a master that exchanges them before initialisation ends (FMI 2.0.4, 2.1.6.1).

        What the half refuses it refuses at the end of initialisation again, and says so there.
        """
        # fault: outputs are not numbers while a half is initialised -> if True: | contact/test_half_initialised
        if not self._unanswered or self._store.input_refused():
            return
        self._unanswered = False
        with contextlib.suppress(ArithmeticError):
            self._store.take_outputs(self._first()[1])

    @guarded(lambda slave, t, h: False)
    def do_step(self, current_time: float, step_size: float) -> bool:
        """Take one substep; False (a discard) leaves everything but status.* as it was."""
        if self._broken or self._model is None or not self._started:
            self._report(FAILED, self._broken or "a step was asked of a half that is not initialised")
            return False
        if self._interrupted:
            # Between steps nobody looks at status.*, and what was being set or saved may not have been.
            self._interrupted = False
            self._report(INTERRUPTED, "interrupted")
            return False
        refusal = self._store.input_refused()
        if not (math.isfinite(current_time) and 0 < step_size < math.inf):
            refusal = f"a step from {current_time!r} s by {step_size!r} s is none"
        if refusal:
            self._report(DISCARDED, refusal)
            return False
        answer = self._model.step(self._state, self._store.inputs(), current_time, step_size, self._link)
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
        """Return Reals by value reference; always a list of full length."""
        self._answer_early()
        return self._store.get_reals(vrs)

    @guarded(_nothing)
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set inputs and parameters."""
        self._store.set_reals(vrs, values)
        # fault: first outputs are those of the first inputs for good -> pass | contact/test_half_initialised
        self._unanswered = self._initialising

    @guarded(lambda slave, first, values: values.fill(math.nan))
    def read_block(self, first: int, values: Floats) -> None:
        """As of contact.half.door.Door."""
        self._store.read(first, values)

    @guarded(_nothing)
    def write_block(self, first: int, values: Floats) -> None:
        """As of contact.half.door.Door."""
        self._store.write(first, values)

    @guarded(lambda slave, vrs: [FAILED] * len(vrs))
    def get_integer(self, vrs: list[int]) -> list[int]:
        """Return Integers by value reference."""
        return [self._store.integers[self._store.integer_at(vr)] for vr in vrs]

    @guarded(_nothing)
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set Integer inputs and parameters."""
        for vr, value in zip(vrs, values, strict=True):
            self._store.integers[self._store.integer_at(vr, settable=True)] = int(value)

    @guarded(lambda slave, vrs: [""] * len(vrs))
    def get_string(self, vrs: list[int]) -> list[str]:
        """Return texts by value reference."""
        return [plain(self._store.texts[self._store.text_at(vr)]) for vr in vrs]

    @guarded(_nothing)
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """Set String inputs and parameters."""
        for vr, value in zip(vrs, values, strict=True):
            self._store.texts[self._store.text_at(vr, settable=True)] = str(value)

    # State

    @guarded(lambda slave: Unread(b""))
    def _get_fmu_state(self) -> Saved:
        # self._state is a private copy already and cannot be written to: sharing it is safe.
        store = self._store
        return Saved(self.identity, self._time, frozen_copy(store.reals), tuple(store.integers), tuple(store.texts),
                     self._state, self._started, store.owed)

    @guarded(_nothing)
    def _set_fmu_state(self, saved: Saved | Unread) -> None:
        if isinstance(saved, Unread):
            saved = from_bytes(saved.data, self.packages)
        if not isinstance(saved, Saved) or saved.half != self.identity:
            raise StateError("this state belongs to another half, or to another version of it")
        # Where the contact service is belongs to the run, not to the state: a restored half may live elsewhere.
        link = self._store.text("contact.link")
        self._store.reals = np.array(saved.reals)
        # fault: what was owed when a state was kept is owed no more -> self._store.owed = () | contact/test_store
        self._store.owed = saved.owed
        self._store.integers, self._store.texts = list(saved.integers), list(saved.texts)
        self._store.set_text("contact.link", link)
        self._time, self._started, self._state = saved.time, saved.started, saved.state

    @staticmethod
    def _fmu_state_to_bytes(saved: Saved | Unread) -> bytes:
        try:
            return saved.data
        except BaseException:  # noqa: BLE001 the border; restoring no bytes at all fails with a clear text
            return b""

    @staticmethod
    def _fmu_state_from_bytes(data: bytes) -> Unread:
        return Unread(bytes(data))

    # Inside

    def _accept(self, state: Any, outputs: Values, time: float) -> str:
        """Take a state and outputs over, all or nothing; return why they are refused, or ""."""
        state = frozen_copy(state)
        refusal = self._store.take_outputs(outputs)
        if not refusal:
            self._state, self._time = state, time
        return refusal

    def _report(self, code: int, message: str = "", dt_suggest: float = 0.0, dt_stable: float = 0.0) -> None:
        self._store.report(code, plain(message), dt_suggest, dt_stable)
        # A failure was logged when it happened, with its traceback, which repetitions must not push out.
        if code == DISCARDED:
            self._say(message, Fmi2Status.warning)

    def _fail(self, where: str, exc: BaseException) -> None:
        """Turn an exception into a status.  A failed computation may be tried again; a bug may not."""
        what = f"{type(exc).__name__}: {exc}" if str(exc) else type(exc).__name__
        if isinstance(exc, KeyboardInterrupt):
            self._interrupted = where != "do_step"
            self._report(INTERRUPTED, "interrupted")
            return
        if where == "exit_initialization_mode" and _is_refusal(exc):
            self._broken = str(exc)
            self._say(self._broken, Fmi2Status.error)
            self._report(FAILED, self._broken)
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
