"""Halves run in this process, without an FMU around them: a scene of some dozen cells is not worth a build of a second.

The half's own FMI face (contact.half.slave) is used as it is; only the C layer and the archive are left out.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np

import coupler.running.run
import mechanical_fmu.build
import thermal_fmu.build
from contact.half.slave import DISCARDED, HalfSlave
from coupler.errors import HalfError
from coupler.fmu.half import Advance, Array, Block, Status
from coupler.fmu.launch import Launched
from coupler.scenario import Scenario

# What a step that fails counts for: it does not tell its iterations, and has cut itself in pieces that failed in turn.
FAILED_STEP = 150
LOADS = {**thermal_fmu.build.LOADS, **mechanical_fmu.build.LOADS}


def _slave_of(kind: str, resources: Path) -> HalfSlave:
    from importlib import import_module

    module, _, function = LOADS[kind].partition(":")
    loader = getattr(import_module(module), function)

    class Slave(HalfSlave):
        identity = str(resources)
        load = staticmethod(loader)

        def log(self, msg: str, *_: object) -> None:
            self.log_queue.append(msg)

    return Slave(instance_name=kind, resources=str(resources))


class DirectHalf:
    """A half (coupler.fmu.half.Half) called without FMI's C interface.

    work : calls and their iterations so far, which are the same on every machine; explicit pieces solve nothing.
    """

    def __init__(self, kind: str, resources: Path, name: str) -> None:
        self.name = name
        self._slave = _slave_of(kind, resources)
        self._store = self._slave._store
        layout = self._store.layout
        self._variables = {v.name: v for v in layout.variables}
        self.blocks: Mapping[str, Block] = {
            v.name: Block(v.name, v.shape, v.unit if v.kind == "Real" else "", v.causality, v.kind, v.description, v.on)
            for v in layout.variables}
        self.strings: Mapping[str, str] = {v.name: str(v.start) for v in layout.texts}
        self.can_save = self.can_serialise = True
        self._states: dict[int, object] = {}
        self._token = 0
        self.work = 0

    def initialise(self, t_start: float, t_end: float, parameters: Mapping[str, str], inputs: Mapping[str, Array],
                   outputs: Sequence[str]) -> dict[str, Array]:
        self._slave.setup_experiment(t_start, t_end)
        for name, text in parameters.items():
            if self._variables[name].kind == "String":
                self._store.set_text(name, text)
            else:
                self._set(name, np.array(float(text)))
        for name, value in inputs.items():
            self._set(name, value)
        self._slave.exit_initialization_mode()
        self._raise_if_failed()
        return self.read(outputs)

    def advance(self, t: float, h: float, inputs: Mapping[str, Array], outputs: Sequence[str]) -> Advance:
        for name, value in inputs.items():
            self._set(name, value)
        begin = time.perf_counter()
        done = self._slave.do_step(t, h)
        seconds = time.perf_counter() - begin
        explicit = self.name == "mechanical" and self._get("status.dt_stable") > 0.0
        solves = "iterations" in self._variables and not explicit
        self.work += 1 + (int(self._get("iterations")) if solves else 0) + (0 if done else FAILED_STEP)
        if not done:
            if self._code() != DISCARDED:
                raise HalfError(self._message() or "the step failed", half=self.name, log=self.log_tail())
            return Advance(Status.DISCARD, self._message(), {}, seconds,
                           float(self._store.reals[self._store.layout.first["status.dt_suggest"]]))
        return Advance(Status.OK, "", self.read(outputs), seconds)

    def read(self, names: Sequence[str], finite: bool = True) -> dict[str, Array]:
        found = {name: self._get(name) for name in names}
        for name, value in found.items():
            if finite and not np.isfinite(value).all():
                raise HalfError(f"{name} is not finite", half=self.name)
        return found

    def save(self) -> int:
        self._token += 1
        self._states[self._token] = self._slave._get_fmu_state()
        return self._token

    def restore(self, token: int) -> None:
        self._slave._set_fmu_state(self._states[token])
        self._raise_if_failed()

    def release(self, token: int) -> None:
        del self._states[token]

    def serialise(self, token: int) -> bytes:
        return self._slave._fmu_state_to_bytes(self._states[token])

    def deserialise(self, data: bytes) -> int:
        self._token += 1
        self._states[self._token] = self._slave._fmu_state_from_bytes(data)
        return self._token

    def log_tail(self) -> str:
        return "\n".join(self._slave.log_queue[-30:])

    def close(self) -> None:
        self._slave.terminate()

    def _set(self, name: str, value: Array) -> None:
        variable, first = self._variables[name], self._store.layout.first[name]
        if variable.kind == "Integer":
            self._store.integers[self._store.integer_at(first, settable=True)] = int(value)
        else:
            self._store.layout.block(self._store.reals, variable)[...] = np.reshape(value, variable.shape)

    def _get(self, name: str) -> Array:
        self._store.settle()
        variable, first = self._variables[name], self._store.layout.first[name]
        if variable.kind == "Integer":
            return np.array(float(self._store.integers[self._store.integer_at(first)]))
        return np.array(self._store.layout.block(self._store.reals, variable))

    def _code(self) -> int:
        return self._store.integers[self._store.integer_at(self._store.layout.first["status.code"])]

    def _message(self) -> str:
        return self._store.text("status.message")

    def _raise_if_failed(self) -> None:
        if self._code() > DISCARDED:
            raise HalfError(self._message(), half=self.name, log=self.log_tail())


@contextlib.contextmanager
def launch_directly(scenario: Scenario, *, processes: bool, hosts: Path | None = None,
                    join: object = None, built: object = None) -> Iterator[Launched]:
    """Load both halves of a scenario in this process; the place of coupler.fmu.launch.launch."""
    assert not processes, "halves in processes of their own are FMUs"
    with TemporaryDirectory(prefix="slideline-random-") as scratch, contextlib.ExitStack() as stack:
        halves = {}
        for role in ("thermal", "mechanical"):
            directory = Path(scratch) / role
            kind = scenario.write_half(role, directory)
            halves[role] = DirectHalf(kind, directory, role)
            stack.callback(halves[role].close)
        yield Launched(halves["thermal"], halves["mechanical"], scenario.coupling.link)


def without_fmus() -> contextlib.AbstractContextManager[object]:
    """Runs inside use halves of this process."""
    return patch.object(coupler.running.run, "launch", launch_directly)
