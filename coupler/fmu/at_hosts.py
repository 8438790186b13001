"""The coupler's side of roles on other machines: found in their lobby, told of the run, watched, and let go."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from contact.rpc.calls import LinkError, LinkSpecError
from contact.rpc.client import Client
from contact.rpc.seal import Seal, secret_line
from contact.rpc.server import keys_of
from contact.rpc.tls import SECRET
from contact.rpc.zenoh_session import Session
from coupler.errors import ScenarioError
from coupler.fmu.children import ChildError
from coupler.fmu.hosts import COUPLER, Hosts
from coupler.fmu.lobby_messages import LOBBY, TOLD, Begin, Begun, End, Has, Knock, Take, digest_of, proof_of

OUT_OF_SIGHT = 60.0  # s for which a machine may not be heard of before it counts as dead
PERIOD = 1.0  # s between two looks at whether it is there
BLIND = 5.0  # s without a look for which this process was stopped itself, or had no need to look
CALL_PATIENCE = 60.0  # s for an FMU to get there
END_PATIENCE = 2.0  # s
_NOTHING_BEGUN = End("", "")


class Away:
    """A role on another machine, as coupler.fmu.children.Child is one on this.

    over : what ends the run there.  left : lives of the role which the run has let go, to which this one is added.
    """

    pid = 0

    def __init__(self, name: str, address: str, session: Session, seal: Seal, over: End = _NOTHING_BEGUN,
                 left: set[str] | None = None) -> None:
        self.name, self.address = name, address
        self._over, self._left = over, set() if left is None else left
        self._begun = False
        self._session, self._seal = session, seal
        self._life = self._ended = self._last = ""
        self._seen = self._looked = time.monotonic()

    def enter(self, until: float, watch: Callable[[], None]) -> Client:
        """Wait in its lobby; returns who is there.  until : as time.monotonic().  Raises ChildError."""
        while True:
            found = self._lives()
            # fault: a role that was let go a moment ago is taken for the next one -> lives = found |
            #   coupler/test_lobby::test_who_was_let_go_is_waited_out_and_told_again
            lives = found - self._left
            if lives:
                break
            if time.monotonic() > until:
                raise ChildError(f"nobody serves as {self.name} at {self.address}: `slideline host {self.name}` runs "
                                 "there, with a certificate of the authority that made ours?", self.name, "")
            for life in found:  # it may not have heard it
                self._tell_end(life)
            watch()
            time.sleep(0.1)
        self._life = lives.pop()
        self._seen = self._looked = time.monotonic()
        return self._client(self._life, CALL_PATIENCE)

    def begin(self, lobby: Client, begin: Begin) -> Begun:
        """Begin the run.  Raises ChildError."""
        # Where no answer comes it may have begun all the same.
        self._begun = True
        try:
            begun = lobby.call(begin)
        except LinkError as exc:
            raise ChildError(f"{self.address}: {exc}", self.name, "") from exc
        if not isinstance(begun, Begun):
            self._begun = False
            raise ChildError(f"{self.address}: {begun.text}", self.name, "")
        return begun

    def death(self) -> str:
        """How it ended, in words; empty while it lives, or may."""
        blind = time.monotonic() - self._looked
        if not self._ended and blind > PERIOD:
            # fault: a coupler that was stopped for a while takes all machines for dead -> if False: |
            #   coupler/test_lobby::test_a_coupler_that_was_stopped_does_not_blame_the_machines
            if blind > BLIND:
                self._seen += blind - PERIOD
            lives, self._looked = self._lives(), time.monotonic()
            if self._life in lives:
                self._seen = self._looked
            elif lives:
                self._ended = f"its process at {self.address} ended{self._last_words(lives.pop())}"
            elif self._looked - self._seen > OUT_OF_SIGHT:
                self._ended = f"nothing was heard of {self.address} for {OUT_OF_SIGHT:g} s"
        return self._ended

    def end(self) -> None:
        """Let it go.  One that is gone, or does not listen, ends by itself."""
        if self._begun:
            # fault: who was let go is not remembered -> pass |
            #   coupler/test_lobby::test_who_was_let_go_is_waited_out_and_told_again
            self._left.add(self._life)
            # One that counts as dead too: it may only be out of sight.
            self._tell_end(self._life)

    def tell(self, line: str) -> None:
        """Where contact is: it has the hosts file."""

    def is_stopped(self) -> bool:
        """Whether its process is stopped: not known from here."""
        return False

    def log_tail(self) -> str:
        """The last lines of its log, as far as it got here."""
        return self._last

    def trim(self) -> None:
        """Its log is cut where it is."""

    def _lives(self) -> set[str]:
        keys = self._session.tokens(keys_of(LOBBY, self._seal.name(self.name), "*").token, lambda: None)
        return {life for key in keys if self._seal.made(self.name, life := key.rsplit("/", 1)[1])}

    def _tell_end(self, life: str) -> None:
        with suppress(LinkError):
            self._client(life, END_PATIENCE).call(self._over)

    def _last_words(self, life: str) -> str:
        try:
            how, _, self._last = self._client(life, END_PATIENCE).call(Knock()).text.partition("\n")
        except LinkError:
            return ""
        return f" ({how})" if how else ""

    def _client(self, life: str, deadline: float) -> Client:
        return Client(self._session, self._seal, self.name, TOLD, instance=life, deadline=deadline)


class AtHosts:
    """Starts the roles of a run where a hosts file says, over a session that reaches them.  Raises ScenarioError."""

    def __init__(self, hosts: Hosts, session: Session, run: str, secret: bytes, patience: float) -> None:
        self._hosts, self._session, self._run, self._secret = hosts, session, run, secret
        self.patience = patience
        try:
            self._seals = {role: Seal(LOBBY, secret_line((hosts.tls / COUPLER / f"{SECRET}.{role}").read_text()))
                           for role in hosts.addresses}
        except (OSError, LinkSpecError) as exc:
            raise ScenarioError(f"the secrets of the roles cannot be read ({exc})", file=str(hosts.tls / COUPLER)
                                ) from exc
        seal = Seal(run, secret)
        self._over = End(run, proof_of(run, secret))
        self._left: dict[str, set[str]] = {role: set() for role in hosts.addresses}
        self._fmus: Mapping[str, Path | None] = {}
        # By this the others see that there is somebody to serve.
        self._token = session.show_token(keys_of(run, seal.name(COUPLER), seal.instance(COUPLER)).token)

    def start(self, name: str, fmu: Path | None, listen: str = "") -> Away:
        """Turn to a role; `ready` begins the run with it."""
        self._fmus = {**self._fmus, name: fmu}
        return Away(name, self._hosts.addresses[name], self._session, self._seals[name], self._over, self._left[name])

    def ready(self, away: Away, until: float, watch: Callable[[], None]) -> tuple[str, str]:
        """Hand a role what it needs; returns its address and which life of its server it is.  Raises ChildError."""
        lobby, fmu = away.enter(until, watch), self._fmus[away.name]
        digest = "" if fmu is None else digest_of(fmu)
        try:
            if fmu is not None and not self._call(lobby, Has(digest)).text:
                self._call(lobby, Take(fmu.read_bytes()))
        except LinkError as exc:
            raise ChildError(f"{away.address}: {exc}", away.name, "") from exc
        return away.address, away.begin(lobby, Begin(self._run, self._secret, digest)).instance

    def reap(self, everyone: Iterable[Away]) -> None:
        """Let roles go."""
        for away in everyone:
            away.end()

    def close(self) -> None:
        """Nobody is served any more."""
        self._token.undeclare()

    def _call(self, lobby: Client, what: Any) -> Any:
        return lobby.call(what)

