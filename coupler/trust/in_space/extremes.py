"""How far the hottest and the coldest temperatures are off because cells are too large.

A half that can solve its scene with halved cells estimates it, body by body (outputs mesh.T_high_off.BODY and
mesh.T_low_off.BODY [K]).  That costs as much as some steps, so it is asked for at the end, each time that the run has
four times as many windows or its temperatures twice the span as at the last look, and no more.  The largest estimate
counts, over the span of all nodes over the run: what the first milliseconds of a shock are off by is little of it.  A
run of a microsecond, which warms a body by three, is no such span: what windows may err by is below the first limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from coupler.schemes.state import HIGH_OFF, LOW_OFF
from coupler.trust.checks import Check, TrustVerdict, amount, measured

LIMITS = (0.05, 0.2)  # of the span of temperatures: noted, broken
NAME = "cells fine enough for the hottest and coldest"
# From one look to the next.
WINDOWS, SPAN = 4, 2.0
# What flows just after contact changed is taken by the half to have flown since the start.  So where less than this
# share of the run so far lies between, the next look waits for so many times as many windows.
SETTLED, WAITS = 0.1, 2


@dataclass(frozen=True)
class ExtremesLog:
    """off : output -> the largest so far [K], the last such at t [s].

    looks : so many, of which `known` told; the last after so many windows, at that span [K].
    """

    off: Mapping[str, float] = field(default_factory=dict)
    t: Mapping[str, float] = field(default_factory=dict)
    looks: int = 0
    known: int = 0
    windows: int = 0
    span: float = 0.0


def extreme_outputs(blocks: Iterable[str]) -> list[str]:
    """Return the outputs of a half that tell of its extremes.  blocks : names of all it has."""
    return sorted(n for n in blocks if n.startswith((HIGH_OFF, LOW_OFF)))


def due(log: ExtremesLog, windows: int, span: float, at_end: bool, t: float, event: float) -> bool:
    """Whether to look after so many windows, at t [s], at a span of all temperatures so far [K].

    at_end : the run is over.  event [s] : when contact changed last; 0: never.
    """
    if at_end:
        return True
    # fault: bodies that touched a moment ago are told to be as wrong as what flows between them -> unsettled = False |
    #   coupler/test_trust_extremes::test_it_waits_after_contact_changed
    unsettled = t - event < SETTLED * t
    many = WINDOWS * max(log.windows, 1) * (WAITS if unsettled else 1)
    # fault: what comes and goes between two looks is not seen -> return windows >= many |
    #   coupler/test_trust_extremes::test_it_looks_when_temperatures_rise
    return windows >= many or (log.looks > 0 and span > SPAN * log.span)


def watched(log: ExtremesLog, told: Mapping[str, float], windows: int, span: float, t: float) -> ExtremesLog:
    """Return the log after a look at t [s].  told : outputs by name [K], below 0 where they are not known."""
    known = {name: off for name, off in told.items() if off >= 0.0}
    # fault: what was off before is forgotten -> larger = known | coupler/test_trust_extremes
    larger = {name: off for name, off in known.items() if off >= log.off.get(name, 0.0)}
    return replace(log, off={**log.off, **larger}, t={**log.t, **dict.fromkeys(larger, t)}, looks=log.looks + 1,
                   known=log.known + bool(known), windows=windows, span=span)


def checks(log: ExtremesLog, span: float, slight: float = 0.0) -> tuple[Check, ...]:
    """Return the check at the end, none where no half was asked.

    span [K]: of the nodes' temperatures over the run.  slight [K]: an error that harms nobody, and is not noted.
    """
    if not log.looks:
        return ()
    if not log.known:
        return (Check(NAME, TrustVerdict.UNCHECKED, what="the scene with halved cells was not solved, or a half that "
                                                         "was put back told nothing"),)
    worst = max(log.off, key=lambda name: log.off[name])
    off, t = log.off[worst], log.t[worst]
    # fault: a warmth that nobody can feel is held against itself -> least = max(span, off) |
    #   coupler/test_trust_extremes::test_what_harms_nobody_is_not_noted
    least = max(span, off, slight / LIMITS[0])
    # fault: extremes that are off are trusted -> share = 0.0 | coupler/test_trust_extremes
    share = off / least if off > 0.0 else 0.0
    which = "hottest" if worst.startswith(HIGH_OFF) else "coldest"
    body = worst.removeprefix(HIGH_OFF).removeprefix(LOW_OFF)
    of = ("the span of temperatures" if least <= max(span, off) else
          f"{amount(least, 'K')}, {1 / LIMITS[0]:.0f} times what windows may err by")
    more = max(2, math.ceil(share / LIMITS[0]))
    return (measured(
        NAME, share, LIMITS, t=t,
        what=f"the {which} temperature of {body} may be off by {amount(off, 'K')}, {100 * share:.3g} % of {of}, "
             f"because its cells are too large at t = {t:.6g} s, as a solution with halved cells says",
        remedy=f"Use {more} times as many cells along each edge there, or smaller cells where heat is concentrated"),)
