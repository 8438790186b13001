"""A link to the contact service that opens when first asked, so that a half without contact opens none."""

from __future__ import annotations

from contact.link import Link
from contact.open import open_link
from contact.wire import Reply, Request


class LinkOnDemand:
    """A link (contact.link.Link) by its text."""

    def __init__(self, spec: str) -> None:
        self.spec = spec
        self._link: Link | None = None

    def ask(self, request: Request) -> Reply:
        """The reply to a request.  Raises contact.link.LinkError."""
        if self._link is None:
            self._link = open_link(self.spec)
        return self._link.ask(request)

    def close(self) -> None:
        """Close the link, if it was ever opened."""
        if self._link is not None:
            self._link.close()
            self._link = None
