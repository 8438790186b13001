"""What mechanics would make of other temperatures: the end of a window solved once more with them.

What cells leave out of temperatures is told of gaps and displacements too: the mechanical half goes over the window
again, from its state at the start, to temperatures that smaller cells would have given, and back to where it was.  The
run goes on from the window as it was solved, bit for bit as if nobody had looked.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupler.control.solve_window import SavedStates, given_to
from coupler.control.spare import Window
from coupler.schemes.levels import Level, exchanged
from coupler.schemes.state import NO_WORK, Halves
from coupler.schemes.sweep import DiscardError, mechanical_level, mechanical_pass

Array = NDArray[np.float64]

EXCHANGED = ("x", "contact.t_N", "contact.gap", "contact.covered")


@dataclass(frozen=True)
class Answer:
    """level : at the end of the window, with other temperatures.  read : outputs of the mechanical half then, by name.
    """

    level: Level
    read: Mapping[str, Array]


@dataclass(frozen=True)
class Warmed:
    """answers : one for each change; none where one of them has no solution, for the reason `why`.

    times : so often the window was solved.  solves : of the mechanical half that it took.
    """

    answers: tuple[Answer, ...] = ()
    times: int = 0
    solves: int = 0
    why: str = ""

    def then(self, other: Warmed) -> Warmed:
        """Return both; where the other has none of its answers, with its reason."""
        return Warmed((*self.answers, *other.answers), self.times + other.times, self.solves + other.solves,
                      self.why or other.why)


def can_warm(halves: Halves) -> bool:
    """Whether mechanics take temperatures, and can be put back."""
    taken = halves.mechanical.blocks.get("T")
    return taken is not None and taken.causality == "input" and halves.mechanical.can_save


def as_it_ended(window: Window) -> bool:
    """Whether the window's end is what mechanics make of its temperatures in one go, from its start.

    It is not where the window was kept as its two halves, or mechanics were given temperatures that were guessed.
    """
    solved = window.solved
    given = solved.state.sent.get("mechanical", {}).get("T")
    return solved.whole is None and given is not None and np.array_equal(given, solved.state.now.T)


def warmed(halves: Halves, window: Window, changes: Sequence[Mapping[str, Array]], names: Sequence[str]) -> Warmed:
    """Solve mechanics at a window's end once for each change of temperatures.  The halves are as before, afterwards.

    changes : T [K], and f_s [1] where it is exchanged, (n_nodes,) each, to be added to those of the end.  names : of
    what is read then.  Raises HalfError.
    """
    now, span = window.solved.state.now, window.span
    levels = [with_change(now, change) for change in changes]
    if not all((level.T > 0.0).all() for level in levels):
        return Warmed(why="with smaller cells something would be colder than 0 K")
    given = given_to(halves, replace(window.options, scheme=window.solved.scheme))
    read = [n for n in dict.fromkeys((*EXCHANGED, *names)) if n in halves.mechanical.blocks]
    given = replace(given, mechanical_outputs=tuple(read))
    found, times, why = list[Answer](), 0, ""
    with SavedStates(halves, now.t, window.saved.number, ("mechanical",)) as end:
        try:
            for level in levels:
                window.saved.roll_back("a window is looked at", "mechanical")
                times += 1
                done = mechanical_pass(given, window.before, span.times("mechanical"), exchanged(level), NO_WORK)
                found.append(Answer(mechanical_level(level, done.outputs), done.outputs))
        except DiscardError as exc:
            found, why = [], str(exc)
        # fault: a look at other temperatures leaves mechanics with them -> pass | coupler/test_trust_moved
        end.roll_back("a window was only looked at")
    return Warmed(tuple(found), times, times * span.substeps["mechanical"], why)


def with_change(now: Level, change: Mapping[str, Array]) -> Level:
    """Return the level with other temperatures [K], and solid fractions within 0 and 1."""
    f_s = now.f_s
    if f_s is not None and "f_s" in change:
        f_s = np.clip(f_s + change["f_s"], 0.0, 1.0)
    return replace(now, T=now.T + change["T"], f_s=f_s)
