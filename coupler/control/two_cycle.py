"""The two-cycle: a quantity that goes up and down from window to window because of the exchange, not of the physics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from coupler.scenario.options import OnCycle, Scheme, Seen
from coupler.schemes.levels import Level, extent
from coupler.schemes.state import Settings

Array = NDArray[np.float64]

# A turn: the increment points against the one before (cosine below -0.9) and is at least 0.8 times as long.
OPPOSITE, MIN_RATIO = 0.9, 0.8
# So many turns on end are a cycle if none of them shrinks: two are a transient that overshoots, and a swing of physics
# in windows of nearly half its period beats.
# fault: a swing of two turns is a cycle -> GROWING = 1 | coupler/test_cycle_action
# fault: a swing that grows waits for four turns -> GROWING = 5 | coupler/test_cycle_action
GROWING = 3
# So many are one that settles: over all of them the increments shrink by no more than a hundredth a window.  What is
# multiplied by -.98 a window only converges; the increments of a two-cycle are all as long.
# fault: what shrinks by a tenth a window called a cycle -> TURNS, LASTING = 4, 0.9 | coupler/test_cycle_action
TURNS, LASTING = 4, 0.99
# Below these shares an increment is round-off and iteration error: of the differences of T (of T itself, where all is
# even), of the size of the scene, of the largest pressure.
FAINT_T, EVEN_T, FAINT_GAP, FAINT_PRESSURE = 1e-5, 1e-10, 1e-7, 1e-4
# A contraction of plain iteration up to this, (b dt/2)/(1 + a dt) <= .4, means b dt < 1 where a dt is small: every
# scheme of one solve a half is stable there (docs/theory.md, limits of stability).
CALM = 0.4
EXCHANGE = ("the exchange between the halves does that, or a midpoint rule that rings; smaller windows, scheme: "
            "iterated (acceleration: aitken or iqn_ils) or thermal.method: sdirk2 end it")
THERMAL = ("gaps and pressures do not go with it, so the thermal half's own method rings; smaller windows or "
           "thermal.method: sdirk2 end it")
MECHANICAL = ("temperatures do not go with it, so bodies or their contact swing by themselves; smaller windows or, "
              "with inertia, mechanical.elastic.dynamics: {rho_inf: 0.8} end it")
PHYSICS = "What is still there in windows of half the size is physics"


@dataclass(frozen=True)
class Swing:
    """The last increment of a quantity, and how many turns on end led to it.

    ratios : of each of the last TURNS of them, how long the increment was over the one before.
    """

    increment: Array
    turns: int = 0
    ratios: tuple[float, ...] = ()

    @property
    def cycles(self) -> bool:
        """Whether it goes up and down and does not die."""
        if self.turns >= GROWING and min(self.ratios[-GROWING:]) >= 1.0:
            return True
        return self.turns >= TURNS and math.prod(self.ratios) >= LASTING**TURNS


@dataclass(frozen=True)
class Watch:
    """What is remembered of the exchange.  swings : by quantity.  told : quantities already noted since a kink.

    home : the scheme in use before windows were iterated because of a cycle; "": they are not.  calm : windows on end
    in which that scheme would have held; calm_at : contraction of plain iteration up to which it does.
    home_level : `coupling.iteration.level` before; "": as it is.  cap [s] : the longest window before they were halved;
    halved : how often.
    """

    swings: Mapping[str, Swing] = field(default_factory=dict)
    told: frozenset[str] = frozenset()
    home: str = ""
    calm: int = 0
    cap: float = math.inf
    halved: int = 0
    home_level: str = ""
    calm_at: float = CALM

    def plus(self, before: Level, now: Level) -> Watch:
        """After one more window; quantities that are not known (nan) or not there are left out."""
        # A gap that the mechanical half does not tell is nan: then its coordinates stand for it.
        known = now.gap.size and math.isfinite(now.gap[0] - before.gap[0])
        # Beside the end of the other side a node faces a sliver of it or nothing, by rounding, and then its gap jumps.
        # fault: the gap of a node that faces nothing is taken for a swing -> faced = 1.0 | coupler/test_cycle_action
        faced = np.minimum(before.covered, now.covered)
        news = {"temperature": now.T - before.T, "pressure": now.t_N - before.t_N,
                "gap": (now.gap - before.gap) * faced if known else (now.x - before.x).ravel()}
        floors = _floors(before, now)
        swings = {name: swung(self.swings.get(name), d, floors[name]) for name, d in news.items() if d.size}
        return replace(self, swings=swings)

    @property
    def cycling(self) -> tuple[str, ...]:
        """Quantities that cycle, where one of them was not told of yet."""
        if all(n in self.told or not s.cycles for n, s in self.swings.items()):
            return ()
        # One may turn a window later than the other, or settle from above.
        return tuple(n for n, s in self.swings.items() if s.cycles or s.turns >= GROWING - 1)

    @property
    def exchanged(self) -> bool:
        """Whether both halves' quantities cycle: gap and pressure are both the mechanical half's."""
        # fault: gap and pressure alone are taken for the exchange -> return len(self.cycling) > 1 |
        #   coupler/test_cycle_action
        return "temperature" in self.cycling and len(self.cycling) > 1

    def tell(self) -> Watch:
        """The watch after its finds were told: each quantity once."""
        return replace(self, told=self.told | set(self.cycling)) if self.cycling else self


def _floors(before: Level, now: Level) -> dict[str, float]:
    """Return quantity -> what an increment is at least to be one, in its unit."""
    T = max(FAINT_T * float(np.ptp(before.T)), EVEN_T * float(np.abs(before.T).max()))
    p = max(float(np.abs(t_N).max(initial=0.0)) for t_N in (before.t_N, now.t_N))
    # fault: floors of cycles are fixed numbers -> return {"temperature": 1e-3, "gap": 1e-8, "pressure": 1e3} |
    #   coupler/test_schemes::test_a_cycle_is_seen_in_a_scene_of_any_size
    return {"temperature": T, "gap": FAINT_GAP * extent(before), "pressure": FAINT_PRESSURE * p}


def swung(last: Swing | None, increment: Array, floor: float) -> Swing:
    """Return the swing after one more increment of a quantity.

    increment : (n,) of temperature [K], pressure [Pa], gap or coordinates [m].  floor : in the same unit; an increment
    that nowhere exceeds it is no turn.
    """
    if last is None:
        return Swing(increment)
    # Asked first, because most increments point as the one before.
    along = float(last.increment @ increment)
    if along >= 0.0:
        return Swing(increment)
    a2, b2 = float(last.increment @ last.increment), float(increment @ increment)
    # fault: what dies by itself called a cycle -> turned = along < -OPPOSITE * math.sqrt(a2 * b2) |
    #   coupler/test_schemes
    turned = along < -OPPOSITE * math.sqrt(a2 * b2) and b2 >= MIN_RATIO**2 * a2
    if not turned or float(np.abs(increment).max()) <= floor:
        return Swing(increment)
    # fault: cycles not noticed -> return Swing(increment, 0, (*last.ratios, math.sqrt(b2 / a2))[-TURNS:]) |
    #   coupler/test_schemes
    return Swing(increment, last.turns + 1, (*last.ratios, math.sqrt(b2 / a2))[-TURNS:])


def two_cycles(levels: Sequence[Level]) -> Iterator[tuple[int, tuple[str, ...]]]:
    """(number of the window, quantities) of every cycle first seen in a recorded exchange, windows from 1.

    levels : at the start and at the end of each window.
    """
    watch = Watch()
    for number in range(1, len(levels)):
        watch = watch.plus(levels[number - 1], levels[number])
        if watch.cycling:
            yield number, watch.cycling
        watch = watch.tell()


def note(watch: Watch, window: int, t: float) -> str:
    """A sentence on the cycle a watch found.  window : the one that showed it, from 1, ending at t [s]."""
    units = {"temperature": "K", "gap": "m", "pressure": "Pa"}
    found = [(name, watch.swings[name]) for name in watch.cycling]
    sizes = " and ".join(f"{name} by {float(np.abs(s.increment).max()):.3g} {units[name]}" for name, s in found)
    first = window - max(s.turns for _, s in found)
    why = EXCHANGE if watch.exchanged else THERMAL if "temperature" in watch.cycling else MECHANICAL
    return f"windows {first} to {window} (to t = {t:.6g} s) go up and down, {sizes}: {why}. {PHYSICS}"


# What follows when a two-cycle was seen: it is told, the windows after it are iterated, or windows are halved.
#
# Iterating ends a cycle of the exchange at any window; it ends when plain iteration has contracted well for some
# windows on end, for then the scheme that cycled would hold too, or at the next kink.  Halving holds to the next kink.

# So many windows on end: no longer than a cycle takes to show, so going back too soon costs no more than it did.
CALM_WINDOWS = 5
# What still cycles in windows of a 64th is no cycle of the exchange.
HALVINGS = 6


@dataclass(frozen=True)
class WindowSummary:
    """A window that may be taken.  number : from 1.  t [s]: its end.  H [s].  may_cut : whether it may be halved.

    contraction : of plain iteration, as measured in it; nan: unknown.
    """

    number: int
    t: float
    H: float
    may_cut: bool
    contraction: float = math.nan


@dataclass(frozen=True)
class CycleAction:
    """settings : of the next window, or of the next try where the window is put back (`cut`)."""

    watch: Watch
    settings: Settings
    notes: tuple[str, ...] = ()
    cut: bool = False


def act(watch: Watch, settings: Settings, on: OnCycle, window: WindowSummary) -> CycleAction:
    """What is done about what the watch has seen."""
    # At rest nothing tells a contraction (nan), and an iterated window is one iterate.
    if watch.home and not math.isnan(window.contraction):
        # fault: back from iterating at once -> watch = replace(watch, calm= watch.calm + 1) | coupler/test_cycle_action
        watch = replace(watch, calm=0 if window.contraction > watch.calm_at else watch.calm + 1)
        if watch.calm >= CALM_WINDOWS:
            told = (f"window {window.number} (to t = {window.t:.6g} s): plain iteration has contracted by "
                    f"{watch.calm_at:.2g} or better for {CALM_WINDOWS} windows; on with scheme {watch.home}")
            return CycleAction(Watch(), home(watch, settings), (told,))
    if not watch.cycling:
        return CycleAction(watch, settings)
    text = note(watch, window.number, window.t)
    if on is OnCycle.CUT and window.may_cut and watch.halved < HALVINGS:
        cap = watch.cap if watch.halved else settings.window_cap
        settings = replace(settings, window_cap=min(settings.window_cap, 0.5 * window.H))
        text = f"{text}; no window is longer than {settings.window_cap:.3g} s up to the next breakpoint"
        watch = replace(watch, swings={}, told=frozenset(), calm=0, cap=cap, halved=watch.halved + 1)
        return CycleAction(watch, settings, (text,), cut=True)
    # What one half does alone is there whatever the other is told.
    if on is OnCycle.ITERATE and watch.exchanged and settings.scheme is not Scheme.ITERATED:
        text = f"{text}; windows are iterated from here on"
        watch = replace(watch.tell(), home=settings.scheme.value, calm=0)
        # fault: a cycle is told and nothing follows -> return CycleAction(watch, settings, (text,)) |
        #   coupler/test_cycle_action
        return CycleAction(watch, replace(settings, scheme=Scheme.ITERATED), (text,))
    return CycleAction(watch.tell(), settings, (text,))


def home(watch: Watch, settings: Settings) -> Settings:
    """The settings with what was changed because of a cycle as it was."""
    if watch.home and settings.scheme is Scheme.ITERATED:
        level = Seen(watch.home_level) if watch.home_level else settings.iteration.level
        settings = replace(settings, scheme=Scheme(watch.home), iteration=settings.iteration.changed(level=level))
    return replace(settings, window_cap=watch.cap) if watch.halved else settings
