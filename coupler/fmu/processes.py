"""Each half and the contact service in a process of its own, on this machine.

They speak over sockets in the folder of the run, which no other user can enter, and sign what they say with a secret
that they hear on their standard input (contact.rpc.seal, docs/threat_model.md).
"""

from __future__ import annotations

import hashlib
import re
import secrets
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from contact.rpc.calls import LinkError, ServiceDownError
from contact.rpc.client import Client
from contact.rpc.seal import SECRET_BYTES, Seal, forget_secret, keep_secret
from contact.rpc.zenoh_session import Session, close_session, open_session, socket_in
from coupler.errors import HalfError, indented
from coupler.fmu.at_hosts import AtHosts, Away
from coupler.fmu.children import Child, ChildError, python, ready_line, reap, start
from coupler.fmu.host import role_of
from coupler.fmu.hosts import COUPLER, Hosts
from coupler.fmu.remote import ANSWERS, RemoteHalf
from coupler.fmu.replayed import Place, ReplayedHalf
from coupler.fmu.scratch import scratch_folder

CONTACT = "contact"
_NAME = re.compile(r"[A-Za-z0-9_.-]{1,129}")  # ROLE.NAME of one of several
START_DEADLINE = 120.0  # s for all to be ready; a first run compiles kernels
HOSTS_PATIENCE = 30.0  # s to find everybody on their machines
TRIES = 10  # to have all of them live at once, before those that go on dying have the better of it
CALL_DEADLINE = 600.0  # s for one substep of a half; a death is noticed at once, only a hang waits for this


@dataclass(frozen=True)
class Processes:
    """The processes of a run.

    halves : by name.  contact_link : what to give the halves as parameter `contact.link`, or to open_link.
    pids : of the halves by name, and of "contact", as they are now.  asked : what contact was asked so far, a
    contact.rpc.calls.Verb for each verb; nothing where it cannot say.  restarts : who was started anew, in words.
    recover : brings halves to places, in new processes where the old ones are of no more use; raises HalfError,
    ServiceDownError.
    """

    halves: dict[str, ReplayedHalf]
    contact_link: str
    pids: dict[str, int]
    asked: Callable[[], dict[str, Any]]
    restarts: list[str]
    recover: Callable[[Mapping[str, Place]], None]


@contextmanager
def processes(fmus: Mapping[str, Path], *, start_deadline: float = START_DEADLINE,
              call_deadline: float = CALL_DEADLINE,
              step_deadlines: Mapping[str, float] | None = None, restarts: int = 0, hosts: Hosts | None = None,
              host: Sequence[str] | None = None, service: Sequence[str] | None = None) -> Iterator[Processes]:
    """Start the contact service and one host for every FMU; end them all on the way out, whatever the way.

    fmus : name of a half (letters, digits, -, _ and .) -> its FMU.  call_deadline : [s] of a call, and of the first
    steps.
    step_deadlines : name of a half -> seconds a step of it may take, where that is stated.  restarts : how often one
    that died may be started anew, in all.  hosts : where the roles run, if not on this machine.  host, service :
    commands to run instead of `python -m coupler.fmu.host` and `python -m contact.rpc.serve`, with the same options.
    Raises ValueError for another name; HalfError or ServiceDownError naming who did not start, later who died, with
    the tail of its log.
    """
    for name in fmus:
        if not _NAME.fullmatch(name) or name == CONTACT:
            raise ValueError(f"{name!r} cannot name a half's process: letters, digits, -, _ and . only, not "
                             f"{CONTACT!r}")
    run, secret = secrets.token_hex(4), secrets.token_bytes(SECRET_BYTES)
    with ExitStack() as stack:
        seal = keep_secret(run, secret)
        stack.callback(forget_secret, run)
        directory = stack.enter_context(scratch_folder())
        sessions: list[Session] = []
        # Children first: to close a session takes ten seconds while a stopped process is at its other end.
        stack.callback(_give_back, sessions)
        begin: Any
        if hosts is None:
            begin = _Beginning(directory, run, secret, start_deadline, host or [*python(), "-m", "coupler.fmu.host"],
                               service or [*python(), "-m", "contact.rpc.serve"])
        else:
            sessions.append(open_session(connect=hosts.addresses.values(), tls=hosts.tls_of(COUPLER)))
            begin = AtHosts(hosts, sessions[0], run, secret, min(start_deadline, HOSTS_PATIENCE))
            stack.callback(begin.close)
        crew = _Crew(begin, seal, fmus, _Deadlines(call_deadline, step_deadlines or {}), restarts)
        stack.callback(lambda: begin.reap(crew.children.values()))
        try:
            crew.start_all()
        except ChildError as exc:
            raise _named(exc.child, str(exc), exc.log) from exc
        sessions.append(open_session(connect=crew.endpoints.values()))
        crew.meet(sessions[0])
        yield Processes(crew.halves, f"zenoh:{crew.endpoints[CONTACT]}/{run}", crew.pids, crew.asked, crew.told,
                        crew.recover)
        for half in crew.halves.values():  # only after a good end: after an error nobody waits for a busy half
            _close(half)


@dataclass(frozen=True)
class _Beginning:
    """What the processes of a run begin with.  patience : seconds that they have to be ready."""

    directory: Path
    run: str
    secret: bytes
    patience: float
    host: Sequence[str]
    service: Sequence[str]

    def start(self, name: str, fmu: Path | None, listen: str = "") -> Child:
        """Start a half with this FMU, or the contact service, and hand it the secret.

        listen : where one before it did; else a socket in the folder of the run.
        """
        # The path of a socket is short: the folder may have taken most of what the kernel allows.
        listen = listen or socket_in(self.directory, f"{_socket_name(name)}.sock")
        # Unpacked in the run's directory, which this process removes: a host that is killed cannot clean up.
        command = [*self.service, "--child"] if fmu is None else [
            *self.host, "--name", name, "--fmu", str(fmu.resolve()), "--extracted", str(self.directory / f"{name}.d")]
        child = start(name, [*command, "--run", self.run, "--listen", listen], self.directory)
        child.tell(self.secret.hex())
        return child

    def ready(self, child: Child, until: float, watch: Callable[[], None]) -> tuple[str, str]:
        """Where a child listens and which life of its server it is.  Raises ChildError."""
        _, endpoint, instance = ready_line(child, until, watch).split()
        return endpoint, instance

    def reap(self, everyone: Iterable[Child]) -> None:
        """End children, and take away what those who were killed left in the way of the next."""
        reap(everyone)
        for left in self.directory.glob("*.sock*"):
            if left.stem in {_socket_name(child.name) for child in everyone}:
                left.unlink(missing_ok=True)


def _socket_name(name: str) -> str:
    return hashlib.sha256(name.encode()).hexdigest()[:8]


@dataclass(frozen=True)
class _Deadlines:
    """Seconds of a call of a half, and of a step by name of the half, where that is stated."""

    call: float
    step: Mapping[str, float]


class _Crew:
    """The processes as they are now: who died is named, and started anew where that is allowed.

    left : how often it still is.  told : what was started anew, in words.
    """

    def __init__(self, begin: Any, seal: Seal, fmus: Mapping[str, Path], deadlines: _Deadlines,
                 restarts: int) -> None:
        self._begin, self._seal, self._fmus, self._deadlines = begin, seal, fmus, deadlines
        self._restarts = self.left = restarts
        self.told: list[str] = []
        # How many were started anew; and had been, when a call of a half that failed was repeated last.
        self._anew, self._known_anew = 0, dict[str, int]()
        self.children: dict[str, Child | Away] = {}
        self.endpoints: dict[str, str] = {}
        self._instances: dict[str, str] = {}
        self.pids: dict[str, int] = {}
        self.halves: dict[str, ReplayedHalf] = {}

    def start_all(self) -> None:
        """Start all at once, for each imports for a second.  Raises ChildError."""
        until = time.monotonic() + self._begin.patience
        for name, fmu in ((CONTACT, None), *self._fmus.items()):
            self.children[name] = self._begin.start(name, fmu)
        for name in self.children:
            self._await(name, until)
            if name == CONTACT:
                for other in self._fmus:
                    self.children[other].tell(self.endpoints[CONTACT])

    def meet(self, session: Session) -> None:
        """Turn to all of them over a session."""
        self._session = session
        self._contact, self._contact_anew = self._contact_client(), False
        for name in self._fmus:
            self.halves[name] = ReplayedHalf(self._remote(name), partial(self.mended, name))

    def asked(self) -> dict[str, Any]:
        """What contact was asked so far; nothing of one that died, nor of the one after it alone."""
        return {} if self._contact_anew else _asked(self._contact)

    def mended(self, of: str = "") -> bool:
        """Start anew who died, after a call of a half failed; whether somebody had, and all live now.

        Who waited for the call may have started contact anew before: then the call is repeated once.
        """
        # fault: contact was started anew and the call that it broke is not repeated -> anew = False |
        #   coupler/test_replayed::test_a_call_that_contact_broke_off_is_repeated_once
        anew = self._is_news(of)
        self._known_anew[of] = self._anew
        if not self._dead():
            return anew
        for _ in range(TRIES):
            wanted = [*self._dead(), *(n for n, half in self.halves.items() if half.spoiled)]
            if not wanted:
                return True
            for name in wanted:
                if name in self._dead() and not self.left:
                    return False
                # One that does not come up has used one of its chances, and so has who keeps it from that.
                with suppress(HalfError, ServiceDownError):
                    if name in self._dead():
                        self._again(name)
                    else:
                        self._start_anew(name)
        return False

    def recover(self, places: Mapping[str, Place]) -> None:
        """Bring halves to places.  Raises HalfError, ServiceDownError."""
        self.left = 0
        contact = self.children[CONTACT]
        if contact.death() or contact.is_stopped():
            self._start_anew(CONTACT)
        for name, place in places.items():
            half = self.halves[name]
            # One that was not answered, or is wrong itself, may be in the middle of something.
            if half.failed or self.children[name].death():
                self._start_anew(name)
            half.bring_to(place)

    def _is_news(self, of: str) -> bool:
        return self._known_anew.get(of, 0) < self._anew

    def dead(self, patience: float, of: str = "") -> bool:
        """Raise the error that names a dead process, if one dies within `patience` seconds.

        Returns whether contact was started anew, now or since a call of this half was repeated last.
        A contact service is started anew where that is allowed: it has no state, and the halves wait for it.
        """
        until = time.monotonic() + patience
        while True:
            for name in self._dead():
                if name != CONTACT or not self.left:
                    child = self.children[name]
                    raise _named(name, child.death(), child.log_tail())
                self._again(name)
            if time.monotonic() >= until:
                return self._is_news(of)
            time.sleep(0.02)

    def blame(self, patience: float, of: str = "") -> bool:
        """Raise the error that names a dead process, or else one that is stopped.  Returns as `dead`."""
        anew = self.dead(patience, of)
        for child in self.children.values():
            # fault: a stopped contact service shows as a failure of a half -> if False: | coupler/test_stopped
            if child.is_stopped():
                raise _named(child.name, f"its process is stopped; `kill -CONT {child.pid}` lets one go on",
                             child.log_tail())
        return anew

    def _dead(self) -> list[str]:
        return [name for name, child in self.children.items() if child.death()]

    def _again(self, name: str) -> None:
        """Start one that died anew, which is told.  Raises HalfError, ServiceDownError."""
        death, log = self.children[name].death(), self.children[name].log_tail()
        # fault: one that dies again and again is started for ever -> pass |
        #   coupler/test_restarts::test_who_dies_again_and_again_is_named_when_the_restarts_are_used_up
        self.left -= 1
        self._anew += 1
        who = "contact service" if name == CONTACT else f"half {name!r}"
        last = f" (its log ended: {log.splitlines()[-1]})" if log.strip() else ""
        self.told.append(f"{who}: {death}{last}; started anew, {self._restarts - self.left} of {self._restarts}")
        self._start_anew(name)

    def _start_anew(self, name: str) -> None:
        """A new process in the place of an old one, where that listened.  Raises HalfError, ServiceDownError."""
        if name != CONTACT:
            self.halves[name].spoiled = True
        self._begin.reap([self.children[name]])
        child = self.children[name] = self._begin.start(name, self._fmus.get(name), self.endpoints[name])
        if name != CONTACT:
            child.tell(self.endpoints[CONTACT])
        try:
            self._await(name, time.monotonic() + self._begin.patience)
        except ChildError as exc:
            raise _named(name, str(exc), exc.log) from exc
        if name == CONTACT:
            self._contact, self._contact_anew = self._contact_client(), True
        else:
            self.halves[name].replace(self._remote(name))

    def _await(self, name: str, until: float) -> None:
        def watch() -> None:
            # Whoever begins needs the contact service, which may die at any time.
            if name != CONTACT and self.left and self.children[CONTACT].death():
                self._again(CONTACT)

        self.endpoints[name], self._instances[name] = self._begin.ready(self.children[name], until, watch)
        self.pids[name] = self.children[name].pid

    def _contact_client(self) -> Client:
        return Client(self._session, self._seal, CONTACT, {}, instance=self._instances[CONTACT])

    def _remote(self, name: str) -> RemoteHalf:
        def watch() -> None:
            self.dead(0.0)
            self.children[name].trim()

        client = Client(self._session, self._seal, role_of(name), ANSWERS, instance=self._instances[name],
                        deadline=self._deadlines.call, watch=watch, lives=lambda: not self.children[name].death())
        return RemoteHalf(name, client, partial(self.blame, of=name), self._deadlines.step.get(name),
                          lambda: self.children[name].log_tail())


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


def _close(half: ReplayedHalf) -> None:
    # Whoever cannot be closed is dead or stuck; reaping, which comes next, ends it.
    with suppress(HalfError, ServiceDownError):
        half.close()
