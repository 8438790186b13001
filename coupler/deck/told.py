"""What came of a deck: the files written, what was not understood, what was taken for granted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Missed:
    """A line of the deck that has no counterpart in the scenario, and why."""

    file: str
    line: int
    text: str
    why: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.text}: {self.why}"


@dataclass(frozen=True)
class Converted:
    """files : written, the scenario first.  missed : not understood, in the deck's order.  notes : choices made
    where the deck leaves one."""

    files: tuple[Path, ...]
    missed: tuple[Missed, ...]
    notes: tuple[str, ...]

    @property
    def lines(self) -> tuple[str, ...]:
        """All there is to tell, one text each, as the command line prints it."""
        head = (f"{len(self.missed)} line{'s' * (len(self.missed) != 1)} of the deck not understood:",)
        return (*(f"wrote {path}" for path in self.files), *(f"note: {note}" for note in self.notes),
                *(head if self.missed else ()), *(f"  {missed}" for missed in self.missed))
