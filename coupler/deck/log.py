"""Gathers, while a deck is read, what is not understood and what is taken for granted."""

from __future__ import annotations

from dataclasses import dataclass, field

from coupler.deck.lexer import Block, Row
from coupler.deck.told import Missed


@dataclass
class Log:
    """missed, notes : so far.  The one thing that is written to while a deck is read; nothing is read from it."""

    missed: list[Missed] = field(default_factory=list)
    notes: dict[str, None] = field(default_factory=dict)

    def miss(self, what: Row | Block, why: str) -> None:
        """A line without a counterpart; of a block its keyword line stands for the data under it."""
        row = what if isinstance(what, Row) else what.row
        if isinstance(what, Block) and len(what.data) > 1:
            why = f"{why} (with its {len(what.data)} lines of data)"
        found = Missed(row.file, row.line, row.shown, why)
        if found not in self.missed[-50:]:  # one line may be looked at once for each body it touches
            self.missed.append(found)

    def note(self, text: str) -> None:
        """A choice, told once."""
        self.notes[text] = None
