"""The contact service in a process of its own:  python -m contact.rpc.serve --listen tcp/127.0.0.1:PORT --run ID

The first line of its standard input is the secret of the run, 64 hexadecimal digits; only whoever has it may ask
(contact.rpc.seal).  It says `ready ENDPOINT INSTANCE` on its standard output and answers until it is interrupted.  With
--child it lives as long as its parent (contact.rpc.server).
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

from contact.codec import REQUESTS
from contact.rpc.calls import LinkSpecError, lines
from contact.rpc.link import Handler
from contact.rpc.seal import Seal, keep_secret, secret_line
from contact.rpc.server import Server, become_child, keep_freed_memory
from contact.rpc.zenoh_session import Session, close_all_sessions, close_session, open_session

SECRET_PATIENCE = 30.0  # s to hear the secret from a parent


def main(handle: Handler, arguments: list[str] | None = None) -> int:
    """Serve until stopped; returns the exit code.  handle : request -> reply."""
    parser = argparse.ArgumentParser(prog="python -m contact.rpc.serve", description=__doc__)
    add = parser.add_argument
    add("--listen", default="tcp/127.0.0.1:0",
        help="unixsock-stream/PATH in a folder of mode 0700, or a loopback endpoint; port 0 takes a free one")
    add("--run", required=True, help="name of the run whose halves may ask")
    add("--child", action="store_true", help="end when standard input is closed; ignore Ctrl-C")
    options = parser.parse_args(arguments)
    say: Callable[[str], object]
    served: list[Server] = []

    def end() -> None:
        """What is done when the parent is gone, on another thread than the one that may be deep in its work."""
        log_call_stats(served)
        close_all_sessions()

    try:
        if options.child:
            parent = become_child(end)
            say, secret = parent.say, secret_line(parent.hear(SECRET_PATIENCE))
        else:
            keep_freed_memory()
            say, secret = _print, secret_line(sys.stdin.readline())
    except (LinkSpecError, TimeoutError) as exc:
        print(exc, file=sys.stderr, flush=True)
        return 2
    seal = keep_secret(options.run, secret)
    session = open_session(listen=(options.listen,))
    try:
        _serve(handle, session, seal, say, stoppable=not options.child, served=served)
    finally:
        log_call_stats(served)
        close_session(session)
    if options.child:
        # Nothing is left to do, and an interpreter with native threads does not always end quietly.
        sys.stderr.flush()
        os._exit(0)
    return 0


def log_call_stats(served: list[Server]) -> None:
    """Write the statistics of the server's calls to the log, once."""
    while served:
        for line in lines(served.pop().stats.so_far()):
            print(line, file=sys.stderr, flush=True)


def _serve(handle: Handler, session: Session, seal: Seal, say: Callable[[str], object], *,
           stoppable: bool, served: list[Server]) -> None:
    with Server(session, seal, "contact", REQUESTS) as server:
        served.append(server)

        def stop(number: int, frame: FrameType | None) -> None:
            server.stop()

        signal.signal(signal.SIGTERM, stop)
        if stoppable:
            signal.signal(signal.SIGINT, stop)
        say(f"ready {session.listen[0]} {server.instance}")
        server.work(handle)


def _print(line: str) -> None:
    print(line, flush=True)


if __name__ == "__main__":
    from contact.service import ContactService

    sys.exit(main(ContactService().handle))
