"""Sessions of zenoh on this machine, and the four things done on them; the only file that imports zenoh.

Traits of zenoh that shape this file.  A plain configuration listens on every interface and calls out by
multicast: every endpoint is named here.  Every failure looks alike, an empty list of replies; the token of
whoever was asked tells "try again" from "gone".  A process that ends without closing hangs on the thread of a
callback, so callbacks run on the network thread (indirect=False) and do no more than put things into queues.
"""

from __future__ import annotations

import json
import os
import re
import socket
import stat
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Lock
from typing import Any

import zenoh

from contact.rpc.calls import LinkError, LinkSpecError, ServiceDownError
from contact.rpc.tls import Tls, is_tls

CONNECT_TIMEOUT = 5.0  # s
WATCH_PERIOD = 0.25  # s between looks at whether the other processes live, while waiting for an answer
LEASE_MS = 3000  # a stopped process or cut line counts as gone after this long
_ENCODING = "application/x-slideline"
_LOOPBACK = re.compile(r"tcp/(?:127\.0\.0\.1|\[::1\]|localhost):([0-9]{1,5})")
SOCKET = "unixsock-stream/"
_SOCKET_PATH = 100  # bytes; the kernel takes 108


@dataclass(frozen=True)
class QueryAnswer:
    """An answer to a query.

    spoken : by whoever answered; else in zenoh's own words (its timeout).  label : the attachment.
    """

    spoken: bool
    label: str
    payload: bytes


class Question:
    """A query that arrived; to be answered once, from any thread."""

    def __init__(self, query: Any) -> None:
        self._query = query
        self.label = _text(query.attachment)
        self.payload: bytes = query.payload.to_bytes() if query.payload is not None else b""

    def answer(self, key: str, label: str, payload: bytes) -> None:
        """Raises LinkError where the answer cannot be sent."""
        try:
            with self._query:
                # A refusal is a reply as well: what zenoh calls an error has no room for a signature.
                self._query.reply(key, payload, encoding=_ENCODING, attachment=label)
        except zenoh.ZError as exc:
            raise LinkError(f"answer to {self.label!r} not sent: {exc}") from exc


class Session:
    """A zenoh session and how many use it.  A process should have one: two are slower and no more useful."""

    def __init__(self, listen: tuple[str, ...], connect: tuple[str, ...], tls: Tls | None = None) -> None:
        self._zenoh = zenoh.open(_config(listen, connect, tls))
        self.listen, self.connect = listen, connect
        self.pid = os.getpid()
        self.users = 1

    def close(self) -> None:
        close: Callable[[], None] = self._zenoh.close
        close()

    def answer(self, key: str, arrived: Callable[[Question], None]) -> Any:
        """Have questions on a key delivered; undeclare() what is returned to end it."""
        handler: Any = zenoh.handlers.Callback(lambda query: arrived(Question(query)), indirect=False)
        return self._zenoh.declare_queryable(key, handler, complete=True)

    def show_token(self, key: str) -> Any:
        """Declare a token that vanishes with this process or its connection; undeclare() the result to end it."""
        return self._zenoh.liveliness().declare_token(key)

    def tokens(self, key: str, watch: Callable[[], None]) -> set[str]:
        """Return the keys of all tokens that match."""
        def get(handler: Any) -> None:
            self._zenoh.liveliness().get(key, handler, timeout=1.0)

        return {str(r.ok.key_expr) for r in self._asked(get, 1.0).replies(watch) if r.ok is not None}

    def ask(self, key: str, payload: bytes, label: str, timeout: float) -> Asked:
        """Ask a question, whose answers may be had later; `answers` waits for them.

        timeout : seconds.  Raises LinkError where it cannot be asked.
        """
        # All that have the key: a stranger who declares it too could otherwise be the only one who is asked.
        # fault: a stranger who takes a server's key is asked in its place -> target =
        #   zenoh.QueryTarget.BEST_MATCHING | coupler/test_strangers
        target = zenoh.QueryTarget.ALL

        def get(handler: Any) -> None:
            self._zenoh.get(key, handler, payload=payload, attachment=label, encoding=_ENCODING, timeout=timeout,
                            target=target, consolidation=zenoh.ConsolidationMode.NONE)

        return self._asked(get, timeout)

    def _asked(self, get: Callable[[Any], None], timeout: float) -> Asked:
        if os.getpid() != self.pid:
            raise LinkError("a zenoh session does not survive a fork; start processes anew instead")
        asked = Asked(time.monotonic() + timeout + 1.0)
        try:
            get(zenoh.handlers.Callback(asked.arrived, drop=lambda: asked.arrived(None), indirect=False))
        except zenoh.ZError as exc:
            raise LinkError(f"not asked: {exc}") from exc
        return asked


class Asked:
    """A question on its way, and what has been answered so far.

    until : when to wait no longer (time.monotonic); zenoh ends a query at its timeout, this is for where it does not.
    """

    def __init__(self, until: float) -> None:
        self._until = until
        self._box: SimpleQueue[tuple[float, Any]] = SimpleQueue()
        self.at = time.perf_counter()
        """When the last answer that was looked at had arrived (time.perf_counter); before that, when it was asked."""

    def arrived(self, reply: Any) -> None:
        """Keep a reply, or None: there are no more.  On a thread of zenoh."""
        self._box.put((time.perf_counter(), reply))

    def answers(self, watch: Callable[[], None], taken: Callable[[QueryAnswer], bool]) -> list[QueryAnswer]:
        """Wait; return the answers up to the first that is taken; others may come before it.

        None at all: nobody has the key, or its owner died, or the line is cut.
        watch : called while waiting; may raise what ends the wait.  taken : whether an answer is the one that was
        waited for.
        """
        answers: list[QueryAnswer] = []
        for reply in self.replies(watch):
            answers.append(answer := _answer(reply))
            # fault: an answer waits for the end of its question -> if answer is None: | contact/test_call_stats
            if taken(answer):  # zenoh says that nothing more comes a tenth of a millisecond later
                break
        return answers

    def replies(self, watch: Callable[[], None]) -> Iterator[Any]:
        """Wait for all replies; watch : as of `answers`."""
        while True:
            over = time.monotonic() >= self._until
            try:
                # What came in time counts for whoever looks late, too.
                # fault: an answer is not seen by who looks late -> self.at, reply = SimpleQueue().get_nowait() if over
                #   else self._box.get(timeout=WATCH_PERIOD) | contact/test_zenoh
                self.at, reply = self._box.get_nowait() if over else self._box.get(timeout=WATCH_PERIOD)
            except Empty:
                if over:
                    return
                watch()
                continue
            if reply is None:
                return
            yield reply


def _answer(reply: Any) -> QueryAnswer:
    if reply.ok is not None:
        return QueryAnswer(True, _text(reply.ok.attachment), reply.ok.payload.to_bytes())
    return QueryAnswer(str(reply.err.encoding) == _ENCODING, "", reply.err.payload.to_bytes())


def _text(attachment: Any) -> str:
    """The text of an attachment; whatever a stranger put there must not raise where questions arrive."""
    return attachment.to_bytes().decode("ascii", "replace") if attachment is not None else ""


_sessions: list[Session] = []
_sessions_lock = Lock()


def open_session(*, listen: Iterable[str] = (), connect: Iterable[str] = (), tls: Tls | None = None) -> Session:
    """Open a session with these endpoints: one this process has open already, or a new one.

    listen : `tcp/127.0.0.1:0` takes a free port; the session says which.  Give it back with close_session.
    tls : with it all endpoints are `tls/HOST:PORT`, and whoever is to be reached may come later.
    Raises LinkSpecError for an endpoint that is not loopback without TLS, ServiceDownError where a connect endpoint
    does not answer, LinkError where it cannot listen.
    """
    wanted_listen, wanted_connect = tuple(listen), tuple(connect)
    with _sessions_lock:
        for session in _sessions:
            endpoints = {*session.listen, *session.connect}
            if session.pid == os.getpid() and not wanted_listen and endpoints.issuperset(wanted_connect):
                session.users += 1
                return session
        for endpoint in (*wanted_listen, *wanted_connect):
            # fault: what leaves the machine need not be encrypted -> pass |
            #   coupler/test_hosts::test_what_leaves_the_machine_is_encrypted_or_not_sent
            check_endpoint(endpoint, tls)
        session = _open(wanted_listen, wanted_connect, tls)
        _sessions.append(session)
        return session


def close_session(session: Session) -> None:
    """Give a session back; the last user closes it."""
    with _sessions_lock:
        session.users -= 1
        if session.users == 0 and session in _sessions:
            _sessions.remove(session)
            session.close()


def close_all_sessions() -> None:
    """Close whatever is open in this process: the last act before it ends."""
    with _sessions_lock:
        while _sessions:
            _sessions.pop().close()


def check_endpoint(endpoint: str, tls: Tls | None) -> None:
    """Check that an endpoint is on this machine, or behind TLS.  Raises LinkSpecError."""
    if tls is None:
        check_loopback(endpoint)
    elif not is_tls(endpoint):
        raise LinkSpecError(f"endpoint {endpoint!r} is not tls/HOST:PORT")


def check_loopback(endpoint: str) -> None:
    """Check that an endpoint is on this machine: TCP on loopback, or a socket in a folder of this user's own.

    There is no encryption on these links, so nobody elsewhere may reach them, and no other user the sockets.
    Raises LinkSpecError.
    """
    if endpoint.startswith(SOCKET):
        return _check_folder(Path(endpoint.removeprefix(SOCKET)))
    match = _LOOPBACK.fullmatch(endpoint)
    if match is None or int(match[1]) > 65535:
        raise LinkSpecError(f"endpoint {endpoint!r} is not tcp/127.0.0.1:PORT or {SOCKET}/FOLDER/NAME; other addresses "
                            "need TLS, which this link does not have: only loopback is allowed (docs/hosts.md says how "
                            "halves run on other machines)")
    return None


def _check_folder(socket_path: Path) -> None:
    """Check that only this user can enter the folder of a socket.  Raises LinkSpecError."""
    folder = socket_path.parent
    try:
        facts = folder.lstat()
    except OSError as exc:
        raise LinkSpecError(f"the folder of the socket {socket_path} cannot be looked at ({exc.strerror})") from exc
    own = stat.S_ISDIR(facts.st_mode) and facts.st_uid == os.getuid()
    # fault: a socket may lie where others can reach it -> if not own: |
    #   contact/test_zenoh::test_only_loopback
    if not own or stat.S_IMODE(facts.st_mode) & 0o077:
        raise LinkSpecError(f"others may enter the folder of the socket {socket_path}: it must be this user's own, "
                            "with mode 0700")


def socket_in(folder: Path, name: str) -> str:
    """Return an endpoint in a folder of one's own, out of reach of other users; loopback TCP where that cannot be."""
    path = folder / name
    if sys.platform == "win32" or len(os.fsencode(path)) > _SOCKET_PATH:
        return "tcp/127.0.0.1:0"
    return f"{SOCKET}{path}"


def _open(listen: tuple[str, ...], connect: tuple[str, ...], tls: Tls | None) -> Session:
    for _ in range(10):  # another process may take a free port before we do
        chosen = tuple(_with_port(endpoint) for endpoint in listen)
        try:
            return Session(chosen, connect, tls)
        except zenoh.ZError as exc:
            if "Unable to connect" in str(exc):
                raise ServiceDownError(f"nobody answers at {', '.join(connect)}") from exc
            if chosen == listen or "listener" not in str(exc):
                raise LinkError(f"no session (listen {chosen}, connect {connect}): {exc}") from exc
    raise LinkError(f"no free port found for {listen}")


def _with_port(endpoint: str) -> str:
    if not endpoint.endswith(":0"):
        return endpoint
    host = endpoint[len("tcp/") : -len(":0")].strip("[]")
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
        probe.bind((host, 0))
        return f"{endpoint[:-1]}{probe.getsockname()[1]}"


def _config(listen: tuple[str, ...], connect: tuple[str, ...], tls: Tls | None) -> Any:
    config = zenoh.Config()
    settings: dict[str, object] = {
        "mode": "peer",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "listen/endpoints": listen,
        "listen/exit_on_failure": True,
        "connect/endpoints": connect,
        "connect/timeout_ms": int(CONNECT_TIMEOUT * 1000),
        "connect/exit_on_failure": tls is None,
        "connect/retry": {"period_init_ms": 20, "period_max_ms": 500, "period_increase_factor": 2},
        # Its segments outlive the session, and the process where that is killed: 40 MB and 4 open files a run.
        # fault: memory shared with nobody stays when a session is closed -> "transport/shared_memory/enabled": True, |
        #   contact/test_zenoh::test_a_closed_session_leaves_nothing_behind
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/queue/size/data": 16,
        # After 5 s of a full queue zenoh would drop the connection and lose what it holds.
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 60_000_000,
        **({} if tls is None else tls.settings()),
    }
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config
