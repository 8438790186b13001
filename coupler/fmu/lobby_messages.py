"""What the coupler says to a role on another machine before and beside a run, and what it hears back."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from contact.codec import kinds_of
from contact.rpc.seal import Seal
from coupler.fmu.remote import Acknowledged, Text

LOBBY = "hosts"  # the run of those who have none


@dataclass(frozen=True)
class Knock:
    """How did the one before you end?  Answered by Text: in words, and the end of its log; "" for the first."""


@dataclass(frozen=True)
class Has:
    """Is an FMU there?  digest : SHA-256, in hexadecimal digits.  Answered by Text: "yes" or ""."""

    digest: str


@dataclass(frozen=True)
class Take:
    """An FMU.  Answered by Acknowledged."""

    data: bytes


@dataclass(frozen=True)
class Begin:
    """Serve a run.  digest : of the FMU; "" for the contact service.  Answered by Begun, or by Text: why not."""

    run: str
    secret: bytes
    digest: str


@dataclass(frozen=True)
class Begun:
    """instance : which life of the server it is."""

    instance: str


@dataclass(frozen=True)
class End:
    """A run is over: obeyed by who serves it.  proof : by `proof_of`.  Answered by Acknowledged."""

    run: str
    proof: str


ASKED = kinds_of((Knock, Has, Take, Begin, End))
TOLD = kinds_of((Text, Begun, Acknowledged))


def proof_of(run: str, secret: bytes) -> str:
    """What only those have who have the secret of a run: other couplers have that of the lobby too."""
    return Seal(run, secret).sign("end of the run", b"")


def digest_of(fmu: Path) -> str:
    """SHA-256 of an FMU, in hexadecimal digits."""
    return hashlib.sha256(fmu.read_bytes()).hexdigest()
