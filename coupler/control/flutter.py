"""A pair that opens and closes without end because its conductance jumps at touch: neither state lasts.

In touch the bodies exchange so much heat that they part, apart so little that they touch again, at once.  In the limit
of ever faster turns the pair conducts a part of the time, at no gap and no pressure (Filippov's solution of a law that
jumps; Barber 1978 has no steady state without it).  The thermal half has that solution where the law is joined over a
gap below all that the scene resolves: the share of it that conducts is then found as the gap is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from coupler.control.contact_status import ContactState, PairNodes, contact_status
from coupler.schemes.levels import Level
from coupler.schemes.state import Settings

JOIN = "contact.join"  # of the thermal half: the gap [m]
# A pair that turned so many times within this share of the run gets nowhere.
TURNS, SHARE = 4, 1e-3
# Where events are not looked for nobody sees turns.  A pair nearer than so many times the gap over which laws are
# joined turns in a window that was halved so often and whose iterates still do not agree.
NEAR, HALVED = 100.0, 2


@dataclass(frozen=True)
class Torn:
    """pairs : name -> its conductance apart and in touch [W/m2K], of those where they differ.

    gap [m] : over which they are joined.  end : of the run [s].  nodes : name -> the pair.
    """

    pairs: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    gap: float = 0.0
    end: float = 0.0
    nodes: Mapping[str, PairNodes] = field(default_factory=dict)

    def near(self, level: Level) -> list[str]:
        """Return the pairs that touch at a level, or all but do."""
        stand = {name: contact_status((self.nodes[name],), level, {}) for name in self.pairs}
        return [name for name, now in stand.items() if now.status[0] is ContactState.CLOSED
                or any(gap < NEAR * self.gap for gap in now.margins[0])]


NOT_TORN = Torn()


@dataclass(frozen=True)
class Memory:
    """turns : pair -> when it turned last [s], TURNS of them at most.  notes : what was told, of each pair once."""

    turns: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def turned_by(t: float, due: tuple[int, ...], turned: tuple[float, ...]) -> tuple[float, ...]:
    """Return when each status turned last, after a window that ends at t [s].

    due : which were to change at once in it.  turned : when each was another at the end of a window [s].  What was to
    change and is again as it was has turned twice within the window.
    """
    # fault: a pair that touches and parts within each window is not seen -> return turned | coupler/test_flutter
    return tuple(t if i in due else last for i, last in enumerate(turned))


def after(memory: Memory, settings: Settings, torn: Torn, names: tuple[str, ...],
          turned: tuple[float, ...], joins: bool) -> tuple[Memory, Settings]:
    """Return memory and settings after a window that stands.

    names : of what has a status.  turned : when each turned last [s].  joins : whether the thermal half can join laws.
    """
    turns, fluttering = dict(memory.turns), list[str]()
    for what, t in zip(names, turned, strict=False):
        name = what.removeprefix("pair ")
        known = turns.get(name, ())
        if name not in torn.pairs or t < 0.0 or (known and t <= known[-1]):
            continue
        last = turns[name] = (*known[1 - TURNS:], t)
        # fault: a pair that flutters without end is kept to itself -> if False: | coupler/test_flutter
        if len(last) == TURNS and t - last[0] <= SHARE * torn.end:
            fluttering.append(name)
    return _joined(replace(memory, turns=turns), settings, torn, fluttering, joins)


def stuck(memory: Memory, settings: Settings, torn: Torn, t: float, joins: bool,
          near: Sequence[str] = ()) -> tuple[Memory, Settings]:
    """Return memory and settings after a window from t [s] whose iterates did not agree; the rest is as of `after`.

    Where a pair turned a moment ago they are in touch and apart by turns.  near : pairs taken for such.
    """
    # fault: iterates that open and close a pair by turns are taken as they are -> fluttering: list[str] = [] |
    #   coupler/test_flutter
    fluttering = [name for name, turns in memory.turns.items() if turns and t - turns[-1] <= SHARE * torn.end]
    at_touch = {name: (t,) for name in near if name not in memory.turns}
    memory = replace(memory, turns={**memory.turns, **at_touch})
    return _joined(memory, settings, torn, [*fluttering, *at_touch], joins)


def _joined(memory: Memory, settings: Settings, torn: Torn, fluttering: list[str],
            joins: bool) -> tuple[Memory, Settings]:
    """With notes on pairs of which none was given yet, and with their laws joined."""
    new = [name for name in fluttering if not any(note.startswith(f"pair {name} ") for note in memory.notes)]
    if not new:
        return memory, settings
    found = tuple(_note(name, torn, memory.turns[name], joins) for name in new)
    if joins:
        given = settings.inputs.get("thermal", {})
        settings = replace(settings, inputs={**settings.inputs, "thermal": {**given, JOIN: torn.gap}})
    return replace(memory, notes=(*memory.notes, *found)), settings


def _note(name: str, torn: Torn, turns: tuple[float, ...], joined: bool) -> str:
    apart, touching = torn.pairs[name]
    what = (f"pair {name} opens and closes without end at t = {turns[-1]:.9g} s: its conductance jumps from "
            f"{apart:.6g} to {touching:.6g} W/m2K when it touches; in touch it soon opens, and apart it soon closes")
    if joined:
        return (f"{what}. From here on it fades within a gap of {torn.gap:.3g} m, so that there is a state in between. "
                "With laws that join in the file it does from the start")
    return (f"{what}. Windows stay as short as that. With laws that join there is a state in between: in place of a "
            f"constant `closed`, `{{law: table, x: [0, P], h: [{apart:.6g}, {touching:.6g}]}}` with P [Pa] small "
            "beside the pressures of the scene, such as 1e5 between metals")
