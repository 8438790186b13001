"""A role on another machine:  python -m coupler.fmu.lobby ROLE HOSTS SECONDS

`slideline host` starts it again and again.  It waits in the lobby for the coupler: everything there is signed with the
secret of the role.  The coupler hands it the FMU, by its content, and the secret of the run; from then on it is what
coupler.fmu.host or contact.rpc.serve are on the coupler's own machine.  It serves one run and ends: by the word of the
coupler, when that is gone for too long, or with whoever started it.
"""

from __future__ import annotations

import hmac
import os
import sys
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from contact.codec import REQUESTS
from contact.rpc.calls import LinkError
from contact.rpc.seal import Seal, keep_secret
from contact.rpc.server import Server, become_child, keys_of
from contact.rpc.tls import secret_of
from contact.rpc.zenoh_session import Session, close_all_sessions, open_session
from coupler.errors import HalfError, ScenarioError
from coupler.fmu.fmi import load_half
from coupler.fmu.host import CONTACT_PATIENCE, Hosted, answer_or_stop, role_of
from coupler.fmu.hosts import CONTACT, COUPLER, read_hosts
from coupler.fmu.launch import cache_directory, is_whole, put_ready, ready_place
from coupler.fmu.lobby_messages import ASKED, LOBBY, Begin, Begun, End, Has, Knock, Take, proof_of
from coupler.fmu.remote import VERBS, Acknowledged, Text

OWNER_PERIOD = 2.0  # s between two looks for it


class Lobby:
    """What is asked of a role before and beside a run.

    last : how the one before ended.
    """

    def __init__(self, last: str) -> None:
        self._last = last
        self._begun = self._proof = ""
        self.begins: SimpleQueue[Begin] = SimpleQueue()
        self.answers: SimpleQueue[Begun | Text] = SimpleQueue()

    def answer(self, asked: Any) -> Any:
        """Carry out what is asked."""
        match asked:
            case Knock():
                return Text(self._last)
            case Has(digest):
                place = ready_place(digest, cache_directory()) / "half.fmu"
                return Text("yes" if place.is_file() and is_whole(place) else "")
            case Take(data):
                put_ready(data, cache_directory())
            case Begin(run, secret):
                if self._begun:
                    return Text(f"it serves run {self._begun} already")
                self._begun, self._proof = run, proof_of(run, secret)
                self.begins.put(asked)
                return self.answers.get()
            # fault: a coupler ends the run of another -> case End(): |
            #   coupler/test_lobby::test_a_run_is_ended_by_who_began_it
            case End(run, proof) if self._is_ours(run, proof):
                # When the answer is on its way.
                threading.Timer(0.2, _end, (0,)).start()
        return Acknowledged()

    def _is_ours(self, run: str, proof: str) -> bool:
        return bool(run) and run == self._begun and hmac.compare_digest(proof.encode(), self._proof.encode())


def main(role: str, file: Path, patience: float) -> None:
    """Serve one run as a role, and end the process.  patience : [s] for which the coupler may be unreachable."""
    parent = become_child(close_all_sessions)
    last = parent.hear(30.0).replace("\x00", "\n")
    try:
        hosts = read_hosts(file)
        tls = hosts.tls_of(role)
        seal = Seal(LOBBY, secret_of(tls.folder))
        session = open_session(listen=(hosts.addresses[role],),
                               connect=(hosts.addresses[CONTACT],) if role != CONTACT else (), tls=tls)
    except (ScenarioError, LinkError) as exc:
        print(exc, file=sys.stderr, flush=True)
        _end(2)
    lobby = Lobby(last)
    with Server(session, seal, role, ASKED) as door:
        parent.say("ready")
        threading.Thread(target=door.work, args=(lobby.answer,), daemon=True).start()
        _serve(role, lobby, session, patience)


def _serve(role: str, lobby: Lobby, session: Session, patience: float) -> None:
    """Serve the run that comes first; on the main thread, from which an FMU wants to be called."""
    begin = lobby.begins.get()
    seal = keep_secret(begin.run, begin.secret, CONTACT_PATIENCE)
    threading.Thread(target=_watch_owner, args=(session, seal, patience), daemon=True).start()
    if role == CONTACT:
        from contact.service import ContactService  # the halves do not load it

        handle = ContactService().handle
        server = Server(session, seal, CONTACT, REQUESTS)
        answer: Any = handle
    else:
        try:
            place = ready_place(begin.digest, cache_directory()) / "half.fmu"
            hosted = Hosted(load_half(place, None, role, past_lists=True))
        except HalfError as exc:
            lobby.answers.put(Text(str(exc)))
            _end(1)
        server = Server(session, seal, role_of(role), VERBS, one_owner=True)
        answer = lambda verb: answer_or_stop(hosted, verb, server)  # noqa: E731  the server is known only here
    lobby.answers.put(Begun(server.instance))
    server.work(answer)
    _end(0)


def _watch_owner(session: Session, seal: Seal, patience: float) -> None:
    """End this process where the coupler stays out of sight."""
    token = keys_of(seal.run, seal.name(COUPLER), "*").token
    seen = time.monotonic()
    while True:
        time.sleep(OWNER_PERIOD)
        keys: Iterable[str] = ()
        # fault: whoever looks for the coupler has lost the network once and looks no more -> with suppress(OSError): |
        #   coupler/test_lobby::test_a_network_that_is_lost_for_a_while_does_not_end_the_watch
        with suppress(LinkError):
            keys = session.tokens(token, lambda: None)
        # fault: a host waits for ever for a coupler that is gone -> if True: |
        #   coupler/test_hosts::test_a_coupler_that_was_killed_leaves_hosts_that_are_free_again
        if any(seal.made(COUPLER, key.rsplit("/", 1)[1]) for key in keys):
            seen = time.monotonic()
        if time.monotonic() - seen > patience:
            print(f"the coupler of run {seal.run} was not seen for {patience:g} s", file=sys.stderr, flush=True)
            _end(3)


def _end(code: int) -> Any:
    """End at once: after an FMU was loaded, an orderly end of the interpreter may corrupt the heap."""
    sys.stderr.flush()
    try:
        # From another thread than the callbacks', with a limit: what hangs on the network must not keep us.
        closing = threading.Thread(target=close_all_sessions, daemon=True)
        closing.start()
        closing.join(1.0)
    finally:
        os._exit(code)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), float(sys.argv[3]))
