"""The secret of a run: whoever has it may ask and answer, and every message is signed with it.

A secret is made where a run begins and handed to its processes through their standard input: it is on no command
line, in no environment and in no file.  A signature is HMAC-SHA256 over who says what to whom (way, run, role, key,
envelope) and the bytes of the message.  Names of roles on the network are made with the secret, too, and a life of a
server proves by its name that it has it.  What this keeps out and what not: docs/threat_model.md.
"""

from __future__ import annotations

import hmac
import re
import secrets
from hashlib import sha256

from contact.rpc.calls import LinkSpecError

SECRET_BYTES = 32
_SIGNATURE = 64  # hexadecimal digits
_NAME = 24  # hexadecimal digits of a name made with the secret: 96 bits
_INSTANCE = re.compile(r"([0-9a-f]{16})-([0-9a-f]{24})")


RESTART_PATIENCE = 1.5  # s a link waits for the next life of its service


class Seal:
    """Signs and checks the messages of one run.

    patience : [s], how long a link waits for its service where nobody tells it that the service has died.
    """

    def __init__(self, run: str, secret: bytes, patience: float = RESTART_PATIENCE) -> None:
        if len(secret) != SECRET_BYTES:
            raise LinkSpecError(f"the secret of a run has {SECRET_BYTES} bytes, not {len(secret)}")
        self.run, self.patience = run, patience
        # Made once: of an HMAC over a short message, half the time goes into its key.
        self._keyed = hmac.new(secret, run.encode() + b"\0", sha256)

    def sign(self, about: str, payload: bytes) -> str:
        """Return the signature of a message.  about : what it is, of which parts none holds a NUL."""
        mac = self._keyed.copy()
        mac.update(about.encode() + b"\0")
        mac.update(payload)
        return mac.hexdigest()

    def signed(self, about: str, payload: bytes, signature: str) -> bool:
        """Whether a signature is that of the message, told in a time that does not depend on where it differs."""
        # fault: any signature will do -> return True | contact/test_seal
        return hmac.compare_digest(self.sign(about, payload).encode(), signature.encode())

    def name(self, role: str) -> str:
        """Return what a role is called on the network, where nobody without the secret can tell it."""
        return self.sign(f"role {role}", b"")[:_NAME]

    def instance(self, role: str) -> str:
        """Return a name for a new life of a server, which only one who has the secret can make."""
        life = secrets.token_hex(8)
        return f"{life}-{self._proof(role, life)}"

    def made(self, role: str, instance: str) -> bool:
        """Whether the name of a life of a server was made with the secret."""
        match = _INSTANCE.fullmatch(instance)
        # fault: a stranger's token counts as a server's -> return match is not None | contact/test_seal
        return match is not None and hmac.compare_digest(self._proof(role, match[1]), match[2])

    def _proof(self, role: str, life: str) -> str:
        return self.sign(f"life {role}", life.encode())[:_NAME]


_seals: dict[str, Seal] = {}


def keep_secret(run: str, secret: bytes, patience: float = RESTART_PATIENCE) -> Seal:
    """Remember the secret of a run in this process, for links to its contact service.  Returns its seal."""
    _seals[run] = seal = Seal(run, secret, patience)
    return seal


def forget_secret(run: str) -> None:
    """Forget the secret of a run that is over."""
    _seals.pop(run, None)


def seal_of(run: str) -> Seal:
    """Return the seal of a run.  Raises LinkSpecError where this process was not given its secret."""
    if run not in _seals:
        raise LinkSpecError(f"the secret of run {run!r} was not given to this process: "
                            "contact.rpc.seal.keep_secret(run, secret) takes it (docs/threat_model.md)")
    return _seals[run]


def secret_line(line: str) -> bytes:
    """Return the secret that a line tells in hexadecimal digits.  Raises LinkSpecError."""
    try:
        secret = bytes.fromhex(line.strip())
    except ValueError:
        secret = b""
    if len(secret) != SECRET_BYTES:
        # What came is not quoted: it may be a secret cut short.
        raise LinkSpecError("the first line of standard input is not a secret of "
                            f"{2 * SECRET_BYTES} hexadecimal digits")
    return secret
