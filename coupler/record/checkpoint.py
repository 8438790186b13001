"""Checkpoints: all a run needs to go on from the end of a window, in one file beside its results file.

    magic | SHA-256 of the rest | length of the origin (u64) | origin | the checkpoint

Both are messages (contact.codec), encoded by their type hints: what the coupler comes to remember is in the file as
soon as it is a field, and a type that has no form on the wire cannot be remembered at all.  The origin stands apart
because another version of the program may know other fields: it is compared before the rest is looked at.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import struct
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.codec import decode, encode, kinds_of
from contact.half.diagnostics import ContactLog
from contact.half.interface import Interface
from contact.half.memory import LAYOUT, layout_from, remembered
from contact.records import WireError
from coupler.control.plan import Plan
from coupler.control.state import Committed
from coupler.errors import ResultsError
from coupler.fmu.half import Half
from coupler.fmu.outputs import On, OutputField
from coupler.record.frames import FrameChoice
from coupler.record.journal import Mark
from coupler.record.paths import checkpoint_of, part_of
from coupler.record.recorder import Recorder
from coupler.record.tables import EXCHANGED
from coupler.scenario import Scenario
from coupler.scenario.conditions import ConditionOutput
from coupler.scenario.document import plain_value
from coupler.scenario.rule_model import Rule
from coupler.schemes.ledger import Ledger
from coupler.trust.table.log import TrustLog

KIND, MAGIC = b"SLIDELINE-CHECKPOINT-", b"SLIDELINE-CHECKPOINT-2\n"
_HEAD = struct.Struct("<32sQ")
_LENGTH = struct.Struct("<Q")


@dataclass(frozen=True)
class Origin:
    """What a checkpoint belongs to.

    file : the scenario, beside which its meshes lie.  scenario : its hash.  overrides : JSON of what was put in place
    of its values.  versions : of the program and of the packages results depend on, by name.
    """

    file: str
    scenario: str
    overrides: str
    versions: dict[str, str]


@dataclass(frozen=True)
class RunRecord:
    """What a run has recorded, up to its last accepted window.

    mark : where its journal goes on.  seen, said : of what happened to contact.  noticed : by control.
    framed [s]: the time of the last frame; -1: none yet.  seconds, setup_seconds : wall-clock time spent so far.
    resumed : the times [s] from which it was resumed.  rows : of the windows table.  rules : those in
    force, which the user may have changed.  trust : what was measured of the run.  choice : of frames.
    restarts : who was started anew, in words.
    """

    mark: Mark
    ledger: Ledger = field(default_factory=Ledger)
    seen: ContactLog = field(default_factory=ContactLog)
    said: tuple[str, ...] = ()
    noticed: tuple[str, ...] = ()
    framed: float = -1.0
    seconds: float = 0.0
    setup_seconds: float = 0.0
    resumed: tuple[float, ...] = ()
    rows: int = 0
    rules: tuple[Rule, ...] = ()
    trust: TrustLog = field(default_factory=TrustLog)
    choice: FrameChoice = field(default_factory=FrameChoice)
    restarts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Checkpoint:
    """packages : role of a half -> hash of the sources it was built of.  halves : role -> bytes of its state."""

    committed: Committed
    record: RunRecord
    packages: dict[str, str]
    halves: dict[str, bytes]


ORIGINS, CHECKPOINTS = kinds_of((Origin,)), kinds_of((Checkpoint,))


def to_bytes(origin: Origin, checkpoint: Checkpoint) -> bytes:
    """The content of a checkpoint file.  Raises WireError naming a field that is not what its hint says."""
    first = encode(origin)
    rest = b"".join([_LENGTH.pack(len(first)), first, encode(checkpoint)])
    return b"".join([MAGIC, hashlib.sha256(rest).digest(), rest])


def from_bytes(data: bytes, versions: dict[str, str], name: str) -> tuple[Origin, Checkpoint]:
    """Origin and checkpoint behind the bytes of a file.

    versions : those that run now.  name : of the file, for messages.
    Raises ResultsError for bytes that are cut or damaged, or of other versions.
    """
    if data.startswith(KIND) and not MAGIC.startswith(data[:len(MAGIC)]):
        raise ResultsError(f"{name}: not a checkpoint of this version of the program, which keeps what contact tells "
                           "pair by pair; no resume from it")
    if not data.startswith(MAGIC):
        cut = MAGIC.startswith(data)
        raise ResultsError(f"{name}: {'cut short' if cut else 'not a checkpoint of this program'}; no resume from it")
    begin = len(MAGIC) + _HEAD.size
    digest, length = _HEAD.unpack(data[len(MAGIC) : begin].ljust(_HEAD.size, b"\0"))
    # fault: the checksum of a checkpoint is not looked at -> if len(digest) != 32: |
    #   coupler/test_checkpoint::test_500_flipped_bytes_are_refused
    if hashlib.sha256(data[begin - _LENGTH.size :]).digest() != digest:
        raise ResultsError(f"{name}: cut short or damaged (its checksum does not fit); no resume from it")
    try:
        origin: Origin = decode(data[begin : begin + length], ORIGINS)
        # fault: other versions are not noticed -> pass |
        #   coupler/test_checkpoint::test_other_versions_are_refused_by_name
        check_versions(origin, versions, name)
        checkpoint: Checkpoint = decode(data[begin + length :], CHECKPOINTS)
    except WireError as exc:
        raise ResultsError(f"{name}: written by another version of this program ({exc}); no resume from it") from exc
    return origin, checkpoint


def check_versions(origin: Origin, versions: dict[str, str], name: str) -> None:
    """Raises ResultsError where something that results depend on has changed since."""
    other = [f"{n} {origin.versions.get(n, 'none')}, now {versions.get(n, 'none')}"
             for n in sorted({*origin.versions, *versions}) if origin.versions.get(n) != versions.get(n)]
    if other:
        raise ResultsError(f"{name}: written with other versions ({'; '.join(other)}), which may give other bits; "
                           "resume with those, or run anew")


def read_checkpoint(path: Path, versions: dict[str, str]) -> tuple[Origin, Checkpoint]:
    """The checkpoint in a file.  Raises ResultsError where it cannot be read or gone on from."""
    try:
        data = path.read_bytes()
    except OSError as exc:
        raise ResultsError(f"{path}: cannot be read ({exc.strerror})") from exc
    return from_bytes(data, versions, str(path))


def write_checkpoint(path: Path, data: bytes) -> None:
    """Put a checkpoint in the place of the older one, in one step: whenever this is cut, one of the two is whole.

    Raises OSError.
    """
    # fault: a checkpoint is written over the older one in place -> part = path |
    #   coupler/test_checkpoint::test_a_file_takes_the_place_of_the_older_one_whole_or_not_at_all
    part = part_of(path)
    with part.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(part, path)
    if os.name == "posix":  # the new name too is to survive a power cut
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


# The keeper of a run's checkpoints: when one is due, and what both halves add to it.

PACKAGES = ("slideline", "numpy", "scipy", "fmpy", "pythonfmu", "eclipse-zenoh", "h5py", "numba")


class Keeper:
    """Writes checkpoints beside the results file.

    every : least wall time between two [s]; None: there are none.  halves : by role.  options : of the command
    line that say where they run, for the remedy.
    """

    def __init__(self, scenario: Scenario, recorder: Recorder, halves: Mapping[str, Half],
                 options: str = "") -> None:
        self._resume = f"slideline resume {shlex.quote(str(recorder.out))}{options}"
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
        return f"`{self._resume}` goes on from t = {self._kept:.9g} s"

    @property
    def on(self) -> bool:
        """Whether this run can be resumed."""
        return self._every is not None

    @property
    def due(self) -> bool:
        """Whether enough time has passed since the last one."""
        return self._every is not None and time.monotonic() - self._last >= self._every

    def keep(self, committed: Committed, record: RunRecord) -> None:
        """Write a checkpoint; both halves stand at the end of the last accepted window.

        A disk that is full ends no run of hours: the older checkpoint stays, and `trouble` says why.
        """
        states = {role: state_of(half) for role, half in self._halves.items()}
        checkpoint = Checkpoint(committed, record, packages_of(self._halves), states)
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
    return {"python": platform.python_version(), **dict(zip(PACKAGES, _versions(), strict=True))}


@cache
def _versions() -> tuple[str, ...]:
    """Of PACKAGES; what is loaded stays what it is, and to look takes 6 ms."""
    return tuple(version(package) for package in PACKAGES)


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


def memory_of(half: Half, interface: Interface) -> dict[str, NDArray[np.float64]]:
    """What another run may start from of a half as it stands (contact.half.memory); nothing of one that tells nothing.

    Raises HalfError where its state cannot be had, ValueError where it is not what the half says of it.
    """
    if LAYOUT not in half.strings or not half.can_serialise:
        return {}
    return remembered(state_of(half), layout_from(half.strings[LAYOUT]), interface)


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


# What a results file says of its run before the first window: the scenario, the halves, the plan, the machine.

def header_of(scenario: Scenario, plan: Plan, outputs: Sequence[OutputField],
              probes: Mapping[str, Mapping[str, str]],
              conditions: Sequence[ConditionOutput] = ()) -> dict[str, Any]:
    """Plain values that travel as JSON.

    outputs : arrays of the halves that every frame holds beside the exchange.  probes : name -> "quantity", "unit".
    conditions : those whose heat or force a half gives out.
    """
    s, schedule = scenario, plan.schedule
    return {
        "title": s.title, "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "scenario": {"text": s.text, "hash": s.hash, "resolved": dict(s.resolved), "file": Path(s.file).name,
                     "overrides": {key: str(value) for key, value in s.overrides.items()}},
        "temperature_unit": s.temperature_unit, "geometry": s.geometry,
        "mesh": {"mesh.hash": s.interface.mesh_hash, "surfaces.hash": s.interface.surfaces_hash},
        "halves": {"thermal": s.thermal_half, "mechanical": s.mechanical_half},
        "coupling": {"scheme": plan.scheme.value, "end": s.coupling.end, "windows": len(schedule.bounds) - 1,
                     "adaptive": plan.adaptive is not None,
                     "kinks": [schedule.clock.seconds(k) for k in sorted(schedule.kinks)],
                     "substeps": dict(plan.substeps)},
        **({"starts": [dict(start.source) for start in s.starts.values()]} if s.starts else {}),
        "bodies": list(s.interface.bodies), "pairs": [p.plain for p in s.interface.pairs],
        "probes": {n: dict(about) for n, about in probes.items()},
        "conditions": [c.to_json() for c in conditions],
        "fields": {role: {"point": [*(f.name for f in exchanged), *_labels(outputs, role, On.NODES, On.CONTACT_NODES,
                                                                                On.PAIR_NODES)],
                          "cell": _labels(outputs, role, On.CELLS)} for role, exchanged in EXCHANGED.items()},
        "outputs": [field.to_json() for field in outputs],
        "machine": platform.platform(), "versions": versions(),
    }


def _labels(outputs: Sequence[OutputField], half: str, *on: On) -> list[str]:
    return [f.label for f in outputs if f.half == half and f.on in on]
