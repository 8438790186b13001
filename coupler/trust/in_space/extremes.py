"""How far the hottest and the coldest temperatures are off because cells are too large.

A half that can solve its scene with halved cells estimates it, body by body (outputs mesh.T_high_off.BODY and
mesh.T_low_off.BODY [K]).  That costs as much as some steps, so it is asked for at the end, each time that the run has
four times as many windows or its temperatures twice the span as at the last look, and once more soon after one that
was off by much.  The largest estimate counts, over the span of all nodes over the run.  A run of a microsecond, which
warms a body by three, is no such span: what windows may err by is below the first limit.

Where bodies of unlike temperatures touch at once, or a film strikes, the first moments are off by a tenth of the step
on any mesh: smaller cells are as wrong at earlier ones.  So what the next look finds gone, within a hundredth or two of
the run, is told only as far as it is a peak, which no other look comes to.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from coupler.schemes.state import HIGH_OFF, LOW_OFF
from coupler.trust.checks import Check, TrustVerdict, amount, measured

LIMITS = (0.05, 0.2)  # of the span of temperatures: noted, broken
NAME = "cells fine enough for the hottest and coldest"
# From one look to the next.
WINDOWS, SPAN = 4, 2.0
# What flows just after contact changed is taken by the half to have flown since the start.  So where less than this
# share of the run so far lies between, the next look waits for so many times as many windows.
SETTLED, WAITS = 0.1, 2
# What a look within this share of the run finds gone lasted no longer.  After one that is noted the next is due in a
# quarter of that, or when the time so far has doubled: what began later than that lasts, and is told.
BRIEF = 0.02


@dataclass(frozen=True)
class Told:
    """off : output -> what its extreme is off by at t [s] [K], where that is known.  reached : that extreme [K]."""

    t: float
    off: Mapping[str, float]
    reached: Mapping[str, float]


@dataclass(frozen=True)
class ExtremesLog:
    """told : what looks found, one after another; those that told nothing are not among them.

    looks : how many there were, the last after so many windows, at that span [K].
    """

    told: tuple[Told, ...] = ()
    looks: int = 0
    windows: int = 0
    span: float = 0.0


def extreme_outputs(blocks: Iterable[str]) -> list[str]:
    """Return the outputs of a half that tell of its extremes.  blocks : names of all it has."""
    return sorted(n for n in blocks if n.startswith((HIGH_OFF, LOW_OFF)))


def which(name: str) -> tuple[bool, str]:
    """Return whether an output is of the hottest, and the body it is of."""
    return name.startswith(HIGH_OFF), name.removeprefix(HIGH_OFF).removeprefix(LOW_OFF)


def due(log: ExtremesLog, windows: int, span: float, at_end: bool, t: float, event: float,
        end: float = math.inf) -> bool:
    """Whether to look after so many windows, at t [s], at a span of all temperatures so far [K].

    at_end : the run is over.  event [s] : when contact changed last; 0: never.  end [s] : of the run.
    """
    if at_end:
        return True
    # fault: bodies that touched a moment ago are told to be as wrong as what flows between them -> unsettled = False |
    #   coupler/test_trust_extremes::test_it_waits_after_contact_changed
    unsettled = t - event < SETTLED * t
    many = WINDOWS * max(log.windows, 1) * (WAITS if unsettled else 1)
    # fault: what comes and goes between two looks is not seen -> return windows >= many or _outlived(log, span, t, end)
    #   | coupler/test_trust_extremes::test_it_looks_when_temperatures_rise
    return windows >= many or _outlived(log, span, t, end) or (log.looks > 0 and span > SPAN * log.span)


def _outlived(log: ExtremesLog, span: float, t: float, end: float) -> bool:
    """Whether what the last look was off by may be gone by now."""
    if not log.told:
        return False
    last = log.told[-1]
    # fault: nobody looks whether an error is gone -> return False | coupler/test_trust_extremes
    return max(last.off.values()) > LIMITS[0] * span and t >= max(last.t + 0.25 * BRIEF * end, 2.0 * last.t)


def watched(log: ExtremesLog, told: Mapping[str, float], reached: Mapping[str, float], windows: int, span: float,
            t: float) -> ExtremesLog:
    """Return the log after a look at t [s].

    told : outputs by name [K], below 0 where they are not known.  reached : the extremes they are of [K].
    """
    known = {name: off for name, off in told.items() if off >= 0.0}
    more = (Told(t, known, {name: reached[name] for name in known}),) if known else ()
    return ExtremesLog(log.told + more, log.looks + 1, windows, span)


def _worst(log: ExtremesLog) -> tuple[float, float, str]:
    """What counts most of all looks: by how much it is off [K], when [s], and its output."""
    end, found = log.told[-1].t, (-1.0, 0.0, "")
    for k, look in enumerate(log.told):
        for name, off in look.off.items():
            later = next((after for after in log.told[k + 1:] if name in after.off), None)
            # fault: the first moment of a shock is told as what the run is off by -> brief = False |
            #   coupler/test_trust_extremes
            brief = later is not None and later.t - look.t <= BRIEF * end
            counts = min(_beyond(log, look, name), off) if brief else off
            if counts > found[0]:
                found = (counts, look.t, name)
    return found


def _beyond(log: ExtremesLog, look: Told, name: str) -> float:
    """How far the true extreme at a look may be beyond what it comes to at any other [K]; at least 0."""
    up = 1.0 if which(name)[0] else -1.0
    others = max(up * other.reached[name] for other in log.told if other is not look and name in other.reached)
    # fault: a peak that is soon gone is not told -> return 0.0 | coupler/test_trust_extremes
    return max(up * look.reached[name] + look.off[name] - others, 0.0)


def checks(log: ExtremesLog, span: float, slight: float = 0.0) -> tuple[Check, ...]:
    """Return the check at the end, none where no half was asked.

    span [K]: of the nodes' temperatures over the run.  slight [K]: an error that harms nobody, and is not noted.
    """
    if not log.looks:
        return ()
    if not log.told:
        return (Check(NAME, TrustVerdict.UNCHECKED, what="the scene with halved cells was not solved, or a half that "
                                                         "was put back told nothing"),)
    off, t, worst = _worst(log)
    # fault: a warmth that nobody can feel is held against itself -> least = max(span, off) |
    #   coupler/test_trust_extremes::test_what_harms_nobody_is_not_noted
    least = max(span, off, slight / LIMITS[0])
    # fault: extremes that are off are trusted -> share = 0.0 | coupler/test_trust_extremes
    share = off / least if off > 0.0 else 0.0
    high, body = which(worst)
    of = ("the span of temperatures" if least <= max(span, off) else
          f"{amount(least, 'K')}, {1 / LIMITS[0]:.0f} times what windows may err by")
    more = max(2, math.ceil(share / LIMITS[0]))
    return (measured(
        NAME, share, LIMITS, t=t,
        what=f"the {'hottest' if high else 'coldest'} temperature of {body} may be off by {amount(off, 'K')}, "
             f"{100 * share:.3g} % of {of}, because its cells are too large at t = {t:.6g} s, as a solution with "
             "halved cells says",
        remedy=f"Use {more} times as many cells along each edge there, or smaller cells where heat is concentrated"),)
