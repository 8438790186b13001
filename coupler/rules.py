"""Rules: conditions on monitors, and what follows.

Only a border stands here: no rule fires.  The engine (fire, fire_failed) that belongs here was lost to it and is to be
put back over this whole file; control follows its signatures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from coupler.settings import Settings


@dataclass(frozen=True)
class Rule:
    """One rule of the scenario, checked."""

    name: str


@dataclass(frozen=True)
class Memory:
    """What rules remember from window to window: counts, cooldowns, what drives were at."""


@dataclass(frozen=True)
class Firing:
    """rule : its name.  text : what it did.  values : monitors that made it."""

    rule: str
    text: str
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Fired:
    """What the rules say after a window.

    settings : of the windows that follow, or of the next try.  retry : put the window back and try this share of it;
    0: keep it.  stop : why the run is to end; "": it goes on.
    """

    settings: Settings
    memory: Memory
    log: tuple[Firing, ...] = ()
    retry: float = 0.0
    stop: str = ""


def fire(rules: Sequence[Rule], memory: Memory, monitors: Mapping[str, float], settings: Settings) -> Fired:
    """Which rules fire after a window that could be taken.  monitors : coupler.monitors; "t" [s] is among them.

    Where a window is put back its memory is not kept, except for what the answer to `retried` says.
    """
    return Fired(settings, memory)


def retried(memory: Memory, fired: Fired) -> Memory:
    """The memory for the next try of a window that a rule put back.  memory : before that window."""
    return memory


def wanted(rules: Sequence[Rule]) -> tuple[str, ...]:
    """Names of the monitors that the rules read."""
    return ()
