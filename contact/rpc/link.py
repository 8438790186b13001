"""Links to the contact service: one method, three transports that give bitwise the same reply.

What may go wrong: contact.rpc.calls.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable
from typing import Protocol

from contact.codec import REPLIES, REQUESTS, decode, encode
from contact.messages import Reply, Request
from contact.records import WireError
from contact.rpc.calls import LinkProtocolError, LinkSpecError

Handler = Callable[[Request], Reply]


class Link(Protocol):
    """A connection to a contact service."""

    def ask(self, request: Request) -> Reply:
        """Ask the service; return its reply.  Raises LinkError."""
        ...

    def close(self) -> None: ...


class DirectLink:
    """A plain call in this process; the request's arrays are the caller's own."""

    def __init__(self, handler: Handler) -> None:
        self._handler = handler

    def ask(self, request: Request) -> Reply:
        return self._handler(request)

    def close(self) -> None:
        """Nothing is held."""


class CodecLink:
    """A call in this process through the bytes of both messages: what a transport would do to them."""

    def __init__(self, handler: Handler) -> None:
        self._handler = handler

    def ask(self, request: Request) -> Reply:
        try:
            reply = self._handler(decode(encode(request), REQUESTS))
            answer: Reply = decode(encode(reply), REPLIES)
        except WireError as exc:
            raise LinkProtocolError(f"{type(request).__name__}: {exc}") from exc
        return answer

    def close(self) -> None:
        """Nothing is held."""


class Waits(threading.local):
    """What requests to contact cost the halves of this thread: how many, and seconds until the answer, since ever.

    Halves of one process share it: whoever calls a half takes the difference of before and after.
    """

    requests = 0
    seconds = 0.0

    def ask(self, link: Link, request: Request) -> Reply:
        """Ask over a link, and count it; one that raises is counted too.  Raises LinkError."""
        begun = time.perf_counter()
        try:
            return link.ask(request)
        finally:
            self.requests += 1
            # fault: the time of contact is not counted -> pass |
            #   coupler/test_timings::test_waiting_for_contact_is_counted_also_where_it_fails
            self.seconds += time.perf_counter() - begun


waits = Waits()
_ZENOH = re.compile(r"zenoh:(?P<endpoint>[^\s]+)/(?P<run>[A-Za-z0-9_-]+)")


def open_link(spec: str) -> Link:
    """Open a link: `direct`, `codec`, or `zenoh:ENDPOINT/RUN` (a service in its own process).

    ENDPOINT : `unixsock-stream/PATH` or `tcp/127.0.0.1:PORT`; the process has the secret of RUN (contact.rpc.seal).
    zenoh is imported only when asked for: an embedded run has no threads and no sockets of it.
    Raises LinkSpecError for any other text, ServiceDownError where no service listens.
    """
    if spec in ("direct", "codec"):
        from contact.service import ContactService

        return (DirectLink if spec == "direct" else CodecLink)(ContactService().handle)
    match = _ZENOH.fullmatch(spec)
    if match is None:
        raise LinkSpecError(f"contact link {spec!r} is none of: direct, codec, zenoh:ENDPOINT/RUN")
    from contact.rpc.client import ZenohLink

    return ZenohLink(match["endpoint"], match["run"])
