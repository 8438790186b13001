"""The two-cycle: a quantity that goes up and down from window to window because of the exchange, not of the physics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from coupler.level import Level

Array = NDArray[np.float64]

# So many turns on end are a cycle: two turns are a transient that overshoots once.
TURNS = 4
# A turn: the increment points against the one before (cosine below -OPPOSITE) and is at least HOLDS times as long.
# A cycle that halves at every turn dies by itself in a few windows.
OPPOSITE, HOLDS = 0.9, 0.5
# Below these an increment is round-off and iteration error: T [K], gap [m], t_N [Pa].
FLOORS = {"temperature": 1e-3, "gap": 1e-8, "pressure": 1e3}
WHAT_HELPS = ("that is the exchange between the halves, not the bodies; smaller windows or scheme: iterated "
              "(acceleration: aitken or iqn_ils) end it. What is still there in windows of half the size is physics")


@dataclass(frozen=True)
class Swing:
    """The last increment of a quantity, and how many turns on end led to it."""

    increment: Array
    turns: int = 0


@dataclass(frozen=True)
class Watch:
    """What is remembered of the exchange.  swings : by quantity.  told : quantities already noted since an event."""

    swings: Mapping[str, Swing] = field(default_factory=dict)
    told: frozenset[str] = frozenset()

    def plus(self, before: Level, now: Level) -> Watch:
        """After one more window; quantities that are not known (nan) or not there are left out."""
        news = {"temperature": now.T - before.T, "gap": now.gap - before.gap, "pressure": now.t_N - before.t_N}
        swings = {name: swung(self.swings.get(name), d, FLOORS[name]) for name, d in news.items()
                  if d.size and np.isfinite(d).all()}
        return replace(self, swings=swings)

    @property
    def cycling(self) -> tuple[str, ...]:
        """Quantities that cycle and were not told of yet."""
        return tuple(n for n, s in self.swings.items() if s.turns >= TURNS and n not in self.told)

    def tell(self) -> Watch:
        """The watch after its finds were told: each quantity once."""
        return replace(self, told=self.told | set(self.cycling))


def swung(last: Swing | None, increment: Array, floor: float) -> Swing:
    """The swing after one more increment of a quantity : (n,)."""
    if last is None:
        return Swing(increment)
    a, b = float(np.linalg.norm(last.increment)), float(np.linalg.norm(increment))
    against = float(last.increment @ increment) < -OPPOSITE * a * b
    return Swing(increment, last.turns + 1 if against and b >= HOLDS * a and np.abs(increment).max() > floor else 0)


def two_cycles(levels: Sequence[Level]) -> Iterator[tuple[int, str]]:
    """(number of the window, quantity) of every cycle first seen in a recorded exchange, windows from 1.

    levels : at the start and at the end of each window.
    """
    watch = Watch()
    for number in range(1, len(levels)):
        watch = watch.plus(levels[number - 1], levels[number])
        yield from ((number, name) for name in watch.cycling)
        watch = watch.tell()


def note(quantity: str, window: int, swing: Swing, t: float) -> str:
    """A sentence on a cycle.  window : the number of the window [from 1] that showed it, ending at t [s]."""
    unit = {"temperature": "K", "gap": "m", "pressure": "Pa"}[quantity]
    size = float(np.abs(swing.increment).max())
    return (f"windows {window - swing.turns} to {window} (to t = {t:.6g} s): {quantity} goes up and down by {size:.3g} "
            f"{unit} from window to window: {WHAT_HELPS}")
