"""Links to the contact service: one method, three transports that give bitwise the same reply.

    LinkError
    |-- LinkSpecError      the link's text is wrong, or names an address that is not allowed
    |-- ServiceDownError   nobody is there, or who was there died
    |-- LinkTimeoutError   somebody is there and did not answer within the deadline
    `-- LinkProtocolError  what came back is not an answer (damaged, refused by the transport, a bug at the far end)

That the service refuses a request is no error of the link: it is the reply `Refused`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from contact.codec import REPLIES, REQUESTS, WireError, decode, encode
from contact.messages import Reply, Request

Handler = Callable[[Request], Reply]


class LinkError(Exception):
    """The contact service could not be asked."""


class LinkSpecError(LinkError):
    """The link's text is wrong, or names an address that is not allowed."""


class ServiceDownError(LinkError):
    """Nobody is there, or who was there died."""


class LinkTimeoutError(LinkError):
    """Somebody is there and did not answer within the deadline."""


class LinkProtocolError(LinkError):
    """What came back is not an answer."""


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
