"""Open the link to a contact service that a text describes."""

from __future__ import annotations

import re

from contact.rpc.link import CodecLink, DirectLink, Link, LinkSpecError

_ZENOH = re.compile(r"zenoh:(?P<endpoint>[^\s]+)/(?P<run>[A-Za-z0-9_-]+)")


def open_link(spec: str) -> Link:
    """Open a link: `direct`, `codec`, or `zenoh:tcp/127.0.0.1:PORT/RUN` (a service in its own process).

    zenoh is imported only when asked for: an embedded run has no threads and no sockets of it.
    Raises LinkSpecError for any other text, ServiceDownError where no service listens.
    """
    if spec in ("direct", "codec"):
        from contact.service import ContactService

        return (DirectLink if spec == "direct" else CodecLink)(ContactService().handle)
    match = _ZENOH.fullmatch(spec)
    if match is None:
        raise LinkSpecError(f"contact link {spec!r} is none of: direct, codec, zenoh:tcp/127.0.0.1:PORT/RUN")
    from contact.rpc.client import ZenohLink

    return ZenohLink(match["endpoint"], match["run"])
