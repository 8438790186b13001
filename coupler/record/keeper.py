"""The keeper of a run's checkpoints: when one is due, and what both halves add to it."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

from coupler.control.state import Committed
from coupler.errors import ResultsError
from coupler.fmu.half import Half
from coupler.record.beside import checkpoint_of
from coupler.record.checkpoint import Checkpoint, Origin, Told, to_bytes, write_checkpoint
from coupler.record.recorder import Recorder
from coupler.scenario import Scenario
from coupler.scenario.reading import plain_value

PACKAGES = ("slideline", "numpy", "scipy", "fmpy", "pythonfmu", "eclipse-zenoh", "h5py", "numba")


class Keeper:
    """Writes checkpoints beside the results file.

    every : least wall time between two [s]; None: there are none.  halves : by role.
    """

    def __init__(self, scenario: Scenario, recorder: Recorder, halves: Mapping[str, Half]) -> None:
        every = scenario.output.checkpoint
        self._every = every if all(half.can_serialise for half in halves.values()) else None
        self._recorder = recorder
        self._path = checkpoint_of(recorder.out)
        self._halves = halves
        self._origin = origin_of(scenario)
        self._last = float("-inf")
        self.trouble = ""
        self._kept: float | None = None

    @property
    def remedy(self) -> str:
        """How this run, if it ends early, is gone on with; empty where it cannot be."""
        if self._kept is None:
            return ""
        return f"`slideline resume {self._recorder.out}` goes on from t = {self._kept:.9g} s"

    @property
    def on(self) -> bool:
        """Whether this run can be resumed."""
        return self._every is not None

    @property
    def due(self) -> bool:
        """Whether enough time has passed since the last one."""
        return self._every is not None and time.monotonic() - self._last >= self._every

    def keep(self, committed: Committed, told: Told) -> None:
        """Write a checkpoint; both halves stand at the end of the last accepted window.

        A disk that is full ends no run of hours: the older checkpoint stays, and `trouble` says why.
        """
        states = {role: state_of(half) for role, half in self._halves.items()}
        checkpoint = Checkpoint(committed, told, packages_of(self._halves), states)
        try:
            # What the checkpoint goes on from must be on the disk before the checkpoint is.
            self._recorder.sync()
            write_checkpoint(self._path, to_bytes(self._origin, checkpoint))
            self.trouble, self._kept = "", committed.state.now.t
        except OSError as exc:
            self.trouble = f"{self._path}: the checkpoint could not be written ({exc.strerror}); an older one stays"
        self._last = time.monotonic()


def origin_of(scenario: Scenario) -> Origin:
    """What the checkpoints of a run of this scenario belong to."""
    return Origin(str(Path(scenario.file).absolute()), scenario.hash,
                  json.dumps(plain_value(scenario.overrides)), versions())


def versions() -> dict[str, str]:
    """Of Python, this program and what it computes with."""
    return {"python": platform.python_version(), **{p: version(p) for p in PACKAGES}}


def packages_of(halves: Mapping[str, Half]) -> dict[str, str]:
    """Role -> hash of the sources a half's FMU was built of; empty for one that does not tell."""
    return {role: half.strings.get("packages.hash", "") for role, half in halves.items()}


def state_of(half: Half) -> bytes:
    """The bytes of a half's state as it stands."""
    token = half.save()
    try:
        return half.serialise(token)
    finally:
        half.release(token)


def put_back(halves: Mapping[str, Half], checkpoint: Checkpoint, name: str) -> None:
    """Bring both halves, initialised, to where a checkpoint left them.

    Raises ResultsError where they were built of other sources, HalfError where one refuses its state.
    """
    now = packages_of(halves)
    for role, half in halves.items():
        if now[role] != checkpoint.packages[role]:
            raise ResultsError(f"{name}: its {role} half was built of other sources ({checkpoint.packages[role]}) than "
                               f"the one installed now ({now[role]}); resume with those, or run anew")
        token = half.deserialise(checkpoint.halves[role])
        try:
            # fault: a half is left at its start when a run is resumed -> pass |
            #   coupler/test_resume::test_stopped_twice_and_resumed_it_is_the_undisturbed_run
            half.restore(token)
        finally:
            half.release(token)
