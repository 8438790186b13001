"""Contact events: where in a window something opens, closes, sticks or slips.

First version, for the border: none is looked for.
"""

from __future__ import annotations

from dataclasses import dataclass

from coupler.level import Level
from coupler.window import CoupledState, Solved, Span


@dataclass(frozen=True)
class Memory:
    """What is remembered from window to window, and from try to try while an event is being located."""


@dataclass(frozen=True)
class Found:
    """tick : where the window is to end.  located : it does so already.  text : what happens there, in words."""

    tick: int
    located: bool
    text: str


def met(memory: Memory, start: Level, solved: Solved, span: Span, tolerance: float) -> tuple[Found | None, Memory]:
    """Whether an event lies in a window that was solved.

    solved.state.now : the level at its end; solved.monitors : touching, slipping.  tolerance [s]; 0: as events says.
    Of the two outcomes: None, the window may be taken; located, it may be taken and ends at an event; else both halves
    are put back and the next try ends at `tick`.  The memory is kept whatever is done with the window: it holds the
    bracket.  `settled` is called as well once a window is taken.
    """
    return None, memory


def expected(memory: Memory, state: CoupledState, span: Span) -> int | None:
    """Where an event is expected inside a window that is about to be solved: the tick at which to end it."""
    return None


def settled(memory: Memory, start: Level, solved: Solved) -> Memory:
    """The memory after a window was taken."""
    return memory


def forgotten(memory: Memory) -> Memory:
    """The memory past a kink or an event."""
    return memory
