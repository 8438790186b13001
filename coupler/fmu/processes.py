"""Each half and the contact service in a process of its own, on this machine.

They speak over sockets in the folder of the run, which no other user can enter, and sign what they say with a secret
that they hear on their standard input (contact.rpc.seal, docs/threat_model.md).
"""

from __future__ import annotations

import hashlib
import re
import secrets
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from contact.rpc.calls import LinkError, ServiceDownError
from contact.rpc.client import Client
from contact.rpc.seal import SECRET_BYTES, Seal, forget_secret, keep_secret
from contact.rpc.zenoh_session import Session, close_session, open_session, socket_in
from coupler.errors import HalfError, indented
from coupler.fmu.children import Child, ChildError, python, ready_line, reap, start
from coupler.fmu.host import role_of
from coupler.fmu.remote import ANSWERS, RemoteHalf
from coupler.fmu.scratch import scratch_folder

CONTACT = "contact"
_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")
START_DEADLINE = 120.0  # s for all to be ready; a first run compiles kernels
CALL_DEADLINE = 600.0  # s for one substep of a half; a death is noticed at once, only a hang waits for this


@dataclass(frozen=True)
class Processes:
    """The processes of a run.

    halves : by name.  contact_link : what to give the halves as parameter `contact.link`, or to open_link.
    pids : of the halves by name, and of "contact".  asked : what contact was asked so far, a contact.rpc.calls.Verb for
    each verb; nothing where it cannot say.
    """

    halves: dict[str, RemoteHalf]
    contact_link: str
    pids: dict[str, int]
    asked: Callable[[], dict[str, Any]]


@contextmanager
def processes(fmus: Mapping[str, Path], *, start_deadline: float = START_DEADLINE,
              call_deadline: float = CALL_DEADLINE,
              step_deadlines: Mapping[str, float] | None = None, host: Sequence[str] | None = None,
              service: Sequence[str] | None = None) -> Iterator[Processes]:
    """Start the contact service and one host for every FMU; end them all on the way out, whatever the way.

    fmus : name of a half (letters, digits, - and _) -> its FMU.  call_deadline : [s] of a call, and of the first steps.
    step_deadlines : name of a half -> seconds a step of it may take, where that is stated.  host, service : commands
    to run instead of `python -m coupler.fmu.host` and `python -m contact.rpc.serve`, with the same options.
    Raises ValueError for another name; HalfError or ServiceDownError naming who did not start, later who died, with
    the tail of its log.
    """
    for name in fmus:
        if not _NAME.fullmatch(name) or name == CONTACT:
            raise ValueError(f"{name!r} cannot name a half's process: letters, digits, - and _ only, not {CONTACT!r}")
    run, secret = secrets.token_hex(4), secrets.token_bytes(SECRET_BYTES)
    with ExitStack() as stack:
        seal = keep_secret(run, secret)
        stack.callback(forget_secret, run)
        directory = stack.enter_context(scratch_folder())
        children: dict[str, Child] = {}
        sessions: list[Session] = []
        # Children first: to close a session takes ten seconds while a stopped process is at its other end.
        stack.callback(_give_back, sessions)
        stack.callback(lambda: reap(children.values()))
        try:
            begin = _Beginning(directory, run, secret, time.monotonic() + start_deadline,
                               host or [*python(), "-m", "coupler.fmu.host"],
                               service or [*python(), "-m", "contact.rpc.serve"])
            endpoints, instances = _start(children, fmus, begin)
        except ChildError as exc:
            raise _named(exc.child, str(exc), exc.log) from exc
        sessions.append(open_session(connect=endpoints.values()))
        halves = {name: _remote(name, sessions[0], seal, instance, children,
                                _Deadlines(call_deadline, (step_deadlines or {}).get(name)))
                  for name, instance in instances.items() if name != CONTACT}
        pids = {name: child.process.pid for name, child in children.items()}
        contact = Client(sessions[0], seal, CONTACT, {}, instance=instances[CONTACT])
        yield Processes(halves, f"zenoh:{endpoints[CONTACT]}/{run}", pids, lambda: _asked(contact))
        for half in halves.values():  # only after a good end: after an error nobody waits for a busy half
            _close(half)


@dataclass(frozen=True)
class _Beginning:
    """What the processes of a run begin with.  until : when all must be ready, as time.monotonic()."""

    directory: Path
    run: str
    secret: bytes
    until: float
    host: Sequence[str]
    service: Sequence[str]

    def start(self, name: str, command: Sequence[str]) -> Child:
        """Start a child that listens in the folder of the run, and hand it the secret."""
        # The path of a socket is short: the folder may have taken most of what the kernel allows.
        listen = socket_in(self.directory, hashlib.sha256(name.encode()).hexdigest()[:8] + ".sock")
        child = start(name, [*command, "--run", self.run, "--listen", listen], self.directory)
        child.tell(self.secret.hex())
        return child


def _start(children: dict[str, Child], fmus: Mapping[str, Path],
           begin: _Beginning) -> tuple[dict[str, str], dict[str, str]]:
    """Start all at once, for each imports for a second; returns endpoint and instance of each."""
    children[CONTACT] = begin.start(CONTACT, [*begin.service, "--child"])
    for name, fmu in fmus.items():
        # Unpacked in the run's directory, which this process removes: a host that is killed cannot clean up.
        children[name] = begin.start(name, [*begin.host, "--name", name, "--fmu", str(fmu.resolve()), "--extracted",
                                            str(begin.directory / f"{name}.d")])
    endpoints: dict[str, str] = {}
    instances: dict[str, str] = {}
    for name, child in children.items():
        _, endpoints[name], instances[name] = ready_line(child, begin.until).split()
        if name == CONTACT:
            for other in fmus:
                children[other].tell(endpoints[CONTACT])
    return endpoints, instances


@dataclass(frozen=True)
class _Deadlines:
    """Seconds of a call of a half, and of a step where that is stated."""

    call: float
    step: float | None


def _remote(name: str, session: Session, seal: Seal, instance: str, children: Mapping[str, Child],
            deadlines: _Deadlines) -> RemoteHalf:
    def dead(patience: float) -> None:
        """Raise the error that names a dead process, if one dies within `patience` seconds."""
        until = time.monotonic() + patience
        while True:
            for child in children.values():
                if death := child.death():
                    raise _named(child.name, death, child.log_tail())
            if time.monotonic() >= until:
                return
            time.sleep(0.02)

    def watch() -> None:
        dead(0.0)
        children[name].trim()

    def blame(patience: float) -> None:
        """Raise the error that names a dead process, or else one that is stopped."""
        dead(patience)
        for child in children.values():
            # fault: a stopped contact service shows as a failure of a half -> if False: | coupler/test_stopped
            if child.is_stopped():
                raise _named(child.name, f"its process is stopped; `kill -CONT {child.process.pid}` lets one go on",
                             child.log_tail())

    client = Client(session, seal, role_of(name), ANSWERS, instance=instance, deadline=deadlines.call,
                    watch=watch, lives=lambda: not children[name].death())
    return RemoteHalf(name, client, blame, deadlines.step, children[name].log_tail)


def _asked(contact: Client) -> dict[str, Any]:
    try:
        return {verb: asdict(cost) for verb, cost in contact.stats().verbs.items()}
    except LinkError:  # it died, which the run has been told, or is stuck: no reason to lose the rest of the totals
        return {}


def _give_back(sessions: list[Session]) -> None:
    while sessions:
        close_session(sessions.pop())


def _named(child: str, message: str, log: str) -> HalfError | ServiceDownError:
    if child == CONTACT:
        quoted = f"\n{indented(log)}" if log.strip() else ""
        return ServiceDownError(f"contact service: {message}{quoted}")
    return HalfError(message, half=child, log=log)


def _close(half: RemoteHalf) -> None:
    # Whoever cannot be closed is dead or stuck; reaping, which comes next, ends it.
    with suppress(HalfError, ServiceDownError):
        half.close()
