"""Checkpoints: all a run needs to go on from the end of a window, in one file beside its results file.

    magic | SHA-256 of the rest | length of the origin (u64) | origin | the checkpoint

Both are messages (contact.messages), encoded by their type hints: what the coupler comes to remember is in the file as
soon as it is a field, and a type that has no form on the wire cannot be remembered at all.  The origin stands apart
because another version of the program may know other fields: it is compared before the rest is looked at.
"""

from __future__ import annotations

import hashlib
import os
import struct
from dataclasses import dataclass, field
from pathlib import Path

from contact.codec import WireError
from contact.messages import decode, encode, kinds_of
from contact.watch import Seen
from coupler.control.state import Committed
from coupler.errors import ResultsError
from coupler.record.beside import part_of
from coupler.record.journal import Mark
from coupler.rules.model import Rule
from coupler.schemes.ledger import Ledger

MAGIC = b"SLIDELINE-CHECKPOINT-1\n"
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
class Told:
    """What a run has recorded and told, up to its last accepted window.

    mark : where its journal goes on.  seen, said : of what happened to contact.  noticed : by control.
    framed [s]: the time of the last frame; -1: none yet.  seconds, setup_seconds : wall-clock time spent so far.
    resumed : the times [s] from which it was resumed.  rows : of the windows table.  rules : those in
    force, which the user may have changed.
    """

    mark: Mark
    ledger: Ledger = field(default_factory=Ledger)
    seen: Seen = field(default_factory=Seen)
    said: tuple[str, ...] = ()
    noticed: tuple[str, ...] = ()
    framed: float = -1.0
    seconds: float = 0.0
    setup_seconds: float = 0.0
    resumed: tuple[float, ...] = ()
    rows: int = 0
    rules: tuple[Rule, ...] = ()


@dataclass(frozen=True)
class Checkpoint:
    """packages : role of a half -> hash of the sources it was built of.  halves : role -> bytes of its state."""

    committed: Committed
    told: Told
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
