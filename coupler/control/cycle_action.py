"""What follows when a two-cycle was seen: it is told, the windows after it are iterated, or windows are halved.

Iterating ends a cycle of the exchange at any window; it ends when plain iteration has contracted well for some windows
on end, for then the scheme that cycled would hold too, or at the next kink.  Halving holds to the next kink.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from coupler.control.cycle import Watch, note
from coupler.scenario.options import OnCycle, Scheme
from coupler.schemes.settings import Settings

# A contraction of plain iteration up to this, (b dt/2)/(1 + a dt) <= .4, means b dt < 1 where a dt is small: every
# scheme of one solve a half is stable there (docs/theory.md, limits of stability).
CALM = 0.4
# So many windows on end: no longer than a cycle takes to show, so going back too soon costs no more than it did.
CALM_WINDOWS = 5
# What still cycles in windows of a 64th is no cycle of the exchange.
HALVINGS = 6


@dataclass(frozen=True)
class Shown:
    """A window that may be taken.  number : from 1.  t [s]: its end.  H [s].  may_cut : whether it may be halved.

    contraction : of plain iteration, as measured in it; nan: unknown.
    """

    number: int
    t: float
    H: float
    may_cut: bool
    contraction: float = math.nan


@dataclass(frozen=True)
class Acted:
    """settings : of the next window, or of the next try where the window is put back (`cut`)."""

    watch: Watch
    settings: Settings
    notes: tuple[str, ...] = ()
    cut: bool = False


def acted(watch: Watch, settings: Settings, on: OnCycle, shown: Shown) -> Acted:
    """What is done about what the watch has seen."""
    # At rest nothing tells a contraction (nan), and an iterated window is one iterate.
    if watch.home and not math.isnan(shown.contraction):
        # fault: back from iterating at once -> watch = replace(watch, calm= watch.calm + 1) | coupler/test_cycle_action
        watch = replace(watch, calm=0 if shown.contraction > CALM else watch.calm + 1)
        if watch.calm >= CALM_WINDOWS:
            told = (f"window {shown.number} (to t = {shown.t:.6g} s): plain iteration has contracted by {CALM:g} or "
                    f"better for {CALM_WINDOWS} windows; on with scheme {watch.home}")
            return Acted(Watch(), home(watch, settings), (told,))
    if not watch.cycling:
        return Acted(watch, settings)
    text = note(watch, shown.number, shown.t)
    if on is OnCycle.CUT and shown.may_cut and watch.halved < HALVINGS:
        cap = watch.cap if watch.halved else settings.window_cap
        settings = replace(settings, window_cap=min(settings.window_cap, 0.5 * shown.H))
        text = f"{text}; no window is longer than {settings.window_cap:.3g} s up to the next kink"
        return Acted(Watch(home=watch.home, cap=cap, halved=watch.halved + 1), settings, (text,), cut=True)
    # What one half does alone is there whatever the other is told.
    if on is OnCycle.ITERATE and len(watch.cycling) > 1 and settings.scheme is not Scheme.ITERATED:
        text = f"{text}; windows are iterated from here on"
        watch = replace(watch.tell(), home=settings.scheme.value, calm=0)
        # fault: a cycle is told and nothing follows -> return Acted(watch, settings, (text,)) |
        #   coupler/test_cycle_action
        return Acted(watch, replace(settings, scheme=Scheme.ITERATED), (text,))
    return Acted(watch.tell(), settings, (text,))


def home(watch: Watch, settings: Settings) -> Settings:
    """The settings with what was changed because of a cycle as it was."""
    if watch.home and settings.scheme is Scheme.ITERATED:
        settings = replace(settings, scheme=Scheme(watch.home))
    return replace(settings, window_cap=watch.cap) if watch.halved else settings
