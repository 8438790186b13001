"""What happened to contact in a run, kept from window to window (contact.watch says what is looked for)."""

from __future__ import annotations

from collections.abc import Collection

from contact.half.interface import Interface
from contact.watch import Contact, Seen, Watch
from coupler.schemes.level import Level


class Watched:
    """Of a run whose mechanical half says which nodes face something (outputs); of any other nothing is known."""

    def __init__(self, interface: Interface, outputs: Collection[str]) -> None:
        self._watch = Watch(interface) if "contact.covered" in outputs and interface.pairs else None
        self._seen = Seen()
        self._said: tuple[str, ...] = ()

    @property
    def memory(self) -> tuple[Seen, tuple[str, ...]]:
        """What was seen and said up to now."""
        return self._seen, self._said

    def put_back(self, seen: Seen, said: tuple[str, ...]) -> None:
        """Go on from what was remembered once."""
        self._seen, self._said = seen, said

    def after(self, before: Level, now: Level) -> tuple[str, ...]:
        """What an accepted window brought that should not go by in silence."""
        if self._watch is None:
            return ()
        self._seen, notes = self._watch.after(self._seen, now.t, _contact(before), _contact(now))
        self._said = (*self._said, *notes)
        return notes

    def at_end(self, now: Level) -> list[str]:
        """All that was said, and what is to be said at the end."""
        return list(self._said) + (self._watch.at_end(self._seen, now.x) if self._watch is not None else [])


def _contact(level: Level) -> Contact:
    return Contact(level.x, level.t_N, level.covered)
